"""`bow-rule`: dynamic positioning whose bow thrusters never blow forward, the simplest rival of all.

Astern push from a vectored bow pair crosses two jets ahead of the bow, where the camera looks. Whoever has seen that
once forbids it: the level thrusters before the middle push ahead only, and the after pair does the rest.
"""

from __future__ import annotations

import numpy as np

from wakewise.allocation import Layout, compile_layout
from wakewise.control.dynamic_positioning import with_least_thrusts
from wakewise.control.loop import TrackingController
from wakewise.control.settings import ControlSettings
from wakewise.errors import InputError
from wakewise.interfaces import WakeModel
from wakewise.planning import Surroundings
from wakewise.targets import Region
from wakewise.vehicles import Vehicle

_LEVEL = 0.5
"""A thruster counts as level if its axis is less than 30 deg off level, and as blowing forward if its jet has more than
this share of its speed ahead."""


def bow_layout(vehicle: Vehicle) -> Layout:
    """The vehicle's thrusters with limits that keep the level ones before the middle from blowing forward.

    Raises
    ------
    InputError
        If no thruster could, so that the rule says nothing, or every wrench is not to be had without.
    """
    places, axes = vehicle.thruster_positions_B_m, vehicle.thruster_axes_B
    bow = (places[:, 0] > 1e-6) & (np.abs(axes[:, 2]) < _LEVEL) & (np.abs(axes[:, 0]) > _LEVEL)
    if not bow.any():
        raise InputError(f"bow-rule: {vehicle.name} has no level thruster before its middle that could blow forward")
    # A thrust of either sign sends its jet the other way along the axis.
    upper = np.where(bow & (axes[:, 0] < 0.0), 0.0, vehicle.thrust_upper_N)
    lower = np.where(bow & (axes[:, 0] > 0.0), 0.0, vehicle.thrust_lower_N)
    return compile_layout(vehicle.allocation_matrix, lower, upper)


def bow_rule(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    around: Surroundings | None = None,  # noqa: ARG001
) -> TrackingController:
    """`bow-rule`: the tracker of `dp` with the least thrusts that keep the rule."""
    return with_least_thrusts("bow-rule", bow_layout(vehicle), vehicle, region, wake, settings)
