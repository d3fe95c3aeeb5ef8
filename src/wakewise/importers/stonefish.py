"""Stonefish scenarios (`.scn`): the robot with the most thrusters; axes are FRD, thrust goes along +x of a thruster."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import numpy as np

from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.importers.bodies import Bodies, Joint, Link, checked_mass, read_mass
from wakewise.importers.expressions import evaluate
from wakewise.importers.found import Found, FoundThruster
from wakewise.importers.packages import Folders
from wakewise.importers.plugins import short
from wakewise.importers.urdf import origin
from wakewise.importers.xml import Element, PlacedError, number, numbers, parse_xml, read_text

RULE = (
    "a positive setpoint pushes along +x of the thruster's frame, turned round by a left-handed propeller "
    "and by an inverted setpoint (Stonefish's Thruster)"
)
MAX_INCLUDES = 60
_SUBSTITUTION = re.compile(r"\$\((arg|find|param)\s+([^)\s]+)\s*\)")
_EXPRESSION = re.compile(r"\$\{([^}]*)\}")
_THRUSTERS = frozenset({"thruster", "simple_thruster", "simplethruster"})


class Scenario:
    """Reads a scenario and its includes; what is not there is left out with a note: scenery is often elsewhere."""

    def __init__(self, folders: Folders, arguments: Mapping[str, str], notes: list[str]) -> None:
        self.folders = folders
        self.arguments = dict(arguments)
        self.notes = notes
        self.includes = 0

    def robots(self, root: Element, arguments: Mapping[str, str], depth: int = 0) -> list[Element]:
        """All robots of a scenario element, arguments put in."""
        found: list[Element] = []
        if depth > 8:
            raise PlacedError(f"{root.place}: includes within one another more than 8 deep")
        for element in root.children:
            if element.tag == "robot":
                found.append(self._filled(element, arguments))
            elif element.tag == "include":
                found += self._included(element, arguments, depth)
        return found

    def _included(self, element: Element, arguments: Mapping[str, str], depth: int) -> list[Element]:
        self.includes += 1
        if self.includes > MAX_INCLUDES:
            raise PlacedError(f"{element.place}: more than {MAX_INCLUDES} includes")
        name = self._text(element.attributes.get("file", ""), arguments)
        unknown = _SUBSTITUTION.search(name)
        if unknown is not None:
            self.notes.append(f"include left out: {unknown[0]} has no value; give --arg {unknown[2]}:=VALUE")
            return []
        try:
            path = self.folders.locate(name, element.place.file.parent, element.place)
        except PlacedError as fault:
            if "climbs out" in str(fault):
                raise
            self.notes.append(f"include left out: {fault}")
            return []
        if not path.is_file():
            self.notes.append(
                f"include left out, not found: {name[:80]} ({element.place.file.name}:{element.place.line})"
            )
            return []
        inner = {
            arg.attributes.get("name", ""): self._text(arg.attributes.get("value", ""), arguments)
            for arg in element.all("arg")
        }
        root = parse_xml(read_text(path), path)
        return self.robots(root, {**inner, **self.arguments}, depth + 1)

    def _filled(self, element: Element, arguments: Mapping[str, str]) -> Element:
        attributes = {k: self._text(v, arguments) for k, v in element.attributes.items()}
        children = [self._filled(child, arguments) for child in element.children]
        return Element(element.tag, attributes, element.place, children, self._text(element.text, arguments))

    def _text(self, text: str, arguments: Mapping[str, str]) -> str:
        def put(match: re.Match[str]) -> str:
            word, name = match[1], match[2]
            if word == "find":
                folder = self.folders.package(name)
                return f"package://{name}" if folder is None else str(folder)
            value = arguments.get(name, self.arguments.get(name))
            # What has no value stays as it is: it matters only where it is needed.
            return match[0] if value is None else value

        return _EXPRESSION.sub(_evaluated, _SUBSTITUTION.sub(put, text))


def _evaluated(match: re.Match[str]) -> str:
    def nothing(name: str) -> str:
        raise KeyError(name)

    try:
        return str(evaluate(match[1], nothing))
    except InputError:
        return match[0]


def read_stonefish(root: Element, folders: Folders, arguments: Mapping[str, str], found: Found) -> None:
    """Fill in what a scenario says about its robot.

    Raises
    ------
    InputError
        If there is no robot, or a number is not one.
    """
    scenario = Scenario(folders, arguments, found.notes)
    whole = Element("scenario", {}, root.place, [root]) if root.tag == "robot" else root
    robots = scenario.robots(whole, dict(arguments))
    if not robots:
        left_out = next((note for note in found.notes if note.startswith("include left out")), "")
        raise PlacedError(f"{root.place}: scenario holds no robot" + (f" ({left_out})" if left_out else ""))
    robot = max(robots, key=lambda r: sum(a.attributes.get("type") in _THRUSTERS for a in r.all("actuator")))
    if len(robots) > 1:
        found.notes.append(f"robot {robot.attributes.get('name')}: taken out of {len(robots)} in the scenario")
    found.name = robot.attributes.get("name", "") or found.name
    bodies = _bodies(robot)
    read_mass(bodies, found)
    _hydrodynamics(robot, found)
    for actuator in robot.all("actuator"):
        if actuator.attributes.get("type") in _THRUSTERS:
            found.thrusters.append(_thruster(actuator, bodies))
    found.thrust_rule = RULE
    if found.thrusters:
        found.derived["thruster_layout"] = f"{found.kind} {found.file.name}: actuators of type thruster"
    _camera(robot, bodies, found)
    if found.mass_kg is not None and found.inertia_kg_m2 is None:
        found.notes.append("inertia: left to Stonefish, which computes it from meshes; not in the file")


def _bodies(robot: Element) -> Bodies:
    base_element = robot.first("base_link")
    elements = [e for e in robot.children if e.tag in {"base_link", "link"}]
    if not elements:
        raise PlacedError(f"{robot.place}: robot holds no link")
    base = (base_element or elements[0]).attributes.get("name", "base_link")
    links = {
        e.attributes.get("name", f"link{i}"): _link(e, e.attributes.get("name", "")) for i, e in enumerate(elements)
    }
    steps: dict[str, tuple[str, Pose]] = {}
    for joint in robot.all("joint"):
        parent, child = joint.first("parent"), joint.first("child")
        if parent is not None and child is not None:
            steps[child.attributes.get("name", "")] = (parent.attributes.get("name", ""), origin(joint.first("origin")))
    for name, link in links.items():
        X, here = Pose(np.zeros(3)), name
        for _ in range(len(links)):
            if here == base or here not in steps:
                break
            here, step = steps[here]
            X = step @ X
        link.X_BL = X
    joints: dict[str, Joint] = {}
    return Bodies(robot.attributes.get("name", "robot"), base, links, joints, [], [])


def _link(element: Element, name: str) -> Link:
    link = Link(name, element.place)
    mass, inertia, centre = element.first("mass"), element.first("inertia"), element.first("cg")
    if mass is not None:
        link.place = mass.place
        link.mass_kg = checked_mass(mass.attributes.get("value"), mass.place, name)
    at = origin(centre)
    link.p_LG_m = at.p_m
    if inertia is not None and "xyz" in inertia.attributes:
        moments = numbers(inertia.attributes["xyz"], inertia.place, "inertia", 3)
        link.inertia_kg_m2 = at.R @ np.diag(moments) @ at.R.T
    return link


def _thruster(actuator: Element, bodies: Bodies) -> FoundThruster:
    name = actuator.attributes.get("name", "") or f"line {actuator.place.line}"
    link_element = actuator.first("link")
    link = bodies.link(link_element.attributes.get("name", "")) if link_element is not None else None
    if link is None:
        raise PlacedError(f"{actuator.place}: thruster {name} is on no link of the robot")
    X_BT = link.X_BL @ origin(actuator.first("origin"))
    specs, propeller = actuator.first("specs"), actuator.first("propeller")
    sign = 1.0
    if specs is not None and _true(specs.attributes.get("inverted_setpoint") or specs.attributes.get("inverted")):
        sign = -sign
    thruster = FoundThruster(short(name), X_BT.p_m, sign * X_BT.R[:, 0], actuator.place, X_BT.R)
    if propeller is not None:
        diameter = propeller.attributes.get("diameter")
        if diameter is not None:
            thruster.disk_area_m2 = 0.25 * math.pi * number(diameter, propeller.place, "diameter") ** 2
        model = actuator.first("thrust_model")
        if not _true(propeller.attributes.get("right", "true")) and (
            model is None or model.attributes.get("type") != "fluid_dynamics"
        ):
            thruster.axis = -thruster.axis
            sign = -sign
    _limits(actuator, thruster, flipped=sign < 0.0)
    return thruster


def _limits(actuator: Element, thruster: FoundThruster, *, flipped: bool) -> None:
    """Limits from a table of thrust, and from the curve at the largest setpoint; lag from a first-order rotor."""
    model, specs, rotor = actuator.first("thrust_model"), actuator.first("specs"), actuator.first("rotor_dynamics")
    if rotor is not None:
        kind = rotor.attributes.get("type")
        constant = rotor.first("time_constant")
        if kind == "zero_order":
            thruster.time_constant_s = 0.0
        elif kind == "first_order" and constant is not None:
            thruster.time_constant_s = number(constant.attributes.get("value", ""), constant.place, "time_constant")
    if model is None or specs is None:
        return
    text = specs.attributes.get("max_setpoint")
    top = None if text is None else abs(number(text, specs.place, "max_setpoint"))
    table_in, table_out = model.first("input"), model.first("output")
    forward: float | None = None
    reverse: float | None = None
    if table_in is not None and table_out is not None and top is not None:
        x = numbers(table_in.attributes.get("value", ""), table_in.place, "input")
        y = numbers(table_out.attributes.get("value", ""), table_out.place, "output", len(x))
        if len(x) and np.all(np.diff(x) > 0.0):
            forward, reverse = float(np.interp(top, x, y)), -float(np.interp(-top, x, y))
    elif model.attributes.get("type") in {"quadratic", "deadband"} and top is not None:
        coefficients = {e.tag: number(e.attributes.get("value", ""), e.place, e.tag) for e in model.children}
        if "thrust_coeff" in coefficients:
            forward = reverse = coefficients["thrust_coeff"] * top**2
    if forward is not None and reverse is not None and forward >= 0.0 and reverse >= 0.0:
        thruster.max_forward_N, thruster.max_reverse_N = (reverse, forward) if flipped else (forward, reverse)


def _hydrodynamics(robot: Element, found: Found) -> None:
    base = robot.first("base_link")
    if base is not None and base.first("hydrodynamics") is not None:
        found.notes.append(
            "hydrodynamics: viscous and quadratic drag of Stonefish are factors on forces from the mesh, "
            "not coefficients of the whole vehicle, so they are not taken"
        )
    found.notes.append("added mass, damping and buoyancy: Stonefish computes them from meshes; not in the file")


def _camera(robot: Element, bodies: Bodies, found: Found) -> None:
    """First camera; Stonefish gives camera frames OpenCV axes, so the mount needs no turn."""
    for sensor in robot.all("sensor"):
        if "camera" in sensor.attributes.get("type", ""):
            link_element = sensor.first("link")
            link = bodies.link(link_element.attributes.get("name", "")) if link_element is not None else None
            if link is None:
                continue
            found.X_BC = link.X_BL @ origin(sensor.first("origin"))
            specs = sensor.first("specs")
            if specs is not None and "horizontal_fov" in specs.attributes:
                degrees = number(specs.attributes["horizontal_fov"], specs.place, "horizontal_fov")
                found.camera_fov_rad = math.radians(degrees)
            found.notes.append(f"camera: {sensor.attributes.get('name', 'camera')}")
            found.derived["camera_mount"] = f"{found.kind} {found.file.name}: sensor"
            return


def _true(text: str | None) -> bool:
    return (text or "").strip().lower() in {"true", "1", "yes"}
