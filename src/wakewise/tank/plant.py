"""The true vehicle in the tank: thruster lag, limits, failures and losses, motion, cable, and what it touches."""

from __future__ import annotations

import numpy as np

from wakewise.arrays import Array
from wakewise.errors import InputError
from wakewise.geometry import Pose, matrix_from_quat
from wakewise.interfaces import BodyState
from wakewise.tank.contact import Surroundings
from wakewise.tank.currents import AmbientSum
from wakewise.tank.settings import ThrusterFailure
from wakewise.tank.tether import Tether
from wakewise.tank.thrust_losses import FailingThrusters, inflow_factors
from wakewise.vehicles import Vehicle, compile_body, saturate, step_rk4, thruster_lag

_GRAVITY_W_M_S2 = np.array([0.0, 0.0, 9.80665])


class VehiclePlant:
    """A vehicle with its own (true) parameters, moved by its thrusters and by the water round it.

    The ambient water acts at the body origin as if it were uniform: drag and added mass go with the velocity relative
    to it, and water that speeds up pushes with (rho V + M_A) du/dt (Morison's equation for a small body). The water
    that its own jets set in motion acts on it only through `inflow_W_m_s`, if that is given. Floor, walls and target
    stop it; see `Surroundings`.

    Parameters
    ----------
    vehicle : Vehicle
        True parameters.
    start : BodyState
    density_kg_m3 : float
    ambient : AmbientSum
        Motion of the water without thrusters.
    size_m : tuple of three floats
        Length, width and depth of the tank.
    target_W_m : ndarray, shape (n, 3)
        Points on the target's surface.
    failures : tuple of ThrusterFailure
    tether : Tether or None

    Raises
    ------
    InputError
        If the hull is in the floor, a wall, the air or the target at the start, the cable does not reach it, or a
        failure names a thruster that it has not.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        start: BodyState,
        *,
        density_kg_m3: float,
        ambient: AmbientSum,
        size_m: tuple[float, float, float],
        target_W_m: Array,
        failures: tuple[ThrusterFailure, ...] = (),
        tether: Tether | None = None,
    ) -> None:
        self.vehicle = vehicle
        self._body = compile_body(vehicle, density_kg_m3)
        self._density = density_kg_m3
        self._ambient = ambient
        self._surroundings = Surroundings(vehicle.size_m, size_m, target_W_m)
        self._failing = FailingThrusters(failures, len(vehicle.thrusters))
        self._tether = tether
        self._time = 0.0
        self._p, self._q, self._nu = start.X_WB.p_m.copy(), start.X_WB.q.copy(), start.nu_B.copy()
        self._R = matrix_from_quat(self._q)
        self._motors_N = np.zeros(len(vehicle.thrusters))
        self._factors = np.ones(len(vehicle.thrusters))
        self._force_B_m_s2 = -_GRAVITY_W_M_S2 @ start.X_WB.R
        self._water_W = ambient.velocity(self._p[None], 0.0)[0]
        self.contact = ""
        """What the hull was stopped by in the last step, or nothing (an empty string)."""
        where = ", ".join(f"{v:.2f}" for v in self._p)
        if start.X_WB.apply(self._surroundings.corners_B_m)[:, 2].min() < 0.0:
            raise InputError(f"start: hull of {vehicle.name} at ({where}) m rises above the water surface at z = 0")
        touched = self.touches()
        if touched:
            raise InputError(f"start: hull of {vehicle.name} at ({where}) m is inside {touched}, it must start clear")
        if tether is not None:
            tether.check_reach(start.X_WB)

    @property
    def state(self) -> BodyState:
        """True pose and twist."""
        return BodyState(X_WB=Pose(self._p, self._q), nu_B=self._nu)

    @property
    def thrusts_N(self) -> Array:
        """Force that each thruster delivers, shape (n,): the motor's answer times its true gain, less what it loses."""
        return self._motors_N * self.vehicle.thrust_gains * self._factors

    @property
    def force_B_m_s2(self) -> Array:
        """Specific force at the body origin, mean over the last step, shape (3,): what an accelerometer there feels."""
        return self._force_B_m_s2

    def step(self, commands_N: Array, dt_s: float, inflow_W_m_s: Array | None = None) -> None:
        """Move on by one short time step.

        Parameters
        ----------
        commands_N : ndarray, shape (n,)
            Clipped to the limits.
        dt_s : float
        inflow_W_m_s : ndarray, shape (n, 3), or None
            Velocity of the water at the disks without each thruster's own jet; None leaves inflow losses out.
        """
        vehicle = self.vehicle
        wanted = self._failing.wanted(self._time, np.asarray(commands_N, dtype=np.float64), self._motors_N)
        wanted = saturate(wanted, vehicle.thrust_lower_N, vehicle.thrust_upper_N)
        before = self._motors_N
        self._motors_N = thruster_lag(before, wanted, vehicle.time_constants_s, dt_s)
        # The mean of both ends keeps the step's impulse right to second order.
        thrusts = vehicle.thrust_gains * 0.5 * (before + self._motors_N)
        if inflow_W_m_s is not None:
            self._factors = self._inflow_factors(thrusts, inflow_W_m_s)
            thrusts = thrusts * self._factors
        wrench = vehicle.allocation_matrix @ thrusts
        water = self._water_W
        if not (self._ambient.steady and self._ambient.uniform) and dt_s > 0.0:
            self._water_W = self._ambient.velocity(self._p[None], self._time + dt_s)[0]
            water = 0.5 * (water + self._water_W)
            if not self._ambient.steady:
                wrench = wrench + self._push_of_water(dt_s)
        if self._tether is not None:
            wrench = wrench + self._tether.wrench_B(Pose(self._p, self._q), self._nu, self._ambient, self._time)
        v_W = self._R @ self._nu[:3]
        self._p, self._q, self._nu = step_rk4(self._body, self._p, self._q, self._nu, wrench, water, dt_s)
        self._R = matrix_from_quat(self._q)
        self._p, self._nu, self.contact = self._surroundings.held(self._p, self._R, self._nu)
        self._time += dt_s
        if dt_s > 0.0:
            self._force_B_m_s2 = ((self._R @ self._nu[:3] - v_W) / dt_s - _GRAVITY_W_M_S2) @ self._R

    def disks(self) -> tuple[Array, Array]:
        """Where the disks are and which way positive thrust pushes, shapes (n, 3), in the world."""
        turn = self._R.T
        return self._p + self.vehicle.thruster_positions_B_m @ turn, self.vehicle.thruster_axes_B @ turn

    def touches(self) -> str:
        """Name what the hull, taken as a box, is in or on: the floor, a wall, the target, or nothing."""
        return self._surroundings.touches(self._p, self._R)

    def _push_of_water(self, dt_s: float) -> Array:
        """Wrench of water that speeds up at a fixed place: its pressure gradient and the added mass."""
        rate_W = (self._water_W - self._ambient.velocity(self._p[None], self._time)[0]) / dt_s
        rate_B = rate_W @ self._R
        pressure = self._density * self.vehicle.displaced_volume_m3 * rate_B
        push: Array = self._body.added_mass[:, :3] @ rate_B
        return push + np.concatenate([pressure, np.cross(self.vehicle.p_BB_m, pressure)])

    def _inflow_factors(self, thrusts_N: Array, inflow_W_m_s: Array) -> Array:
        vehicle = self.vehicle
        arms = vehicle.thruster_positions_B_m
        disk_B = self._nu[:3] + np.cross(self._nu[3:], arms)
        past_B = inflow_W_m_s @ self._R - disk_B
        jets = -np.sign(thrusts_N)[:, None] * vehicle.thruster_axes_B
        along = np.einsum("ij,ij->i", past_B, jets)
        return inflow_factors(thrusts_N, along, vehicle.disk_areas_m2, self._density)
