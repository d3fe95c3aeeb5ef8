"""Thrusters as Gazebo's plugins describe them: gz-sim, UUV Simulator (Plankton, DAVE), ArduPilot's channels.

Forms of thruster plugins whose rule is known: gz-sim, UUV Simulator (Plankton, DAVE), HippoCampus, orca2.
"""

from __future__ import annotations

import math
import re

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedThruster, ParsedVehicle, unit_axis
from wakewise.robot.importers.robot_description import THRUSTER_NAME, Joint, RobotDescription, moving_parts, short
from wakewise.robot.importers.urdf import origin
from wakewise.robot.importers.xml import Element, PlacedError, SourceLocation, number, numbers

GZ_RULE = "positive thrust pushes along the joint axis, whatever the sign of thrust_coefficient (gz-sim's Thruster)"
UUV_RULE = "positive thrust pushes along the joint axis, +x of the thruster where none is given (UUV Simulator)"
HIPPO_RULE = (
    "positive thrust pushes along +x of the thruster's link, turned round by a clockwise propeller (HippoCampus)"
)
ORCA_RULE = "positive thrust pushes along +z of each thruster's origin, turned round by a negative pos_force (orca2)"

DIAMETERS_M = (0.005, 2.0)
"""Smallest and largest propeller of an underwater vehicle."""


def words(plugin: Element) -> str:
    """What a plugin calls itself, in lower case."""
    return (plugin.attributes.get("filename", "") + " " + plugin.name).lower()


def plugin_thrusters(
    plugin: Element, bodies: RobotDescription, found: ParsedVehicle
) -> list[tuple[ParsedThruster, str, float]] | None:
    """Thrusters of one plugin with its rule and their order; None if its form is not known."""
    if "thruster" in words(plugin):
        if plugin.first("joint_name") is not None:
            return [(_gz(plugin, bodies), GZ_RULE, math.inf)]
        if plugin.first("linkName") is not None or plugin.first("jointName") is not None:
            identity = plugin.value("thrusterID")
            place = number(identity, plugin.place, "thrusterID") if identity else math.inf
            return [(_uuv(plugin, bodies), UUV_RULE, place)]
        if plugin.first("link") is not None and plugin.first("propeller_direction") is not None:
            return [(_hippo(plugin, bodies), HIPPO_RULE, math.inf)]
    inner = plugin.all("thruster")
    if inner and all(t.first("origin") is not None and t.first("map") is None for t in inner):
        return [(t, ORCA_RULE, math.inf) for t in _orca(plugin, bodies, found)]
    return None


def _hippo(plugin: Element, bodies: RobotDescription) -> ParsedThruster:
    name = plugin.value("link") or ""
    link = bodies.link(name)
    if link is None:
        raise PlacedError(f"{plugin.place}: thruster plugin: link {name} is not in the file")
    sign = -1.0 if (plugin.value("propeller_direction") or "").lower() == "cw" else 1.0
    # The force acts at the link's centre of mass (gz-sim's AddWorldForce).
    p_m = link.X_BL.apply(link.p_LG_m)
    return ParsedThruster(short(link.name), p_m, sign * link.X_BL.R[:, 0], plugin.place, link.X_BL.R)


