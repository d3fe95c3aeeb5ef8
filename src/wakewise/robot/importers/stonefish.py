"""Stonefish scenarios (`.scn`): the robot with the most thrusters; axes are FRD, thrust goes along +x of a thruster.

Actuators of a Stonefish robot that push: which way, how hard, and how fast (Stonefish's Thruster and its models).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.robot.importers.expressions import evaluate
from wakewise.robot.importers.gazebo_thrusters import disk_area_m2, note_movable_thrusters
from wakewise.robot.importers.packages import PackagePaths
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedThruster, ParsedVehicle
from wakewise.robot.importers.robot_description import (
    Joint,
    Link,
    RobotDescription,
    checked_mass,
    moving_parts,
    read_mass,
    short,
)
from wakewise.robot.importers.urdf import origin
from wakewise.robot.importers.xml import Element, PlacedError, SourceLocation, number, numbers, parse_xml, read_text

RULE = (
    "a positive setpoint pushes along +x of the thruster's frame, turned round by a left-handed propeller "
    "and by an inverted setpoint (Stonefish's Thruster)"
)
SIMPLE_RULE = (
    "a positive setpoint pushes along +x of the actuator's frame, turned round if it is inverted, whatever its "
    "propeller's hand (Stonefish's SimpleThruster and Push)"
)
KINDS = frozenset({"thruster", "simple_thruster", "simplethruster", "push"})
_STEADY = frozenset({"zero_order", "first_order", "mechanical_pi"})
"""Rotor dynamics whose speed settles at the setpoint."""


def count(robot: Element) -> int:
    """How many actuators of a robot push."""
    return sum(a.attributes.get("type") in KINDS for a in robot.all("actuator"))


def read_thrusters(robot: Element, bodies: RobotDescription, density: float | None, found: ParsedVehicle) -> None:
    """Fill in the thrusters of a robot; other actuators are named as not read.

    `bodies`: its links. `density`: density of the scenario's water in kg/m^3. Raises InputError if a thruster is on no
    link, or a number is not one.
    """
    rules: list[str] = []
    turning = {short(name) for name in moving_parts(bodies)}
    steered: list[str] = []
    others: dict[str, int] = {}
    for actuator in robot.all("actuator"):
        kind = actuator.attributes.get("type", "")
        if kind not in KINDS:
            others[kind] = others.get(kind, 0) + 1
            continue
        found.thrusters.append(
            _thruster(actuator, bodies, density, found) if kind == "thruster" else _simple(actuator, bodies)
        )
        rules.append(RULE if kind == "thruster" else SIMPLE_RULE)
        if short(actuator.child("link").name) in turning:
            steered.append(found.thrusters[-1].name)
    note_movable_thrusters(steered, found)
    old = sum(
        actuator.first("thrust_model") is None and "max_rpm" in actuator.child("specs").attributes
        for actuator in robot.all("actuator")
        if actuator.attributes.get("type") == "thruster"
    )
    if old:
        found.notes.append(f"not read: thrust_coeff and max_rpm of {old} thrusters in the form before thrust models")
    found.thrust_rule = "; ".join(dict.fromkeys(rules)) or RULE
    if others:
        said = ", ".join(f"{n} of type {kind[:40] or 'unknown'}" for kind, n in others.items())
        doubt = QUESTION if "propeller" in others else ""
        found.notes.append(f"{doubt}not read: actuators that are no thrusters ({said})")
    if found.thrusters:
        found.derived["thruster_layout"] = f"{found.origin}: actuators of type thruster"


def true(text: str | None) -> bool:
    """Whether an attribute says true, as Stonefish's reader of XML takes it."""
    return (text or "").strip() in {"true", "True", "TRUE", "1"}


def _placed(actuator: Element, bodies: RobotDescription) -> ParsedThruster:
    name = actuator.name or f"line {actuator.place.line}"
    link = _link_of(actuator, bodies)
    if link is None:
        raise PlacedError(f"{actuator.place}: thruster {name} is on no link of the robot")
    X_BT = link.X_BL @ origin(actuator.first("origin"))
    return ParsedThruster(short(name), X_BT.p_m, X_BT.R[:, 0], actuator.place, X_BT.R)


def _link_of(element: Element, bodies: RobotDescription) -> Link | None:
    """The link that an actuator or a sensor names; None if it names none of the robot."""
    named = element.first("link")
    return None if named is None else bodies.link(named.name)


