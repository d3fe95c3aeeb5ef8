"""Pilots by name: where the goals of a flight come from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from wakewise.core.errors import InputError
from wakewise.core.interfaces import Pilot
from wakewise.core.plugins import find
from wakewise.operation.teleop.human_pilot import HumanPilot
from wakewise.operation.teleop.input.script import read_input
from wakewise.scene.missions import RoutePilot

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts


def route_pilot(parts: Parts) -> RoutePilot:
    """`route`: follows the mission's route by the clock."""
    return RoutePilot(
        route=parts.route, aim=parts.aim, max_tracking_deviation=parts.scenario.mission.max_tracking_deviation
    )


def human_pilot(parts: Parts) -> HumanPilot:
    """`human`: a person who flies the route by eye, and whose sticks ask any method for velocities."""
    return HumanPilot(
        wish=route_pilot(parts),
        X_BC=parts.vehicle.X_BC,
        target_W_m=parts.target.centre_W_m,
        dt_s=1.0 / parts.control.rate_hz,
        seed=parts.control.operator_seed or 0,
    )


def operator_pilot(parts: Parts) -> Pilot:
    """`operator`: hands at the desk's sticks, as a file tells of them.

    Raises
    ------
    InputError
        If the scenario names no such file: a person's own hands no scenario can hold.
    """
    from wakewise.operation.teleop.assisted import assisted_pilot
    from wakewise.operation.teleop.operator_state import OperatorState

    if parts.scenario.control_log is None:
        raise InputError("pilot: operator, flies by hand: take `wakewise cockpit`, or name a record in controls")
    return assisted_pilot(parts, read_input(Path(parts.scenario.control_log)), OperatorState())


def assisted_person(parts: Parts) -> Pilot:
    """`assisted`: the person of `human` at the desk's sticks, camera kept on the target, brakes and all."""
    from wakewise.operation.teleop.assisted import assisted_pilot
    from wakewise.operation.teleop.human_pilot import SimulatedOperatorInput
    from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState

    hands = SimulatedOperatorInput(
        wish=route_pilot(parts),
        X_BC=parts.vehicle.X_BC,
        target_W_m=parts.target.centre_W_m,
        dt_s=1.0 / parts.control.rate_hz,
        seed=parts.control.operator_seed or 0,
    )
    begin = OperatorSettings(mode="operator")
    return assisted_pilot(parts, hands, OperatorState(begin), begin)


PILOTS: dict[str, Callable[[Parts], Pilot]] = {
    "route": route_pilot,
    "human": human_pilot,
    "assisted": assisted_person,
    "operator": operator_pilot,
}
"""Our own pilots: what makes each from the parts of a flight."""


def make_pilot(parts: Parts) -> Pilot:
    """The pilot that the scenario names, ours or one from outside.

    Raises
    ------
    InputError
        If there is no such pilot.
    """
    return find("pilot", parts.scenario.pilot, PILOTS).maker(parts)
