"""Controller of a survey that allocates thrusts: from a target of the plan to thrusts that spare the bed.

The state is the autopilot's own: place and velocity of its filter (LOCAL_POSITION_NED), carried on over their age,
attitude and rates. `PassiveTiltPid` gives the wrench, null-space allocation for the region of `moving_region` the
thrusts, with the failsafe and the thruster model that all flights have.

What makes a survey blow at the bed is vertical thrust, which allocation alone cannot take away. So roll and pitch are
left to the hull, and pulses in the dead zone are long.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace

import numpy as np

from wakewise.control import ControlSettings, make_pid, with_failsafe, with_pwm
from wakewise.control.null_space_allocation import Allocator, allocation_context
from wakewise.control.pid import Pid
from wakewise.control.pipeline import Demand, MotionStage, Pipeline, PipelineState, hold
from wakewise.core.arrays import Array
from wakewise.core.errors import StageError
from wakewise.core.geometry import Pose, euler_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import Vehicle, compile_body, restoring_wrench
from wakewise.wake import wake_model
from wakewise_ardusub.survey.guided_messages import SurveyTarget
from wakewise_ardusub.survey.moving_region import MovingRegionAllocator, bed_region

RATE_HZ = 10.0
PULSE_S = 0.5
"""Shortest pulse and pause below a thruster's least thrust. At 0.1 s vertical thrusters answer the noise of the depth
target with pulses up and down, and the wash at the bed is a tenth to a third more."""
TILT_RAD = math.radians(10.0)
"""How far level thrusters may tilt the hull before vertical ones hold against it."""
LONGEST_SHARE = 0.5
"""Share of a control period that a step may take on this computer; receiving and judging need the rest."""
MEAN_S = 2.0
"""Time over which the weight is averaged."""
_STEPS = 24
_OTHERS = [0, 1, 2, 5]
"""Forces, and the moment about yaw."""


def settings_of() -> ControlSettings:
    """Settings of the controller."""
    return ControlSettings(rate_hz=RATE_HZ, pulse_s=PULSE_S)


@dataclass(frozen=True, kw_only=True, eq=False)
class PassiveTiltPid(MotionStage):
    """PID whose moments about roll and pitch are left to the hull's righting moment, as far as that tilts it little.

    Level thrusters that push below or above the origin pitch the hull. To hold it upright, vertical thrusters blow at
    the bed all the time. Here the demanded moment is the one that those thrusts have which make the other four
    components alone, at most `most_Nm`, shape (2,), and damping by the PID's own gains.
    """

    pid: Pid
    others: Array
    most_Nm: Array

    @classmethod
    def of(cls, vehicle: Vehicle, settings: ControlSettings, most_rad: float) -> PassiveTiltPid:
        """For a vehicle; `most_rad` is the tilt at which its righting moment equals the largest moment left to it."""
        B, body = vehicle.allocation_matrix, compile_body(vehicle)
        tilts = [quat_from_euler(most_rad, 0.0, 0.0), quat_from_euler(0.0, most_rad, 0.0)]
        most = [-float(restoring_wrench(body, q)[3 + k]) for k, q in enumerate(tilts)]
        others = B[3:5] @ np.linalg.pinv(B[_OTHERS])
        return cls(pid=make_pid(vehicle, settings), others=others, most_Nm=np.maximum(most, 0.0))

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the wrench for the next `dt_s` seconds; the goal's roll and pitch are not used."""
        roll, pitch, _ = euler_from_quat(estimate.X_WB.q)
        heading = euler_from_quat(goal.X_WB.q)[2]
        X_WB = Pose(goal.X_WB.p_m, quat_from_euler(float(roll), float(pitch), float(heading)))
        turned = np.concatenate([X_WB.R.T @ goal.X_WB.R @ goal.nu_B[:3], goal.nu_B[3:]])
        flown = replace(goal, X_WB=X_WB, nu_B=turned)
        pid, wrench = self.pid.wrench(state.pid, dt_s, estimate, flown, saturated=state.saturated)
        if not np.isfinite(wrench.sum()):
            return hold(state, dt_s, "wrench not finite")
        free = np.clip(self.others @ wrench[_OTHERS], -self.most_Nm, self.most_Nm)
        wrench[3:5] = free - self.pid.kd[3:5] * estimate.nu_B[3:5]
        return replace(state, pid=pid, goal_nu=flown.nu_B), Demand(wrench_B=wrench)


