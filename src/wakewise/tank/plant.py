"""The true vehicle in the tank: thruster lag and limits, motion, and what it touches."""

from __future__ import annotations

from itertools import product

import numpy as np

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.geometry import Pose
from wakewise.interfaces import BodyState
from wakewise.vehicles import Vehicle, compile_body, saturate, step_rk4, thruster_lag


class VehiclePlant:
    """A vehicle with its own (true) parameters, moved by its thrusters in a uniform current.

    The water that its own jets set in motion does not act back on it. Where its hull reaches the floor the vehicle is
    set back onto it and its downward velocity removed; walls and target are reported as collisions and do not stop it.

    Parameters
    ----------
    vehicle : Vehicle
        True parameters.
    start : BodyState
    density_kg_m3 : float
    current_W_m_s : ndarray, shape (3,)
    size_m : tuple of three floats
        Length, width and depth of the tank.
    target_W_m : ndarray, shape (n, 3)
        Vertices of the target.

    Raises
    ------
    InputError
        If the hull is in the floor, a wall, the air or the target at the start.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        start: BodyState,
        *,
        density_kg_m3: float,
        current_W_m_s: Array,
        size_m: tuple[float, float, float],
        target_W_m: Array,
    ) -> None:
        self.vehicle = vehicle
        self._body = compile_body(vehicle, density_kg_m3)
        self._current = current_W_m_s
        self._size = size_m
        self._target_W_m = target_W_m
        self._target_middle_m = target_W_m.mean(axis=0)
        self._target_radius_m = float(np.linalg.norm(target_W_m - self._target_middle_m, axis=1).max())
        self._corners_B_m = 0.5 * vehicle.size_m * np.array(list(product((-1.0, 1.0), repeat=3)))
        self._p, self._q, self._nu = start.X_WB.p_m.copy(), start.X_WB.q.copy(), start.nu_B.copy()
        self._motors_N = np.zeros(len(vehicle.thrusters))
        where = ", ".join(f"{v:.2f}" for v in self._p)
        if self.state.X_WB.apply(self._corners_B_m)[:, 2].min() < 0.0:
            raise InputError(f"start: hull of {vehicle.name} at ({where}) m rises above the water surface at z = 0")
        touched = self.touches()
        if touched:
            raise InputError(f"start: hull of {vehicle.name} at ({where}) m is inside {touched}, it must start clear")

    @property
    def state(self) -> BodyState:
        """True pose and twist."""
        return BodyState(X_WB=Pose(self._p, self._q), nu_B=self._nu)

    @property
    def thrusts_N(self) -> Array:
        """Force that each thruster delivers, shape (n,): the motor's answer times the thruster's true gain."""
        return self._motors_N * self.vehicle.thrust_gains

    def step(self, commands_N: Array, dt_s: float) -> None:
        """Move on by one short time step under commands, shape (n,), which are clipped to the limits."""
        vehicle = self.vehicle
        wanted = saturate(commands_N, vehicle.thrust_lower_N, vehicle.thrust_upper_N)
        before = self._motors_N
        self._motors_N = thruster_lag(before, wanted, vehicle.time_constants_s, dt_s)
        # The mean of both ends keeps the step's impulse right to second order.
        wrench = vehicle.allocation_matrix @ (vehicle.thrust_gains * 0.5 * (before + self._motors_N))
        self._p, self._q, self._nu = step_rk4(self._body, self._p, self._q, self._nu, wrench, self._current, dt_s)
        self._stay_above_floor()

    def disks(self) -> tuple[Array, Array]:
        """Where the disks are and which way positive thrust pushes, shapes (n, 3), in the world."""
        X_WB = Pose(self._p, self._q)
        return X_WB.apply(self.vehicle.thruster_positions_B_m), self.vehicle.thruster_axes_B @ X_WB.R.T

    def touches(self) -> str:
        """Name what the hull, taken as a box, is in: the floor, a wall, the target, or nothing (an empty string)."""
        X_WB = Pose(self._p, self._q)
        hull = X_WB.apply(self._corners_B_m)
        if hull[:, 2].max() > self._size[2] - 1e-6:
            return "the floor"
        if np.any(np.abs(hull[:, 0]) > self._size[0] / 2) or np.any(np.abs(hull[:, 1]) > self._size[1] / 2):
            return "a wall"
        reach = float(np.linalg.norm(self.vehicle.size_m)) / 2
        if float(np.linalg.norm(self._p - self._target_middle_m)) > reach + self._target_radius_m:
            return ""
        away = self._target_W_m - self._p
        near = away[np.einsum("ij,ij->i", away, away) < reach**2]
        inside = np.all(np.abs(near @ X_WB.R) < self.vehicle.size_m / 2, axis=1)
        return "the target" if bool(inside.any()) else ""

    def _stay_above_floor(self) -> None:
        R_WB = Pose(self._p, self._q).R
        depth = (self._corners_B_m @ R_WB.T)[:, 2].max() + self._p[2]
        if depth <= self._size[2]:
            return
        self._p = self._p - np.array([0.0, 0.0, depth - self._size[2]])
        v_W = R_WB @ self._nu[:3]
        v_W[2] = min(v_W[2], 0.0)
        self._nu = np.concatenate([R_WB.T @ v_W, self._nu[3:]])
