"""From a goal and an estimate to a wrench: a PID in six degrees of freedom with feed-forward, shared by all methods."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wakewise.control.gain_margins import Gains, desired_gains, stable_gain_scale, vehicle_axes
from wakewise.control.settings import ControlSettings
from wakewise.core.arrays import Array, freeze
from wakewise.core.interfaces import BodyState, Goal
from wakewise.core.jit.njit import assign, njit
from wakewise.robot.vehicles import RigidBody, Vehicle, compile_body, coriolis_wrench, damping_wrench, restoring_wrench

_NO_FEED = np.zeros(6)


ESTIMATOR_LAG_S = 0.08
"""Delay of position and velocity that the margins allow for: the 35 ms that the filter lives behind the present and as
much for what it smooths; the whole loop, filter included, then withstands twice the gain and 30 deg of delay in flight
on two vehicles (tests of `estimation`)."""
GYRO_LAG_S = 0.04
"""Delay of attitude and rate, which come from a gyro: at most two samples."""
INTEGRAL_SHARE = 0.25
"""Most that the integral may ask, as a share of what the thrusters can do. Steady loads are fed forward from the
estimator; the integral is for what that misses."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PidState:
    """Integral part: force in the *world* (currents and trim do not turn with the vehicle), moment in the body.

    `goal_nu`, shape (6,), is the goal's twist of the step before, None before the first.
    """

    force_W_N: Array
    moment_B_Nm: Array
    goal_nu: Array | None = None

    def __post_init__(self) -> None:
        freeze(self, force_W_N=(3,), moment_B_Nm=(3,))

    @classmethod
    def zero(cls) -> PidState:
        """Nothing learned yet."""
        return cls(force_W_N=np.zeros(3), moment_B_Nm=np.zeros(3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Pid:
    """Gains, limits of the integral, and the nominal vehicle behind the feed-forward; make one with `make_pid`.

    `kp`, `kd`, `ki`, shape (6,): N/m, N s/m, N/(m s) for forces and Nm/rad, Nm s/rad, Nm/(rad s) for moments.
    `integral_limit`, shape (6,), in N and Nm. `gain_scale`, shape (6,), is the share of the desired bandwidth that the
    margins allowed.
    """

    body: RigidBody
    kp: Array
    kd: Array
    ki: Array
    integral_limit: Array
    gain_scale: Array

    def __post_init__(self) -> None:
        freeze(self, kp=(6,), kd=(6,), ki=(6,), integral_limit=(6,), gain_scale=(6,))

    @property
    def load_limit(self) -> Array:
        """Most of a load that is held against, shape (6,), in N and Nm: all that the thrusters can do.

        At the integral's own bound a current of half a metre a second on the beam, 80 N for an estimator that knew
        them, pushed `dp` .3 m aside with its thrusters at half their power.
        """
        return self.integral_limit / INTEGRAL_SHARE

    def init(self) -> PidState:
        """State before the first step."""
        return PidState.zero()

    def wrench(
        self, state: PidState, dt_s: float, estimate: BodyState, goal: Goal, *, saturated: bool = False
    ) -> tuple[PidState, Array]:
        """Wrench on the vehicle that leads it towards the goal, shape (6,), expressed in B.

        Errors are those of Goal over estimate in the body frame: position, rotation vector, and twist (the goal's
        twist is turned from its own body frame into B). Feed-forward, from the nominal vehicle: what holds it at the
        goal's attitude, the drag at the goal's twist in still water, the Coriolis and centripetal wrench that bends
        its path, and the inertia of the goal's own change of twist since the last step. What the estimator says pulls
        at the vehicle is held against (`BodyState.load_B`). While the last allocation could not make all of its
        wrench (`saturated`), the integral does not grow.
        """
        feed = -restoring_wrench(self.body, goal.X_WB.q)
        place = (goal.X_WB.p_m, goal.X_WB.q, goal.nu_B)
        integral, wrench, twist_B = self._pid(state, dt_s, estimate, *place, feed, saturated)
        wrench -= damping_wrench(self.body, twist_B) + coriolis_wrench(self.body, twist_B)
        wrench -= np.clip(estimate.load_B, -self.load_limit, self.load_limit)
        if state.goal_nu is not None and dt_s > 0.0:
            push = self.body.mass_matrix @ (goal.nu_B - state.goal_nu) / dt_s
            # A goal that jumps has no acceleration worth following.
            if np.all(np.abs(push) <= self.integral_limit):
                wrench += push
        return replace(integral, goal_nu=goal.nu_B), wrench

    def correction(
        self, state: PidState, dt_s: float, estimate: BodyState, goal: Goal, *, saturated: bool = False
    ) -> tuple[PidState, Array]:
        """The same without feed-forward, for a goal on a path whose thrusts are known; wrench in B, shape (6,)."""
        place = (goal.X_WB.p_m, goal.X_WB.q, goal.nu_B)
        integral, wrench, _ = self._pid(state, dt_s, estimate, *place, _NO_FEED, saturated)
        return integral, wrench

    def to_path(
        self, state: PidState, dt_s: float, estimate: BodyState, nominal: Array, *, saturated: bool = False
    ) -> tuple[PidState, Array]:
        """`correction` towards a state of a path, shape (13,): position, unit quaternion, twist; made read-only."""
        nominal.setflags(write=False)  # as goals are: the kernel is compiled for the one or the other
        integral, wrench, _ = self._pid(
            state, dt_s, estimate, nominal[:3], nominal[3:7], nominal[7:], _NO_FEED, saturated
        )
        return integral, wrench

    def _pid(
        self,
        state: PidState,
        dt_s: float,
        estimate: BodyState,
        goal_p: Array,
        goal_q: Array,
        goal_nu: Array,
        feed: Array,
        saturated: bool,
    ) -> tuple[PidState, Array, Array]:
        """New integral, wrench, and the goal's twist in B."""
        wrench = np.empty(6)
        force_W, moment_B = np.empty(3), np.empty(3)
        twist_B = np.empty(6)
        _pid(
            estimate.X_WB.p_m,
            estimate.X_WB.q,
            estimate.nu_B,
            goal_p,
            goal_q,
            goal_nu,
            state.force_W_N,
            state.moment_B_Nm,
            self.kp,
            self.kd,
            self.ki,
            self.integral_limit,
            dt_s,
            saturated,
            feed,
            wrench,
            twist_B,
            force_W,
            moment_B,
        )
        return PidState(force_W_N=force_W, moment_B_Nm=moment_B, goal_nu=state.goal_nu), wrench, twist_B


def make_pid(vehicle: Vehicle, settings: ControlSettings, *, slowed: bool = True) -> Pid:
    """PID for a nominal vehicle; if `slowed`, its gains are per axis as slow as the loop's margins ask for.

    Raises
    ------
    InputError
        If an axis has no stable bandwidth at all.
    """
    dt_s = 1.0 / settings.rate_hz
    forces = Gains(kp=settings.kp_N_m, kd=settings.kd_N_s_m, ki=settings.ki_N_m_s)
    scale = stable_gain_scale(vehicle, forces, dt_s, ESTIMATOR_LAG_S, GYRO_LAG_S) if slowed else np.ones(6)
    gains = [g.slowed(float(s)) for g, s in zip(desired_gains(vehicle_axes(vehicle), forces), scale, strict=True)]
    reach = np.minimum(-vehicle.thrust_lower_N, vehicle.thrust_upper_N)
    limit = INTEGRAL_SHARE * (np.abs(vehicle.allocation_matrix) @ reach)
    # The force integral lives in the world, where any body axis may have to supply it.
    limit[:3] = np.min(limit[:3][limit[:3] > 0.0], initial=np.inf) if np.any(limit[:3] > 0.0) else 0.0
    return Pid(
        body=compile_body(vehicle),
        kp=np.array([g.kp for g in gains]),
        kd=np.array([g.kd for g in gains]),
        ki=np.array([g.ki for g in gains]),
        integral_limit=limit,
        gain_scale=scale,
    )


@njit
def _turn(q: Array, v: Array, inverse: bool) -> Array:
    """Turn a vector by R(q), or by its inverse."""
    sign = -1.0 if inverse else 1.0
    w, x, y, z = q[0], sign * q[1], sign * q[2], sign * q[3]
    tx, ty, tz = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    return np.array(
        [
            v[0] + w * tx + y * tz - z * ty,
            v[1] + w * ty + z * tx - x * tz,
            v[2] + w * tz + x * ty - y * tx,
        ]
    )


@njit
def _pid(
    p: Array, q: Array, nu: Array, goal_p: Array, goal_q: Array, goal_nu: Array, force_W: Array, moment_B: Array,
    kp: Array, kd: Array, ki: Array, limit: Array, dt_s: float, saturated: bool, feed_G: Array, wrench: Array,
    twist_B: Array, new_force_W: Array, new_moment_B: Array,
) -> None:  # fmt: skip
    # q_BG = conj(q_WB) q_WG: the goal's attitude as seen from B, shorter way round.
    w = q[0] * goal_q[0] + q[1] * goal_q[1] + q[2] * goal_q[2] + q[3] * goal_q[3]
    x = q[0] * goal_q[1] - q[1] * goal_q[0] - q[2] * goal_q[3] + q[3] * goal_q[2]
    y = q[0] * goal_q[2] + q[1] * goal_q[3] - q[2] * goal_q[0] - q[3] * goal_q[1]
    z = q[0] * goal_q[3] - q[1] * goal_q[2] + q[2] * goal_q[1] - q[3] * goal_q[0]
    q_BG = np.array([w, x, y, z])
    half = np.sqrt(x * x + y * y + z * z)
    factor = 2.0 * np.arctan2(half, abs(w)) / half if half > 1e-12 else 2.0
    if w < 0.0:
        factor = -factor
    error = np.empty(6)
    assign(error[:3], _turn(q, goal_p - p, True))
    error[3], error[4], error[5] = factor * x, factor * y, factor * z
    assign(twist_B[:3], _turn(q_BG, goal_nu[:3], False))
    assign(twist_B[3:], _turn(q_BG, goal_nu[3:], False))
    # Weight against buoyancy is a world force: express the goal's feed-forward force in B, its moment as at the goal.
    feed_B = feed_G.copy()
    assign(feed_B[:3], _turn(q_BG, feed_G[:3], False))
    integral = np.empty(6)
    assign(integral[:3], _turn(q, force_W, True))
    assign(integral[3:], moment_B)
    for i in range(6):
        base = kp[i] * error[i] + kd[i] * (twist_B[i] - nu[i]) + feed_B[i]
        step = ki[i] * error[i] * dt_s
        # While limits cut the wrench, the integral may only fall back, never ask for more of the same.
        if not (saturated and step * (base + integral[i]) > 0.0):
            integral[i] = min(max(integral[i] + step, -limit[i]), limit[i])
        wrench[i] = base + integral[i]
    assign(new_force_W, _turn(q, integral[:3], False))
    assign(new_moment_B, integral[3:])