class SurveyController:
    """Thrusts for one survey, step by step.

    Parameters
    ----------
    vehicle : Vehicle
        As it is believed to be.
    settings : ControlSettings, optional
    """

    def __init__(self, vehicle: Vehicle, settings: ControlSettings | None = None) -> None:
        chosen = settings or settings_of()
        context = allocation_context(vehicle, bed_region(), wake_model(chosen.wake, 0.0), chosen)
        self._allocator = MovingRegionAllocator(inner=Allocator(layout=context.layout, context=context))
        pipeline = Pipeline(
            name="survey",
            layout=context.layout,
            motion=PassiveTiltPid.of(vehicle, chosen, TILT_RAD),
            allocator=self._allocator,
        )
        self._pipeline = with_pwm(with_failsafe(pipeline, vehicle, chosen), vehicle, chosen.pulse_s)
        self.begin()

    def begin(self) -> None:
        """Forget what was flown before."""
        self._state: PipelineState = self._pipeline.init()
        self.weight_N = 0.0
        """Weight in water by the vertical force of the last seconds; right where the vehicle is at rest."""

    def thrusts_N(
        self, estimate: BodyState, target: SurveyTarget, *, bed_m: float, way_rad: float, dt_s: float
    ) -> Array:
        """Thrusts, shape (n,), for the next `dt_s` seconds; `bed_m` is the depth of the bed, `way_rad` of the line."""
        self._allocator.bed_m, self._allocator.way_rad = bed_m, way_rad
        self._state, command = self._pipeline.step(self._state, dt_s, estimate, goal_of(target))
        lift_N = -float((estimate.X_WB.R @ command.wrench_B[:3])[2])
        self.weight_N += min(dt_s / MEAN_S, 1.0) * (lift_N - self.weight_N)
        return command.thrusts_N

    def warm_up(self) -> float:
        """Compile what is needed; the median time of the last steps in s.

        Raises
        ------
        StageError
            If a step takes more than `LONGEST_SHARE` of a period on this computer.
        """
        took_s, period_s = list[float](), 1.0 / RATE_HZ
        rest = np.array([0.0, 0.0, 4.0]), np.zeros(3), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0
        currents = (None, np.array([0.05, 0.02]))  # not known yet, and known: other kernels
        for k in range(_STEPS):
            began = time.perf_counter()
            target = SurveyTarget(place_W_m=np.array([0.01 * k, 0.0, 4.0 + 0.01 * k]))
            state = state_of_filter(*rest, currents[2 * k // _STEPS])
            self.thrusts_N(state, target, bed_m=math.nan if k == 0 else 5.0, way_rad=0.0, dt_s=period_s)
            took_s.append(time.perf_counter() - began)
        self.begin()
        median_s = float(np.median(took_s[1 + _STEPS // 2 :]))
        if median_s > LONGEST_SHARE * period_s:
            raise StageError(
                f"survey: a control step takes {1e3 * median_s:.0f} ms on this computer, must be at most "
                f"{1e3 * LONGEST_SHARE * period_s:.0f} ms; end what else runs here, or fly without --allocate"
            )
        return median_s


def goal_of(target: SurveyTarget) -> Goal:
    """The target as a goal of the controller: upright, its bow along the heading."""
    q = quat_from_euler(0.0, 0.0, target.heading_rad)
    X_WB = Pose(target.place_W_m, q)
    turn = np.array([0.0, 0.0, target.turn_rad_s])
    return Goal(X_WB=X_WB, nu_B=np.concatenate([X_WB.R.T @ target.velocity_W_m_s, turn]))


def state_of_filter(
    place_W_m: Array,
    velocity_W_m_s: Array,
    attitude_rad: tuple[float, float, float],
    rates_rad_s: tuple[float, float, float],
    age_s: float,
    current_W_m_s: Array | None = None,
) -> BodyState:
    """State by the autopilot's filter: its place, shape (3,), carried on by its velocity, shape (3,), over its age."""
    X_WB = Pose(place_W_m + age_s * velocity_W_m_s, quat_from_euler(*attitude_rad))
    rates = np.array([rate if math.isfinite(rate) else 0.0 for rate in rates_rad_s])
    nu_B = np.concatenate([X_WB.R.T @ velocity_W_m_s, rates])
    current = None if current_W_m_s is None else np.array([*current_W_m_s[:2], 0.0])
    return BodyState(X_WB=X_WB, nu_B=nu_B, current_W_m_s=current)
