"""What other thrusts would have done at each instant of a log: least ones and gentle ones for the flown wrench.

Pulses become thrusts by the thrusters' curve at the battery's voltage of that moment, turned where the vehicle's
parameter MOT_n_DIRECTION says that a motor runs the other way; thrusts become a wrench by the vehicle's geometry. For
that wrench stand beside the flown thrusts the least ones (pseudo-inverse within limits) and the gentlest ones
(`wakewise.allocation`). D is of points that are fixed to the vehicle, since a log does not know where the target was.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
import polars as pl

from wakewise.allocation import Layout, Weights, compile_layout, disturbance_of, gentle_allocation, least_thrusts
from wakewise.arrays import Array, BoolArray, IntArray
from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.interfaces import WakeModel
from wakewise.links.logs.gather import SERVOS
from wakewise.targets import Region
from wakewise.thrusters.curve_library import library_curve
from wakewise.vehicles import Vehicle
from wakewise.wake import WakeView

EFFORT = 1e-6
"""Weight of squared thrust beside D in (m/s)^2 per N^2, as `wakewise allocate` has it."""
VOLTAGE_STEP_V = 0.1
MIDDLE_US, FULL_US = 1500.0, 400.0
BOXES = 2000
STILL_M_S = 1e-4
"""Root mean square speed at the points below which there is nothing to spare."""
RADIUS_M = 0.25
AHEAD_ALLOWED_M = (0.05, 20.0)
Shares = Literal["flown", "least", "gentle"]
SHARES: tuple[Shares, ...] = ("flown", "least", "gentle")
_FUNCTION = re.compile(r"SERVO(\d+)_FUNCTION\Z")
_FIRST_MOTORS, _LATER_MOTORS = 33, 82
"""SERVOn_FUNCTION of motor 1 (to 8), and of motor 9 (to 12)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Hindsight:
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
        before = self.total(than)
        if before <= int(self.running.sum()) * self.total_weight * STILL_M_S**2:
            return None
        return 100.0 * (1.0 - self.total("gentle") / before)

    def columns(self) -> pl.DataFrame:
        """The same as columns of the log's table."""
        found: dict[str, Array] = {}
        for share in SHARES:
            found |= {f"{share}_{i + 1}_N": column for i, column in enumerate(self.thrusts_N[share].T)}
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
    """Fifteen points of a ball half a metre across that stands ahead of the bow, on the camera's height.

    `ahead_m` is from the front of the vehicle's box to the ball's middle; a nearer ball is smaller. The points are its
    middle, and on its surface those of an octahedron and of a cube.
    """
    if not AHEAD_ALLOWED_M[0] <= ahead_m <= AHEAD_ALLOWED_M[1]:
        raise InputError(
            f"--ahead {ahead_m:g}: {AHEAD_ALLOWED_M[0]:g} to {AHEAD_ALLOWED_M[1]:g} m ahead of the bow are allowed"
        )
    middle = np.array([0.5 * vehicle.size_m[0] + ahead_m, 0.0, vehicle.X_BC.p_m[2]])
    radius_m = min(RADIUS_M, 0.5 * ahead_m)
    cube = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]) / np.sqrt(3.0)
    points = middle + radius_m * np.vstack([np.zeros((1, 3)), np.eye(3), -np.eye(3), cube])
    return Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))


def motor_channels(vehicle: Vehicle, parameters: dict[str, float]) -> tuple[int, ...]:
    """Servo channel of each thruster, from 1: as SERVOn_FUNCTION says, or in their order where a log does not.

    Raises
    ------
    InputError
        If the log drives another number of motors than the vehicle has.
    """
    named: dict[int, int] = {}
    said = False
    for name, value in parameters.items():
        match = _FUNCTION.match(name)
        if match is None:
            continue
        said = True
        function, channel = round(value), int(match[1])
        for first, motor in ((_FIRST_MOTORS, 1), (_LATER_MOTORS, 9)):
            if first <= function < first + (8 if motor == 1 else 4) and channel <= SERVOS:
                named[motor + function - first] = channel
    count = len(vehicle.thrusters)
    if not said or not named:
        if count > SERVOS:
            raise InputError(f"vehicle {vehicle.name}: {count} thrusters, a log holds {SERVOS} servo outputs")
        return tuple(range(1, count + 1))
    if sorted(named) != list(range(1, count + 1)):
        raise InputError(
            f"vehicle {vehicle.name}: {count} thrusters, the log's SERVOn_FUNCTION drives motors "
            f"{', '.join(map(str, sorted(named)))}; name the vehicle that was flown with --vehicle"
        )
    return tuple(named[motor] for motor in range(1, count + 1))


