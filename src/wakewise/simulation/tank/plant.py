"""True vehicle of the tank: thruster lag, limits, failures, inflow losses, motion, tether and contact."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, matrix_from_quat, skew
from wakewise.core.interfaces import BodyState
from wakewise.core.jit.njit import njit
from wakewise.robot.thrusters import saturate, thruster_lag
from wakewise.robot.vehicles import Vehicle, compile_body
from wakewise.robot.vehicles.kernels import rk4_kernel, rotate
from wakewise.simulation.tank.contact import CollisionGeometry, surely_clear
from wakewise.simulation.tank.settings import PLANT_STEP_S, ThrusterFailure
from wakewise.simulation.tank.tether import Tether
from wakewise.simulation.water.currents import AmbientSum

KT_STILL = 0.32
"""Thrust coefficient T / (rho n^2 D^4) in still water of a Wageningen B3-50 screw with pitch 0.8 D."""

ADVANCE_OF_NO_THRUST = 0.88
"""Advance ratio V / (n D) at which the same screw gives no thrust.

Both from the series' polynomial (M. W. C. Oosterveld and P. van Oossanen 1975, Int. Shipbuild. Prog. 22, 251). Small
ducted thrusters publish bollard thrust only; this screw stands for them.
"""

_MOST_GAIN = 1.2  # water that runs against the jet raises thrust; the line holds no farther than J = -0.2


class FailingThrusters:
    """Turns wanted thrusts into what failing thrusters are still driven to; the motors' lag comes after.

    `count`: thrusters of the vehicle. Raises InputError if a failure names a thruster that the vehicle has not.
    """

    def __init__(self, failures: tuple[ThrusterFailure, ...], count: int) -> None:
        for failure in failures:
            if failure.thruster > count:
                raise InputError(f"tank.failures: thruster {failure.thruster}, the vehicle has {count}")
        self._failures = failures
        self._stuck_N: dict[int, float] = {}

    def wanted(self, time_s: float, wanted_N: Array, motors_N: Array) -> Array:
        """Thrusts, shape (n,), that motors now at `motors_N` turn towards when `wanted_N` is commanded."""
        if not self._failures:
            return wanted_N
        result = wanted_N.copy()
        for k, failure in enumerate(self._failures):
            i = failure.thruster - 1
            if time_s < failure.at_s - 1e-9:
                continue
            if failure.kind == "dead":
                result[i] = 0.0
            elif failure.kind == "half":
                result[i] *= 0.5 if failure.value is None else failure.value
            else:
                now = float(motors_N[i]) if failure.value is None else failure.value
                result[i] = self._stuck_N.setdefault(k, now)
        return result


def inflow_factors(thrusts_N: Array, inflow_m_s: Array, areas_m2: Array, density_kg_m3: float) -> Array:
    """Share of its still-water thrust that each thruster gives at the same revolutions, shape (n,).

    T(V) = T(0) (1 - V / V0), the linear law of thrust against advance (e.g. M. Blanke, K.-P. Lindegaard and
    T. I. Fossen 2000, Dynamic model for thrust generation of marine propellers, IFAC MCMC): V0 = J0 n D with
    n = sqrt(T(0) / (rho D^4 K_T)). Kept between 0 and 1.2.

    - `thrusts_N`, shape (n,): in still water; only the size counts.
    - `inflow_m_s`, shape (n,): speed of the water relative to the disk, along the jet that the thruster sends; its own
      suction left out.
    - Shapes: `areas_m2` (n,).
    """
    diameters = np.sqrt(4 * areas_m2 / math.pi)
    no_thrust = ADVANCE_OF_NO_THRUST / math.sqrt(KT_STILL) * np.sqrt(np.abs(thrusts_N) / density_kg_m3) / diameters
    factor = 1.0 - np.divide(inflow_m_s, no_thrust, out=np.zeros_like(no_thrust), where=no_thrust > 1e-6)
    return np.clip(factor, 0.0, _MOST_GAIN)


_GRAVITY_W_M_S2 = np.array([0.0, 0.0, GRAVITY_M_S2])
_TIME_TOLERANCE_S = 1e-9


class VehiclePlant:
    """A vehicle with its own (true) parameters, moved by its thrusters and by the water round it.

    The ambient water acts at the body origin as if it were uniform: drag and added mass go with the velocity relative
    to it, and water that speeds up pushes with (rho V + M_A) du/dt (Morison's equation for a small body). The water
    that its own jets set in motion acts on it only through `inflow_W_m_s`, if that is given. Floor, walls and target
    stop it; see `CollisionGeometry`.

    Thrusters do what their speed controllers can: a command below the least thrust turns no propeller, one above it is
    that of the nearest pulse (`Vehicle.thrust_steps`).

    - `vehicle`: true parameters.
    - `ambient`: motion of the water without thrusters.
    - `size_m`: length, width and depth of the tank.
    - `target_W_m`, shape (n, 3): points on the target's surface.

    Raises InputError if the hull is in the floor, a wall, the air or the target at the start, the cable does not reach
    it, or a failure names a thruster that it has not.
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
        self._surroundings = CollisionGeometry(vehicle.size_m, size_m, target_W_m)
        self._failing = FailingThrusters(failures, len(vehicle.thrusters))
        self._tether = tether
        self._time = 0.0
        # Position, quaternion and twist in one array, as the kernels take them.
        self._state = np.concatenate([start.X_WB.p_m, start.X_WB.q, start.nu_B])
        self._R = matrix_from_quat(start.X_WB.q)
        n = len(vehicle.thrusters)
        self._motors_N, self._factors = np.zeros(n), np.ones(n)
        self._impulse_N_s = np.zeros((n, 2))
        self._lower_N, self._upper_N = np.array(vehicle.thrust_lower_N), np.array(vehicle.thrust_upper_N)
        self._lags_s, self._gains = np.array(vehicle.time_constants_s), np.array(vehicle.thrust_gains)
        self._allocation = np.array(vehicle.allocation_matrix)
        self._packed = np.array(self._body.packed)
        self._arms_B, self._axes_B = np.array(vehicle.thruster_positions_B_m), np.array(vehicle.thruster_axes_B)
        self._force_B_m_s2 = -_GRAVITY_W_M_S2 @ start.X_WB.R
        self._still = ambient.steady and ambient.uniform
        self._steady = ambient.steady
        self._steps = vehicle.thrust_steps
        self._asked, self._turned_N = b"", np.zeros(n)
        self._follows = _following(vehicle, self._body.added_mass, density_kg_m3)
        self._calm = self._still and tether is None and not failures  # so that nothing acts between two events
        # Velocity in the world before the last step, that step, and 1 if the hull was surely clear of everything then.
        self._last = np.zeros(5)
        self._water_W = ambient.velocity(start.X_WB.p_m[None], 0.0)[0]
        self.push_B = np.zeros(6)
        """Wrench of what is outside the water, in the body frame, shape (6,), held until it is set anew."""
        self.contact = ""
        """What the hull was stopped by in the last step, or nothing (an empty string)."""
        where = ", ".join(f"{v:.2f}" for v in start.X_WB.p_m)
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
        return BodyState(X_WB=Pose(self._state[:3], self._state[3:7]), nu_B=self._state[7:])

    @property
    def thrusts_N(self) -> Array:
        """Force that each thruster delivers, shape (n,): the motor's answer times its true gain, less what it loses."""
        return self._motors_N * self._gains * self._factors

    def take_impulse_N_s(self) -> Array:
        """Integral of forward and of reverse thrust since the last call, both positive, shape (n, 2)."""
        taken, self._impulse_N_s = self._impulse_N_s, np.zeros_like(self._impulse_N_s)
        return taken

    @property
    def force_B_m_s2(self) -> Array:
        """Specific force at the body origin, mean over the last step, shape (3,): what an accelerometer there feels."""
        return self._force_B_m_s2.copy()

    @property
    def vector(self) -> Array:
        """Position, quaternion and twist, shape (13,): the true state as it is, which is not to be written to."""
        return self._state

    @property
    def R_WB(self) -> Array:
        """True attitude, shape (3, 3), which is not to be written to."""
        return self._R

    @property
    def time_s(self) -> float:
        """Sum of the steps."""
        return self._time

    def advance(self, commands_N: Array, until_s: float, inflow_W_m_s: Array | None = None) -> str:
        """Move on to a time in steps of at most 5 ms; what the hull was stopped by on the way. Arguments as `step`."""
        commands, touched = self._steps_of(np.array(commands_N, dtype=np.float64)), ""
        while until_s - self._time > _TIME_TOLERANCE_S:
            if self._calm and inflow_W_m_s is None:
                self._move(commands, until_s, self.push_B, self._water_W)
            else:
                self._step(commands, min(self._time + PLANT_STEP_S, until_s) - self._time, inflow_W_m_s)
            touched = touched or self.contact
        return touched

    def _move(
        self, wanted_N: Array, until_s: float, wrench_B: Array, water_W: Array, longest_s: float = PLANT_STEP_S
    ) -> None:
        """Steps under one wrench in steady, even water, up to a time or to where the hull may touch something."""
        self._time = _steps_in_free_water(
            self._packed,
            self._allocation,
            self._lower_N,
            self._upper_N,
            self._lags_s,
            self._gains,
            self._factors,
            wanted_N,
            wrench_B,
            water_W,
            np.array([self._time, until_s, longest_s]),
            self._surroundings.packed,
            self._state,
            self._motors_N,
            self._impulse_N_s,
            self._R,
            self._last,
            self._force_B_m_s2,
        )
        if self._last[4] == 0.0:
            self._hold()
        else:
            self.contact = ""

    def _hold(self) -> None:
        """Set the hull back out of what it is in, and note the specific force of the last step."""
        self.contact = ""
        if not surely_clear(self._surroundings.packed, self._state, self._R):
            p, nu, self.contact = self._surroundings.held(self._state[:3].copy(), self._R, self._state[7:].copy())
            self._state[:3], self._state[7:] = p, nu
        dt_s = self._last[3]
        if dt_s > 0.0:
            rate_W = (self._R @ self._state[7:10] - self._last[:3]) / dt_s
            self._force_B_m_s2 = (rate_W - _GRAVITY_W_M_S2) @ self._R

    def step(self, commands_N: Array, dt_s: float, inflow_W_m_s: Array | None = None) -> None:
        """Move on by one short time step.

        `commands_N`, shape (n,): clipped to the limits, and to what the thrusters can hold. `inflow_W_m_s`, shape (n,
        3): velocity of the water at the disks without each thruster's own jet; None leaves inflow losses out.
        """
        self._step(self._steps_of(np.array(commands_N, dtype=np.float64)), dt_s, inflow_W_m_s)

    def _step(self, given_N: Array, dt_s: float, inflow_W_m_s: Array | None) -> None:
        """`step` of what the speed controllers have made of the commands."""
        wanted = self._failing.wanted(self._time, given_N, self._motors_N)
        if inflow_W_m_s is not None:
            motors = thruster_lag(self._motors_N, saturate(wanted, self._lower_N, self._upper_N), self._lags_s, dt_s)
            self._factors = self._inflow_factors(self._gains * 0.5 * (self._motors_N + motors), inflow_W_m_s)
        water, wrench = self._water_W, self.push_B.copy()
        if not self._still and dt_s > 0.0:
            self._water_W = self._ambient.velocity(self._state[None, :3], self._time + dt_s)[0]
            water = 0.5 * (water + self._water_W)
            if not self._steady:
                wrench += self._push_of_water(dt_s)
        if self._tether is not None:
            pose = Pose(self._state[:3], self._state[3:7])
            wrench += self._tether.wrench_B(pose, self._state[7:], self._ambient, self._time)
        self._move(wanted, self._time + dt_s, wrench, water, dt_s)

    def drag(self) -> tuple[Array, Array]:
        """Velocity through the ambient water in m/s and the drag on the water in N, both shape (3,), in the world."""
        body, nu = self._body, self._state[7:].copy()
        nu[:3] -= self._water_W @ self._R
        force_B = body.linear_damping[:3] @ nu + body.quadratic_damping[:3] * np.abs(nu[:3]) * nu[:3]
        return self._R @ nu[:3], self._R @ force_B

    def disks(self) -> tuple[Array, Array]:
        """Where the disks are and which way positive thrust pushes, shapes (n, 3), in the world."""
        turn = self._R.T
        return self._state[:3] + self._arms_B @ turn, self._axes_B @ turn

    def touches(self) -> str:
        """Name what the hull, taken as a box, is in or on: the floor, a wall, the target, or nothing."""
        if surely_clear(self._surroundings.packed, self._state, self._R):
            return ""
        return self._surroundings.touches(self._state[:3], self._R)

    def _steps_of(self, commands_N: Array) -> Array:
        """What the speed controllers make of commands, shape (n,); looked up once for each new command."""
        if self._steps is None:
            return commands_N
        key = commands_N.tobytes()  # ten times faster to compare than arrays
        if key != self._asked:
            self._asked, self._turned_N = key, self._steps.delivered_N(commands_N)
        return self._turned_N

    def _push_of_water(self, dt_s: float) -> Array:
        """Wrench of water that speeds up at a fixed place: its pressure gradient and the added mass."""
        rate_W = (self._water_W - self._ambient.velocity(self._state[None, :3], self._time)[0]) / dt_s
        push: Array = self._follows @ (rate_W @ self._R)
        return push

    def _inflow_factors(self, thrusts_N: Array, inflow_W_m_s: Array) -> Array:
        vehicle = self.vehicle
        arms = vehicle.thruster_positions_B_m
        disk_B = self._state[7:10] + np.cross(self._state[10:], arms)
        past_B = inflow_W_m_s @ self._R - disk_B
        jets = -np.sign(thrusts_N)[:, None] * vehicle.thruster_axes_B
        along = np.einsum("ij,ij->i", past_B, jets)
        return inflow_factors(thrusts_N, along, vehicle.disk_areas_m2, self._density)


def _following(vehicle: Vehicle, added_mass: Array, density_kg_m3: float) -> Array:
    """Wrench in the body frame per acceleration of the water, shape (6, 3): pressure on the volume, and added mass."""
    displaced_kg = density_kg_m3 * vehicle.displaced_volume_m3
    pressure = displaced_kg * np.concatenate([np.eye(3), skew(vehicle.p_BB_m)])
    return np.asarray(pressure + added_mass[:, :3])


@njit
def _lag_and_move(
    packed: Array,
    allocation: Array,
    lower_N: Array,
    upper_N: Array,
    lags_s: Array,
    gains: Array,
    factors: Array,
    wanted_N: Array,
    wrench_B: Array,
    water_W: Array,
    dt_s: float,
    state: Array,
    motors_N: Array,
    impulse_N_s: Array,
    R: Array,
) -> None:
    """One step of all motors and of the hull in free water; state, motors, impulse and R (3, 3) change in place."""
    inputs = np.empty(9)
    for k in range(6):
        inputs[k] = wrench_B[k]
    for k in range(3):
        inputs[6 + k] = water_W[k]
    for i in range(motors_N.shape[0]):
        reference = min(max(wanted_N[i], lower_N[i]), upper_N[i])
        kept = math.exp(-dt_s / lags_s[i]) if lags_s[i] > 0.0 else 0.0
        after = reference + kept * (motors_N[i] - reference)
        # The mean of both ends keeps the step's impulse right to second order.
        thrust = gains[i] * 0.5 * (motors_N[i] + after) * factors[i]
        motors_N[i] = after
        impulse_N_s[i, 0] += max(thrust, 0.0) * dt_s
        impulse_N_s[i, 1] += max(-thrust, 0.0) * dt_s
        for k in range(6):
            inputs[k] += allocation[k, i] * thrust
    rk4_kernel(packed, state, inputs, dt_s)
    for k in range(3):
        a, b, c = (1.0 if k == 0 else 0.0), (1.0 if k == 1 else 0.0), (1.0 if k == 2 else 0.0)
        R[0, k], R[1, k], R[2, k] = rotate(state[3], state[4], state[5], state[6], a, b, c)


@njit(nogil=True)
def _steps_in_free_water(
    packed: Array,
    allocation: Array,
    lower_N: Array,
    upper_N: Array,
    lags_s: Array,
    gains: Array,
    factors: Array,
    wanted_N: Array,
    wrench_B: Array,
    water_W: Array,
    times_s: Array,
    around: Array,
    state: Array,
    motors_N: Array,
    impulse_N_s: Array,
    R: Array,
    last: Array,
    force_B: Array,
) -> float:
    """Steps of `_lag_and_move` from a time until another, none longer than a third (`times_s`); the time reached.

    They end where the hull may touch something (`around`). `last`, shape (5,), is written: the velocity in the world
    before the last step, that step, and 1 if the hull was clear of everything after it; then `force_B`, too, the
    specific force.
    """
    time_s, until_s = times_s[0], times_s[1]
    while until_s - time_s > _TIME_TOLERANCE_S:
        dt_s = min(time_s + times_s[2], until_s) - time_s
        for i in range(3):
            last[i] = R[i, 0] * state[7] + R[i, 1] * state[8] + R[i, 2] * state[9]
        last[3] = dt_s
        _lag_and_move(
            packed,
            allocation,
            lower_N,
            upper_N,
            lags_s,
            gains,
            factors,
            wanted_N,
            wrench_B,
            water_W,
            dt_s,
            state,
            motors_N,
            impulse_N_s,
            R,
        )
        time_s += dt_s
        last[4] = 1.0 if surely_clear(around, state, R) else 0.0
        if last[4] == 0.0:
            return time_s
    if last[3] == 0.0:
        return time_s
    rate = np.empty(3)
    for i in range(3):
        now = R[i, 0] * state[7] + R[i, 1] * state[8] + R[i, 2] * state[9]
        rate[i] = (now - last[i]) / last[3] - _GRAVITY_W_M_S2[i]
    for i in range(3):
        force_B[i] = R[0, i] * rate[0] + R[1, i] * rate[1] + R[2, i] * rate[2]
    return time_s