def _simple(actuator: Element, bodies: RobotDescription) -> ParsedThruster:
    """An ideal force along +x of its frame; a propeller's hand turns what is drawn, not what pushes."""
    thruster, specs = _placed(actuator, bodies), actuator.child("specs")
    if true(specs.attributes.get("inverted")):
        thruster.axis = -thruster.axis
    for prefix in ("", "thrust_"):
        low, high = (specs.number_attribute(f"{s}_{prefix}limit", "limit of the thrust") for s in ("lower", "upper"))
        if low is not None and high is not None and low <= 0.0 <= high and low < high:
            thruster.max_forward_N, thruster.max_reverse_N = high, -low
    return thruster


def _thruster(
    actuator: Element, bodies: RobotDescription, density: float | None, found: ParsedVehicle
) -> ParsedThruster:
    thruster = _placed(actuator, bodies)
    specs, propeller, model = (actuator.child(tag) for tag in ("specs", "propeller", "thrust_model"))
    kind = model.attributes.get("type", "")
    # Scenarios of before the thrust models said inverted; with a model Stonefish reads inverted_setpoint only.
    inverted = true(specs.attributes.get("inverted_setpoint", specs.attributes.get("inverted") if not kind else ""))
    if kind and true(specs.attributes.get("inverted")) and "inverted_setpoint" not in specs.attributes:
        found.notes.append(
            f"{QUESTION}thruster {thruster.name}: not read: inverted, which Stonefish ignores (it reads "
            f"inverted_setpoint); is the thrust meant to be turned? ({specs.place.short})"
        )
    left = not true(propeller.attributes.get("right", "true"))
    if left != inverted:
        thruster.axis = -thruster.axis
    diameter = propeller.number_attribute("diameter")
    if diameter is not None:
        thruster.disk_area_m2 = disk_area_m2(diameter, propeller.place)
    steady = _lag(actuator, thruster)
    top = abs(specs.number_attribute("max_setpoint") or 0.0)
    along = _thrusts(model, top or 1.0, diameter, density)
    if along is None:
        return thruster
    if max(along) <= 0.0 and min(along) < 0.0:
        thruster.axis, along = -thruster.axis, (-along[0], -along[1])
    if top and steady and min(along) >= 0.0:
        # The curve is of the rotor's own turning, so a positive setpoint takes its other end where it is inverted;
        # fluid_dynamics alone turns its curve with the hand, so there the end goes with the direction of the force.
        swapped = left != inverted if kind == "fluid_dynamics" else inverted
        thruster.max_forward_N, thruster.max_reverse_N = along[::-1] if swapped else along
    return thruster


def _lag(actuator: Element, thruster: ParsedThruster) -> bool:
    """Fill in the time constant of a first-order rotor; whether the rotor settles at the speed that is asked for."""
    rotor = actuator.first("rotor_dynamics")
    if rotor is None:
        return True
    kind, constant = rotor.attributes.get("type"), rotor.first("time_constant")
    if kind == "zero_order":
        thruster.time_constant_s = 0.0
    elif kind == "first_order" and constant is not None:
        thruster.time_constant_s = number(constant.attributes.get("value", ""), constant.place, "time_constant")
    return kind in _STEADY


def _thrusts(model: Element, top: float, diameter: float | None, density: float | None) -> tuple[float, float] | None:
    """Thrusts in newton, both positive, of the rotor turning at +top and at -top; None where neither is stated."""

    def value(tag: str, key: str) -> float | None:
        return model.child(tag).number_attribute(key, f"{tag} {key}")

    forward, reverse = value("thrust_coeff", "forward"), value("thrust_coeff", "reverse")
    match model.attributes.get("type"):
        case "quadratic":
            one = value("thrust_coeff", "value")
            return None if one is None else (one * top**2, one * top**2)
        case "deadband":
            lower, upper = value("deadband", "lower"), value("deadband", "upper")
            if forward is None or reverse is None or lower is None or upper is None:
                return None
            return forward * max(top**2 - upper, 0.0), reverse * max(top**2 + lower, 0.0)
        case "linear_interpolation":
            table_in, table_out = model.first("input"), model.first("output")
            if table_in is None or table_out is None:
                return None
            x = numbers(table_in.attributes.get("value", ""), table_in.place, "input")
            y = numbers(table_out.attributes.get("value", ""), table_out.place, "output", len(x))
            if not len(x) or not np.all(np.diff(x) > 0.0):
                return None
            return float(np.interp(top, x, y)), -float(np.interp(-top, x, y))
        case "fluid_dynamics":
            if forward is None or reverse is None or diameter is None or density is None:
                return None
            per = density * diameter**4 * (top / (2.0 * math.pi)) ** 2
            return forward * per, reverse * per
        case _:
            return None


MAX_INCLUDES = 60
_DEEPEST = 8
_SUBSTITUTION = re.compile(r"\$\((arg|find|param)\s+([^)\s]+)\s*\)")
_EXPRESSION = re.compile(r"\$\{([^}]*)\}")
_CENTRED = frozenset({"box", "cylinder", "sphere", "torus"})
"""Shapes whose centre of mass is their origin."""
_SMALL = 0.02
"""Share of the mass whose centre or inertia may be unknown."""


