"""Power-constrained null-space allocation: least disturbance subject to P(T) <= beta(v0) P(T_0).

T_0 are the least thrusts of a wrench, T_1 those of least disturbance. The electrical power of a propeller grows as
|T|^1.5 (actuator disk at bollard pull). All points between T_0 and T_1 make the same wrench within limits, and power is
convex, so the allowed part of the way from T_0 to T_1 is an interval that begins at T_0. A higher weight on effort
cannot do the same: D is concave in a thrust between sign changes, so its minimum jumps from T_1 to about T_0.

*Choice.* Each block of the null space (horizontal, vertical) is scaled by itself. Of all such points within the bound
that of the least product of cost and power is taken: D goes as the square of a speed, so 2 % of power must save 1 % of
speed. The cost of water that counts as calm is added to the cost, `standing_W` to the power.

*Bound.* beta depends on the mean speed v0 that T_0 would leave at the target (wake model over its bias `MODEL_BIAS`),
linear in between:

| v0 | beta |
|---|---|
| up to `CALM_M_S` | `CALM` |
| `TROUBLE_M_S` | `TROUBLE` |
| from `MOST_M_S` | `MOST` |

`CALM` and `TROUBLE` were set beforehand: 1.3 times the energy of `dp` where that leaves more than 10 mm/s, 1.05 times
below 5 mm/s (docs/research-log/0036). A twentieth of the excess is kept for pulses, rotor lag and corrections between
two searches. A step may exceed the bound of a flight (docs/research-log/0065). `standing_W` counts because a ballasted
vehicle hovers on 1 to 2 W (docs/research-log/0078).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.allocation.allocate import Allocation, Weights, disturbance_of, min_wash_allocation
from wakewise.allocation.layout import Layout, largest_feasible_share
from wakewise.allocation.line_search import cost
from wakewise.core.arrays import Array, freeze
from wakewise.core.jit.njit import njit

KEPT = 0.95
"""Share of the extra power of a flight that the bound of a step allows: with 1.3 two flights cost 1.307 and 1.299
times the energy of `dp`."""
CALM, TROUBLE = 1.0 + KEPT * 0.05, 1.0 + KEPT * 0.3
"""beta where the least thrusts leave the target's water calm, and where they do not."""
CALM_M_S, TROUBLE_M_S, MOST_M_S = 0.005, 0.010, 0.025
MOST = 1.5
"""Least bound without more wash. Share of `dp`'s wash and energy over `dp`'s, 18 flights in trouble: 1.7: 33 %, 1.28;
1.5: 32 %, 1.27; 1.4: 34 %, 1.25 (docs/research-log/0079)."""
MODEL_BIAS = 2.6
"""Modelled over true speed at the target under the least thrusts: median 2 in 14 flights in trouble (1 to 3.7), 3.2 in
35 calm ones. With 2.6 all but one of the first lie above `TROUBLE_M_S` and all but one of the others below
(docs/research-log/0078)."""
_PARTS = 3
"""Most blocks of the null space scaled by themselves; further ones are scaled with the last."""
_STEPS = {0: 1, 1: 32, 2: 16, 3: 8}
"""Grid steps along each block, by the number of blocks."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerLaw:
    """Electrical power of thrusters: `forward`, `reverse`, shape (n,), in W/N^1.5, and their least thrusts in N.

    Below a least thrust a thruster is pulsed at it, so power is linear in |T|. `standing_W` is added where thrusts are
    compared.
    """

    forward: Array
    reverse: Array
    least_forward_N: float = 0.0
    least_reverse_N: float = 0.0
    standing_W: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, forward=(None,), reverse=(None,))

    def power_W(self, thrusts_N: Array) -> Array:
        """Sum over thrusters, shape (...), for thrusts of shape (..., n); without `standing_W`."""
        T = np.array(thrusts_N, dtype=np.float64)
        rows = T.reshape(-1, T.shape[-1])
        power = _power_of(rows, self.forward, self.reverse, self.least_forward_N, self.least_reverse_N)
        return np.asarray(power.reshape(T.shape[:-1]))


@njit
def _power(T: Array, forward: Array, reverse: Array, least_forward: float, least_reverse: float) -> float:
    """`PowerLaw.power_W` of thrusts, shape (n,)."""
    power = 0.0
    for i in range(T.size):
        each, least = (forward[i], least_forward) if T[i] >= 0.0 else (reverse[i], least_reverse)
        power += each * abs(T[i]) * np.sqrt(max(abs(T[i]), least))
    return power


@njit
def _power_of(rows: Array, forward: Array, reverse: Array, least_forward: float, least_reverse: float) -> Array:
    """`PowerLaw.power_W` of rows of thrusts, shape (r, n)."""
    power = np.empty(rows.shape[0])
    for r in range(rows.shape[0]):
        power[r] = _power(rows[r], forward, reverse, least_forward, least_reverse)
    return power


@njit
def _best_by_power(
    least: Array, ways: Array, steps: int, forward: Array, reverse: Array, least_forward: float, least_reverse: float,
    standing: float, most_W: float, calm: float, G: Array, previous: Array, weights: Array,
) -> Array:  # fmt: skip
    """Thrusts of the least `power_adjusted_cost` on the grid of `steps` along each of `ways`, shape (k, n), within
    `most_W`.

    Those that begin it, `least`, count whatever they need.
    """
    best, thrusts = least.copy(), np.empty(least.size)
    value = np.inf
    for point in range((steps + 1) ** ways.shape[0]):
        thrusts[:] = least
        rest = point
        for way in ways:
            thrusts += rest % (steps + 1) / steps * way
            rest //= steps + 1
        power = _power(thrusts, forward, reverse, least_forward, least_reverse)
        if power <= most_W or point == 0:
            own = (cost(G, thrusts, previous, weights) + calm) * (power + standing)
            if own < value:
                value = own
                best[:] = thrusts
    return best


def power_adjusted_cost(cost_: float, power_W: float, calm: float) -> float:
    """(cost + calm) times power, including `standing_W`; less is better."""
    return (cost_ + calm) * power_W


def best_by_power(
    layout: Layout,
    found: Allocation,
    least_N: Array,
    law: PowerLaw,
    most_W: float,
    calm: float,
    gram: Array,
    weights: Weights,
    previous_N: Array | None = None,
) -> Allocation:
    """Thrusts between the least ones and those of least disturbance, with the least power-adjusted cost.

    - `least_N`, shape (n,): thrusts of the same wrench; where they alone need more than `most_W`, they are the answer.
    - `most_W`: bound on the thrusters' power.
    - `calm`: cost of what counts as calm, in the units of the weights.
    - `previous_N`, shape (n,): as `min_wash_allocation`.
    - Shapes: `gram` (2 n, 2 n).

    The gap is that of `found`, of the minimum of the cost alone.
    """
    G, base = np.array(gram), np.array(least_N, dtype=np.float64)
    previous = np.zeros(len(base)) if previous_N is None else np.array(previous_N, dtype=np.float64)
    parts = list(layout.owners[: _PARTS - 1])
    if len(layout.owners) >= _PARTS:
        parts.append(layout.owners[_PARTS - 1 :].any(axis=0))
    ways = np.array([np.where(own, found.thrusts_N - base, 0.0) for own in parts]).reshape(-1, len(base))
    best = _best_by_power(
        base, ways, _STEPS[len(parts)], law.forward, law.reverse, law.least_forward_N, law.least_reverse_N,
        law.standing_W, most_W, calm, G, previous, weights.packed,
    )  # fmt: skip
    return replace(found, thrusts_N=best, wrench_B=layout.B @ best, disturbance=disturbance_of(G, best))


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerBoundedAllocator:
    """Allocation of least disturbance within the power bound, if there is a power law.

    `excess` multiplies what the bound allows beyond the power of the least thrusts.
    """

    layout: Layout
    law: PowerLaw | None = None
    excess: float = 1.0

    def allocate(
        self,
        wrench_B: Array,
        gram: Array,
        actual: Array,
        weights: Weights,
        total_weight: float,
        previous_N: Array | None = None,
    ) -> Allocation:
        """Thrusts of least cost; arguments as for `min_wash_allocation`, `total_weight` that of the points behind D.

        `gram` is that of the cost; `actual`, shape (2 n, 2 n), gives v0 of the bound.
        """
        found = min_wash_allocation(self.layout, wrench_B, gram, weights, previous_N)
        if self.law is None:
            return found
        least_N, _ = largest_feasible_share(self.layout, self.layout.inverse @ wrench_B)
        speed_m_s = math.sqrt(max(disturbance_of(actual, least_N), 0.0) / total_weight) / MODEL_BIAS
        share = power_limit(speed_m_s)
        base_W = float(self.law.power_W(least_N))
        most_W = base_W + self.excess * ((share - 1.0) * base_W + (share - CALM) * self.law.standing_W)
        calm = _calm(weights, total_weight)
        return best_by_power(self.layout, found, least_N, self.law, most_W, calm, gram, weights, previous_N)

    def adjusted_cost(self, cost: float, thrusts_N: Array, weights: Weights, total_weight: float) -> float:
        """Power-adjusted cost of thrusts, shape (n,); the cost alone without a power law."""
        if self.law is None:
            return cost
        drawn_W = float(self.law.power_W(thrusts_N)) + self.law.standing_W
        return power_adjusted_cost(cost, drawn_W, _calm(weights, total_weight))


def power_limit(speed_m_s: float) -> float:
    """Beta of a mean speed v0 at the target."""
    return float(np.interp(speed_m_s, (CALM_M_S, TROUBLE_M_S, MOST_M_S), (CALM, TROUBLE, MOST)))


def _calm(weights: Weights, total_weight: float) -> float:
    """Cost of the disturbance that counts as calm."""
    return weights.disturbance * total_weight * (MODEL_BIAS * CALM_M_S) ** 2
