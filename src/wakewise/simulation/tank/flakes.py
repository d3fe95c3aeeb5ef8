"""Visible flakes that drift with the water, the same ones in all photographs.

They fill a box about the target evenly and re-enter on its other side. Ambient flow moves them in short steps; jets are
evaluated only when flakes are read, and held until the next time: between two photographs flakes are a few centimetres
off in a jet, and right in a current or swell.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import Current, FlakeCloud

PER_M3 = 1500.0
"""How many there are; of a murkier water the rest is drawn anew for each photograph."""
HALF_M, HEIGHT_M = 1.0, 1.1
DEPTH_M, SLOPES = 0.62, (1.05, 0.8)
"""Field of view in which flakes are reported: 93 by 77 degrees."""
_STEP_S = 0.25


class FlakeAdvector(Protocol):
    """Water with its velocity split into ambient flow and the thrusters' part."""

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity less that of the same water without thrusters, both shape (n, 3)."""
        ...


class Flakes:
    """Flakes of one tank.

    - `centre_W_m`, shape (3,): of the target.
    - `depth_m`: of the water.
    - `ambient`: the water's own motion.
    """

    def __init__(self, centre_W_m: Array, depth_m: float, ambient: Current, rng: np.random.Generator) -> None:
        x, y = centre_W_m[:2]
        self._low = np.array([x - HALF_M, y - HALF_M, max(depth_m - HEIGHT_M, 0.0)])
        self._high = np.array([x + HALF_M, y + HALF_M, depth_m])
        self._ambient = ambient
        n = int(rng.poisson(PER_M3 * float(np.prod(self._high - self._low))))
        self.p_W_m: Array = rng.uniform(self._low, self._high, (n, 3))
        self._looks = np.column_stack([rng.random(n), rng.standard_normal(n), rng.random(n)])
        self._excess: Array = np.zeros((n, 3))
        self._time = 0.0

    def move(self, time_s: float, water: FlakeAdvector) -> Array:
        """Carry them on to a time; return the velocity of the water at each, shape (n, 3)."""
        steps = max(1, int(np.ceil((time_s - self._time) / _STEP_S - 1e-9)))
        dt = (time_s - self._time) / steps
        if dt > 0.0:
            for k in range(steps):
                own = self._ambient.velocity(self.p_W_m, self._time + (k + 0.5) * dt)
                moved = self.p_W_m + dt * (own + self._excess)
                self.p_W_m = self._low + np.mod(moved - self._low, self._high - self._low)
            self._time = time_s
        self._excess = water.excess_velocity(self.p_W_m)
        velocity: Array = self._excess + self._ambient.velocity(self.p_W_m, time_s)
        return velocity

    def before(self, X_WC: Pose, time_s: float, water: FlakeAdvector) -> FlakeCloud:
        """Advect to a time; returns the flakes before a camera."""
        velocity = self.move(time_s, water)
        whole = FlakeCloud(
            p_W_m=self.p_W_m,
            v_W_m_s=velocity,
            looks=self._looks,
            low_W_m=self._low,
            high_W_m=self._high,
            per_m3=PER_M3,
            depth_m=DEPTH_M,
            slopes=SLOPES,
        )
        seen = whole.covers(self.p_W_m, X_WC)
        return FlakeCloud(
            p_W_m=self.p_W_m[seen],
            v_W_m_s=velocity[seen],
            looks=self._looks[seen],
            low_W_m=self._low,
            high_W_m=self._high,
            per_m3=PER_M3,
            depth_m=DEPTH_M,
            slopes=SLOPES,
        )