class StonefishReader:
    """Reads a scenario and its includes; what is not there is left out with a note: scenery is often elsewhere."""

    def __init__(self, folders: PackagePaths, arguments: Mapping[str, str], notes: list[str]) -> None:
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
            self.notes.append(f"include left out, not found: {name[:80]} ({element.place.short})")
            return []
        inner = {arg.name: self._text(arg.attributes.get("value", ""), arguments) for arg in element.all("arg")}
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


def read_stonefish(
    root: Element, folders: PackagePaths, arguments: Mapping[str, str], macros: list[str], found: ParsedVehicle
) -> None:
    """Fill in what a scenario says about its robot; `macros` are those of xacro that the file defines.

    Raises InputError if there is no robot, or a number is not one.
    """
    scenario = StonefishReader(folders, arguments, found.notes)
    whole = Element("scenario", {}, root.place, [root]) if root.tag == "robot" else root
    robots = scenario.robots(whole, dict(arguments))
    if not robots:
        why = next((note for note in found.notes if note.startswith("include left out")), "")
        if macros:
            why = f"it defines the macros {', '.join(macros)[:120]} and calls none with one; import the file that does"
        raise PlacedError(f"{root.place}: scenario holds no robot" + (f" ({why})" if why else ""))
    robot = max(robots, key=count)
    if len(robots) > 1:
        found.notes.append(f"robot {robot.attributes.get('name')}: taken out of {len(robots)} in the scenario")
    found.name = robot.name or found.name
    weights: dict[str, _Weight] = {}
    bodies = _bodies(robot, weights)
    _mass(bodies, weights, found)
    _hydrodynamics(robot, found)
    read_thrusters(robot, bodies, _density(root), found)
    _camera(robot, bodies, found)
    if found.mass_kg is not None and found.inertia_kg_m2 is None:
        found.notes.append("inertia: left to Stonefish, which computes it from meshes; not in the file")


def _density(root: Element) -> float | None:
    """Density of the scenario's water, kg/m^3."""
    water = next((e for e in root.walk() if e.tag == "water" and "density" in e.attributes), root)
    return water.number_attribute("density", "density of the water") if water.tag == "water" else None


def _bodies(robot: Element, weights: dict[str, _Weight]) -> RobotDescription:
    base_element = robot.first("base_link")
    elements = [e for e in robot.children if e.tag in {"base_link", "link"}]
    if not elements:
        raise PlacedError(f"{robot.place}: robot holds no link")
    base = (base_element or elements[0]).attributes.get("name", "base_link")
    links: dict[str, Link] = {}
    for i, element in enumerate(elements):
        name = element.attributes.get("name", f"link{i}")
        links[name] = Link(element.name, element.place)
        weights[name] = _weight(element, name)
    steps: dict[str, tuple[str, Pose]] = {}
    joints: dict[str, Joint] = {}
    for i, joint in enumerate(robot.all("joint")):
        ends = joint.first("parent"), joint.first("child")
        if ends[0] is None or ends[1] is None:
            continue
        parent, child = (end.name for end in ends if end is not None)
        steps[child] = (parent, origin(joint.first("origin")))
        name, kind = joint.attributes.get("name", f"joint{i}"), joint.attributes.get("type", "")
        joints[name] = Joint(name, kind, child, Pose(np.zeros(3)), None, joint.place, parent)
    for name, link in links.items():
        X, here = Pose(np.zeros(3)), name
        for _ in range(len(links)):
            if here == base or here not in steps:
                break
            here, step = steps[here]
            X = step @ X
        link.X_BL = X
    return RobotDescription(robot.attributes.get("name", "robot"), base, links, joints, [], [])


@dataclass(eq=False)
class _Weight:
    """What a body or a part of it weighs, in its own frame; None where Stonefish computes it from shape and material.

    `open_kg` is the part of the mass whose centre is not known, `spread_kg` that whose inertia is not, and `unstated`
    names the parts that state no mass.
    """

    place: SourceLocation
    mass_kg: float = 0.0
    centre_m: Array = field(default_factory=lambda: np.zeros(3))
    inertia_kg_m2: Array = field(default_factory=lambda: np.zeros((3, 3)))
    open_kg: float = 0.0
    spread_kg: float = 0.0
    unstated: list[str] = field(default_factory=list)


