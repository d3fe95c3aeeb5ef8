"""Wash of a vehicle's pulses on points, and that of gentler thrusts for the same wrench.

Used for each row of a log (`logs/replay_allocation.py`) and ten times per second beside a vehicle (`wash_meter`).
Pulses become thrusts by the thrusters' curve at the battery's voltage, reversed where a motor is; thrusts become a
wrench by the vehicle's geometry. The flown thrusts are compared with the minimum-norm ones (pseudo-inverse within
limits) and the gentlest ones (`wakewise.allocation`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wakewise.allocation import (
    Layout,
    Weights,
    compile_layout,
    disturbance_of,
    min_norm_allocation,
    min_wash_allocation,
)
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import COMPILED
from wakewise.wake.influence import InfluenceModel
from wakewise_ardusub.motors import limits_of_motors, thrusts_of_pulses
from wakewise_ardusub.vehicle_summary import VehicleSummary

EFFORT = 1e-6
"""Weight of squared thrust beside D in (m/s)^2 per N^2, as `wakewise allocate` has it."""
VOLTAGE_STEP_V = 0.1
BOXES = 2000
STILL_M_S = 1e-4
"""Root mean square speed at the points below which there is nothing to spare."""
RADIUS_M = 0.25
AHEAD_ALLOWED_M = (0.05, 20.0)
Shares = Literal["flown", "least", "gentle"]
SHARES: tuple[Shares, ...] = ("flown", "least", "gentle")


@dataclass(frozen=True, kw_only=True, eq=False)
class WashSavings:
    """One instant: thrusts, shape (m,) in N, and D in (m/s)^2 as flown, with least thrusts and with gentle ones."""

    thrusts_N: Mapping[Shares, Array]
    disturbance: Mapping[Shares, float]


class WashSavingsCalculator:
    """Judges the pulses of one craft, each instant by itself; keeps what each voltage's limits leave.

    Parameters
    ----------
    craft : VehicleSummary
    directions : ndarray, shape (m,)
        MOT_n_DIRECTION, 1 or -1.

    Raises
    ------
    InputError
        If the search for the craft's gentlest thrusts needs solvers that this computer lacks.
    """

    def __init__(self, craft: VehicleSummary, directions: Array) -> None:
        self.craft, self.directions = craft, directions
        self._layouts: dict[float, Layout] = {}
        if not COMPILED and not self.is_small(craft):
            raise InputError(
                f"vehicle {craft.name}: its spare thrusters cannot be looked at one by one, which needs Numba and so a "
                "64-bit computer; run the meter there"
            )

    @staticmethod
    def is_small(craft: VehicleSummary) -> bool:
        """Whether each direction of the null space has thrusters of its own: then NumPy alone is fast enough."""
        layout = compile_layout(craft.allocation_matrix, craft.thrust_lower_N, craft.thrust_upper_N)
        return len(layout.lines) == layout.k

    def supply_V(self, measured_V: float | None) -> float:
        """Supply voltage to judge by: rounded, within the curve's table; the vehicle file's where none is known."""
        curve = self.craft.curve
        if curve is None:
            return 0.0
        volts = self.craft.supply_V if measured_V is None or not np.isfinite(measured_V) else measured_V
        return float(np.clip(np.round(volts / VOLTAGE_STEP_V) * VOLTAGE_STEP_V, curve.supply_V[0], curve.supply_V[-1]))

    def flown_N(self, pulses_us: Array, supply_V: float) -> Array:
        """Thrusts of pulses, both shape (m,); a thruster without a curve goes in proportion to its limits."""
        return thrusts_of_pulses(self.craft, pulses_us, self.directions, supply_V)

    def judge(self, pulses_us: Array, supply_V: float, gram: Array) -> WashSavings:
        """Thrusts and D of pulses, shape (m,), at a voltage of `supply_V`, by the Gram matrix, shape (2 m, 2 m)."""
        flown = self.flown_N(pulses_us, supply_V)
        if not np.any(flown):
            return WashSavings(thrusts_N=dict.fromkeys(SHARES, flown), disturbance=dict.fromkeys(SHARES, 0.0))
        layout = self._layout(supply_V)
        wrench = self.craft.allocation_matrix @ flown
        least = min_norm_allocation(layout, wrench, gram)
        gentle = min_wash_allocation(layout, wrench, gram, Weights(disturbance=1.0, effort=EFFORT), budget=BOXES)
        return WashSavings(
            thrusts_N={"flown": flown, "least": least.thrusts_N, "gentle": gentle.thrusts_N},
            disturbance={
                "flown": disturbance_of(gram, flown),
                "least": least.disturbance or 0.0,
                "gentle": gentle.disturbance or 0.0,
            },
        )

    def _layout(self, supply_V: float) -> Layout:
        """Geometry and limits at a voltage; a motor that runs the other way has its limits the other way round."""
        if supply_V not in self._layouts:
            limits_N = limits_of_motors(self.craft, self.directions, supply_V)
            self._layouts[supply_V] = compile_layout(self.craft.allocation_matrix, *limits_N)
        return self._layouts[supply_V]


def influence_model(craft: VehicleSummary, points_m: Array, weights: Array) -> InfluenceModel:
    """A craft's jets before points, shape (n, 3), with weights, shape (n,)."""
    return InfluenceModel(
        wake=craft.wake,
        points_W_m=points_m,
        weights=weights,
        positions_B_m=craft.positions_B_m,
        axes_B=craft.axes_B,
        areas_m2=craft.areas_m2,
    )


def bow_ball(bow_m: float, height_m: float, ahead_m: float) -> Array:
    """Fifteen points, shape (15, 3), of a ball half a metre across ahead of the bow.

    The bow is `bow_m` ahead of the body origin; `ahead_m` is from there to the ball's middle, which lies `height_m`
    below the origin, where the camera is. A nearer ball is smaller. The points are its middle, and on its surface those
    of an octahedron and of a cube.

    Raises
    ------
    InputError
        If the ball would be in the hull or out of sight.
    """
    if not AHEAD_ALLOWED_M[0] <= ahead_m <= AHEAD_ALLOWED_M[1]:
        raise InputError(
            f"--ahead {ahead_m:g}: {AHEAD_ALLOWED_M[0]:g} to {AHEAD_ALLOWED_M[1]:g} m ahead of the bow are allowed"
        )
    middle = np.array([bow_m + ahead_m, 0.0, height_m])
    radius_m = min(RADIUS_M, 0.5 * ahead_m)
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]) / np.sqrt(3.0)
    return np.asarray(middle + radius_m * np.vstack([np.zeros((1, 3)), np.eye(3), -np.eye(3), cube]))


def saved_pct(before: float, after: float, weight: float) -> float | None:
    """How much less D is after than before, in per cent; None where the points lie as good as still.

    D as a mean over the instants that are meant, and the weight of the points: D over it is a mean square speed.
    """
    return None if before <= weight * STILL_M_S**2 else 100.0 * (1.0 - after / before)
