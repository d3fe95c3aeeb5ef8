"""Gazebo's SDF: links, joints, plugins and cameras of one model, with what it includes."""

from __future__ import annotations

import re

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.robot.importers.packages import PackagePaths
from wakewise.robot.importers.robot_description import (
    PART_NAME,
    Joint,
    Link,
    RobotDescription,
    checked_mass,
    collision_shape,
    inertia_matrix,
)
from wakewise.robot.importers.urdf import CAMERA_TYPES, camera, pose_element
from wakewise.robot.importers.xml import Element, PlacedError, number, numbers, parse_xml, read_text

MAX_INCLUDES = 40
_MOMENTS = ("x", "y", "z", "p", "q", "r")


def read_sdf(root: Element, folders: PackagePaths, notes: list[str]) -> RobotDescription:
    """Read an `<sdf>` element; of several models the one with the most thrusters is taken.

    Raises InputError if there is no model, a frame is not defined, or a number is not one.
    """
    models = _models(root)
    tops = [root, *root.all("world")]
    models += [m for top in tops for i in top.all("include")[:MAX_INCLUDES] for m in _included(i, folders, notes, 0)]
    if not models:
        raise PlacedError(f"{root.place}: holds no model{left_out(notes)}")
    model = max(models, key=_thruster_count)
    if len(models) > 1:
        notes.append(f"model {model.attributes.get('name')}: taken out of {len(models)} models in the file")
    return _Reader(model, folders, notes).read()


def left_out(notes: list[str]) -> str:
    """The first note about something left out, in brackets, for a message about what is lacking."""
    return next((f" ({note})" for note in notes if "left out" in note), "")


def _models(root: Element) -> list[Element]:
    models = root.all("model") + [m for world in root.all("world") for m in world.all("model")]
    version = re.match(r"\s*(\d{1,4})\.(\d{1,4})", root.attributes.get("version", ""))
    if version and (int(version[1]), int(version[2])) < (1, 5):
        # Before SDF 1.5 axes of joints are in the axes of the model.
        for axis in (e for model in models for e in model.walk() if e.tag == "axis"):
            xyz = axis.first("xyz")
            if xyz is not None and axis.first("use_parent_model_frame") is None:
                xyz.attributes.setdefault("expressed_in", "__model__")
    return models


def _thruster_count(model: Element) -> tuple[int, int]:
    plugins = [e for e in model.walk() if e.tag == "plugin"]
    text = [(p.attributes.get("filename", "") + p.name).lower() for p in plugins]
    return sum("thruster" in t for t in text), len(plugins)


def _included(element: Element, folders: PackagePaths, notes: list[str], depth: int) -> list[Element]:
    """Models of an `<include>`; one that is not here is left out with a note."""
    uri = element.value("uri") or ""
    if depth > 5:
        raise PlacedError(f"{element.place}: includes within one another more than 5 deep")
    if uri.startswith(("http:", "https:")) or not uri:
        notes.append(f"include left out, not on this disk: {uri[:80]} ({element.place.short})")
        return []
    name = uri if "://" in uri else f"model://{uri}"
    try:
        folder = folders.locate(name, element.place.file.parent, element.place)
    except PlacedError as fault:
        if uri.startswith(("file://", "/", ".")):
            raise
        notes.append(f"include left out: {fault}")
        return []
    path = folder / "model.sdf" if folder.is_dir() else folder
    if not path.is_file():
        notes.append(f"include left out, not found: {uri[:80]} ({element.place.short})")
        return []
    root = parse_xml(read_text(path), path)
    return _models(root)


