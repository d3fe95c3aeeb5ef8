"""URDF: links, joints, Gazebo plugins and cameras, placed in the axes of the base link."""

from __future__ import annotations

import numpy as np

from wakewise.core.geometry import Pose
from wakewise.robot.importers.angles import require_radians
from wakewise.robot.importers.robot_description import (
    IDENTITY,
    PART_NAME,
    CameraSensor,
    Joint,
    Link,
    RobotDescription,
    checked_mass,
    collision_shape,
    inertia_matrix,
    pose_of,
    short,
)
from wakewise.robot.importers.xml import Element, PlacedError, number, numbers

CAMERA_TYPES = frozenset({"camera", "depth", "depth_camera", "rgbd_camera", "rgbd", "wideanglecamera", "multicamera"})


def read_urdf(root: Element) -> RobotDescription:
    """Read an expanded `<robot>` element.

    Raises InputError if a joint names a link that is not there, links form a loop, or a number is not one.
    """
    links: dict[str, Link] = {}
    for element in root.all("link"):
        name = _named(element)
        if name not in links or element.first("inertial") is not None:
            links[name] = _link(element, name)
    if not links:
        raise PlacedError(f"{root.place}: <robot> holds no link")
    joints = [(_named(e), e) for e in root.all("joint") if e.first("child") is not None]
    parents = _parents(joints, links)
    base = _base_link(links, parents)
    _place_links(base, joints, links)
    reached = {name: link for name, link in links.items() if link.X_BL is not IDENTITY or name == base}
    placed = {name: _joint(name, e, reached) for name, e in joints if _end(e, "parent") in reached}
    plugins = [p for gazebo in root.all("gazebo") for p in gazebo.all("plugin")]
    return RobotDescription(
        name=root.name or "vehicle",
        base=base,
        links=reached,
        joints=placed,
        plugins=plugins,
        cameras=_cameras(root, reached),
    )


def _named(element: Element) -> str:
    name = element.name.strip()
    if not name:
        raise PlacedError(f"{element.place}: <{element.tag}> without a name")
    return name


def _end(joint: Element, which: str) -> str:
    name = joint.child(which).attributes.get("link", "").strip()
    if not name:
        raise PlacedError(f"{joint.place}: joint {joint.attributes.get('name')} names no {which} link")
    return name


def origin(element: Element | None) -> Pose:
    """Pose of an `<origin xyz rpy/>`; identity where there is none."""
    if element is None:
        return Pose(np.zeros(3))
    xyz, rpy = element.attributes.get("xyz"), element.attributes.get("rpy")
    return pose_of(
        np.zeros(3) if xyz is None else numbers(xyz, element.place, "origin xyz", 3),
        np.zeros(3)
        if rpy is None
        else require_radians(numbers(rpy, element.place, "origin rpy", 3), element.place, "origin rpy"),
    )


def _link(element: Element, name: str) -> Link:
    link = Link(name, element.place)
    inertial = element.first("inertial")
    if inertial is not None:
        link.place = inertial.place
        link.mass_kg = checked_mass(inertial.child("mass").attributes.get("value"), inertial.place, name)
        at = origin(inertial.first("origin"))
        link.p_LG_m = at.p_m
        inertia = inertial.first("inertia")
        if inertia is not None:
            values = {k: number(v, inertia.place, f"inertia {k} of link {name}") for k, v in inertia.attributes.items()}
            link.inertia_kg_m2 = at.R @ inertia_matrix(values) @ at.R.T
    for collision in element.all("collision"):
        link.shapes.append(collision_shape(origin(collision.first("origin")), collision.first("geometry")))
    return link


def _parents(joints: list[tuple[str, Element]], links: dict[str, Link]) -> dict[str, str]:
    parents: dict[str, str] = {}
    for name, element in joints:
        parent, child = _end(element, "parent"), _end(element, "child")
        for end in (parent, child):
            # Gazebo adds the world itself, and files of parts attach to links of the whole.
            if end not in links:
                links[end] = Link(end, element.place)
        if child in parents:
            raise PlacedError(f"{element.place}: joint {name}: link {child} already has a parent")
        parents[child] = parent
    return parents


