"""A vehicle in still water without walls, by the readable equations: the body of quick tests, of no kernel and no tank.

Motors lag and steps are those of the vehicle file. It stops at the surface, and nothing else is there.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.geometry import Pose, matrix_from_quat, quat_multiply
from wakewise.core.interfaces import BodyState
from wakewise.robot.thrusters import saturate, thruster_lag
from wakewise.robot.vehicles import Vehicle, fossen
from wakewise_ardusub.physics.datagrams import PhysicsState

_GRAVITY_W_M_S2 = np.array([0.0, 0.0, GRAVITY_M_S2])


class FreeWater:
    """Implements `Body`; steps of semi-implicit Euler, velocity first.

    Parameters
    ----------
    vehicle : Vehicle
    start : BodyState, optional
        At rest 2 m deep, level and heading north, if not given.
    """

    def __init__(self, vehicle: Vehicle, start: BodyState | None = None) -> None:
        begin = start or BodyState(X_WB=Pose(np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 0.0, 0.0])))
        self._vehicle = vehicle
        self._p, self._q, self._nu = begin.X_WB.p_m.copy(), begin.X_WB.q.copy(), begin.nu_B.copy()
        self._motors_N = np.zeros(len(vehicle.thrusters))
        self._time_s = 0.0
        self._inverse = np.linalg.inv(fossen.mass_matrix(vehicle))
        self._mass = fossen.mass_matrix(vehicle)

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
        v_before_W = R_WB @ nu[:3]
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
        v_W = R_WB @ self._nu[:3]
        self._p = self._p + dt_s * v_W
        if self._p[2] < 0.0:
            self._p[2], v_W[2] = 0.0, max(float(v_W[2]), 0.0)
            self._nu[:3] = R_WB.T @ v_W
        self._time_s += dt_s
        return PhysicsState(
            time_s=self._time_s,
            omega_B_rad_s=self._nu[3:],
            force_B_m_s2=R_WB.T @ ((v_W - v_before_W) / dt_s - _GRAVITY_W_M_S2),
            p_WB_m=self._p,
            q_WB=self._q,
            v_W_m_s=v_W,
        )
