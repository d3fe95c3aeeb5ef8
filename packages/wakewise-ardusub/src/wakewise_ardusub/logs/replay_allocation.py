"""Replay of a log with other allocations of the flown wrench: minimum-norm thrusts and gentle thrusts.

`wakewise_ardusub.wash_savings` evaluates the pulses; here each distinct row of a log is evaluated once. D is of points
that are fixed to the vehicle, because a log does not hold the target's position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import polars as pl

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise_ardusub.motors import directions_of_motors, motor_channels
from wakewise_ardusub.vehicle_summary import VehicleSummary
from wakewise_ardusub.wash_savings import (
    SHARES,
    STILL_M_S,
    Shares,
    WashSavingsCalculator,
    bow_ball,
    influence_model,
    saved_pct,
)


@dataclass(frozen=True, kw_only=True, eq=False)
class ReplayedAllocation:
    """Flown thrusts against others for n rows of a log and a vehicle's m thrusters; NaN where pulses are not known.

    Parameters
    ----------
    thrusts_N : dict of ndarray, shape (n, m)
        "flown" as the pulses say; "least" and "gentle" for the same wrench.
    disturbance : dict of ndarray, shape (n,)
        D of each in (m/s)^2.
    wrench_B : ndarray, shape (n, 6)
    motors : tuple of int
        Servo channel of each thruster, from 1.
    directions : ndarray, shape (m,)
        MOT_n_DIRECTION, 1 or -1.
    total_weight : float
        Of the points: D over it is a mean square speed.
    """

    thrusts_N: dict[Shares, Array]
    disturbance: dict[Shares, Array]
    wrench_B: Array
    motors: tuple[int, ...]
    directions: Array
    total_weight: float

    @property
    def running(self) -> BoolArray:
        """Rows in which a thruster ran, shape (n,)."""
        return np.asarray(np.nan_to_num(np.abs(self.thrusts_N["flown"])).max(axis=1, initial=0.0) > 0.0)

    def total(self, share: Shares) -> float:
        """Sum of D over the rows."""
        return float(np.nansum(self.disturbance[share]))

    def saved_pct(self, than: Shares = "flown") -> float | None:
        """How much less D gentle thrusts add up to; None where the points lie as good as still (`STILL_M_S`)."""
        return saved_pct(self.total(than), self.total("gentle"), int(self.running.sum()) * self.total_weight)

    def columns(self) -> pl.DataFrame:
        """The same as columns of the log's table."""
        found: dict[str, Array] = {}
        for share in SHARES:
            named = "thrust" if share == "flown" else share  # as a trial names what was flown
            found |= {f"{named}_{i + 1}_N": column for i, column in enumerate(self.thrusts_N[share].T)}
        found |= {f"wrench_{axis}": self.wrench_B[:, i] for i, axis in enumerate(("X_N", "Y_N", "Z_N"))}
        found |= {f"wrench_{axis}": self.wrench_B[:, i + 3] for i, axis in enumerate(("K_Nm", "M_Nm", "N_Nm"))}
        found |= {f"disturbance_{share}": self.disturbance[share] for share in SHARES}
        before = self.disturbance["flown"]
        some = before > self.total_weight * STILL_M_S**2
        saved = np.full(len(before), np.nan)
        saved[some] = 100.0 * (1.0 - self.disturbance["gentle"][some] / before[some])
        found["saved_pct"] = saved
        return pl.DataFrame(found).with_columns(pl.all().fill_nan(None))


def bow_points(vehicle: Vehicle, ahead_m: float) -> Region:
    """The ball of `bow_ball` ahead of a vehicle's bow."""
    points = bow_ball(0.5 * float(vehicle.size_m[0]), float(vehicle.X_BC.p_m[2]), ahead_m)
    return Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))


def replay_log(
    rows: pl.DataFrame, parameters: dict[str, float], vehicle: Vehicle, region: Region, wake: WakeModel
) -> ReplayedAllocation:
    """Hold the flown thrusts of a log's table against least and gentle ones.

    Parameters
    ----------
    rows : polars.DataFrame
        Of `wakewise_ardusub.logs.table`.
    parameters : dict
        The autopilot's.
    vehicle : Vehicle
    region : Region
        Points in the vehicle's own frame.
    wake : WakeModel

    Raises
    ------
    InputError
        As `motor_channels`.
    """
    craft = VehicleSummary.of(vehicle, wake)
    motors, directions = motor_channels(craft, parameters), directions_of_motors(parameters, craft.count)
    calculator = WashSavingsCalculator(craft, directions)
    pulses = rows.select(f"servo_{channel}_us" for channel in motors).to_numpy().astype(np.float64)
    voltages = np.array([calculator.supply_V(volts) for volts in rows["voltage_V"]])
    known = np.isfinite(pulses).all(axis=1)
    unique, back = _distinct(np.column_stack([pulses[known], voltages[known]]))
    view = influence_model(craft, region.points_W_m, region.weights)
    gram = view.gram(Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    m = craft.count
    thrusts = {share: np.zeros((len(unique), m)) for share in SHARES}
    found = {share: np.zeros(len(unique)) for share in SHARES}
    for i, row in enumerate(unique):
        savings = calculator.judge(row[:m], float(row[m]), gram)
        for share in SHARES:
            thrusts[share][i], found[share][i] = savings.thrusts_N[share], savings.disturbance[share]
    every: dict[Shares, Array] = {share: np.full((len(rows), m), np.nan) for share in SHARES}
    disturbances: dict[Shares, Array] = {share: np.full(len(rows), np.nan) for share in SHARES}
    for share in SHARES:
        every[share][known] = thrusts[share][back]
        disturbances[share][known] = found[share][back]
    return ReplayedAllocation(
        thrusts_N=every,
        disturbance=disturbances,
        wrench_B=every["flown"] @ vehicle.allocation_matrix.T,
        motors=motors,
        directions=directions,
        total_weight=view.total_weight,
    )


def _distinct(table: Array) -> tuple[Array, IntArray]:
    """Different rows, and which of them each row is: a vehicle at rest sends the same pulses for minutes."""
    if not len(table):
        return table, np.zeros(0, dtype=np.int64)
    unique, back = np.unique(table, axis=0, return_inverse=True)
    return unique, np.asarray(back, dtype=np.int64).ravel()
