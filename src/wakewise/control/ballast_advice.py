"""What ballast keeps the target's water stillest over a mission, and what it would be worth.

A mission is a list of poses to hold. At each, the thrusters carry net weight and the moment with which the vehicle
rights itself, shared out as gently as can be; buoyancy and the place of the centre of gravity decide how much that is.
The mean is taken over the trim that nobody knows beforehand, so that advice is not made for a vehicle that is exactly
as written. Steady jets only: what moving costs does not depend on ballast.

The advice is the ballast of least effort that is not worse by D than the vehicle as it is, among those that are light
by as much as is unknown, so that the vehicle is heavy in no case: in the tank half a newton light costs a third more
wash than neutral, half a newton heavy up to ten times as much (docs/research-log/0037). Least D is another one and is
told beside it (`gentlest`, of least effort among those near to the least D): D asks for more floats, since jets then go
up, away from target and bed, which the tank does not bear out beyond half a newton. What a flight says of its own trim
is told by `hover_trim`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from wakewise.allocation.allocate import Weights, min_wash_allocation
from wakewise.control.bed_points import with_bed_points
from wakewise.control.null_space_allocation import vehicle_layout
from wakewise.control.settings import ControlSettings
from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.robot.vehicles import Vehicle, compile_body, restoring_wrench
from wakewise.robot.vehicles.ballast import ballasted, net_buoyancy_N
from wakewise.scene.targets import Region
from wakewise.wake.influence import InfluenceModel

__all__ = ["TrimAdvice", "TrimRow", "ballasted", "net_buoyancy_N", "trim_advice"]

FLOATS_N = (-2.0, -1.0, 0.0, 0.5, 1.0, 1.5, 2.0, 3.0)
"""Net buoyancies looked at, positive floats."""
SHIFTS_MM = (-3.0, 0.0, 3.0, 6.0, 9.0)
"""Shifts of the centre of gravity along the vehicle looked at, positive forward."""
NEARLY_N = 0.05
"""Net buoyancies nearer to the vehicle's own than this are not looked at beside it."""
NEAR = 1.25
"""Ballasts with at most this many times the least mean speed are as good as the best."""


@dataclass(frozen=True, kw_only=True)
class TrimRow:
    """One ballast: net buoyancy and shift of the centre of gravity, and what holding the mission's poses then costs.

    `speed_m_s` is the root of D over the sum of weights, a mean speed at the region's points by the wake model;
    `thrust_N` the mean sum of |T|, `effort_N2` of T^2; `down_N` that of jets that go down, by 45 deg or more.
    """

    float_N: float
    shift_mm: float
    speed_m_s: float
    thrust_N: float
    down_N: float
    effort_N2: float


@dataclass(frozen=True, kw_only=True)
class TrimAdvice:
    """All ballasts looked at; the one advised, the one that the wake model alone would take, the vehicle as it is."""

    rows: tuple[TrimRow, ...]
    best: TrimRow
    gentlest: TrimRow
    now: TrimRow

    @property
    def words(self) -> str:
        """The advice in one sentence."""
        change = self.best.float_N - self.now.float_N
        if change == 0.0 and self.best.shift_mm == self.now.shift_mm:
            return "leave the ballast as it is"
        parts = []
        if change != 0.0:
            parts.append(f"{'add floats' if change > 0.0 else 'add lead'} of {abs(change):.2f} N")
        if self.best.shift_mm != self.now.shift_mm:
            where = "forward" if self.best.shift_mm > self.now.shift_mm else "aft"
            parts.append(f"move the centre of gravity {abs(self.best.shift_mm - self.now.shift_mm):.0f} mm {where}")
        now, best = self.now, self.best
        return (
            f"{' and '.join(parts)}: {now.thrust_N:.2f} to {best.thrust_N:.2f} N of thrust to hold its poses, "
            f"{1e3 * now.speed_m_s:.1f} to {1e3 * best.speed_m_s:.1f} mm/s at the target by the wake model"
        )

    @property
    def wake_words(self) -> str:
        """What the wake model alone would do, in one sentence."""
        row = self.gentlest
        return (
            f"least by the wake model alone: {1e3 * row.speed_m_s:.1f} mm/s with {row.float_N:+.1f} N and the centre "
            f"of gravity {row.shift_mm:+.0f} mm, at {row.thrust_N:.2f} N of thrust"
        )


