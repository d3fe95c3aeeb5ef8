"""`ardusub`: the loops and the mixer that such vehicles are shipped with, holding the mission's pose.

ArduSub's POSHOLD as its parameters and public source describe it (release 4; our own code). Horizontally: distance
times PSC_POSXY_P is a velocity, its error in a PID a desired acceleration, and the angle whose tangent is that over g,
over 45 degrees, a demand. Vertically: distance times PSC_POSZ_P, velocity times PSC_VELZ_P, and a PI of acceleration
for the throttle. Attitude: angle times ATC_ANG_*_P is a rate, its error in a PID a demand. `motor_mix.py` makes pulses
of them.

Gains. Attitude and throttle: the release's own (Tools/Frame_params/Sub/bluerov2-heavy-4_0_2.params). Position: those
that ArduSub's page on position hold suggests (ardusub.com/developers/dvl-integration.html: PSC_POSXY_P 2.5,
PSC_VELXY_P 5, I .5, D .8, PSC_POSZ_P 1, PSC_VELZ_P 5), which hold five times as stiffly as the release's.

Lowered where they oscillate. A BlueROV2 runs its loops 400 times a second; here it is the trial's rate, the estimator's
delay and another vehicle's inertia and lag. A pilot who sees a vehicle shake lowers the gains of that loop together.
So each axis is taken at the slope that the thrusters have at 2 N, and inner and outer gain are lowered by one factor
until the loop withstands twice the gain and 40 degrees of phase, the margins of all other methods (`gain_margins.py`).

In its favour: it has the estimator's pose and velocity like all, no magnetometer, no dead zone of its sticks; demands
are turned with the vehicle's roll and pitch, which matters pitched by 40 degrees; the goal's own velocity and rate are
fed forward. As shipped: no model of weight, drag or righting moment, and pulses in proportion to demands, so that 25
microseconds either way, a sixteenth of a demand, turn no propeller.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.control.gain_margins import Gains, axis_scale, vehicle_axes
from wakewise.control.motor_mix import MotorMix, motor_mix
from wakewise.control.null_space_allocation import vehicle_layout
from wakewise.control.pid import ESTIMATOR_LAG_S, GYRO_LAG_S
from wakewise.control.pipeline import Demand, MotionStage, Pipeline, PipelineState
from wakewise.control.settings import ControlSettings
from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.geometry import (
    euler_from_quat,
    matrix_from_quat,
    quat_conjugate,
    quat_from_euler,
    quat_multiply,
    rotvec_from_quat,
)
from wakewise.core.interfaces import BodyState, Goal, WakeModel
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake import InfluenceModel
from wakewise.wake.disturbance import disturbance

ANGLE_P = 6.0
RATE_P, RATE_I, RATE_D = np.array([0.135, 0.135, 0.18]), np.array([0.09, 0.09, 0.018]), np.array([0.0036, 0.0036, 0.0])
RATE_IMAX, RATE_D_HZ = np.array([0.444, 0.444, 0.222]), 30.0
"""ATC_ANG_*_P in 1/s, ATC_RAT_*_P, _I, _D in 1/(rad/s), 1/rad and 1/(rad/s2), the integral's limit, the D term's
filter; roll, pitch, yaw."""
POSITION_P, VELOCITY_P = np.array([2.5, 2.5, 1.0]), np.array([5.0, 5.0, 5.0])
VELOCITY_I, VELOCITY_D, VELOCITY_HZ, VELOCITY_IMAX_M_S2 = 0.5, 0.8, 5.0, 10.0
"""PSC_POSXY_P and PSC_POSZ_P in 1/s, PSC_VELXY_P and PSC_VELZ_P in 1/s; I in 1/s2, D and filter of the horizontal
velocity, and the limit of its integral."""
LEAN_RAD = math.radians(45.0)
"""Lean that is a demand of 1 (ANGLE_MAX)."""
CLIMB_P, CLIMB_I, CLIMB_IMAX, CLIMB_HZ = 0.1, 0.02, 0.2, 20.0
"""PSC_ACCZ_P .5, PSC_ACCZ_I .1 and PSC_ACCZ_IMAX 100, which count per mille of the throttle's half range and cm/s2, as
demand per m/s2; and the filter of the acceleration's error."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ArduSubState:
    """Integrals of rate (roll, pitch, yaw), of velocity (north, east, m/s2) and of climb, and the filters' memories.

    Shapes: (3,), (2,), a float; `rate_error`, `rate_slope` (3,), `velocity_error`, `velocity_slope` (2,),
    `climb_error` a float, `v_W_m_s` (3,) or None before the first step.
    """

    rate_sum: Array
    velocity_sum: Array
    rate_error: Array
    rate_slope: Array
    velocity_error: Array
    velocity_slope: Array
    climb_sum: float = 0.0
    climb_error: float = 0.0
    v_W_m_s: Array | None = None

    def __post_init__(self) -> None:
        freeze(self, rate_sum=(3,), velocity_sum=(2,), rate_error=(3,), rate_slope=(3,))

    @classmethod
    def zero(cls) -> ArduSubState:
        """Before the first step."""
        none2, none3 = np.zeros(2), np.zeros(3)
        return cls(
            rate_sum=none3,
            velocity_sum=none2,
            rate_error=none3,
            rate_slope=none3,
            velocity_error=none2,
            velocity_slope=none2,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class ArduSubStage(MotionStage):
    """Motion stage with a mixer of its own, which is part of what is compared; make a pipeline with `ardusub`.

    `lowered`, shape (6,), is what the margins left of the gains: roll, pitch, yaw, north, east, down.
    """

    mix: MotorMix
    lowered: Array
    allocation: Array
    view: InfluenceModel

    def begin(self, state: PipelineState) -> PipelineState:
        """State before the first step."""
        return replace(state, ardusub=ArduSubState.zero())

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the thrusts for the next `dt_s` seconds."""
        loops, grows = state.ardusub or ArduSubState.zero(), not state.saturated
        loops, turns = self._attitude(loops, grows, dt_s, estimate, goal)
        loops, moves = self._position(loops, grows, dt_s, estimate, goal)
        outputs, saturated = self.mix.outputs(np.array([*turns, moves[2], moves[0], moves[1]]))
        thrusts = self.mix.thrusts_N(outputs)
        gram = self.view.gram(estimate.X_WB)
        demand = Demand(
            wrench_B=self.allocation @ thrusts,
            thrusts_N=thrusts,
            disturbance=float(disturbance(gram, thrusts)) if np.isfinite(gram).all() else None,
            trouble="motors saturated" if saturated else None,
        )
        return replace(state, ardusub=loops, saturated=saturated), demand

    def _attitude(
        self, state: ArduSubState, grows: bool, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[ArduSubState, Array]:
        """Demands of roll, pitch and yaw, shape (3,)."""
        q_BG = quat_multiply(quat_conjugate(estimate.X_WB.q), goal.X_WB.q)
        desired = ANGLE_P * self.lowered[:3] * rotvec_from_quat(q_BG) + matrix_from_quat(q_BG) @ goal.nu_B[3:]
        error = desired - estimate.nu_B[3:]
        share = _share(dt_s, RATE_D_HZ)
        slope = state.rate_slope + share * ((error - state.rate_error) / dt_s - state.rate_slope)
        total = state.rate_sum
        if grows:
            total = np.clip(total + RATE_I * self.lowered[:3] * error * dt_s, -RATE_IMAX, RATE_IMAX)
        demand = self.lowered[:3] * (RATE_P * error + RATE_D * slope) + total
        return replace(state, rate_error=error, rate_slope=slope, rate_sum=total), demand

    def _position(
        self, state: ArduSubState, grows: bool, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[ArduSubState, Array]:
        """Demands forward, lateral and throttle (up) in the vehicle's own frame, shape (3,)."""
        R_WB, low = estimate.X_WB.R, self.lowered[3:]
        v_W = R_WB @ estimate.nu_B[:3]
        off_W = goal.X_WB.p_m - estimate.X_WB.p_m
        error_W = POSITION_P * low * off_W + goal.X_WB.R @ goal.nu_B[:3] - v_W
        share = _share(dt_s, VELOCITY_HZ)
        error = state.velocity_error + share * (error_W[:2] - state.velocity_error)
        slope = state.velocity_slope + share * ((error - state.velocity_error) / dt_s - state.velocity_slope)
        total = state.velocity_sum
        if grows:
            total = total + VELOCITY_I * low[:2] * error * dt_s
            total = total * min(1.0, VELOCITY_IMAX_M_S2 / max(float(np.linalg.norm(total)), 1e-9))
        desired_W = low[:2] * (VELOCITY_P[:2] * error + VELOCITY_D * slope) + total
        before_W = v_W if state.v_W_m_s is None else state.v_W_m_s
        off_a = VELOCITY_P[2] * low[2] * error_W[2] - (v_W[2] - before_W[2]) / dt_s
        climb_error = state.climb_error + _share(dt_s, CLIMB_HZ) * (off_a - state.climb_error)
        climb = state.climb_sum
        if grows:
            climb = float(np.clip(climb + CLIMB_I * climb_error * dt_s, -CLIMB_IMAX, CLIMB_IMAX))
        _, _, heading_rad = euler_from_quat(estimate.X_WB.q)
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        ahead, aside = c * desired_W[0] + s * desired_W[1], c * desired_W[1] - s * desired_W[0]
        demands = np.array(
            [
                np.clip(math.atan(ahead / GRAVITY_M_S2) / LEAN_RAD, -1.0, 1.0),
                np.clip(math.atan(aside / GRAVITY_M_S2) / LEAN_RAD, -1.0, 1.0),
                np.clip(-(CLIMB_P * climb_error + climb), -1.0, 1.0),
            ]
        )
        # As forces in the level frame of the heading, then in B, then as demands again; down is against the throttle.
        reach = self.mix.reach[[4, 5, 3]] * np.array([1.0, 1.0, -1.0])
        R_BL = R_WB.T @ matrix_from_quat(quat_from_euler(0.0, 0.0, heading_rad))
        after = replace(
            state,
            velocity_error=error,
            velocity_slope=slope,
            velocity_sum=total,
            climb_error=float(climb_error),
            climb_sum=climb,
            v_W_m_s=v_W,
        )
        return after, np.asarray((R_BL @ (reach * demands)) / reach)


def _share(dt_s: float, cutoff_Hz: float) -> float:
    """Share of the way that a first-order filter goes in a step."""
    return dt_s / (dt_s + 1.0 / (2.0 * math.pi * cutoff_Hz))


def lowered_gains(vehicle: Vehicle, mix: MotorMix, dt_s: float) -> Array:
    """What the margins leave of the gains, shape (6,) in (0, 1]: roll, pitch, yaw, north, east, down.

    Inner and outer gain of an axis are lowered by the same factor, which is what `Gains.slowed` does to a PID.

    Raises
    ------
    InputError
        If an axis has no stable gains at all.
    """
    axes, lag_s = vehicle_axes(vehicle), float(vehicle.time_constants_s.max())
    filter_s = 1.0 / (2.0 * math.pi * VELOCITY_HZ)
    found = np.ones(6)
    for i in range(6):
        if i < 3:
            k, delay_s, axis = float(mix.reach[i]), GYRO_LAG_S, axes[3 + i]
            p, integral = float(RATE_P[i]), float(RATE_I[i])
            gains = Gains(kp=k * (ANGLE_P * p + integral), kd=k * p, ki=k * ANGLE_P * integral)
        elif i < 5:
            # Forward and lateral alternate with the heading; the stronger of them is taken for both.
            k = float(mix.reach[4:].max()) / (GRAVITY_M_S2 * LEAN_RAD)
            delay_s, axis = ESTIMATOR_LAG_S + filter_s, min(axes[:2], key=lambda a: a.mass)
            axis = replace(axis, mass=axis.mass + k * VELOCITY_D)
            outer, inner = float(POSITION_P[0]), float(VELOCITY_P[0])
            gains = Gains(kp=k * (outer * inner + VELOCITY_I), kd=k * inner, ki=k * outer * VELOCITY_I)
        else:
            k, delay_s = float(mix.reach[3]), ESTIMATOR_LAG_S
            axis = replace(axes[2], mass=axes[2].mass + k * CLIMB_P)
            outer, inner = float(POSITION_P[2]), float(VELOCITY_P[2])
            gains = Gains(
                kp=k * inner * (CLIMB_P * outer + CLIMB_I),
                kd=k * (CLIMB_P * inner + CLIMB_I),
                ki=k * CLIMB_I * inner * outer,
            )
        scale = axis_scale(axis, gains, dt_s, lag_s, delay_s)
        if scale is None:
            name = ("roll", "pitch", "yaw", "north", "east", "down")[i]
            raise InputError(f"ardusub: {vehicle.name} oscillates in {name} with a hundredth of the gains")
        found[i] = scale
    return found


def ardusub(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    _: Surroundings | None = None,
) -> Pipeline:
    """`ardusub`: position hold as shipped; the wake model is only asked what D the thrusts cause.

    Raises
    ------
    InputError
        If the vehicle's thrusters are not those of the frame vectored_6dof.
    """
    mix = motor_mix(vehicle)
    motion = ArduSubStage(
        mix=mix,
        lowered=lowered_gains(vehicle, mix, 1.0 / settings.rate_hz),
        allocation=vehicle.allocation_matrix,
        view=InfluenceModel.of(vehicle, region, wake, settings.superposition),
    )
    return Pipeline(name="ardusub", layout=vehicle_layout(vehicle), motion=motion)
