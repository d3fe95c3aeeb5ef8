"""Thrusters as Gazebo's plugins describe them: gz-sim, UUV Simulator (Plankton, DAVE), ArduPilot's channels."""

from __future__ import annotations

import math
import re

import numpy as np

from wakewise.arrays import Array
from wakewise.importers.bodies import THRUSTER_NAME, Bodies, Joint
from wakewise.importers.found import QUESTION, Found, FoundThruster
from wakewise.importers.xml import Element, PlacedError, number, numbers

GZ_RULE = "positive thrust pushes along the joint axis, whatever the sign of thrust_coefficient (gz-sim's Thruster)"
UUV_RULE = "positive thrust pushes along the joint axis, +x of the thruster where none is given (UUV Simulator)"
NAME_RULE = "inferred from names: positive thrust pushes along the axis of each joint that is called a thruster"

_PROPELLER = re.compile(r"prop|rotor|blade", re.IGNORECASE)
_NUMBERED = re.compile(r"\d+")
_HAND_M = 0.15


def words(plugin: Element) -> str:
    """What a plugin calls itself, in lower case."""
    return (plugin.attributes.get("filename", "") + " " + plugin.attributes.get("name", "")).lower()


def read_thrusters(bodies: Bodies, found: Found) -> None:
    """Fill in the thrusters from plugins; where there are none, from joints that are called thrusters.

    Raises
    ------
    InputError
        If a plugin names a joint or link that is not there, or an axis has no length.
    """
    rules: list[str] = []
    order: list[float] = []
    for plugin in bodies.plugins:
        if "thruster" not in words(plugin) or "manager" in words(plugin):
            continue
        if plugin.first("joint_name") is not None:
            found.thrusters.append(_gz(plugin, bodies))
            rules.append(GZ_RULE)
            order.append(math.inf)
        elif plugin.first("linkName") is not None or plugin.first("jointName") is not None:
            found.thrusters.append(_uuv(plugin, bodies))
            rules.append(UUV_RULE)
            identity = plugin.value("thrusterID")
            order.append(number(identity, plugin.place, "thrusterID") if identity else math.inf)
    _drop_repeats(found, order)
    if found.thrusters:
        found.thrusters = [t for _, t in sorted(zip(order, found.thrusters, strict=True), key=lambda pair: pair[0])]
        found.thrust_rule = "; ".join(dict.fromkeys(rules))
        found.derived["thruster_layout"] = f"{found.kind} {found.file.name}: thruster plugins and their joints"
        _question_undriven(bodies, found)
    elif not _freefloating(bodies, found):
        _by_name(bodies, found)
    _ardupilot(bodies, found)


def _question_undriven(bodies: Bodies, found: Found) -> None:
    """Say which turning joints are called thrusters and are driven by no plugin."""
    driven = [t.p_m for t in found.thrusters]
    idle = [
        j.name
        for j in bodies.joints.values()
        if j.kind in {"continuous", "revolute"}
        and THRUSTER_NAME.search(short(j.child) + " " + short(j.name))
        and not any(float(np.linalg.norm(j.X_BJ.p_m - p)) < _HAND_M for p in driven)
    ]
    if idle:
        found.notes.append(
            f"{QUESTION}{len(found.thrusters)} thrusters have a plugin, but {len(idle)} further joints are called "
            f"thrusters: {', '.join(short(name) for name in idle[:12])}"
        )


def _drop_repeats(found: Found, order: list[float]) -> None:
    """Count a thruster once that two plugins drive, as files for two simulators do."""
    seen: list[FoundThruster] = []
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


def _checked_axis(axis: Array, where: str) -> Array:
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise PlacedError(f"{where}: axis {axis.tolist()} has length {length:g}, it must not be zero")
    return axis / length


def _gz(plugin: Element, bodies: Bodies) -> FoundThruster:
    name = plugin.value("joint_name") or ""
    joint = bodies.joint(name)
    if joint is None or joint.axis is None:
        what = "is not in the file" if joint is None else "has no axis"
        raise PlacedError(f"{plugin.place}: thruster plugin: joint {name} {what}")
    thruster = _on_joint(joint)
    diameter = _number(plugin, "propeller_diameter")
    if diameter is not None:
        thruster.disk_area_m2 = 0.25 * math.pi * diameter**2
    if (plugin.value("use_angvel_cmd") or "false").lower() not in {"true", "1"}:
        high, low = _number(plugin, "max_thrust_cmd"), _number(plugin, "min_thrust_cmd")
        thruster.max_forward_N = high if high is not None and high >= 0.0 else None
        thruster.max_reverse_N = -low if low is not None and low <= 0.0 else None
    return thruster


def _on_joint(joint: Joint) -> FoundThruster:
    axis = joint.axis if joint.axis is not None else joint.X_BJ.R[:, 0]
    where = f"{joint.place}: joint {joint.name}"
    name = short(joint.child)
    return FoundThruster(name, joint.X_BJ.p_m, _checked_axis(axis, where), joint.place, joint.X_BJ.R)