def trim_advice(
    vehicle: Vehicle,
    poses: tuple[Pose, ...],
    region: Region,
    wake: WakeModel,
    settings: ControlSettings | None = None,
    *,
    net_weight_N: float = 0.0,
    unknown_N: float = 1.0,
    current_N: Array | None = None,
    floats_N: tuple[float, ...] = FLOATS_N,
    shifts_mm: tuple[float, ...] = SHIFTS_MM,
) -> TrimAdvice:
    """Ballast of least effort that is heavy in no case and not worse by D, and the one of least D beside it.

    - `poses`: X_WB of the mission. `region`, `wake` and `settings` are as a controller has them; with `include_bed`,
      points on the bed count.
    - `net_weight_N`: weight less buoyancy that is known but not in the vehicle's numbers, positive: heavy.
    - `unknown_N`: the trim error beside that lies between minus and plus this; its ends and the middle are compared.
    - `current_N`, shape (3,): steady force of the current on the vehicle, in W.
    - `floats_N`, `shifts_mm`: net buoyancies and shifts of the centre of gravity to compare, beside the vehicle's own.

    Raises
    ------
    InputError
        If there are no poses, `unknown_N` is negative, or a number is not finite.
    """
    chosen = settings or ControlSettings()
    if not poses:
        raise InputError("trim: no poses, a mission must hold at least one")
    if not (np.isfinite(unknown_N) and unknown_N >= 0.0):
        raise InputError(f"trim: unknown_N {unknown_N:g}, must be finite and not negative")
    if not np.isfinite(net_weight_N):
        raise InputError(f"trim: net_weight_N {net_weight_N:g}, must be finite")
    view = InfluenceModel.of(vehicle, with_bed_points(region, chosen.allocation), wake, chosen.superposition)
    grams = [view.gram(X_WB) for X_WB in poses]
    weights = Weights(disturbance=chosen.w_disturbance / view.total_weight, effort=chosen.w_effort)
    believed = net_buoyancy_N(vehicle)
    own = believed - net_weight_N
    force_W = np.zeros(3) if current_N is None else np.asarray(current_N, dtype=np.float64)
    errors = (-unknown_N, 0.0, unknown_N) if unknown_N > 0.0 else (0.0,)
    kept = {round(own, 6), unknown_N}
    buoyancies = sorted(kept | {given for given in floats_N if min(abs(given - own) for own in kept) >= NEARLY_N})
    rows = tuple(
        _row(vehicle, poses, grams, view, weights, force_W, errors, float_N - believed, shift_mm, float_N)
        for float_N, shift_mm in product(buoyancies, sorted({*shifts_mm, 0.0}))
    )
    now = next(row for row in rows if row.float_N == round(own, 6) and row.shift_mm == 0.0)
    least = min(row.speed_m_s for row in rows)
    never_heavy = tuple(row for row in rows if row.float_N >= unknown_N)
    return TrimAdvice(
        rows=rows,
        best=_easiest(never_heavy, max(now.speed_m_s, min(row.speed_m_s for row in never_heavy))),
        gentlest=_easiest(rows, NEAR * least),
        now=now,
    )


def _easiest(rows: tuple[TrimRow, ...], most_m_s: float) -> TrimRow:
    """The row of least effort among those up to a speed."""
    return min((row for row in rows if row.speed_m_s <= most_m_s), key=lambda row: (row.effort_N2, row.speed_m_s))


def _row(
    vehicle: Vehicle,
    poses: tuple[Pose, ...],
    grams: list[Array],
    view: InfluenceModel,
    weights: Weights,
    force_W: Array,
    errors: tuple[float, ...],
    added_N: float,
    shift_mm: float,
    float_N: float,
) -> TrimRow:
    layout = vehicle_layout(vehicle)
    D, thrust, down, effort = [], [], [], []
    for error_N in errors:
        body = compile_body(ballasted(vehicle, added_N + error_N, shift_mm), TRIM_WATER_KG_M3, GRAVITY_M_S2)
        for X_WB, G in zip(poses, grams, strict=True):
            wrench = -restoring_wrench(body, X_WB.q)
            wrench[:3] -= force_W @ X_WB.R
            found = min_wash_allocation(layout, wrench, G, weights)
            T = found.thrusts_N
            jets_W = -np.sign(T)[:, None] * (vehicle.thruster_axes_B @ X_WB.R.T)
            value = 0.0 if found.disturbance is None else found.disturbance
            D.append(value / view.total_weight)
            thrust.append(float(np.abs(T).sum()))
            down.append(float(np.abs(T)[jets_W[:, 2] > np.sqrt(0.5)].sum()))
            effort.append(float(T @ T))
    return TrimRow(
        float_N=float_N,
        shift_mm=shift_mm,
        speed_m_s=float(np.sqrt(np.mean(D))),
        thrust_N=float(np.mean(thrust)),
        down_N=float(np.mean(down)),
        effort_N2=float(np.mean(effort)),
    )