def _orca(plugin: Element, bodies: RobotDescription, found: ParsedVehicle) -> list[ParsedThruster]:
    """Thrusters that stand in the plugin itself, each an origin in one link with its forces at full command."""
    name = plugin.value("link_name") or bodies.base
    link = bodies.link(name)
    if link is None:
        raise PlacedError(f"{plugin.place}: thruster plugin: link {name} is not in the file")
    thrusters: list[ParsedThruster] = []
    for i, element in enumerate(plugin.all("thruster")):
        X_BT = link.X_BL @ origin(element.first("origin"))
        ahead, astern = element.number("pos_force"), element.number("neg_force")
        ahead, astern = 50.0 if ahead is None else ahead, 40.0 if astern is None else astern
        label = element.attributes.get("name") or f"thruster{i}"
        if ahead * astern <= 0.0:
            raise PlacedError(
                f"{element.place}: thruster {label}: pos_force {ahead:g} and neg_force {astern:g} must be of one sign, "
                f"or it pushes one way only"
            )
        sign = math.copysign(1.0, ahead)
        thruster = ParsedThruster(label, X_BT.p_m, sign * X_BT.R[:, 2], element.place, X_BT.R)
        thruster.max_forward_N, thruster.max_reverse_N = abs(ahead), abs(astern)
        thrusters.append(thruster)
    if np.any(np.abs(link.p_LG_m) > 1e-9):
        found.notes.append(
            f"{QUESTION}places of thrusters are from the origin of link {short(link.name)}, as the plugin's text says; "
            f"Gazebo counts them from its centre of mass, {np.round(link.p_LG_m, 4).tolist()} m away"
        )
    found.derived["thruster_limits"] = f"{found.origin}: pos_force and neg_force of the plugin"
    return thrusters


def _gz(plugin: Element, bodies: RobotDescription) -> ParsedThruster:
    name = plugin.value("joint_name") or ""
    joint = bodies.joint(name)
    if joint is None or joint.axis is None:
        what = "is not in the file" if joint is None else "has no axis"
        raise PlacedError(f"{plugin.place}: thruster plugin: joint {name} {what}")
    thruster = on_joint(joint, bodies)
    diameter = plugin.number("propeller_diameter")
    if diameter is not None:
        thruster.disk_area_m2 = disk_area_m2(diameter, plugin.place)
    if (plugin.value("use_angvel_cmd") or "false").lower() not in {"true", "1"}:
        high, low = plugin.number("max_thrust_cmd"), plugin.number("min_thrust_cmd")
        thruster.max_forward_N = high if high is not None and high >= 0.0 else None
        thruster.max_reverse_N = -low if low is not None and low <= 0.0 else None
    return thruster


def disk_area_m2(diameter_m: float, place: SourceLocation) -> float:
    """Area in m^2 of a propeller's disk.

    Raises InputError if the diameter is none that an underwater vehicle's propeller has.
    """
    low_m, high_m = DIAMETERS_M
    if not low_m <= diameter_m <= high_m:
        raise PlacedError(
            f"{place}: propeller diameter {diameter_m:g} must be from {low_m:g} to {high_m:g} m; are these metres?"
        )
    return 0.25 * math.pi * diameter_m**2


def where_on(joint: Joint, bodies: RobotDescription) -> Array:
    """Where a thruster on a joint pushes: at the origin of the link that turns, wherever the joint itself is placed."""
    link = bodies.link(joint.child)
    return joint.X_BJ.p_m if link is None else link.X_BL.p_m


def on_joint(joint: Joint, bodies: RobotDescription) -> ParsedThruster:
    """A thruster that turns on a joint and pushes along its axis."""
    axis = joint.axis if joint.axis is not None else joint.X_BJ.R[:, 0]
    where = f"{joint.place}: joint {joint.name}"
    name = short(joint.child)
    return ParsedThruster(name, where_on(joint, bodies), unit_axis(axis, where), joint.place, joint.X_BJ.R)


def _uuv(plugin: Element, bodies: RobotDescription) -> ParsedThruster:
    link_name, joint_name = plugin.value("linkName"), plugin.value("jointName")
    joint = bodies.joint(joint_name) if joint_name else None
    link = bodies.link(link_name) if link_name else None
    if joint is not None:
        thruster = on_joint(joint, bodies)
        if link is not None:
            thruster.name = short(link.name)
    elif link is not None:
        thruster = ParsedThruster(short(link.name), link.X_BL.p_m, link.X_BL.R[:, 0], plugin.place, link.X_BL.R)
    else:
        raise PlacedError(f"{plugin.place}: thruster plugin: neither link {link_name} nor its joint is in the file")
    dynamics = plugin.first("dynamics")
    if dynamics is not None:
        lag = dynamics.number("timeConstant")
        thruster.time_constant_s = 0.0 if (dynamics.value("type") or "").lower() == "zeroorder" else lag
    _uuv_limits(plugin, thruster)
    return thruster


