"""Trim as a hover shows it: how heavy the vehicle is, where that sits, and which block of ballast takes it away.

In a hover the thrusters carry what the believed vehicle does not explain, and the estimator says what that is
(`BodyState.load_B`). Its vertical part W is net weight; of its moment, what weight W at the place (x, y) of the hull
makes, m = (x, y, z) x W v, with v straight down in B and z the height of the centre of buoyancy. One attitude tells
nothing of the height.

The current is taken out first. Its drag pulls level on a level hull, but a pitched one is lifted or pushed down, and
turned (Munk's moment). The level part of the load is the drag, since weight has none; turned round by the believed
drag (`estimation.current`) it gives the current, and that its lift and moment. For sets of drag of the same vehicle
that differ by a factor of two (its `drag_cases`), the lift that goes with one level force differs by up to a half, so
half of it counts as unknown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze, frozen
from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat
from wakewise.estimation.current_from_drag import current_from_force
from wakewise.estimation.settings import Priors
from wakewise.robot.vehicles import Vehicle, compile_body, coriolis_wrench, damping_wrench, restoring_wrench
from wakewise.robot.vehicles.ballast import BallastBlock, net_buoyancy_N

STEP_N, STEP_M = 0.5, 0.05
"""What a person can do: blocks of half a newton (50 g of lead, 60 ml of foam), places to five centimetres."""
LIGHT_N = 0.5 * STEP_N
"""Net buoyancy that is aimed at. After rounding to blocks a vehicle is then left neutral to half a newton light, and
never heavy: that half newton costs a third more wash than neutral, half a newton heavy once cost ten times as much
(docs/research-log/0037)."""
WORTH_NM = 0.05
"""A moment below this, half a newton at a decimetre, is left alone where no net weight goes with it."""
SURE = 2.0
"""How many standard deviations a change must be worth."""
LIFT_KNOWN, RIGHTING_KNOWN = 0.5, 0.1
"""Shares that count as unknown: of a current's lift and turning, and of the moment with which a vehicle rights itself,
whose centres are known to a millimetre in ten."""
_LOOKS = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class HoverTrim:
    """What a hover said of the trim, and what follows."""

    weight_N: float  # weight less buoyancy that nobody believed, positive: heavy
    weight_std_N: float
    moment_Nm: Array  # shape (2,): weight times place, forward and to starboard of the body's origin
    moment_std_Nm: Array  # shape (2,)
    own_N: float  # net buoyancy of the vehicle as believed
    light_N: float  # net buoyancy that is wanted
    p_BB_m: Array  # shape (3,): believed centre of buoyancy
    size_m: Array  # shape (3,): the hull's box

    def __post_init__(self) -> None:
        freeze(self, moment_Nm=(2,), moment_std_Nm=(2,), p_BB_m=(3,), size_m=(3,))

    @property
    def heavy_N(self) -> float:
        """Weight less buoyancy in all, what was believed included."""
        return self.weight_N - self.own_N

    @property
    def change_N(self) -> float:
        """Lift that is lacking, as if blocks came in any size."""
        return self.heavy_N + self.light_N

    @property
    def worth(self) -> bool:
        """Whether the change is worth half a newton, or lead is to be moved: less is not proposed unasked."""
        return bool(self.blocks) and (abs(self.change_N) >= STEP_N or len(self.blocks) == 2)

    @property
    def blocks(self) -> tuple[BallastBlock, ...]:
        """What to fix to the hull: one block, or two that stand for lead moved, or none where nothing is sure."""
        moment = np.where(np.abs(self.moment_Nm) > SURE * self.moment_std_Nm, self.moment_Nm, 0.0)
        sure = abs(self.change_N) > SURE * self.weight_std_N
        float_N = _rounded(self.change_N, STEP_N) if sure else 0.0
        if float_N != 0.0:
            # The wanted change of what was believed sits in the centre of buoyancy.
            place = (moment + (self.light_N - self.own_N) * self.p_BB_m[:2]) / float_N
            return (BallastBlock(float_N=float_N, at_B_m=self._on_the_hull(place)),)
        size = float(np.hypot(*moment))
        lead_N = max(_rounded(size / (2.0 * STEP_M), STEP_N), STEP_N)
        # Lead goes to where the load is not.
        to, origin = self._on_the_hull(-moment / lead_N), self._on_the_hull(np.zeros(2))
        if size < WORTH_NM or to == origin:
            return ()
        return (BallastBlock(float_N=lead_N, at_B_m=origin), BallastBlock(float_N=-lead_N, at_B_m=to))

    def _on_the_hull(self, place_m: Array) -> tuple[float, float, float]:
        """A place that a person can find, at the height of the centre of buoyancy."""
        most = [STEP_M * math.floor(0.5 * side / STEP_M + 1e-9) for side in self.size_m[:2]]
        x, y = (float(np.clip(_rounded(float(p), STEP_M), -m, m)) for p, m in zip(place_m, most, strict=True))
        return x, y, round(float(self.p_BB_m[2]), 4)

    @property
    def advice(self) -> str:
        """What to do, in words."""
        blocks = self.blocks
        if not blocks:
            return "no change"
        if len(blocks) == 2:
            return f"move {blocks[0].float_N:.1f} N of lead from the middle to {_where(blocks[1])}"
        block = blocks[0]
        kind = "float" if block.float_N > 0.0 else "lead"
        return f"add {abs(block.float_N):.1f} N of {kind} {_where(block)}"

    @property
    def words(self) -> str:
        """The advice, and what was found, in one line."""
        kind = "heavy" if self.heavy_N >= 0.0 else "light"
        found = f"it is {abs(self.heavy_N):.1f} +- {SURE * self.weight_std_N:.1f} N {kind}"
        return f"{self.advice} ({found}, two standard deviations)"


def hover_trim(vehicle: Vehicle, q_WB: Array, loads_B: Array, thrusts_N: Array, light_N: float = LIGHT_N) -> HoverTrim:
    """Net weight and its place from the estimates of a hover.

    - `q_WB`, shape (n, 4): estimated attitudes. `loads_B`, shape (n, 6): estimated loads, in N and N m.
    - `thrusts_N`, shape (n, m): commanded thrusts; how well their gains are known is the larger part of the
      uncertainty.
    - `light_N`: net buoyancy that is wanted.

    Raises
    ------
    InputError
        If there are no rows, shapes do not fit, or a number is not finite.
    """
    q, loads = frozen(q_WB, (None, 4), "q_WB"), frozen(loads_B, (len(q_WB), 6), "loads_B")
    thrusts = frozen(thrusts_N, (len(q), len(vehicle.thrusters)), "thrusts_N")
    if len(q) == 0:
        raise InputError("trim: no steps of a hover, at least one is needed")
    down_B = np.asarray(matrix_from_quat(q))[:, 2, :]
    every = max(1, len(q) // _LOOKS)
    past = np.mean([_of_current(vehicle, q[k], loads[k]) for k in range(0, len(q), every)], axis=0)
    # The current's own part is told for each step's attitude; its mean is taken out of all.
    lift_N, turning = float(past[0]), past[1:]
    weights = np.einsum("ni,ni->n", down_B, loads[:, :3])
    weight_N = float(weights.mean()) - lift_N
    righting = weight_N * float(vehicle.p_BB_m[2]) * np.cross([0.0, 0.0, 1.0], down_B)
    places = _places(down_B)
    each = np.einsum("nij,nj->ni", places, loads[:, 3:] - righting - turning)
    B, gain = vehicle.allocation_matrix, Priors().gain_std
    by_gain_N = np.mean(thrusts * (down_B @ B[:3]), axis=0)
    by_gain_Nm = np.mean(np.einsum("nij,jm->nim", places, B[3:]) * thrusts[:, None, :], axis=0)
    body = compile_body(vehicle)
    own = np.mean([places[k] @ restoring_wrench(body, q[k])[3:] for k in range(0, len(q), every)], axis=0)
    doubts = np.square(LIFT_KNOWN * np.mean(places @ turning, axis=0)) + np.square(RIGHTING_KNOWN * own)
    return HoverTrim(
        weight_N=weight_N,
        weight_std_N=float(np.sqrt(weights.var() + gain**2 * by_gain_N @ by_gain_N + (LIFT_KNOWN * lift_N) ** 2)),
        moment_Nm=each.mean(axis=0),
        moment_std_Nm=np.sqrt(each.var(axis=0) + gain**2 * np.square(by_gain_Nm).sum(axis=1) + doubts),
        own_N=net_buoyancy_N(vehicle),
        light_N=light_N,
        p_BB_m=vehicle.p_BB_m,
        size_m=vehicle.size_m,
    )


def _places(down_B: Array) -> Array:
    """What gives weight times place, shape (n, 2, 3), of a moment in B: least squares of m = (a, b, 0) x v."""
    by = np.stack([np.cross([1.0, 0.0, 0.0], down_B), np.cross([0.0, 1.0, 0.0], down_B)], axis=2)
    return np.asarray(np.linalg.pinv(by))


def _of_current(vehicle: Vehicle, q: Array, load_B: Array) -> Array:
    """Vertical force and moment in B that go with a load's level part where that is a current's drag, shape (4,)."""
    body, R = compile_body(vehicle), np.asarray(matrix_from_quat(q))
    level = R @ load_B[:3]
    found = current_from_force(body.packed.copy(), q.copy(), float(level[0]), float(level[1]))
    if not np.isfinite(found).all():
        return np.zeros(4)
    past = np.concatenate([-np.array([found[0], found[1], 0.0]) @ R, np.zeros(3)])
    wrench = damping_wrench(body, past) + coriolis_wrench(body, past)
    return np.concatenate([[R[2] @ wrench[:3]], wrench[3:]])


def _rounded(value: float, step: float) -> float:
    return round(step * round(value / step), 6) + 0.0


def _where(block: BallastBlock) -> str:
    """Place of a block in words."""
    x, y, _ = block.at_B_m or (0.0, 0.0, 0.0)
    parts = []
    if x != 0.0:
        parts.append(f"{100.0 * abs(x):.0f} cm {'forward' if x > 0.0 else 'aft'}")
    if y != 0.0:
        parts.append(f"{100.0 * abs(y):.0f} cm to {'starboard' if y > 0.0 else 'port'}")
    return f"{' and '.join(parts)} of the middle" if parts else "in the middle"
