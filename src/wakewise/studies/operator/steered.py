"""A script at the sticks: what it asks for becomes goals as any operator's wish does (`wakewise.control.intent`)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wakewise.arrays import Array
from wakewise.control.intent import Intent, goal_of, moved_on, slewed
from wakewise.geometry import Pose, euler_from_quat
from wakewise.interfaces import BodyState, Goal
from wakewise.studies.operator.courses import SLEW_M_S2, Course


@dataclass(kw_only=True, eq=False)
class Steered:
    """A `Pilot` that flies a course; begins afresh at time zero.

    Parameters
    ----------
    course : Course
    start : Pose
        X_WB.
    watch_W_m : ndarray, shape (3,), or None
        What the camera is kept on.
    dt_s : float
    """

    course: Course
    start: Pose
    watch_W_m: Array | None
    dt_s: float
    velocity_W_m_s: Array = field(default_factory=lambda: np.zeros(3))
    place_W_m: Array = field(init=False)

    def __post_init__(self) -> None:
        self.place_W_m = self.start.p_m

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Where the sticks have led to, moving as they ask."""
        if time_s <= 0.0:
            self.velocity_W_m_s, self.place_W_m = np.zeros(3), self.start.p_m
        forward, right, down = self.course.asked_m_s(time_s)
        heading = float(euler_from_quat(estimate.X_WB.q)[2])
        c, s = math.cos(heading), math.sin(heading)
        wished = np.array([c * forward - s * right, s * forward + c * right, down])
        self.velocity_W_m_s = slewed(self.velocity_W_m_s, wished, self.dt_s, SLEW_M_S2)
        self.place_W_m = moved_on(self.place_W_m, self.velocity_W_m_s, estimate, self.dt_s)
        kept = float(euler_from_quat(self.start.q)[2])
        return goal_of(
            Intent(velocity_W_m_s=self.velocity_W_m_s, watch_W_m=self.watch_W_m, heading_rad=kept), self.place_W_m
        )