def _uuv_limits(plugin: Element, thruster: ParsedThruster) -> None:
    """Limits: stated thrusts first, then the ends of a thrust table, then the command's ends through the curve."""
    high, low = plugin.number("thrustMax"), plugin.number("thrustMin")
    conversion = plugin.first("conversion")
    clamp_high, clamp_low = plugin.number("clampMax"), plugin.number("clampMin")
    gain = plugin.number("gain")
    gain = 1.0 if gain is None else gain
    if conversion is not None:
        table = conversion.numbers("outputValues")
        constant = conversion.number("rotorConstant")
        if table is not None:
            high = float(table.max()) if high is None else high
            low = float(table.min()) if low is None else low
        elif constant is not None:
            ends = [constant * g * abs(g) for g in (gain * c for c in (clamp_low, clamp_high) if c is not None)]
            if len(ends) == 2:
                high = max(ends) if high is None else high
                low = min(ends) if low is None else low
    efficiency = plugin.number("thrust_efficiency")
    scale = efficiency if efficiency is not None and 0.0 < efficiency <= 1.0 else 1.0
    thruster.max_forward_N = scale * high if high is not None and high >= 0.0 else None
    thruster.max_reverse_N = -scale * low if low is not None and low <= 0.0 else None


NAME_RULE = "inferred from names: positive thrust pushes along the axis of each joint that is called a thruster"

_DRIVES = re.compile(r"thrust|propel|propuls|rotor|motor", re.IGNORECASE)
_READ = frozenset(
    {
        *("joint_name", "thrust_coefficient", "propeller_diameter", "use_angvel_cmd", "max_thrust_cmd"),
        *("min_thrust_cmd", "linkName", "jointName", "thrusterID", "dynamics", "thrustMax", "thrustMin", "conversion"),
        *("clampMax", "clampMin", "gain", "thrust_efficiency", "link", "joint", "propeller_direction", "link_name"),
        *("turning_direction", "thruster", "pos_force", "neg_force", "origin"),
    }
)
"""What is read of the plugins above; their hands, coefficients and topics change no direction."""
_PROPELLER = re.compile(r"prop|rotor|blade", re.IGNORECASE)
_NUMBERED = re.compile(r"\d+")
_HAND_M = 0.15


