"""What thrusts cost in electrical power, and shares that stay within a bound on it.

Of all thrusts that make a wrench, T_0 are the least (pseudo-inverse) and T_1 the gentlest. The power of a propeller
grows as |T|^1.5 (actuator disk at bollard pull), so load on fewer thrusters costs more: half of them carry it for
sqrt(2) times the power, more where they run in reverse. A bound is kept by going only a part of the way from T_0 to
T_1. All points between make the same wrench within limits, and power is convex in thrust, so the allowed part of a
way is an interval that begins at T_0.

Why not a higher price on effort. D is made of roots of thrusts, so along a way it is concave between two thrusters'
rests and its weighted sum with effort has minima at rests alone: with a rising price the minimum jumps from the
gentlest shares to about the least ones, past all that the bound allows.

What is worth its power. Some of a way saves nearly all of the wash and some next to nothing, at the same price. So the
parts of the null space that share no thruster (the horizontal ones, the vertical ones) are each gone along by
themselves, and of all such points within the bound that of the least product of cost and power is taken: D goes as the
square of a speed, so two percent of power must save a percent of it. The cost of what may count as calm is added to
all, as nobody gains by water stiller than that; so is, to the power, what a vehicle draws whatever it thrusts with.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wakewise.allocation.allocate import Allocation, Weights, disturbance_of
from wakewise.allocation.layout import Layout
from wakewise.allocation.line_search import cost
from wakewise.core.arrays import Array, freeze
from wakewise.core.jit.njit import njit

_PARTS = 3
"""Most parts of the null space gone along by themselves; what a layout has beyond goes with the last of them."""
_STEPS = {0: 1, 1: 32, 2: 16, 3: 8}
"""Steps on the way along each part, by the number of parts."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerLaw:
    """Electrical power of thrusters: `forward`, `reverse`, shape (n,), in W/N^1.5, and their least thrusts in N.

    Below a least thrust a thruster is run at it for a part of the time, so there power goes with |T|. `standing_W` is
    reckoned beside that of the thrusters where shares are held against each other.
    """

    forward: Array
    reverse: Array
    least_forward_N: float = 0.0
    least_reverse_N: float = 0.0
    standing_W: float = 0.0

    def __post_init__(self) -> None:
        freeze(self, forward=(None,), reverse=(None,))

    def power_W(self, thrusts_N: Array) -> Array:
        """Sum over thrusters, shape (...), for thrusts of shape (..., n); nothing of what stands beside."""
        T = np.array(thrusts_N, dtype=np.float64)
        rows = T.reshape(-1, T.shape[-1])
        power = _power_of(rows, self.forward, self.reverse, self.least_forward_N, self.least_reverse_N)
        return np.asarray(power.reshape(T.shape[:-1]))


@njit
def _power(T, forward, reverse, least_forward, least_reverse):  # type: ignore[no-untyped-def]
    """`PowerLaw.power_W` of thrusts, shape (n,)."""
    power = 0.0
    for i in range(T.size):
        each, least = (forward[i], least_forward) if T[i] >= 0.0 else (reverse[i], least_reverse)
        power += each * abs(T[i]) * np.sqrt(max(abs(T[i]), least))
    return power


@njit
def _power_of(rows, forward, reverse, least_forward, least_reverse):  # type: ignore[no-untyped-def]
    """`PowerLaw.power_W` of rows of thrusts, shape (r, n)."""
    power = np.empty(rows.shape[0])
    for r in range(rows.shape[0]):
        power[r] = _power(rows[r], forward, reverse, least_forward, least_reverse)
    return power


@njit
def _worthiest(  # type: ignore[no-untyped-def]
    least, ways, steps, forward, reverse, least_forward, least_reverse, standing, most_W, calm, G, previous, weights
):
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
    """What shares are compared by: cost over what is calm times power with what stands beside; less is better."""
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
    """Of what lies between the least thrusts and the gentlest found: the shares that are worth their power most.

    Parameters
    ----------
    layout : Layout
    found : Allocation
    least_N : ndarray, shape (n,)
        Thrusts of the same wrench; where they alone need more than `most_W`, they are the answer.
    law : PowerLaw
    most_W : float
        Bound on the thrusters' power.
    calm : float
        Cost of what counts as calm, in the units of the weights.
    gram : ndarray, shape (2 n, 2 n)
    weights : Weights
    previous_N : ndarray, shape (n,), optional
        As `gentle_allocation`.

    Returns
    -------
    Allocation
        With the gap of `found`, which is that of the minimum of cost alone.
    """
    G, base = np.array(gram), np.array(least_N, dtype=np.float64)
    previous = np.zeros(len(base)) if previous_N is None else np.array(previous_N, dtype=np.float64)
    parts = list(layout.owners[: _PARTS - 1])
    if len(layout.owners) >= _PARTS:
        parts.append(layout.owners[_PARTS - 1 :].any(axis=0))
    ways = np.array([np.where(own, found.thrusts_N - base, 0.0) for own in parts]).reshape(-1, len(base))
    best = _worthiest(
        base, ways, _STEPS[len(parts)], law.forward, law.reverse, law.least_forward_N, law.least_reverse_N,
        law.standing_W, most_W, calm, G, previous, weights.packed,
    )  # fmt: skip
    return replace(found, thrusts_N=best, wrench_B=layout.B @ best, disturbance=disturbance_of(G, best))
