"""Forms of thruster plugins whose rule is known: gz-sim, UUV Simulator (Plankton, DAVE), HippoCampus, orca2."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedThruster, ParsedVehicle
from wakewise.robot.importers.robot_description import Joint, RobotDescription
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
    return (plugin.attributes.get("filename", "") + " " + plugin.attributes.get("name", "")).lower()


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
        ahead, astern = number_in(element, "pos_force"), number_in(element, "neg_force")
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
    found.derived["thruster_limits"] = f"{found.kind} {found.file.name}: pos_force and neg_force of the plugin"
    return thrusters


def _checked_axis(axis: Array, where: str) -> Array:
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise PlacedError(f"{where}: axis {axis.tolist()} has length {length:g}, it must not be zero")
    return axis / length


def _gz(plugin: Element, bodies: RobotDescription) -> ParsedThruster:
    name = plugin.value("joint_name") or ""
    joint = bodies.joint(name)
    if joint is None or joint.axis is None:
        what = "is not in the file" if joint is None else "has no axis"
        raise PlacedError(f"{plugin.place}: thruster plugin: joint {name} {what}")
    thruster = on_joint(joint, bodies)
    diameter = number_in(plugin, "propeller_diameter")
    if diameter is not None:
        thruster.disk_area_m2 = disk_area_m2(diameter, plugin.place)
    if (plugin.value("use_angvel_cmd") or "false").lower() not in {"true", "1"}:
        high, low = number_in(plugin, "max_thrust_cmd"), number_in(plugin, "min_thrust_cmd")
        thruster.max_forward_N = high if high is not None and high >= 0.0 else None
        thruster.max_reverse_N = -low if low is not None and low <= 0.0 else None
    return thruster


def disk_area_m2(diameter_m: float, place: SourceLocation) -> float:
    """Area in m^2 of a propeller's disk.

    Raises
    ------
    InputError
        If the diameter is none that an underwater vehicle's propeller has.
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
    return ParsedThruster(name, where_on(joint, bodies), _checked_axis(axis, where), joint.place, joint.X_BJ.R)


def short(name: str) -> str:
    """A link's name without namespaces."""
    return name.replace("::", "/").rpartition("/")[2] or name


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
        lag = number_in(dynamics, "timeConstant")
        thruster.time_constant_s = 0.0 if (dynamics.value("type") or "").lower() == "zeroorder" else lag
    _uuv_limits(plugin, thruster)
    return thruster


def _uuv_limits(plugin: Element, thruster: ParsedThruster) -> None:
    """Limits: stated thrusts first, then the ends of a thrust table, then the command's ends through the curve."""
    high, low = number_in(plugin, "thrustMax"), number_in(plugin, "thrustMin")
    conversion = plugin.first("conversion")
    clamp_high, clamp_low = number_in(plugin, "clampMax"), number_in(plugin, "clampMin")
    gain = number_in(plugin, "gain")
    gain = 1.0 if gain is None else gain
    if conversion is not None:
        outputs = conversion.first("outputValues")
        constant = number_in(conversion, "rotorConstant")
        if outputs is not None and outputs.text.strip():
            table = numbers(outputs.text, outputs.place, "outputValues")
            high = float(table.max()) if high is None else high
            low = float(table.min()) if low is None else low
        elif constant is not None:
            ends = [constant * g * abs(g) for g in (gain * c for c in (clamp_low, clamp_high) if c is not None)]
            if len(ends) == 2:
                high = max(ends) if high is None else high
                low = min(ends) if low is None else low
    efficiency = number_in(plugin, "thrust_efficiency")
    scale = efficiency if efficiency is not None and 0.0 < efficiency <= 1.0 else 1.0
    thruster.max_forward_N = scale * high if high is not None and high >= 0.0 else None
    thruster.max_reverse_N = -scale * low if low is not None and low <= 0.0 else None


def number_in(element: Element, tag: str) -> float | None:
    """Number in the first child with this tag; None if there is none."""
    text = element.value(tag)
    child = element.first(tag)
    return None if text is None or child is None else number(text, child.place, tag)
