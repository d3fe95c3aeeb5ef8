"""The planners that do not ask what their wash does: `unaware`, and `smooth`, which pays for change of thrust."""

from __future__ import annotations

from typing import Any

from wakewise.control.receding import planning_controller
from wakewise.control.settings import ControlSettings
from wakewise.core.interfaces import Controller, WakeModel
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import free_jet

FILTER_S = 0.77
"""Time over which `smooth` filters its thrusts: of those flown the longest whose position error is within a tenth of
that of `unaware` (docs/research-log/0036)."""


def price_of_change(settings: ControlSettings) -> float:
    """Price of squared change of thrust from stage to stage, per N^2.

    Thrusts that cost w_effort h T^2 in a stage of h seconds and w_change (dT)^2 from stage to stage relax over the
    time h sqrt(w_change / (w_effort h)), so the price follows effort and stage where these are set otherwise.
    """
    stage_s = settings.plan.stage_s
    return (FILTER_S / stage_s) ** 2 * settings.w_effort * stage_s


def unaware(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`unaware`: the planner without a disturbance term."""
    careless = settings.model_copy(update={"w_disturbance": 0.0})
    return planning_controller(vehicle, region, free_jet(wake), careless, name="unaware", surroundings=around)


def smooth(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,
) -> Controller[Any]:
    """`smooth`: the planner without a disturbance term and with a price on change of thrust."""
    change = max(settings.plan.w_change, price_of_change(settings))
    plan = settings.plan.model_copy(update={"w_change": change})
    careless = settings.model_copy(update={"w_disturbance": 0.0, "plan": plan})
    return planning_controller(vehicle, region, free_jet(wake), careless, name="smooth", surroundings=around)
