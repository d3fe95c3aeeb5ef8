"""A vehicle that is held at the surface while its autopilot starts, then let down to where it begins.

ArduSub takes the pressure at its start for that of the surface, and any that is less for it later on. Started under
water it reads a depth of 0 there, and goes on doing so while it rises.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.interfaces import BodyState
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.physics.physics import SimulatedBody

LOWERED_M_S = 0.3
"""Fastest that it is let down."""
_GRAVITY_W_M_S2 = np.array([0.0, 0.0, GRAVITY_M_S2])


class LoweringBody:
    """Implements `SimulatedBody`: at rest at a depth of 0, then down without a jerk, then the body of its own.

    Thrusts move nothing before that, and the body's own time begins then.

    Parameters
    ----------
    body : SimulatedBody
        At its start.
    start : BodyState
        Where that is.
    held_s : float
        How long it is held.
    """

    def __init__(self, body: SimulatedBody, start: BodyState, held_s: float) -> None:
        self._body, self._start, self._held_s = body, start, held_s
        self._down_s = 2.0 * max(float(start.X_WB.p_m[2]), 0.0) / LOWERED_M_S
        self._time_s = 0.0

    @property
    def stage(self) -> str:
        """What is done with it now, in words; empty once it is free."""
        if self._time_s > self._held_s + self._down_s:
            return ""
        left_s = self._held_s - self._time_s
        if left_s > 0.0:
            return f"held at the surface for {math.ceil(left_s)} s more"
        return f"let down, {math.ceil(left_s + self._down_s)} s more"

    def step(self, thrusts_N: Array, dt_s: float) -> PhysicsState:
        """Hold commanded thrusts, shape (n,), for `dt_s`; before it is free they move nothing."""
        self._time_s += dt_s
        if self._time_s > self._held_s + self._down_s:
            return replace(self._body.step(thrusts_N, dt_s), time_s=self._time_s)
        depth_m, down_m_s, down_m_s2 = self._way()
        p, R = self._start.X_WB.p_m, self._start.X_WB.R
        return PhysicsState(
            time_s=self._time_s,
            omega_B_rad_s=np.zeros(3),
            force_B_m_s2=(np.array([0.0, 0.0, down_m_s2]) - _GRAVITY_W_M_S2) @ R,
            p_WB_m=np.array([p[0], p[1], depth_m]),
            q_WB=self._start.X_WB.q,
            v_W_m_s=np.array([0.0, 0.0, down_m_s]),
        )

    def _way(self) -> tuple[float, float, float]:
        """Depth, speed and acceleration downwards now."""
        since_s = self._time_s - self._held_s
        if since_s <= 0.0 or self._down_s <= 0.0:
            return 0.0, 0.0, 0.0
        depth, turn = float(self._start.X_WB.p_m[2]), 2.0 * math.pi * since_s / self._down_s
        mean = depth / self._down_s
        return (
            mean * (since_s - self._down_s * math.sin(turn) / (2.0 * math.pi)),
            mean * (1.0 - math.cos(turn)),
            mean * 2.0 * math.pi / self._down_s * math.sin(turn),
        )
