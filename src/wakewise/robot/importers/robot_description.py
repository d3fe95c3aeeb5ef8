"""Links and joints of a vehicle placed in the axes of its body, whichever format they came from.

What links say by where they are: the vehicle's size by collision shapes, its camera by a link of that name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.robot.importers.parsed_vehicle import QUESTION, R_LINK_CAMERA, ParsedVehicle
from wakewise.robot.importers.xml import Element, PlacedError, SourceLocation, number, numbers

IDENTITY = Pose(np.zeros(3))

THRUSTER_NAME = re.compile(r"thrust|propell|prop(?:\d|_|$)|t200|rotor", re.IGNORECASE)
PART_NAME = re.compile(
    r"(^|[_/: ])(arm|manipulator|gripper|payload|tether|umbilical|cable|tool|camera|sensor|dvl|imu|battery|thruster|"
    r"propeller|rotor|joint|finger|jaw|wrist|elbow|shoulder|forearm|ballast)s?\d*([_/: ]|$)",
    re.IGNORECASE,
)
"""Names of parts that a vehicle carries: their masses and frames are not the vehicle's."""

_MOVING = frozenset(
    {"revolute", "continuous", "prismatic", "revolute2", "universal", "ball", "screw", "planar", "floating"}
)


@dataclass(eq=False)
class CollisionShape:
    """A collision shape; `X_LS` is its pose in its link, `half_m` half the box round it. A mesh has neither measure."""

    X_LS: Pose
    volume_m3: float | None
    half_m: Array | None = None


@dataclass(eq=False)
class Link:
    """A rigid body: where it is, and what it weighs. Inertia is about its centre of mass, in the axes of the link."""

    name: str
    place: SourceLocation
    X_BL: Pose = IDENTITY
    mass_kg: float | None = None
    p_LG_m: Array = field(default_factory=lambda: np.zeros(3))
    inertia_kg_m2: Array | None = None
    added_mass: Array | None = None
    computed: bool = False
    """Whether the simulator computes mass and inertia from shapes and densities, so that the file states none."""
    shapes: list[CollisionShape] = field(default_factory=list)


@dataclass(eq=False)
class Joint:
    """A joint: its child and its parent link, and its axis in body axes (None if the joint has none)."""

    name: str
    kind: str
    child: str
    X_BJ: Pose
    axis: Array | None
    place: SourceLocation
    parent: str = ""


@dataclass(eq=False)
class CameraSensor:
    """A camera sensor: pose of its Gazebo frame (looks along x) and horizontal field of view."""

    name: str
    X_BS: Pose
    fov_rad: float | None


@dataclass(eq=False)
class RobotDescription:
    """A vehicle's links and joints, its plugins, and its cameras; `base` is the link whose frame is the body."""

    name: str
    base: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    plugins: list[Element]
    cameras: list[CameraSensor]

    def link(self, name: str) -> Link | None:
        """A link by name, with or without its scope."""
        return self.links.get(name) or next((v for k, v in self.links.items() if short(k) == short(name)), None)

    def joint(self, name: str) -> Joint | None:
        """A joint by name, with or without its scope."""
        return self.joints.get(name) or next((v for k, v in self.joints.items() if short(k) == short(name)), None)


def short(name: str) -> str:
    """A name without its scope."""
    return name.replace("::", "/").rpartition("/")[2] or name


def pose_of(xyz: Array, rpy: Array) -> Pose:
    """Pose from a position and roll, pitch, yaw about fixed axes, as URDF, SDF and Stonefish write them."""
    return Pose(xyz, quat_from_euler(float(rpy[0]), float(rpy[1]), float(rpy[2])))


