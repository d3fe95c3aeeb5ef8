"""What thrusts cost in electrical power, and shares that stay within a bound on it.

Of all thrusts that make a wrench, T_0 are the least (pseudo-inverse) and T_1 the gentlest. The power of a propeller
grows as |T|^1.5 (actuator disk at bollard pull), so load on fewer thrusters costs more: half of them carry it for
sqrt(2) times the power, more where they run in reverse. A bound is kept by going only a part of the way from T_0 to
T_1. All points between make the same wrench within limits, and power is convex in thrust, so the allowed part of a
way is an interval that begins at T_0.

Why not a higher price on effort. D is made of roots of thrusts, so along a way it is concave between two thrusters'
rests and its weighted sum with effort has minima at rests alone: with a rising price the minimum jumps from the
gentlest shares to about the least ones, past all that the bound allows.

Which part is worth most: parts of the null space that share no thruster (the horizontal ones, the vertical ones) are
gone along one after the other, in each order, as far as is cheapest and the power that is left allows; the cheapest
result is taken.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from wakewise.allocation.allocate import Allocation, Weights, disturbance_of
from wakewise.allocation.layout import Layout
from wakewise.allocation.search import cost
from wakewise.arrays import Array, freeze
from wakewise.compiled import njit

_SHARES = np.linspace(0.0, 1.0, 33)
_MOST_ORDERED = 3
"""Parts of the null space up to which each order is tried; beyond, only that in which they are listed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerLaw:
    """Electrical power of thrusters: `forward`, `reverse`, shape (n,), in W/N^1.5, and their least thrusts in N.

    Below a least thrust a thruster is run at it for a part of the time, so there power goes with |T|.
    """

    forward: Array
    reverse: Array
    least_forward_N: float = 0.0
    least_reverse_N: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, forward=(None,), reverse=(None,))

    def power_W(self, thrusts_N: Array) -> Array:
        """Sum over thrusters, shape (...), for thrusts of shape (..., n)."""
        T = np.array(thrusts_N, dtype=np.float64)
        rows = T.reshape(-1, T.shape[-1])
        power = _power_of(rows, self.forward, self.reverse, self.least_forward_N, self.least_reverse_N)
        return np.asarray(power.reshape(T.shape[:-1]))


@njit
def _power_of(rows, forward, reverse, least_forward, least_reverse):  # type: ignore[no-untyped-def]
    """`PowerLaw.power_W` of rows of thrusts, shape (r, n)."""
    power = np.zeros(rows.shape[0])
    for r in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            T = rows[r, i]
            each, least = (forward[i], least_forward) if T >= 0.0 else (reverse[i], least_reverse)
            power[r] += each * abs(T) * np.sqrt(max(abs(T), least))
    return power


@njit
def _costs_of(rows, G, previous, weights):  # type: ignore[no-untyped-def]
    """`cost` of rows of thrusts, shape (r, n)."""
    costs = np.empty(rows.shape[0])
    for r in range(rows.shape[0]):
        costs[r] = cost(G, rows[r], previous, weights)
    return costs


def within_power(
    layout: Layout,
    found: Allocation,
    least_N: Array,
    law: PowerLaw,
    most_W: float,
    gram: Array,
    weights: Weights,
    previous_N: Array | None = None,
) -> Allocation:
    """The gentlest shares found, or what lies between them and the least ones within a bound on power.

    Parameters
    ----------
    layout : Layout
    found : Allocation
    least_N : ndarray, shape (n,)
        Thrusts of the same wrench; where they alone need more than `most_W`, they are the answer.
    law : PowerLaw
    most_W : float
    gram : ndarray, shape (2 n, 2 n)
    weights : Weights
    previous_N : ndarray, shape (n,), optional
        As `gentle_allocation`.

    Returns
    -------
    Allocation
        With the gap of `found`, which is that of the minimum without a bound.
    """
    if float(law.power_W(found.thrusts_N)) <= most_W:
        return found
    G, packed = np.array(gram), weights.packed
    previous = np.zeros(len(least_N)) if previous_N is None else np.array(previous_N)
    ways = [np.where(own, found.thrusts_N - least_N, 0.0) for own in layout.owners]
    orders = permutations(ways) if len(ways) <= _MOST_ORDERED else (tuple(ways),)
    best = np.array(least_N)
    value = float(cost(G, best, previous, packed))
    for order in orders:
        thrusts, spent = np.array(least_N), value
        for way in order:
            tried = thrusts + _SHARES[:, None] * way
            tried = tried[: max(int(np.count_nonzero(law.power_W(tried) <= most_W)), 1)]
            costs = _costs_of(tried, G, previous, packed)
            least = int(costs.argmin())
            thrusts, spent = tried[least], float(costs[least])
        if spent < value:
            best, value = thrusts, spent
    return replace(found, thrusts_N=best, wrench_B=layout.B @ best, disturbance=disturbance_of(G, best))
