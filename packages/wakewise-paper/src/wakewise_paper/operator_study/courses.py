"""What a pilot asks for: three courses of a script, and a route that the human model flies by eye.

Velocities are asked in the vehicle's level frame, as sticks do: forward along its heading, right, down. Every course
begins with `SETTLE_S` of rest, like the gentle bench's, so that what holds the vehicle has come to the target by then.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.control.intent import FULL_M_S
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.operation.teleop.input import Controls
from wakewise.scene.missions import Leg, Route
from wakewise.scene.missions.route import rest_to_rest
from wakewise.scene.targets import Target
from wakewise_paper.wash_reduction.routes import SETTLE_S, joined, resting, top_above_centre_m

SPEED_M_S, CLIMB_M_S = 0.10, 0.05
SLEW_M_S2 = 0.1
ELEVATION_DEG, CLIMBED_DEG = 30.0, 50.0
"""Where a course begins; the middle of a mission's lower two orbits. The human climbs to between its upper two."""
APPROACH_M, LOOK_ARC_M, LOOK_REST_S = 0.4, 0.5, 3.0
ABOVE_M, HALF_HULL_M, HALF_WAY_M = 0.2, 0.14, 0.3
"""Left between hull and target by `over`; half the height of the paper's hull; half of the way to and fro."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """What a script asks for.

    `legs` are seconds and velocity forward, right, down in m/s, one after the other, from the end of rest on.
    `watches`: the camera is kept on the target; otherwise the vehicle is level and keeps its heading. `outside_m`: so
    much farther off than the standoff it begins.
    """

    legs: tuple[tuple[float, tuple[float, float, float]], ...]
    watches: bool = True
    outside_m: float = 0.0

    @property
    def duration_s(self) -> float:
        """How long it asks, without the rest."""
        return sum(seconds for seconds, _ in self.legs)

    def asked_m_s(self, time_s: float) -> Array:
        """Velocity asked `time_s` after the start, shape (3,); none at rest and after the end."""
        left_s = time_s - SETTLE_S
        for seconds, velocity in self.legs:
            if 0.0 <= left_s < seconds:
                return np.array(velocity)
            left_s -= seconds
        return np.zeros(3)


@dataclass(frozen=True, eq=False)
class CourseInput:
    """A `ControlSource` that flies a course; `share` is what full stick asks for, of the fastest."""

    course: Course
    share: float

    def read(self, time_s: float) -> Controls:
        """The sticks of that time."""
        return Controls(axes=np.array([*self.course.asked_m_s(time_s) / (FULL_M_S * self.share), 0.0, 0.0]))


COURSES = {
    "front": Course(
        legs=(
            (4.0, (0.0, SPEED_M_S, 0.0)),
            (4.0, (0.0, 0.0, -CLIMB_M_S)),
            (4.0, (0.0, -SPEED_M_S, 0.0)),
            (4.0, (0.0, 0.0, CLIMB_M_S)),
        )
    ),
    "over": Course(legs=((6.0, (SPEED_M_S, 0.0, 0.0)), (6.0, (-SPEED_M_S, 0.0, 0.0))), watches=False),
    "look": Course(
        legs=(
            (APPROACH_M / SPEED_M_S, (SPEED_M_S, 0.0, 0.0)),
            (LOOK_ARC_M / SPEED_M_S, (0.0, SPEED_M_S, 0.0)),
            (LOOK_REST_S, (0.0, 0.0, 0.0)),
            (4.0, (0.0, 0.0, -CLIMB_M_S)),
        ),
        outside_m=APPROACH_M,
    ),
}
"""In the order of the Latin square (see `waters`)."""
SQUARE = tuple(COURSES)


def operator_route(centre_W_m: Array, duration_s: float) -> Route:
    """Rest, then a leg of this length that says nothing of where to be, with photographs."""
    return joined(centre_W_m, (resting("operator", np.array([0.0, 0.0, 1.0]), duration_s),), ("operator",))


def look_route(centre_W_m: Array, azimuth_rad: float, standoff_m: float) -> Route:
    """What the human would like to see: `look` as a route, by the clock and on the sphere."""
    elevation, climbed = np.radians((ELEVATION_DEG, CLIMBED_DEG))
    # To the right of a camera that looks inward is towards smaller azimuths, seen from above with x north, y east.
    turn = -LOOK_ARC_M / (standoff_m * np.cos(elevation))
    far = np.array([azimuth_rad, elevation, standoff_m + APPROACH_M])
    near = np.array([azimuth_rad, elevation, standoff_m])
    round_ = near + np.array([turn, 0.0, 0.0])
    legs: tuple[Leg, ...] = (
        rest_to_rest("approach", far, near, SPEED_M_S, SLEW_M_S2),
        rest_to_rest("arc", near, round_, SPEED_M_S, SLEW_M_S2),
        resting("stop", round_, LOOK_REST_S),
        rest_to_rest("climb", round_, np.array([round_[0], climbed, standoff_m]), CLIMB_M_S, SLEW_M_S2),
    )
    return joined(centre_W_m, legs, tuple(leg.name for leg in legs))


def start_pose(course: Course, target: Target, azimuth_rad: float, standoff_m: float, X_BC: Pose) -> Pose:
    """Where a course begins, X_WB: its camera on the target from outside, or level above it."""
    centre = target.centre_W_m
    if not course.watches:
        inward = np.array([np.cos(azimuth_rad + np.pi), np.sin(azimuth_rad + np.pi), 0.0])
        up_m = top_above_centre_m(target) + ABOVE_M + HALF_HULL_M
        return Pose(centre - HALF_WAY_M * inward - [0.0, 0.0, up_m], quat_from_euler(0.0, 0.0, azimuth_rad + np.pi))
    place = np.array([azimuth_rad, np.radians(ELEVATION_DEG), standoff_m + course.outside_m])
    return joined(centre, (resting("start", place, 0.0),), ()).body(0.0, X_BC).X_WB