def inertia_matrix(values: dict[str, float]) -> Array:
    """Symmetric matrix from the six entries ixx ... izz."""
    xx, xy, xz, yy, yz, zz = (values.get(key, 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def checked_mass(text: str | None, place: SourceLocation, link: str) -> float:
    """A link's mass.

    Raises InputError if it is missing, not a number, or negative; a massless link is allowed, a massless vehicle is
    not.
    """
    if text is None:
        raise PlacedError(f"{place}: link {link}: inertial without a mass")
    mass = number(text, place, f"mass of link {link}")
    if mass < 0.0:
        raise PlacedError(f"{place}: mass of link {link} is {mass:g}, must be at least 0")
    return mass


def _measures(tag: str, sizes: dict[str, Array]) -> tuple[float | None, Array | None]:
    """Volume of a primitive shape, and half the sides of the box round it, whose axis is z; None of anything else."""
    radius, length = (float(sizes[key][0]) if key in sizes else 0.0 for key in ("radius", "length"))
    match tag:
        case "box" if "size" in sizes:
            return float(np.prod(sizes["size"])), 0.5 * sizes["size"]
        case "sphere":
            return 4.0 / 3.0 * np.pi * radius**3, np.full(3, radius)
        case "cylinder":
            return np.pi * radius**2 * length, np.array([radius, radius, 0.5 * length])
        case "capsule":
            volume = np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
            return volume, np.array([radius, radius, 0.5 * length + radius])
        case "ellipsoid" if "radii" in sizes:
            return float(4.0 / 3.0 * np.pi * np.prod(sizes["radii"])), sizes["radii"]
        case _:
            return None, None


def collision_shape(X_LS: Pose, geometry: Element | None) -> CollisionShape:
    """Shape of a `<geometry>` of URDF (attributes) or SDF (elements)."""
    if geometry is None or not geometry.children:
        return CollisionShape(X_LS, None)
    shape = geometry.children[0]
    counts = {"size": 3, "radii": 3, "radius": 1, "length": 1}
    sizes: dict[str, Array] = {}
    for key, count in counts.items():
        text = shape.attributes.get(key) or shape.value(key)
        if text is not None:
            sizes[key] = numbers(text, shape.place, f"{shape.tag} {key}", count)
    return CollisionShape(X_LS, *_measures(shape.tag, sizes))


def read_mass(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Mass, centre of gravity and inertia of all links together, as a simulator would move them.

    Raises InputError if the masses add up to nothing, or the inertia is not positive definite.
    """
    computed = [link for link in bodies.links.values() if link.computed]
    if computed:
        names = ", ".join(link.name for link in computed[:4])
        found.notes.append(
            f"{QUESTION}mass: not taken: the simulator computes that of {names} "
            f"from shapes and densities (inertial auto) ({computed[0].place.short})"
        )
        return
    weighed = [link for link in bodies.links.values() if link.mass_kg is not None]
    if not weighed:
        return
    moving = moving_parts(bodies)
    if all(link.name in moving or PART_NAME.search(link.name) for link in weighed):
        names = ", ".join(link.name for link in weighed[:4])
        found.notes.append(f"mass: only links of parts or that move state one ({names}), so it is not taken")
        return
    total = sum(link.mass_kg or 0.0 for link in weighed)
    heaviest = max(weighed, key=lambda link: link.mass_kg or 0.0)
    if total <= 0.0:
        raise PlacedError(f"{heaviest.place}: masses of the links add up to {total:g} kg, must be more than 0")
    for link in weighed:
        _require_inertia(link)
    found.mass_kg = total
    centres = {link.name: link.X_BL.apply(link.p_LG_m) for link in weighed}
    centre = sum((link.mass_kg or 0.0) * centres[link.name] for link in weighed) / total
    found.p_G_m = np.asarray(centre, dtype=np.float64)
    if heaviest.inertia_kg_m2 is not None:
        inertia = np.zeros((3, 3))
        for link in weighed:
            arm = centres[link.name] - found.p_G_m
            own = np.zeros((3, 3)) if link.inertia_kg_m2 is None else link.X_BL.R @ link.inertia_kg_m2 @ link.X_BL.R.T
            inertia += own + (link.mass_kg or 0.0) * (float(arm @ arm) * np.eye(3) - np.outer(arm, arm))
        found.inertia_kg_m2 = 0.5 * (inertia + inertia.T)
    others = [link for link in weighed if link is not heaviest]
    if others:
        found.notes.append(
            f"mass: link {heaviest.name} {heaviest.mass_kg:g} kg and {len(others)} further links, together "
            f"{sum(link.mass_kg or 0.0 for link in others):g} kg, are counted as one rigid body"
        )
    arms = [link for link in weighed if link.name in moving and (link.mass_kg or 0.0) > 0.02 * total]
    if arms:
        found.notes.append(
            f"{QUESTION}mass: {sum(link.mass_kg or 0.0 for link in arms):g} kg of it move on joints "
            f"({', '.join(link.name for link in arms[:4])}), as an arm does; they are held where the file has them"
        )
    unstated = [link.name for link in bodies.links.values() if link.mass_kg is None]
    if found.kind == "SDF" and unstated:
        found.notes.append(
            f"{QUESTION}mass: {', '.join(unstated[:6])} states no inertial, for which Gazebo takes 1 kg each "
            f"({len(unstated)} kg in all); not counted"
        )
    where = heaviest.place.short
    found.derived["body"] = found.derived["inertia"] = (
        f"{found.kind} {where}: link {heaviest.name} and all others as one body"
    )


def moving_parts(bodies: RobotDescription) -> set[str]:
    """Links beyond a joint that moves, thrusters' own apart: an arm, not the hull."""
    joined: dict[str, list[str]] = {}
    rigid: dict[str, list[str]] = {}
    for joint in bodies.joints.values():
        parent, child = (link.name if (link := bodies.link(end)) else end for end in (joint.parent, joint.child))
        moves = joint.kind in _MOVING and not THRUSTER_NAME.search(joint.child + " " + joint.name)
        for edges in (joined,) if moves else (joined, rigid):
            edges.setdefault(parent, []).append(child)
            edges.setdefault(child, []).append(parent)
    still = _reached({bodies.base}, rigid)
    return _reached(still, joined) - still


def _reached(start: set[str], edges: dict[str, list[str]]) -> set[str]:
    """Where edges lead to from some places, these included."""
    reached, waiting = set(start), list(start)
    while waiting:
        new = set(edges.get(waiting.pop(), [])) - reached
        reached |= new
        waiting += new
    return reached


def _require_inertia(link: Link) -> None:
    inertia = link.inertia_kg_m2
    if inertia is None:
        return
    scale = float(np.abs(inertia).max())
    lowest = float(np.linalg.eigvalsh(inertia)[0])
    # A dummy link may have no inertia at all; a link that carries the vehicle may not.
    if lowest < -1e-9 * scale or (lowest <= 0.0 and (link.mass_kg or 0.0) > 0.1):
        raise PlacedError(
            f"{link.place}: inertia of link {link.name} has smallest eigenvalue {lowest:g}, must be positive definite"
        )


def read_camera(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Mount and field of view of the first camera."""
    if not bodies.cameras:
        return
    camera = bodies.cameras[0]
    found.X_BC = Pose.from_matrix(camera.X_BS.R @ R_LINK_CAMERA, camera.X_BS.p_m)
    found.camera_fov_rad = camera.fov_rad
    more = f", the first of {len(bodies.cameras)}" if len(bodies.cameras) > 1 else ""
    found.notes.append(f"camera: {camera.name}{more}")
    found.derived["camera_mount"] = f"{found.origin}: sensor {camera.name}"


def read_displacement(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Displaced volume and centre of buoyancy from collision shapes, which Gazebo's buoyancy system weighs.

    Taken only where that makes the vehicle float within 30 % of its mass in fresh water, since collision shapes of
    other files are drawn for contact, not for buoyancy.
    """
    shapes = [(link, shape) for link in bodies.links.values() for shape in link.shapes]
    if found.displaced_volume_m3 is not None or found.mass_kg is None or not shapes:
        return
    if any(shape.volume_m3 is None for _, shape in shapes):
        found.notes.append("displaced volume: collision meshes are not measured, so it is not known")
        return
    volume = sum(shape.volume_m3 or 0.0 for _, shape in shapes)
    if not 0.7 < 1000.0 * volume / found.mass_kg < 1.3:
        found.notes.append(
            f"displaced volume: collision shapes hold {volume:.4g} m3, which does not fit {found.mass_kg:.4g} kg, "
            f"so they are not taken for it"
        )
        return
    moment = sum((s.volume_m3 or 0.0) * (link.X_BL @ s.X_LS).p_m for link, s in shapes)
    found.displaced_volume_m3 = volume
    found.p_buoyancy_m = np.asarray(moment, dtype=np.float64) / volume
    found.notes.append(f"displaced volume: inferred from {len(shapes)} collision shapes, as Gazebo's buoyancy does")
    found.derived["buoyancy"] = f"{found.origin}: collision shapes"
    found.estimates.add("buoyancy")


_CAMERA = re.compile(r"(^|[_/:-])cam(era)?(_?\d+|_[a-z]+)?(_link|_frame)?$", re.IGNORECASE)
_AHEAD = re.compile(
    r"(^|[/:])((base|front|forward|main|fwd)_?)*cam(era)?(_(front|forward|main))?(_link|_frame)?$", re.IGNORECASE
)
_OPTICAL = re.compile(r"cam(?:era)?\w*_optical(?:_link|_frame)?$", re.I)
_R_FRD_CAMERA = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_OUTSIDE_M = 1e-3
"""So far a thruster's place may lie outside the outline, by rounding."""


def read_outline(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Size and camera mount, where nothing else in the file states them."""
    if found.size_m is None:
        _read_size(bodies, found)
    if found.X_BC is None:
        _read_camera_link(bodies, found)


def _read_size(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """The box round the collision shapes of the base link, which is centred on its origin, as `Vehicle.size_m` is.

    Taken only where it holds every thruster, since collision shapes may be drawn for buoyancy or for contact alone.
    """
    base = bodies.links[bodies.base]
    if not base.shapes:
        return
    if any(shape.half_m is None for shape in base.shapes):
        found.notes.append(f"size: collision meshes of link {base.name} are not measured, so it is not known")
        return
    reach = np.max([_reach(base.X_BL @ shape.X_LS, shape.half_m) for shape in base.shapes], axis=0)
    if np.any(reach <= 0.0):
        found.notes.append(f"size: a collision shape of link {base.name} has no extent, so it is not known")
        return
    kind = f"the box round {len(base.shapes)} collision shapes" if len(base.shapes) > 1 else "the collision shape"
    box = " x ".join(f"{2.0 * side:.4g}" for side in reach)
    outside = [t.name for t in found.thrusters if np.any(np.abs(t.p_m) > reach + _OUTSIDE_M)]
    if outside:
        found.notes.append(
            f"size: {kind} of link {base.name}, {box} m, leaves {', '.join(outside[:4])} outside, so it is not taken"
        )
        return
    found.size_m = 2.0 * reach
    found.notes.append(f"size: {kind} of link {base.name}, {box} m; an estimate, such shapes are drawn for collisions")
    where = f"size_m: an estimate by {kind} of link {base.name}"
    known = found.derived.get("body", found.origin)
    found.derived["body"] = f"{known}; {where}"
    found.estimates.add("body")


def _reach(X_BS: Pose, half_m: Array | None) -> Array:
    """How far a shape goes from the body origin along each body axis, shape (3,)."""
    half = np.zeros(3) if half_m is None else half_m
    return np.asarray(np.abs(X_BS.p_m) + np.abs(X_BS.R) @ half)


def _read_camera_link(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Camera mount by a link that is called one: its x axis looks ahead (ROS REP 103), or z of an optical frame."""
    optical = [link for name, link in bodies.links.items() if _OPTICAL.search(name)]
    plain = [link for name, link in bodies.links.items() if _CAMERA.search(name) and link not in optical]
    if not optical and not plain:
        return
    link: Link = min(optical or plain, key=lambda link: _AHEAD.search(link.name) is None)
    # Of a body with z down its frames are taken to have z down too, so that the image is upright.
    axes = np.eye(3) if optical else R_LINK_CAMERA if found.frame == "FLU" else _R_FRD_CAMERA
    found.X_BC = Pose.from_matrix(link.X_BL.R @ axes, link.X_BL.p_m)
    looks = "the z axis of the optical frame" if optical else "its x axis"
    others = len(optical or plain) - 1
    more = f" of {others + 1} so called" if others else ""
    found.notes.append(
        f"camera: by the name of link {link.name}{more}, taken to look along {looks}; no sensor states it"
    )
    found.derived["camera_mount"] = f"{found.origin}: link {link.name}, by its name"