def short(name: str) -> str:
    """A link's name without namespaces."""
    return name.replace("::", "/").rpartition("/")[2] or name


def _uuv(plugin: Element, bodies: Bodies) -> FoundThruster:
    link_name, joint_name = plugin.value("linkName"), plugin.value("jointName")
    joint = bodies.joint(joint_name) if joint_name else None
    link = bodies.link(link_name) if link_name else None
    if joint is not None:
        thruster = _on_joint(joint)
        if link is not None:
            thruster.name = short(link.name)
    elif link is not None:
        thruster = FoundThruster(short(link.name), link.X_BL.p_m, link.X_BL.R[:, 0], plugin.place, link.X_BL.R)
    else:
        raise PlacedError(f"{plugin.place}: thruster plugin: neither link {link_name} nor its joint is in the file")
    dynamics = plugin.first("dynamics")
    if dynamics is not None:
        lag = _number(dynamics, "timeConstant")
        thruster.time_constant_s = 0.0 if (dynamics.value("type") or "").lower() == "zeroorder" else lag
    _uuv_limits(plugin, thruster)
    return thruster


def _uuv_limits(plugin: Element, thruster: FoundThruster) -> None:
    """Limits: stated thrusts first, then the ends of a thrust table, then the command's ends through the curve."""
    high, low = _number(plugin, "thrustMax"), _number(plugin, "thrustMin")
    conversion = plugin.first("conversion")
    clamp_high, clamp_low = _number(plugin, "clampMax"), _number(plugin, "clampMin")
    gain = _number(plugin, "gain")
    gain = 1.0 if gain is None else gain
    if conversion is not None:
        outputs = conversion.first("outputValues")
        constant = _number(conversion, "rotorConstant")
        if outputs is not None and outputs.text.strip():
            table = numbers(outputs.text, outputs.place, "outputValues")
            high = float(table.max()) if high is None else high
            low = float(table.min()) if low is None else low
        elif constant is not None:
            ends = [constant * g * abs(g) for g in (gain * c for c in (clamp_low, clamp_high) if c is not None)]
            if len(ends) == 2:
                high = max(ends) if high is None else high
                low = min(ends) if low is None else low
    efficiency = _number(plugin, "thrust_efficiency")
    scale = efficiency if efficiency is not None and 0.0 < efficiency <= 1.0 else 1.0
    thruster.max_forward_N = scale * high if high is not None and high >= 0.0 else None
    thruster.max_reverse_N = -scale * low if low is not None and low <= 0.0 else None


def _number(element: Element, tag: str) -> float | None:
    text = element.value(tag)
    child = element.first(tag)
    return None if text is None or child is None else number(text, child.place, tag)


def _by_name(bodies: Bodies, found: Found) -> None:
    joints = [j for j in bodies.joints.values() if THRUSTER_NAME.search(short(j.child) + " " + short(j.name))]
    turning = [j for j in joints if j.axis is not None and j.kind in {"continuous", "revolute"}]
    fixed = [j for j in joints if j.kind == "fixed"]
    turning, fixed = _one_each(turning, bodies, found), _one_each(fixed, bodies, found) if not turning else []
    for joint in turning or fixed:
        found.thrusters.append(_on_joint(joint))
    if turning:
        found.thrust_rule = NAME_RULE
    elif fixed:
        found.thrust_rule = (
            "inferred from names: positive thrust pushes along +x of each fixed link that is called a thruster"
        )
    if found.thrusters:
        found.notes.append("no thruster plugin in the file: links were taken for thrusters by their names")
        found.thrusters.sort(key=lambda t: [int(n) for n in _NUMBERED.findall(t.name)])
        found.derived["thruster_layout"] = f"{found.kind} {found.file.name}: joints with thruster names"


def _one_each(joints: list[Joint], bodies: Bodies, found: Found) -> list[Joint]:
    """One joint per thruster: a propeller counts, the hull that carries it does not.

    Raises
    ------
    InputError
        If two joints of one number lie within one another and neither is called a propeller.
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


def _freefloating(bodies: Bodies, found: Found) -> bool:
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


def _ardupilot(bodies: Bodies, found: Found) -> None:
    """Thrust commands of ArduPilot's plugin: `multiplier * (u + offset)` newton for u from 0 to 1."""
    reversed_names, limited = [], 0
    for plugin in bodies.plugins:
        if "ardupilot" not in words(plugin):
            continue
        for control in plugin.all("control"):
            joint = bodies.joint(control.value("jointName") or "")
            if joint is None or "thrust" not in (control.value("cmd_topic") or ""):
                continue
            multiplier, offset = _number(control, "multiplier"), _number(control, "offset")
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
        found.derived["thruster_limits"] = f"{found.kind} {found.file.name}: ArduPilot plugin, multiplier and offset"
    if reversed_names:
        found.notes.append(
            f"ArduPilot's plugin turns the command round for {', '.join(reversed_names)}; "
            f"axes here are for positive thrust, not for positive command"
        )
