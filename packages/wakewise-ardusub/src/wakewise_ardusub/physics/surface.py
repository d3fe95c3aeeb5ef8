"""Water surface for a simulated vehicle: buoyancy and thrust lost above it, and the start at the surface.

`WaterSurface`: the hull is a box. The share of its height above z = 0 has no buoyancy, which acts at the centre of
buoyancy; a thruster gives the share of its disk's height that is below. Limits: no waves, no splash, and drag and added
mass of the whole hull.

`FreeWater`: a vehicle in water without walls, still or with a uniform current (Fossen's equations in NumPy), for quick
tests.

`LoweringBody`: holds the vehicle at the surface while the autopilot starts, then lowers it to its start. ArduSub takes
the pressure at its start as that of the surface; started under water it would read a depth of 0 there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.geometry import Pose, matrix_from_quat, quat_multiply
from wakewise.core.interfaces import BodyState
from wakewise.robot.thrusters import saturate, thruster_lag
from wakewise.robot.vehicles import Vehicle, fossen
from wakewise_ardusub.physics.datagrams import PhysicsState
from wakewise_ardusub.physics.physics import SimulatedBody


@dataclass(frozen=True, kw_only=True, eq=False)
class WaterSurface:
    """The surface at z = 0 for one vehicle of n thrusters.

    Parameters
    ----------
    half_m : ndarray, shape (3,)
        Half of the hull's box.
    buoyancy_N : float
        Of the whole hull, at `p_BB_m`, shape (3,).
    p_BB_m : ndarray, shape (3,)
    disks_B_m : ndarray, shape (n, 3)
        Middles of the thrusters' disks, and their radii in `radii_m`, shape (n,).
    radii_m : ndarray, shape (n,)
    """

    half_m: Array
    buoyancy_N: float
    p_BB_m: Array
    disks_B_m: Array
    radii_m: Array

    def __post_init__(self) -> None:
        freeze(self, half_m=(3,), p_BB_m=(3,), disks_B_m=(len(self.radii_m), 3), radii_m=(len(self.radii_m),))

    @classmethod
    def of(cls, vehicle: Vehicle, density_kg_m3: float = TRIM_WATER_KG_M3) -> WaterSurface:
        """Of a vehicle in water of a density."""
        return cls(
            half_m=0.5 * np.asarray(vehicle.size_m),
            buoyancy_N=density_kg_m3 * GRAVITY_M_S2 * vehicle.displaced_volume_m3,
            p_BB_m=vehicle.p_BB_m,
            disks_B_m=vehicle.thruster_positions_B_m,
            radii_m=np.sqrt(vehicle.disk_areas_m2 / np.pi),
        )

    def emerged(self, X_WB: Pose) -> float:
        """Share of the hull's height that is above the water, 0 to 1."""
        reach = float(np.abs(X_WB.R[2]) @ self.half_m)
        return min(max((reach - float(X_WB.p_m[2])) / (2.0 * reach), 0.0), 1.0)

    def wrench_B(self, X_WB: Pose) -> Array:
        """Wrench of the buoyancy that is lost, in the body frame, shape (6,)."""
        force_B = self.emerged(X_WB) * self.buoyancy_N * X_WB.R[2]
        return np.concatenate([force_B, np.cross(self.p_BB_m, force_B)])

    def thrusts(self, thrusts_N: Array, X_WB: Pose) -> Array:
        """What thrusters that are partly above the water make of thrusts, both shape (n,)."""
        depths = float(X_WB.p_m[2]) + self.disks_B_m @ X_WB.R[2]
        return thrusts_N * np.clip((depths + self.radii_m) / (2.0 * self.radii_m), 0.0, 1.0)


_GRAVITY_W_M_S2 = np.array([0.0, 0.0, GRAVITY_M_S2])


class FreeWater:
    """Implements `Body`; steps of semi-implicit Euler, velocity first.

    A uniform current carries the frame in which the water is still: the equations are those of the velocity through the
    water.

    Parameters
    ----------
    vehicle : Vehicle
    start : BodyState, optional
        At rest 2 m deep, level and heading north, if not given.
    current : callable, optional
        Time in s to the water's velocity in W, m/s, shape (3,); still water if not given.
    """

    def __init__(
        self, vehicle: Vehicle, start: BodyState | None = None, current: Callable[[float], Array] | None = None
    ) -> None:
        begin = start or BodyState(X_WB=Pose(np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0, 0.0])))
        self._vehicle = vehicle
        self._p, self._q, self._nu = begin.X_WB.p_m.copy(), begin.X_WB.q.copy(), begin.nu_B.copy()
        self._motors_N = np.zeros(len(vehicle.thrusters))
        self._time_s = 0.0
        self._inverse = np.linalg.inv(fossen.mass_matrix(vehicle))
        self._mass = fossen.mass_matrix(vehicle)
        self._current = current
        self._carried_W_m_s = np.zeros(3) if current is None else current(0.0)
        self._nu[:3] -= matrix_from_quat(self._q).T @ self._carried_W_m_s

    @property
    def thrusts_N(self) -> Array:
        """What the thrusters give now, shape (n,)."""
        return self._motors_N.copy()

    def step(self, thrusts_N: Array, dt_s: float) -> PhysicsState:
        """Hold commanded thrusts, shape (n,), for `dt_s`."""
        vehicle = self._vehicle
        wanted = saturate(thrusts_N, vehicle.thrust_lower_N, vehicle.thrust_upper_N)
        self._motors_N = thruster_lag(self._motors_N, wanted, vehicle.time_constants_s, dt_s)
        R_WB, nu = matrix_from_quat(self._q), self._nu
        v_before_W = R_WB @ nu[:3] + self._carried_W_m_s
        load = (
            vehicle.allocation_matrix @ self._motors_N
            - fossen.coriolis_matrix(self._mass, nu) @ nu
            - fossen.damping_matrix(vehicle, nu) @ nu
            - fossen.restoring_vector(vehicle, R_WB, TRIM_WATER_KG_M3, GRAVITY_M_S2)
        )
        self._nu = nu + dt_s * (self._inverse @ load)
        turn = quat_multiply(self._q, np.concatenate([[1.0], 0.5 * dt_s * self._nu[3:]]))
        self._q = turn / np.linalg.norm(turn)
        R_WB = matrix_from_quat(self._q)
        v_W = R_WB @ self._nu[:3] + self._carried_W_m_s
        self._p = self._p + dt_s * v_W
        self._time_s += dt_s
        if self._current is not None:
            self._carried_W_m_s = self._current(self._time_s)
        if self._p[2] < 0.0:
            self._p[2], v_W[2] = 0.0, max(float(v_W[2]), 0.0)
        if self._p[2] <= 0.0 or self._current is not None:
            self._nu[:3] = R_WB.T @ (v_W - self._carried_W_m_s)
        return PhysicsState(
            time_s=self._time_s,
            omega_B_rad_s=self._nu[3:],
            force_B_m_s2=R_WB.T @ ((v_W - v_before_W) / dt_s - _GRAVITY_W_M_S2),
            p_WB_m=self._p,
            q_WB=self._q,
            v_W_m_s=v_W,
        )


LOWERED_M_S = 0.3
"""Fastest that it is let down."""


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
