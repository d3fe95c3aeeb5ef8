"""Control: from an estimate and a goal to thrusts, by methods that differ only in how they spend spare thrusters.

All methods share one tracker (a PID with feed-forward, slowed where its margins ask for it), so that what they do to
the water can be compared at equal wrench. `make_controller` makes one by name.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wakewise.control.allocation import (
    Allocation,
    Layout,
    Weights,
    compile_layout,
    disturbance_of,
    gentle_allocation,
    least_thrusts,
    pseudo_inverse,
)
from wakewise.control.baselines import (
    dynamic_positioning,
    instant,
    linear,
    planned,
    planned_pseudo_inverse,
    smooth,
    unaware,
)
from wakewise.control.guard import check_start
from wakewise.control.levers import LeverSettings, watched
from wakewise.control.loop import ControllerState, TrackingController
from wakewise.control.paper_planner import PaperPlanner
from wakewise.control.plan_problem import Horizon, PlanProblem, PlanSettings, state_of
from wakewise.control.planner import Planner, compile_plan
from wakewise.control.receding import PlanningController, planning_controller
from wakewise.control.settings import ControlSettings
from wakewise.control.stability import (
    Axis,
    Gains,
    Margins,
    loop_margins,
    margins,
    stable_gain_scale,
    vehicle_axes,
    wished_gains,
)
from wakewise.control.surroundings import Surroundings, covering_spheres
from wakewise.control.tracker import Tracker, TrackerState, make_tracker
from wakewise.control.view import WakeView
from wakewise.control.wake_aware import vehicle_layout, wake_aware
from wakewise.errors import InputError
from wakewise.interfaces import Controller, WakeModel
from wakewise.targets import Region
from wakewise.vehicles import Vehicle


def _planner(
    vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings, around: Surroundings | None
) -> PlanningController:
    return planning_controller(vehicle, region, wake, settings, settings.plan, surroundings=around)


def _paper_planner(
    vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings, around: Surroundings | None
) -> PlanningController:
    return planning_controller(
        vehicle, region, wake, settings, settings.plan, name="planner-paper", solver=PaperPlanner, surroundings=around
    )


Maker = Callable[[Vehicle, Region, WakeModel, ControlSettings, Surroundings | None], Controller[Any]]

_MAKERS: dict[str, Maker] = {
    "dp": dynamic_positioning,
    "pseudo-inverse": planned_pseudo_inverse,
    "unaware": unaware,
    "smooth": smooth,
    "linear": linear,
    "instant": instant,
    "wake-aware": planned,
    "planner": _planner,
    "planner-paper": _paper_planner,
}

METHODS: tuple[str, ...] = tuple(_MAKERS)
"""Names that `make_controller` knows; the first is the baseline."""


def make_controller(
    method: str,
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings | None = None,
    surroundings: Surroundings | None = None,
) -> Controller[Any]:
    """Controller of that name for a nominal vehicle, a region to spare and a wake model.

    The methods that plan keep clear of `surroundings`; without them, of the sphere round the region's surface alone.

    Raises
    ------
    InputError
        If there is no such method, or the gains have no stable bandwidth on this vehicle.
    """
    if method not in _MAKERS:
        raise InputError(f"method '{method}': unknown, allowed: {', '.join(METHODS)}")
    return _MAKERS[method](vehicle, region, wake, settings or ControlSettings(), surroundings)


__all__ = [
    "METHODS",
    "Allocation",
    "Axis",
    "ControlSettings",
    "ControllerState",
    "Gains",
    "Horizon",
    "Layout",
    "LeverSettings",
    "Margins",
    "PaperPlanner",
    "PlanProblem",
    "PlanSettings",
    "Planner",
    "PlanningController",
    "Surroundings",
    "Tracker",
    "TrackerState",
    "TrackingController",
    "WakeView",
    "Weights",
    "check_start",
    "compile_layout",
    "compile_plan",
    "covering_spheres",
    "disturbance_of",
    "dynamic_positioning",
    "gentle_allocation",
    "instant",
    "least_thrusts",
    "linear",
    "loop_margins",
    "make_controller",
    "make_tracker",
    "margins",
    "planned",
    "planned_pseudo_inverse",
    "planning_controller",
    "pseudo_inverse",
    "smooth",
    "stable_gain_scale",
    "state_of",
    "unaware",
    "vehicle_axes",
    "vehicle_layout",
    "wake_aware",
    "watched",
    "wished_gains",
]