def _base_link(links: dict[str, Link], parents: dict[str, str]) -> str:
    own = [name for name in links if not PART_NAME.search(name)]
    for name in [*own, *links]:
        if short(name) == "base_link":
            return name
    bases = [name for name in own if name.endswith("base_link")]
    if bases:
        return bases[0]
    roots = [name for name in links if name not in parents]
    if not roots:
        first = next(iter(links.values()))
        raise PlacedError(f"{first.place}: the links form a loop, there is no root")
    if roots[0] in {"world", "map"}:
        below = [child for child, parent in parents.items() if parent == roots[0]]
        return below[0] if below else roots[0]
    return max(roots, key=lambda name: links[name].mass_kg or 0.0)


def _place_links(base: str, joints: list[tuple[str, Element]], links: dict[str, Link]) -> None:
    """Walk out from the base link, both ways along the joints, since a footprint may sit above it."""
    edges: dict[str, list[tuple[str, Pose]]] = {}
    for _, element in joints:
        parent, child = _end(element, "parent"), _end(element, "child")
        at = origin(element.first("origin"))
        edges.setdefault(parent, []).append((child, at))
        edges.setdefault(child, []).append((parent, at.inverse()))
    links[base].X_BL = Pose(np.zeros(3))
    done, waiting = {base}, [base]
    while waiting:
        here = waiting.pop()
        for there, step in edges.get(here, []):
            if there not in done and there not in {"world", "map"}:
                done.add(there)
                links[there].X_BL = links[here].X_BL @ step
                waiting.append(there)


def _joint(name: str, element: Element, links: dict[str, Link]) -> Joint:
    child = _end(element, "child")
    X_BJ = links[child].X_BL
    kind = element.attributes.get("type", "")
    stated, axis = element.child("axis"), None
    if kind in {"revolute", "continuous", "prismatic"}:
        axis = X_BJ.R @ numbers(stated.attributes.get("xyz", "1 0 0"), stated.place, f"axis of joint {name}", 3)
    return Joint(name, kind, child, X_BJ, axis, stated.place, _end(element, "parent"))


def _cameras(root: Element, links: dict[str, Link]) -> list[CameraSensor]:
    found: list[CameraSensor] = []
    for gazebo in root.all("gazebo"):
        link = links.get(gazebo.attributes.get("reference", ""))
        for sensor in gazebo.all("sensor"):
            if link is not None and sensor.attributes.get("type") in CAMERA_TYPES:
                found += [camera(sensor, link.X_BL)]
    return found


def camera(sensor: Element, X_BL: Pose) -> CameraSensor:
    """A Gazebo camera sensor on a link."""
    X_LS, _ = pose_element(sensor)
    fov = next((e for e in sensor.walk() if e.tag == "horizontal_fov" and e.text.strip()), None)
    fov_rad = None if fov is None else number(fov.text.strip(), fov.place, "horizontal_fov")
    return CameraSensor(sensor.attributes.get("name", "camera"), X_BL @ X_LS, fov_rad)


def pose_element(element: Element) -> tuple[Pose, str]:
    """Pose of a `<pose>` of SDF, the frame it is relative to ("" if not said); identity if there is none."""
    pose = element.child("pose")
    relative = pose.attributes.get("relative_to", "") or pose.attributes.get("frame", "")
    if not pose.text.strip():
        return Pose(np.zeros(3)), relative
    values = numbers(pose.text, pose.place, "pose")
    if len(values) == 7 and pose.attributes.get("rotation_format") == "quat_xyzw":
        return Pose(values[:3], values[[6, 3, 4, 5]]), relative
    if len(values) != 6:
        raise PlacedError(f"{pose.place}: pose has {len(values)} numbers, must have 6")
    if pose.attributes.get("degrees", "").strip().lower() in {"true", "1"}:
        return pose_of(values[:3], np.deg2rad(values[3:])), relative
    return pose_of(values[:3], require_radians(values[3:], pose.place, "pose")), relative