def _weight(element: Element, name: str, depth: int = 0) -> _Weight:
    """Weight of one solid; a compound is the sum of its parts, each at its transform, and has no mass of its own."""
    if element.attributes.get("type") == "compound" and depth < _DEEPEST:
        return _compound(element, name, depth)
    mass, inertia, centre = element.first("mass"), element.first("inertia"), element.first("cg")
    weight = _Weight(element.place if mass is None else mass.place)
    value = 0.0 if mass is None else checked_mass(mass.attributes.get("value"), mass.place, name)
    if value == 0.0:
        weight.unstated.append(name)
        return weight
    weight.mass_kg = value
    if centre is None and element.attributes.get("type") not in _CENTRED:
        weight.open_kg = value
    at = origin(element.first("origin") if centre is None and weight.open_kg == 0.0 else centre)
    weight.centre_m = at.p_m
    if inertia is not None and "xyz" in inertia.attributes:
        moments = numbers(inertia.attributes["xyz"], inertia.place, "inertia", 3)
        weight.inertia_kg_m2 = at.R @ np.diag(moments) @ at.R.T
    else:
        weight.spread_kg = value
    return weight


def _compound(element: Element, name: str, depth: int) -> _Weight:
    whole = _Weight(element.place)
    parts: list[tuple[_Weight, Pose]] = []
    for i, part in enumerate(e for e in element.children if e.tag in {"external_part", "internal_part"}):
        one = _weight(part, f"{name}/{part.attributes.get('name', f'part{i}')}", depth + 1)
        parts.append((one, origin(part.first("compound_transform"))))
        whole.mass_kg += one.mass_kg
        whole.open_kg += one.open_kg
        whole.spread_kg += one.spread_kg
        whole.unstated += one.unstated
    if not parts:
        whole.unstated.append(name)
    if whole.mass_kg > 0.0:
        whole.centre_m = sum((w.mass_kg * X.apply(w.centre_m) for w, X in parts), np.zeros(3)) / whole.mass_kg
    for w, X in parts:
        arm = X.apply(w.centre_m) - whole.centre_m
        whole.inertia_kg_m2 += X.R @ w.inertia_kg_m2 @ X.R.T
        whole.inertia_kg_m2 += w.mass_kg * (float(arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return whole


def _mass(bodies: RobotDescription, weights: dict[str, _Weight], found: ParsedVehicle) -> None:
    """Mass of all links, if all state one: what Stonefish computes from meshes is not guessed from what is stated."""
    unstated = [part for weight in weights.values() for part in weight.unstated]
    total = sum(weight.mass_kg for weight in weights.values())
    if unstated:
        stated = f"; what is stated adds up to {total:.6g} kg, which is not the vehicle's" if total else ""
        found.notes.append(
            f"mass: {', '.join(unstated[:6])}{' ...' if len(unstated) > 6 else ''} states none, Stonefish computes it "
            f"from volume and material{stated}"
        )
        return
    for name, weight in weights.items():
        link = bodies.links[name]
        link.place, link.mass_kg, link.p_LG_m = weight.place, weight.mass_kg, weight.centre_m
        if weight.spread_kg <= _SMALL * weight.mass_kg:
            link.inertia_kg_m2 = weight.inertia_kg_m2
    read_mass(bodies, found)
    unknown = sum(weight.open_kg for weight in weights.values())
    if unknown > _SMALL * total and found.p_G_m is not None:
        found.p_G_m = found.inertia_kg_m2 = None
        found.derived.pop("inertia", None)
        found.notes.append(
            f"centre of gravity: {unknown:.6g} kg of {total:.6g} kg state no cg, Stonefish computes it from meshes"
        )


def _hydrodynamics(robot: Element, found: ParsedVehicle) -> None:
    base = robot.first("base_link")
    if base is not None and base.first("hydrodynamics") is not None:
        found.notes.append(
            "hydrodynamics: viscous and quadratic drag of Stonefish are factors on forces from the mesh, "
            "not coefficients of the whole vehicle, so they are not taken"
        )
    found.notes.append("added mass, damping and buoyancy: Stonefish computes them from meshes; not in the file")


def _camera(robot: Element, bodies: RobotDescription, found: ParsedVehicle) -> None:
    """First camera; Stonefish gives camera frames OpenCV axes, so the mount needs no turn."""
    for sensor in robot.all("sensor"):
        if "camera" in sensor.attributes.get("type", ""):
            link = _link_of(sensor, bodies)
            if link is None:
                continue
            found.X_BC = link.X_BL @ origin(sensor.first("origin"))
            degrees = sensor.child("specs").number_attribute("horizontal_fov")
            if degrees is not None:
                found.camera_fov_rad = math.radians(degrees)
            found.notes.append(f"camera: {sensor.attributes.get('name', 'camera')}")
            found.derived["camera_mount"] = f"{found.origin}: sensor"
            return