def read_thrusters(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Fill in the thrusters from plugins; where there are none, from joints that are called thrusters.

    Raises InputError if a plugin names a joint or link that is not there, or an axis has no length.
    """
    rules: list[str] = []
    order: list[float] = []
    known: list[Element] = []
    unknown: list[Element] = []
    for plugin in bodies.plugins:
        if not _drives(plugin):
            continue
        read = plugin_thrusters(plugin, bodies, found)
        (unknown if read is None else known).append(plugin)
        for thruster, rule, identity in read or ():
            found.thrusters.append(thruster)
            rules.append(rule)
            order.append(identity)
    _drop_repeats(found, order)
    for plugin in unknown:
        inner, title = len(plugin.all("thruster")), plugin.name or plugin.attributes.get("filename") or "without a name"
        found.notes.append(
            f"{QUESTION}not read: plugin {title[:80]}, of a form that is not known"
            + (f", with {inner} thrusters in it" if inner else "")
            + f" ({plugin.place.short})"
        )
    if found.thrusters:
        found.thrusters = [t for _, t in sorted(zip(order, found.thrusters, strict=True), key=lambda pair: pair[0])]
        found.thrust_rule = "; ".join(dict.fromkeys(rules))
        found.derived["thruster_layout"] = f"{found.origin}: thruster plugins and their joints"
        _question_undriven(bodies, found)
        turning = {short(name) for name in moving_parts(bodies)}
        carried = {short(joint.child): short(joint.parent) for joint in bodies.joints.values()}
        note_movable_thrusters([t.name for t in found.thrusters if carried.get(t.name) in turning], found)
    elif not _freefloating(bodies, found):
        _by_name(bodies, unknown, found)
    tags = dict.fromkeys(child.tag for plugin in known for child in plugin.children if child.tag not in _READ)
    if tags:
        found.notes.append(f"not read of the thruster plugins: {', '.join(tags)[:400]}")
    _ardupilot(bodies, found)


def _drives(plugin: Element) -> bool:
    """Whether a plugin seems to push: by its name, or by thrusters inside it; a manager allocates only."""
    if "manager" in words(plugin) or "freefloating" in words(plugin):
        return False
    return _DRIVES.search(words(plugin)) is not None or plugin.first("thruster") is not None


def _title(plugin: Element) -> str:
    return (plugin.attributes.get("name") or plugin.attributes.get("filename") or "without a name")[:80]


def _question_undriven(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Say which turning joints are called thrusters and are driven by no plugin."""
    driven = [t.p_m for t in found.thrusters]
    idle = [
        j.name
        for j in bodies.joints.values()
        if j.kind in {"continuous", "revolute"}
        and THRUSTER_NAME.search(short(j.child) + " " + short(j.name))
        and not any(float(np.linalg.norm(where_on(j, bodies) - p)) < _HAND_M for p in driven)
    ]
    if idle:
        found.notes.append(
            f"{QUESTION}{len(found.thrusters)} thrusters have a plugin, but {len(idle)} further joints are called "
            f"thrusters: {', '.join(short(name) for name in idle[:12])}"
        )


def note_movable_thrusters(names: list[str], found: ParsedVehicle) -> None:
    """Say which thrusters sit beyond a joint that moves: they are read as they point with the joint at zero."""
    if names:
        found.notes.append(
            f"{QUESTION}thrusters on joints that move, as servos turn them: {', '.join(names[:12])}; "
            f"they are held where the joints are at zero"
        )


def _drop_repeats(found: ParsedVehicle, order: list[float]) -> None:
    """Count a thruster once that two plugins drive, as files for two simulators do."""
    seen: list[ParsedThruster] = []
    for index in reversed(range(len(found.thrusters))):
        thruster = found.thrusters[index]
        same = [t for t in found.thrusters[:index] if t.name == thruster.name and np.array_equal(t.p_m, thruster.p_m)]
        if same:
            seen.append(found.thrusters.pop(index))
            order.pop(index)
    if seen:
        found.notes.append(
            f"{QUESTION}two plugins drive {', '.join(sorted(t.name for t in seen)[:12])}; counted once, by the first"
        )


def _by_name(bodies: RobotDescription, unknown: list[Element], found: ParsedVehicle) -> None:
    joints = [j for j in bodies.joints.values() if THRUSTER_NAME.search(short(j.child) + " " + short(j.name))]
    turning = [j for j in joints if j.axis is not None and j.kind in {"continuous", "revolute"}]
    fixed = [j for j in joints if j.kind == "fixed"]
    turning, fixed = _one_each(turning, bodies, found), _one_each(fixed, bodies, found) if not turning else []
    for joint in turning or fixed:
        found.thrusters.append(on_joint(joint, bodies))
    if turning:
        found.thrust_rule = NAME_RULE
    elif fixed:
        found.thrust_rule = (
            "inferred from names: positive thrust pushes along +x of each fixed link that is called a thruster"
        )
    if found.thrusters:
        found.guessed = "links were taken for thrusters by their names"
        why = "the file's thruster plugin is not read" if unknown else "no thruster plugin in the file"
        found.notes.append(f"{QUESTION}{why}: {found.guessed}, and which way they push is a guess")
        found.thrusters.sort(key=lambda t: [int(n) for n in _NUMBERED.findall(t.name)])
        found.derived["thruster_layout"] = f"{found.origin}: joints with thruster names"


def _one_each(joints: list[Joint], bodies: RobotDescription, found: ParsedVehicle) -> list[Joint]:
    """One joint per thruster: a propeller counts, the hull that carries it does not.

    Raises InputError if two joints of one number lie within one another and neither is called a propeller.
    """
    above = {j.child: j.parent for j in bodies.joints.values()}
    carriers: set[str] = set()
    for joint in joints:
        here, steps = joint.parent, 0
        while here and steps < len(above) + 1:
            carriers.add(here)
            here, steps = above.get(here, ""), steps + 1
    kept = [j for j in joints if j.child not in carriers]
    dropped = [j for j in joints if j.child in carriers]
    for joint in list(kept):
        twins = [k for k in kept if k is not joint and _alike(joint, k)]
        if not twins or _PROPELLER.search(short(joint.child)):
            continue
        if any(_PROPELLER.search(short(k.child)) for k in twins):
            kept.remove(joint)
            dropped.append(joint)
        elif any(np.allclose(joint.X_BJ.p_m, k.X_BJ.p_m, atol=1e-6) for k in twins):
            raise PlacedError(
                f"{joint.place}: joints {joint.name} and {twins[0].name} are one thruster at one place, or two: "
                f"which is meant cannot be told"
            )
    if dropped:
        found.notes.append(
            f"{len(dropped)} hulls of thrusters are not counted beside their propellers: "
            f"{', '.join(short(j.child) for j in dropped[:12])}"
        )
    return kept


def _alike(one: Joint, other: Joint) -> bool:
    """Whether two joints may be parts of one thruster: of one number, and within a hand of one another."""
    numbered = [_NUMBERED.findall(short(j.child)) for j in (one, other)]
    return numbered[0] == numbered[1] and float(np.linalg.norm(one.X_BJ.p_m - other.X_BJ.p_m)) < _HAND_M


def _freefloating(bodies: RobotDescription, found: ParsedVehicle) -> bool:
    """Freefloating Gazebo states a wrench per thruster, that is, a column of the matrix, and sometimes no place."""
    thrusters = [t for p in bodies.plugins if "freefloating" in words(p) for t in p.all("thruster")]
    if not thrusters:
        return False
    maps = [t.first("map") for t in thrusters]
    columns = [numbers(m.text, m.place, "map of a thruster", 6) for m in maps if m is not None]
    if len(columns) == len(thrusters):
        found.matrix = np.stack(columns, axis=1)
        found.notes.append(
            f"allocation matrix: {len(columns)} columns of Freefloating Gazebo's plugin; it places no thrusters"
        )
    else:
        found.notes.append(
            f"{len(thrusters) - len(columns)} of {len(thrusters)} thrusters of Freefloating Gazebo's plugin turn on "
            f"joints and have no fixed axis: none of them is read"
        )
    return True


def _ardupilot(bodies: RobotDescription, found: ParsedVehicle) -> None:
    """Thrust commands of ArduPilot's plugin: `multiplier * (u + offset)` newton for u from 0 to 1."""
    reversed_names, limited = [], 0
    for plugin in bodies.plugins:
        if "ardupilot" not in words(plugin):
            continue
        for control in plugin.all("control"):
            joint = bodies.joint(control.value("jointName") or "")
            if joint is None or "thrust" not in (control.value("cmd_topic") or ""):
                continue
            multiplier, offset = control.number("multiplier"), control.number("offset")
            thruster = next((t for t in found.thrusters if t.name == short(joint.child)), None)
            if thruster is None or multiplier is None:
                continue
            ends = sorted(multiplier * (u + (offset or 0.0)) for u in (0.0, 1.0))
            if thruster.max_forward_N is None and ends[1] >= 0.0 >= ends[0]:
                thruster.max_forward_N, thruster.max_reverse_N = ends[1], -ends[0]
                limited += 1
            if multiplier < 0.0:
                reversed_names.append(thruster.name)
    if limited:
        found.notes.append(f"thrust limits of {limited} thrusters: the range that ArduPilot's plugin commands")
        found.derived["thruster_limits"] = f"{found.origin}: ArduPilot plugin, multiplier and offset"
    if reversed_names:
        found.notes.append(
            f"ArduPilot's plugin turns the command round for {', '.join(reversed_names)}; "
            f"axes here are for positive thrust, not for positive command"
        )
