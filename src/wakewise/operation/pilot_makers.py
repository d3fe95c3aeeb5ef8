"""Pilots by name: the sources of a flight's goals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wakewise.core.checks import protocol_part
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Pilot
from wakewise.core.plugins import make
from wakewise.operation.parts import Parts
from wakewise.operation.teleop.assisted import assisted_pilot
from wakewise.operation.teleop.human_pilot import HumanPilot, SimulatedOperatorInput
from wakewise.operation.teleop.input.script import read_input
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.scene.missions import RoutePilot


def route_pilot(parts: Parts) -> RoutePilot:
    """`route`: follows the mission's route by the clock."""
    return RoutePilot(
        route=parts.route, aim=parts.aim, max_tracking_deviation=parts.scenario.mission.max_tracking_deviation
    )


def human_pilot(parts: Parts) -> HumanPilot:
    """`human`: a simulated operator who flies the route by eye; the sticks ask any method for velocities."""
    return HumanPilot(
        reference=route_pilot(parts),
        X_BC=parts.vehicle.X_BC,
        target_W_m=parts.target.centre_W_m,
        dt_s=1.0 / parts.control.rate_hz,
        seed=parts.control.operator_seed or 0,
    )


def assisted_human_pilot(parts: Parts) -> Pilot:
    """`assisted`: the same operator with the assists: camera kept on the target, collision limits, braking."""
    source = SimulatedOperatorInput(
        reference=route_pilot(parts),
        X_BC=parts.vehicle.X_BC,
        target_W_m=parts.target.centre_W_m,
        dt_s=1.0 / parts.control.rate_hz,
        seed=parts.control.operator_seed or 0,
    )
    begin = OperatorSettings(mode="operator")
    return assisted_pilot(parts, source, OperatorState(begin), begin)


def operator_pilot(parts: Parts) -> Pilot:
    """`operator`: assisted flight with the inputs of a file; raises InputError if the scenario names none."""
    if parts.scenario.control_log is None:
        raise InputError("pilot: operator, flies by hand: take `wakewise cockpit`, or name a record in control_log")
    return assisted_pilot(parts, read_input(Path(parts.scenario.control_log)), OperatorState())


def finding_pilot(parts: Parts) -> Pilot:
    """`find`: looks, detects, approaches and scans what the camera finds."""
    from wakewise.operation.finding.find_parts import find_pilot

    return find_pilot(parts)


def surveying_pilot(parts: Parts) -> Pilot:
    """`survey`: transects over a patch of the bed, then orbits round parts of it."""
    from wakewise.operation.finding.find_parts import survey_pilot

    return survey_pilot(parts)


PILOTS: dict[str, Callable[[Parts], Pilot]] = {
    "route": route_pilot,
    "find": finding_pilot,
    "survey": surveying_pilot,
    "human": human_pilot,
    "assisted": assisted_human_pilot,
    "operator": operator_pilot,
}
"""Our own pilots by name."""


def make_pilot(parts: Parts) -> Pilot:
    """The pilot that the scenario names, ours or one from outside; raises InputError if there is none."""
    return make("pilot", parts.scenario.pilot, PILOTS, parts, checked=lambda made: protocol_part(made, "pilot"))
