"""Wake of the hull: the momentum that drag takes from the flow past the hull, as impulse parcels.

Parcels of impulse -F dt / rho start at the lee of the hull, F the drag (`round_jet_closure`, *Wakes*). In hover in a
current the jets supply the impulse that the wake lacks. The initial width is sigma = sqrt(A / 2 pi), A the frontal
area: a Gaussian whose centre is as fast as a top hat of that area. For a drag coefficient above 2 sigma is the momentum
thickness, so that the deficit on the axis does not exceed the speed. Moments and added mass leave no impulse.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.simulation.water.parcel_advection import EMISSION_SPACING
from wakewise.simulation.water.parcels import Parcels

_STILL_M_S = 1e-6  # slower water past the hull leaves it without a lee


@dataclass(frozen=True, kw_only=True, eq=False)
class HullPush:
    """What a hull, taken as a box about its origin, did to the water during a step."""

    p_WB_m: Array  # shape (3,): its middle at the end of the step
    R_WB: Array  # shape (3, 3)
    size_m: Array  # shape (3,): of the box, along the body's axes
    # velocity_W_m_s, through_W_m_s: shape (3,): its velocity, and that through the water without thrusters.
    velocity_W_m_s: Array
    through_W_m_s: Array
    # Shape (3,): the hull's drag on the water over the step: the opposite of the water's on the hull.
    impulse_W_N_s: Array

    def __post_init__(self) -> None:
        threes = ("p_WB_m", "size_m", "velocity_W_m_s", "through_W_m_s", "impulse_W_N_s")
        freeze(self, R_WB=(3, 3), **dict.fromkeys(threes, (3,)))


def frontal_area_m2(size_m: Array, direction_B: Array) -> float:
    """Area of a box as seen along a unit vector."""
    (a, b, c), (x, y, z) = size_m.tolist(), direction_B.tolist()
    return float(abs(x) * b * c + abs(y) * a * c + abs(z) * a * b)


def lee_m(size_m: Array, direction_B: Array) -> float:
    """Distance from the middle of a box to its side along a unit vector."""
    sides = zip(size_m.tolist(), direction_B.tolist(), strict=True)
    return min(0.5 * size / max(abs(along), 1e-9) for size, along in sides)


def first_wake(strength_m3_s: float, speed_m_s: float, area_m2: float) -> tuple[float, float]:
    """Sigma in m and deficit on the axis in m/s of a wake where it begins.

    `strength_m3_s` is its impulse over density and length, F / (rho U), and `speed_m_s` U.
    """
    theta2 = strength_m3_s / (2 * math.pi * speed_m_s)
    sigma2 = max(area_m2 / (2 * math.pi), theta2)
    return math.sqrt(sigma2), speed_m_s * theta2 / sigma2


class HullWake:
    """Collects what a hull gives to the water, and sends it as parcels at even distances along its way.

    `stream`: of the parcels.
    """

    def __init__(self, stream: int, density_kg_m3: float) -> None:
        self._stream = stream
        self._density = density_kg_m3
        self.waiting_m4_s = np.zeros(3)
        """Impulse over density not yet sent, shape (3,)."""
        self._way = self._time = 0.0

    def sent(self, dt_s: float, push: HullPush, rng: np.random.Generator) -> Parcels:
        """Parcels of a step of dt_s, their place and age those of its end; mostly none."""
        speed = math.hypot(*push.through_W_m_s.tolist())
        self.waiting_m4_s = self.waiting_m4_s + push.impulse_W_N_s / self._density
        self._way += speed * dt_s
        self._time += dt_s
        impulse = math.hypot(*self.waiting_m4_s.tolist())
        if speed < _STILL_M_S or impulse == 0.0:
            return Parcels.none()
        ahead = push.through_W_m_s / speed
        ahead_B = ahead @ push.R_WB
        sigma, deficit = first_wake(impulse / self._way, self._way / self._time, frontal_area_m2(push.size_m, ahead_B))
        spacing = EMISSION_SPACING * sigma
        count = int(self._way / spacing)
        if count == 0:
            return Parcels.none()
        # Each stands for the stretch of way about it; what is left of the way waits with its share of the impulse.
        behind = lee_m(push.size_m, ahead_B) + self._way - spacing * (np.arange(count) + 0.5)
        share = count * spacing / self._way
        each = self.waiting_m4_s * (share / count)
        self.waiting_m4_s = self.waiting_m4_s * (1.0 - share)
        self._way, self._time = self._way * (1.0 - share), self._time * (1.0 - share)
        same = np.ones(count)
        sent = Parcels.sent(
            push.p_WB_m - behind[:, None] * ahead,
            np.tile(each, (count, 1)),
            sigma * same,
            # With twice its first sigma as diameter a wake has no core.
            2.0 * sigma * same,
            np.full(count, self._stream),
            rng.standard_normal((count, 3)),
            np.tile(push.velocity_W_m_s, (count, 1)),
            deficit * same,
        )
        # None of its water came through a disk: the deficit itself is all that it has of the hull's motion.
        return replace(sent, share=np.zeros(count))