def hindsight(
    rows: pl.DataFrame, parameters: dict[str, float], vehicle: Vehicle, region: Region, wake: WakeModel
) -> Hindsight:
    """Hold the flown thrusts of a log's table against least and gentle ones.

    Parameters
    ----------
    rows : polars.DataFrame
        Of `wakewise.links.logs.table`.
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
    motors = motor_channels(vehicle, parameters)
    directions = np.array([np.sign(parameters.get(f"MOT_{i + 1}_DIRECTION", 1.0)) or 1.0 for i in range(len(motors))])
    pulses = rows.select(f"servo_{channel}_us" for channel in motors).to_numpy().astype(np.float64)
    voltages = _voltages(rows, vehicle)
    known = np.isfinite(pulses).all(axis=1)
    unique, back = _distinct(np.column_stack([pulses[known], voltages[known]]))
    view = WakeView.of(vehicle, region, wake)
    gram = view.gram(Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
    m = len(motors)
    thrusts = {share: np.zeros((len(unique), m)) for share in SHARES}
    found = {share: np.zeros(len(unique)) for share in SHARES}
    weights = Weights(disturbance=1.0, effort=EFFORT)
    layouts: dict[float, Layout] = {}
    for i, row in enumerate(unique):
        supply_V = float(row[m])
        flown = directions * _thrusts_N(vehicle, row[:m], supply_V)
        if not np.any(flown):
            continue
        if supply_V not in layouts:
            layouts[supply_V] = _layout(vehicle, supply_V, directions)
        layout = layouts[supply_V]
        wrench = vehicle.allocation_matrix @ flown
        least = least_thrusts(layout, wrench, gram)
        gentle = gentle_allocation(layout, wrench, gram, weights, budget=BOXES)
        thrusts["flown"][i], thrusts["least"][i], thrusts["gentle"][i] = flown, least.thrusts_N, gentle.thrusts_N
        found["flown"][i] = disturbance_of(gram, flown)
        found["least"][i], found["gentle"][i] = least.disturbance or 0.0, gentle.disturbance or 0.0
    every: dict[Shares, Array] = {share: np.full((len(rows), m), np.nan) for share in SHARES}
    disturbances: dict[Shares, Array] = {share: np.full(len(rows), np.nan) for share in SHARES}
    for share in SHARES:
        every[share][known] = thrusts[share][back]
        disturbances[share][known] = found[share][back]
    return Hindsight(
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


def _voltages(rows: pl.DataFrame, vehicle: Vehicle) -> Array:
    """Supply voltage of each row, rounded, within the curve's table; the vehicle file's where the log has none."""
    if vehicle.curve is None:
        return np.zeros(len(rows))
    curve = library_curve(vehicle.curve.table)
    measured = rows["voltage_V"].fill_null(vehicle.curve.supply_V).to_numpy()
    rounded = np.round(measured / VOLTAGE_STEP_V) * VOLTAGE_STEP_V
    return np.asarray(np.clip(rounded, curve.supply_V[0], curve.supply_V[-1]))


def _thrusts_N(vehicle: Vehicle, pulses_us: Array, supply_V: float) -> Array:
    """Thrusts of pulses, both shape (m,), as each motor itself turns; a thruster without a curve goes in proportion."""
    if vehicle.curve is not None:
        return library_curve(vehicle.curve.table).thrust_N(pulses_us, supply_V)
    output = np.clip((pulses_us - MIDDLE_US) / FULL_US, -1.0, 1.0)
    return np.asarray(np.where(output > 0.0, output * vehicle.thrust_upper_N, -output * vehicle.thrust_lower_N))


def _layout(vehicle: Vehicle, supply_V: float, directions: Array) -> Layout:
    """Geometry and limits at a voltage; a motor that runs the other way has its limits the other way round."""
    if vehicle.curve is None:
        lower, upper = vehicle.thrust_lower_N, vehicle.thrust_upper_N
    else:
        low, high = library_curve(vehicle.curve.table).limits_N(supply_V)
        lower, upper = np.full(len(directions), low), np.full(len(directions), high)
    turned = directions < 0.0
    return compile_layout(vehicle.allocation_matrix, np.where(turned, -upper, lower), np.where(turned, -lower, upper))
