"""Control: from an estimate and a goal to thrusts, by methods that differ only in how they spend spare thrusters.

All methods share one tracker (a PID with feed-forward, slowed where its margins ask for it), so that what they do to
the water can be compared at equal wrench. `make_controller` makes one by name.
"""

from __future__ import annotations

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
from wakewise.control.baselines import dynamic_positioning, vehicle_layout
from wakewise.control.loop import ControllerState, TrackingController
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
from wakewise.control.tracker import Tracker, TrackerState, make_tracker
from wakewise.control.view import WakeView
from wakewise.control.wake_aware import wake_aware
from wakewise.errors import InputError
from wakewise.interfaces import WakeModel
from wakewise.targets import Region
from wakewise.vehicles import Vehicle

_MAKERS = {"dp": dynamic_positioning, "wake-aware": wake_aware}

METHODS: tuple[str, ...] = tuple(_MAKERS)
"""Names that `make_controller` knows; the first is the baseline."""


def make_controller(
    method: str, vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings | None = None
) -> TrackingController:
    """Controller of that name for a nominal vehicle, a region to spare and a wake model.

    Raises
    ------
    InputError
        If there is no such method, or the gains have no stable bandwidth on this vehicle.
    """
    if method not in _MAKERS:
        raise InputError(f"method '{method}': unknown, allowed: {', '.join(METHODS)}")
    return _MAKERS[method](vehicle, region, wake, settings or ControlSettings())


__all__ = [
    "METHODS",
    "Allocation",
    "Axis",
    "ControlSettings",
    "ControllerState",
    "Gains",
    "Layout",
    "Margins",
    "Tracker",
    "TrackerState",
    "TrackingController",
    "WakeView",
    "Weights",
    "compile_layout",
    "disturbance_of",
    "dynamic_positioning",
    "gentle_allocation",
    "least_thrusts",
    "loop_margins",
    "make_controller",
    "make_tracker",
    "margins",
    "pseudo_inverse",
    "stable_gain_scale",
    "vehicle_axes",
    "vehicle_layout",
    "wake_aware",
    "wished_gains",
]
