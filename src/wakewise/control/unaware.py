"""The planners that do not ask what their wash does: `unaware`, and `smooth`, which pays for change of thrust."""

from __future__ import annotations

from typing import Any

from wakewise.control.receding import planning_controller
from wakewise.control.settings import ControlSettings
from wakewise.interfaces import Controller, WakeModel
from wakewise.planning import Surroundings
from wakewise.targets import Region
from wakewise.vehicles import Vehicle
from wakewise.wake import free_jet

W_CHANGE_PER_N2 = 0.05
"""Price of change of thrust of `smooth`, per N^2 and stage. The planner's effort costs w_effort h = 1e-4 per N^2 and
stage; filtering over the horizon of 2 s asks for w_change / (w_effort h) = (2 s / 0.1 s)^2 = 400, rounded up to 500."""


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
    change = max(settings.plan.w_change, W_CHANGE_PER_N2)
    plan = settings.plan.model_copy(update={"w_change": change})
    careless = settings.model_copy(update={"w_disturbance": 0.0, "plan": plan})
    return planning_controller(vehicle, region, free_jet(wake), careless, name="smooth", surroundings=around)