class _Reader:
    """Places one model's links; frames are found by name and may be defined relative to one another."""

    def __init__(self, model: Element, folders: PackagePaths, notes: list[str]) -> None:
        self.model = model
        self.folders = folders
        self.notes = notes
        self.frames: dict[str, tuple[Pose, str, Element]] = {}
        self.links: dict[str, Element] = {}
        self.joints: dict[str, Element] = {}
        self.plugins: list[Element] = []
        self.includes = 0

    def read(self) -> RobotDescription:
        name = self.model.name or "vehicle"
        self._collect(self.model, "", 0)
        if not self.links:
            raise PlacedError(f"{self.model.place}: model {name} holds no link{left_out(self.notes)}")
        base = self._base()
        X_BM = self._pose(base, ()).inverse()
        links: dict[str, Link] = {}
        cameras = []
        for key, element in self.links.items():
            X_BL = X_BM @ self._pose(key, ())
            links[key] = _link(element, key, X_BL)
            for sensor in element.all("sensor"):
                if sensor.attributes.get("type") in CAMERA_TYPES:
                    cameras += [camera(sensor, X_BL)]
        joints = {key: self._joint(key, element, X_BM) for key, element in self.joints.items()}
        return RobotDescription(name, base, links, joints, self.plugins, cameras)

    def _collect(self, model: Element, scope: str, depth: int) -> None:
        if depth > 5:
            raise PlacedError(f"{model.place}: models within one another more than 5 deep")
        for element in model.children:
            key = scope + element.name
            if element.tag in {"link", "joint", "frame"}:
                if not element.attributes.get("name"):
                    raise PlacedError(f"{element.place}: <{element.tag}> without a name")
                pose, relative = pose_element(element)
                default = f"{scope}__model__"
                if element.tag == "joint":
                    default = scope + (element.value("child") or "")
                    self.joints[key] = element
                elif element.tag == "link":
                    self.links[key] = element
                elif element.attributes.get("attached_to"):
                    default = scope + element.attributes["attached_to"]
                self.frames[key] = (pose, scope + relative if relative else default, element)
            elif element.tag == "plugin":
                self.plugins.append(element)
            elif element.tag == "model":
                self._nested(element, scope, key, depth)
            elif element.tag == "include":
                self._include(element, scope, depth)

    def _nested(self, model: Element, scope: str, key: str, depth: int) -> None:
        pose, relative = pose_element(model)
        self.frames[f"{key}::__model__"] = (pose, scope + (relative or "__model__"), model)
        self._collect(model, f"{key}::", depth + 1)

    def _include(self, element: Element, scope: str, depth: int) -> None:
        self.includes += 1
        if self.includes > MAX_INCLUDES:
            raise PlacedError(f"{element.place}: more than {MAX_INCLUDES} includes")
        for model in _included(element, self.folders, self.notes, depth):
            key = scope + (element.value("name") or model.attributes.get("name", "included"))
            pose, relative = pose_element(element)
            merged = element.attributes.get("merge") == "true" or element.value("merge") == "true"
            self.frames[f"{key}::__model__"] = (pose, scope + (relative or "__model__"), element)
            self._collect(model, scope if merged else f"{key}::", depth + 1)

    def _base(self) -> str:
        own = {key: link for key, link in self.links.items() if not PART_NAME.search(key)} or self.links
        named = [key for key in own if key.rpartition("::")[2].rpartition("/")[2] == "base_link"]
        told = self.model.attributes.get("canonical_link")
        if named:
            return min(named, key=len)
        if told in self.links:
            return str(told)
        ending = [key for key in own if key.endswith("base_link")]
        if ending:
            return ending[0]
        return max(own, key=lambda key: _mass_for_choice(own[key]))

    def _pose(self, key: str, through: tuple[str, ...]) -> Pose:
        """Pose of a link, joint or frame in the model."""
        if key.endswith("__model__") and key not in self.frames:
            return Pose(np.zeros(3))
        if key not in self.frames:
            raise PlacedError(f"{self.model.place}: frame {key[:80]} is not defined")
        pose, relative, element = self.frames[key]
        if key in through or len(through) > 60:
            raise PlacedError(f"{element.place}: frame {key} is defined relative to itself")
        return self._pose(relative, (*through, key)) @ pose

    def _joint(self, key: str, element: Element, X_BM: Pose) -> Joint:
        scope = "".join(key.rpartition("::")[:2])
        X_BJ = X_BM @ self._pose(key, ())
        axis: Array | None = None
        place = element.place
        axis_element = element.first("axis")
        if axis_element is not None:
            xyz = axis_element.child("xyz")
            place = xyz.place
            frame = xyz.attributes.get("expressed_in")
            if axis_element.value("use_parent_model_frame") in {"1", "true"}:
                frame = "__model__"
            X_BF = X_BM @ self._pose(scope + frame, ()) if frame else X_BJ
            axis = X_BF.R @ numbers(xyz.text.strip() or "0 0 1", place, f"axis of joint {key}", 3)
        child, parent = (scope + (element.value(end) or "") for end in ("child", "parent"))
        return Joint(key, element.attributes.get("type", ""), child, X_BJ, axis, place, parent)


def _mass_for_choice(link: Element) -> float:
    text = next((e.text for e in link.walk() if e.tag == "mass"), "0")
    try:
        return float(text)
    except ValueError:
        return 0.0


def _link(element: Element, name: str, X_BL: Pose) -> Link:
    link = Link(name, element.place, X_BL)
    inertial = element.first("inertial")
    if inertial is not None:
        link.place = inertial.place
        mass = inertial.value("mass")
        link.computed = inertial.attributes.get("auto", "").strip().lower() in {"1", "true"}
        link.mass_kg = checked_mass("1" if mass is None else mass, inertial.place, name)
        at, _ = pose_element(inertial)
        link.p_LG_m = at.p_m
        inertia = inertial.first("inertia")
        if inertia is not None:
            values = {e.tag: number(e.text.strip(), e.place, f"{e.tag} of link {name}") for e in inertia.children}
            link.inertia_kg_m2 = at.R @ inertia_matrix(values) @ at.R.T
        fluid = inertial.first("fluid_added_mass")
        if fluid is not None:
            link.added_mass = _fluid_added_mass(fluid)
    for collision in element.all("collision"):
        pose, _ = pose_element(collision)
        link.shapes.append(collision_shape(pose, collision.first("geometry")))
    return link


def _fluid_added_mass(fluid: Element) -> Array:
    """Symmetric 6 x 6 from the upper triangle xx, xy, ... rr (SDF 1.10)."""
    matrix = np.zeros((6, 6))
    for i, row in enumerate(_MOMENTS):
        for j, column in enumerate(_MOMENTS):
            entry = fluid.first(row + column)
            if entry is not None:
                value = number(entry.text.strip(), entry.place, f"fluid_added_mass {row}{column}")
                matrix[i, j] = matrix[j, i] = value
    return matrix
