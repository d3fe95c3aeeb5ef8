"""Actuators of a Stonefish robot that push: which way, how hard, and how fast (Stonefish's Thruster and its models)."""

from __future__ import annotations

import math

import numpy as np

from wakewise.robot.importers.gazebo_thruster_models import disk_area_m2, short
from wakewise.robot.importers.gazebo_thrusters import note_movable_thrusters
from wakewise.robot.importers.parsed_vehicle import QUESTION, ParsedThruster, ParsedVehicle
from wakewise.robot.importers.robot_description import RobotDescription, moving_parts
from wakewise.robot.importers.urdf import origin
from wakewise.robot.importers.xml import Element, PlacedError, number, numbers

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

    Parameters
    ----------
    robot : Element
    bodies : RobotDescription
        Its links.
    density : float or None
        Density of the scenario's water in kg/m^3.
    found : ParsedVehicle

    Raises
    ------
    InputError
        If a thruster is on no link, or a number is not one.
    """
    rules: list[str] = []
    turning = moving_parts(bodies)
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
        link = actuator.first("link")
        if link is not None and short(link.attributes.get("name", "")) in {short(name) for name in turning}:
            steered.append(found.thrusters[-1].name)
    note_movable_thrusters(steered, found)
    old = sum(
        actuator.first("thrust_model") is None and specs is not None and "max_rpm" in specs.attributes
        for actuator in robot.all("actuator")
        if (specs := actuator.first("specs")) is not None and actuator.attributes.get("type") == "thruster"
    )
    if old:
        found.notes.append(f"not read: thrust_coeff and max_rpm of {old} thrusters in the form before thrust models")
    found.thrust_rule = "; ".join(dict.fromkeys(rules)) or RULE
    if others:
        said = ", ".join(f"{n} of type {kind[:40] or 'unknown'}" for kind, n in others.items())
        doubt = QUESTION if "propeller" in others else ""
        found.notes.append(f"{doubt}not read: actuators that are no thrusters ({said})")
    if found.thrusters:
        found.derived["thruster_layout"] = f"{found.kind} {found.file.name}: actuators of type thruster"


def true(text: str | None) -> bool:
    """Whether an attribute says true, as Stonefish's reader of XML takes it."""
    return (text or "").strip() in {"true", "True", "TRUE", "1"}


def _placed(actuator: Element, bodies: RobotDescription) -> ParsedThruster:
    name = actuator.attributes.get("name", "") or f"line {actuator.place.line}"
    link_element = actuator.first("link")
    link = bodies.link(link_element.attributes.get("name", "")) if link_element is not None else None
    if link is None:
        raise PlacedError(f"{actuator.place}: thruster {name} is on no link of the robot")
    X_BT = link.X_BL @ origin(actuator.first("origin"))
    return ParsedThruster(short(name), X_BT.p_m, X_BT.R[:, 0], actuator.place, X_BT.R)


def _simple(actuator: Element, bodies: RobotDescription) -> ParsedThruster:
    """An ideal force along +x of its frame; a propeller's hand turns what is drawn, not what pushes."""
    thruster, specs = _placed(actuator, bodies), actuator.first("specs")
    if specs is None:
        return thruster
    if true(specs.attributes.get("inverted")):
        thruster.axis = -thruster.axis
    for prefix in ("", "thrust_"):
        ends = [specs.attributes.get(f"{side}_{prefix}limit") for side in ("lower", "upper")]
        if None in ends:
            continue
        low, high = (number(text or "", specs.place, "limit of the thrust") for text in ends)
        if low <= 0.0 <= high and low < high:
            thruster.max_forward_N, thruster.max_reverse_N = high, -low
    return thruster


def _thruster(
    actuator: Element, bodies: RobotDescription, density: float | None, found: ParsedVehicle
) -> ParsedThruster:
    thruster = _placed(actuator, bodies)
    specs, propeller, model = (actuator.first(tag) for tag in ("specs", "propeller", "thrust_model"))
    kind = "" if model is None else model.attributes.get("type", "")
    inverted = False
    if specs is not None:
        # Scenarios of before the thrust models said inverted; with a model Stonefish reads inverted_setpoint only.
        inverted = true(specs.attributes.get("inverted_setpoint", specs.attributes.get("inverted") if not kind else ""))
        if kind and true(specs.attributes.get("inverted")) and "inverted_setpoint" not in specs.attributes:
            found.notes.append(
                f"{QUESTION}thruster {thruster.name}: not read: inverted, which Stonefish ignores (it reads "
                f"inverted_setpoint); is the thrust meant to be turned? ({specs.place.file.name}:{specs.place.line})"
            )
    left = propeller is not None and not true(propeller.attributes.get("right", "true"))
    if left != inverted:
        thruster.axis = -thruster.axis
    diameter = None
    if propeller is not None and propeller.attributes.get("diameter") is not None:
        diameter = number(propeller.attributes["diameter"], propeller.place, "diameter")
        thruster.disk_area_m2 = disk_area_m2(diameter, propeller.place)
    steady = _lag(actuator, thruster)
    text = None if specs is None else specs.attributes.get("max_setpoint")
    top = None if text is None or specs is None else abs(number(text, specs.place, "max_setpoint"))
    along = None if model is None else _thrusts(model, top or 1.0, diameter, density)
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
    """Thrusts in newton, both positive, of the rotor turning at +top and at -top; None where the file tells neither."""

    def value(tag: str, key: str) -> float | None:
        element = model.first(tag)
        if element is None or key not in element.attributes:
            return None
        return number(element.attributes[key], element.place, f"{tag} {key}")

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
