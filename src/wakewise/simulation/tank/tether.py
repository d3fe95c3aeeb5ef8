"""Tether: drag and end force of a cable from a fixed point to the vehicle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import Current
from wakewise.simulation.tank.settings import TankSettings

DRAG_COEFFICIENT = 1.1
"""Of a smooth circular cylinder across the flow, Reynolds numbers 1e3 to 2e5 (S. F. Hoerner, Fluid-Dynamic Drag, 1965,
chapter 3: 1.1 to 1.2)."""

STIFFNESS_N_M = 200.0
"""Pull per metre beyond the cable's length: a stand-in for its stretch, soft enough for the vehicle's time step."""

_SEGMENTS = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class Tether:
    """A neutrally buoyant cable that lies straight from its winch to the vehicle.

    Water pushes across each segment with 1/2 rho C_D d |u_n| u_n per length (cross-flow principle: the flow along the
    cable does nothing), u_n relative to the segment, which moves with its share of the vehicle's velocity. As on a
    straight bar held at both ends, the force of a segment at the share s of the way goes to the vehicle with weight s.
    Cable paid out beyond the straight line counts as if it lay along it. Beyond its length the cable pulls like a
    spring. Sag, weight and waves along the cable are left out, and so are the jets that blow past it.
    """

    winch_W_m: Array  # shape (3,)
    p_BT_m: Array  # shape (3,): where it holds the vehicle, in the body frame
    diameter_m: float
    length_m: float
    density_kg_m3: float  # of the water

    @classmethod
    def of(cls, settings: TankSettings) -> Tether | None:
        """The cable of a tank's settings, if any."""
        asked = settings.tether
        if asked.diameter_m == 0.0:
            return None
        return cls(
            winch_W_m=np.array(asked.from_m),
            p_BT_m=np.array(asked.at_B_m),
            diameter_m=asked.diameter_m,
            length_m=asked.length_m,
            density_kg_m3=settings.density_kg_m3,
        )

    def __post_init__(self) -> None:
        freeze(self, winch_W_m=(3,), p_BT_m=(3,))

    def check_reach(self, X_WB: Pose) -> None:
        """Refuse a start beyond the cable's length.

        Raises InputError.
        """
        away = float(np.linalg.norm(X_WB.apply(self.p_BT_m) - self.winch_W_m))
        if away > self.length_m:
            raise InputError(f"tank.tether.length_m: {self.length_m:g}, the vehicle starts {away:.2f} m from its winch")

    def force_W_N(self, X_WB: Pose, nu_B: Array, water: Current, time_s: float) -> Array:
        """Force of the cable on the vehicle, shape (3,), in the world."""
        end = X_WB.apply(self.p_BT_m)
        span = end - self.winch_W_m
        distance = float(np.linalg.norm(span))
        if distance < 1e-6:
            return np.zeros(3)
        along = span / distance
        share = (np.arange(_SEGMENTS) + 0.5) / _SEGMENTS
        end_velocity = X_WB.R @ (nu_B[:3] + np.cross(nu_B[3:], self.p_BT_m))
        flow = water.velocity(self.winch_W_m + share[:, None] * span, time_s) - share[:, None] * end_velocity
        across = flow - (flow @ along)[:, None] * along
        speed = np.linalg.norm(across, axis=1)
        per_speed = 0.5 * self.density_kg_m3 * DRAG_COEFFICIENT * self.diameter_m * max(self.length_m, distance)
        force: Array = (per_speed / _SEGMENTS) * (share * speed) @ across
        return force - STIFFNESS_N_M * max(distance - self.length_m, 0.0) * along

    def wrench_B(self, X_WB: Pose, nu_B: Array, water: Current, time_s: float) -> Array:
        """The same as a wrench about the body origin, in the body frame, shape (6,)."""
        force = self.force_W_N(X_WB, nu_B, water, time_s) @ X_WB.R
        return np.concatenate([force, np.cross(self.p_BT_m, force)])
