"""The pilot `human`: a person who sees the video and whose two sticks ask for velocities, which any method makes.

Assisted teleoperation: the same person as in `manual` (`wakewise.pilot`), but what lies behind the sticks is a
controller that holds the place they lead to, kept within a leash of the vehicle. What is wished is the mission's route;
how near the goals come to it is the person's doing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from wakewise.arrays import Array
from wakewise.control.intent import FULL_M_S, FULL_RAD_S, moved_on
from wakewise.geometry import Pose, euler_from_quat, matrix_from_quat, quat_from_euler
from wakewise.interfaces import BodyState, Goal, Pilot
from wakewise.pilot import Person, PersonState, Sticks, View, begin, draw_person, steer

ANSWER_S = 0.5
"""How much later the vehicle answers a velocity; estimate, from the trackers' bandwidth of two radians a second."""
STICKS = Sticks(
    inertia=np.zeros(4),
    drag=np.zeros(4),
    full=np.array([FULL_M_S, FULL_M_S, FULL_M_S, FULL_RAD_S]),
    lag_s=np.full(4, ANSWER_S),
)


@dataclass(kw_only=True, eq=False)
class HumanPilot:
    """A `Pilot` with a memory, which begins afresh at time zero.

    Parameters
    ----------
    wish : Pilot
        What the person would like to see: goals by the clock.
    X_BC : Pose
        Camera mount.
    target_W_m : ndarray, shape (3,)
        What is to be kept in the picture.
    dt_s : float
        Time between two goals.
    seed : int
        Which person it is.
    """

    wish: Pilot
    X_BC: Pose
    target_W_m: Array
    dt_s: float
    seed: int
    person: Person = field(init=False)
    _state: PersonState = field(init=False)
    _place_W_m: Array = field(init=False)
    _heading_rad: float = 0.0

    def __post_init__(self) -> None:
        self.person = draw_person(self.seed, STICKS)
        self._state, self._place_W_m = begin(self.person), np.zeros(3)

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Where the sticks have led to, moving as they ask, at the wished roll and pitch."""
        wished = self.wish.goal(time_s, estimate)
        roll_rad, pitch_rad, _ = euler_from_quat(wished.X_WB.q)
        if time_s <= 0.0:
            self._state, self._place_W_m = begin(self.person), np.array(estimate.X_WB.p_m)
            self._heading_rad = float(euler_from_quat(estimate.X_WB.q)[2])
        view = View.of(estimate.X_WB, estimate.nu_B, self.X_BC)
        wish = View.of(wished.X_WB, wished.nu_B, self.X_BC)
        self._state, asked = steer(
            self.person, self._state, self.dt_s, view, wish, watched(wished, self.X_BC, self.target_W_m)
        )
        c, s = math.cos(view.heading_rad), math.sin(view.heading_rad)
        velocity_W = np.array([c * asked[0] - s * asked[1], s * asked[0] + c * asked[1], asked[2]])
        self._place_W_m = moved_on(self._place_W_m, velocity_W, estimate, self.dt_s)
        self._heading_rad += float(asked[3]) * self.dt_s
        q = quat_from_euler(roll_rad, pitch_rad, self._heading_rad)
        R_BW = matrix_from_quat(q).T
        turn_W = np.array([0.0, 0.0, asked[3]])
        return Goal(
            X_WB=Pose(self._place_W_m, q),
            nu_B=np.concatenate([R_BW @ velocity_W, R_BW @ turn_W]),
        )


def watched(wished: Goal, X_BC: Pose, target_W_m: Array) -> Array:
    """What the wished picture has in its middle, shape (3,), as far off as the target is."""
    X_WC = wished.X_WB @ X_BC
    axis_W = X_WC.R[:, 2]
    return np.asarray(X_WC.p_m + axis_W * float((target_W_m - X_WC.p_m) @ axis_W))
