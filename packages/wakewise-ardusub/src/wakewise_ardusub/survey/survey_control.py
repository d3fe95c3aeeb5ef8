"""Controller of a survey that allocates thrusts: from a target of the plan to thrusts that spare the bed.

The state is the autopilot's own: place and velocity of its filter (LOCAL_POSITION_NED), carried on over their age,
attitude and rates. A PID with feed-forward gives the wrench. Null-space allocation for the moving region of
`moving_region` makes the thrusts, with the failsafe and the thruster model that all flights have.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from wakewise.control import ControlSettings, make_pid, with_failsafe, with_pwm
from wakewise.control.null_space_allocation import Allocator, allocation_context
from wakewise.control.pipeline import Pipeline, PipelineState, TrackingStage
from wakewise.core.arrays import Array
from wakewise.core.errors import StageError
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal
from wakewise.robot.vehicles import Vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.survey.guided_messages import SurveyTarget
from wakewise_ardusub.survey.moving_region import MovingRegionAllocator, bed_region

RATE_HZ = 10.0
LONGEST_SHARE = 0.5
"""Share of a control period that a step may take on this computer; receiving and judging need the rest."""
_STEPS = 12


def settings_of() -> ControlSettings:
    """Settings of the controller."""
    return ControlSettings(rate_hz=RATE_HZ)


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
            motion=TrackingStage(pid=make_pid(vehicle, chosen)),
            allocator=self._allocator,
        )
        self._pipeline = with_pwm(with_failsafe(pipeline, vehicle, chosen), vehicle, chosen.pulse_s)
        self._state: PipelineState = self._pipeline.init()

    def begin(self) -> None:
        """Forget what was flown before."""
        self._state = self._pipeline.init()

    def thrusts_N(
        self, estimate: BodyState, target: SurveyTarget, *, bed_m: float, way_rad: float, dt_s: float
    ) -> Array:
        """Thrusts, shape (n,), for the next `dt_s` seconds; `bed_m` is the depth of the bed, `way_rad` of the line."""
        self._allocator.bed_m, self._allocator.way_rad = bed_m, way_rad
        self._state, command = self._pipeline.step(self._state, dt_s, estimate, goal_of(target))
        return command.thrusts_N

    def rehearse(self) -> float:
        """Compile what is needed; the longest of the last steps in s.

        Raises
        ------
        StageError
            If a step takes more than `LONGEST_SHARE` of a period on this computer.
        """
        longest, period_s = 0.0, 1.0 / RATE_HZ
        state = BodyState(X_WB=Pose(np.array([0.0, 0.0, 4.0]), np.array([1.0, 0.0, 0.0, 0.0])))
        state = replace(state, current_W_m_s=np.array([0.05, 0.02, 0.0]))
        for k in range(_STEPS):
            began = time.perf_counter()
            target = SurveyTarget(place_W_m=np.array([0.01 * k, 0.0, 4.0 + 0.01 * k]))
            self.thrusts_N(state, target, bed_m=5.0, way_rad=0.0, dt_s=period_s)
            longest = max(longest, time.perf_counter() - began) if 2 * k >= _STEPS else 0.0
        self.begin()
        if longest > LONGEST_SHARE * period_s:
            raise StageError(
                f"survey: a control step takes {1e3 * longest:.0f} ms on this computer, must be at most "
                f"{1e3 * LONGEST_SHARE * period_s:.0f} ms; end what else runs here, or fly without --allocate"
            )
        return longest


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
