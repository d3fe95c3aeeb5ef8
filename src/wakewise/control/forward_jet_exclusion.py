"""`no-forward-jets`: dynamic positioning whose bow thrusters never blow ahead, the simplest rival of all.

Astern push from a vectored bow pair crosses two jets ahead of the bow, where the camera looks. Whoever has seen that
once forbids it: level thrusters that do not sit behind the middle never blow to where the camera looks, and the after
ones do the rest. Ahead is where the camera looks, level: forward on most vehicles, abeam on one that films sideways.
Thrusters beside the middle count as bow thrusters, since what they blow ahead passes the hull and goes the same way.

The rule fits a layout if every wrench that the thrusters can make can still be made, however small. That is so if each
axis can be pushed along both ways: the wrenches that one-sided limits allow form a cone, and a cone that holds plus and
minus each axis holds everything. One linear programme for each axis and way says it.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from wakewise.allocation import Layout, compile_layout
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle

_LEVEL = 0.5
"""A thruster counts as level if its axis is less than 30 deg off level, and as blowing ahead if its jet has more than
this share of its speed ahead; a camera that looks more than 60 deg up or down has no ahead."""
_MIDDLE_M = 1e-6
_AXES = ("ahead or astern", "sideways", "up or down", "in roll", "in pitch", "in yaw")


def ahead_of(vehicle: Vehicle) -> Array:
    """Level unit direction in which the camera looks, in B, shape (3,).

    Raises
    ------
    InputError
        If it looks up or down by more than 60 deg.
    """
    axis = np.array(vehicle.X_BC.R[:, 2])
    axis[2] = 0.0
    length = float(np.linalg.norm(axis))
    if length < _LEVEL:
        raise InputError(
            f"no-forward-jets: the camera of {vehicle.name} looks up or down, so there is no bow to keep still"
        )
    return axis / length


def bow_layout(vehicle: Vehicle) -> Layout:
    """The vehicle's thrusters with limits that keep the level ones not behind the middle from blowing ahead.

    Raises
    ------
    InputError
        If no thruster could, so that the rule says nothing, or a wrench is not to be had without; which, is said.
    """
    ahead = ahead_of(vehicle)
    places, axes = vehicle.thruster_positions_B_m, vehicle.thruster_axes_B
    along = axes @ ahead
    bow = (places @ ahead > -_MIDDLE_M) & (np.abs(axes[:, 2]) < _LEVEL) & (np.abs(along) > _LEVEL)
    if not bow.any():
        raise InputError(
            f"no-forward-jets: {vehicle.name} has no level thruster before its middle that could blow ahead"
        )
    # A thrust of either sign sends its jet the other way along the axis.
    upper = np.where(bow & (along < 0.0), 0.0, vehicle.thrust_upper_N)
    lower = np.where(bow & (along > 0.0), 0.0, vehicle.thrust_lower_N)
    lost = missing_axis(vehicle.allocation_matrix, lower, upper)
    if lost is not None:
        names = ", ".join(vehicle.thrusters[i].name for i in np.flatnonzero(bow))
        raise InputError(f"no-forward-jets: {vehicle.name} could not push {_AXES[lost]} if {names} never blew ahead")
    return compile_layout(vehicle.allocation_matrix, lower, upper)


def missing_axis(B: Array, lower_N: Array, upper_N: Array) -> int | None:
    """Number of an axis along which limits, shape (n,), one-sided ones too, leave no wrench one way; None if all are.

    `B` has shape (6, n). Of an axis that the thrusters cannot push along alone, whatever their signs, counts what
    comes nearest to it.
    """
    n = B.shape[1]
    nearest = B @ np.linalg.pinv(B)
    bounds = [*zip(lower_N, upper_N, strict=True), (0.0, 1.0)]
    for axis in range(6):
        for way in (nearest[:, axis], -nearest[:, axis]):
            if np.linalg.norm(way) < 1e-9:
                continue
            # Thrusts and how much of that wrench they make, which is to be as much as can be.
            made = np.column_stack([B, -way])
            found = linprog(np.append(np.zeros(n), -1.0), A_eq=made, b_eq=np.zeros(6), bounds=bounds)
            if found.status != 0 or found.x is None or found.x[-1] <= 1e-6:
                return axis
    return None
