"""The pilot `human`: a person who sees the video and whose two sticks ask for velocities, which any method makes.

Assisted teleoperation: the same person as in `manual` (`wakewise.operation.teleop.input`), but what lies behind the
sticks is a controller that holds the place they lead to, kept within a leash of the vehicle. What is wished is the
mission's route; how near the goals come to it is the person's doing. The velocity that the sticks lead to is shaped as
for hands at the desk (`steering.answered`); the desk's assists and what keeps it off things are the pilot `assisted`'s.

The person of `wakewise.operation.teleop.input` at the desk's sticks: eyes on the video, the same `Controls` as any
other hands.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from wakewise.control.motion_profile import limit_slew
from wakewise.control.operator_model import (
    CameraMotion,
    OperatorModel,
    OperatorModelState,
    StickDeflection,
    begin,
    sample_operator,
    steer,
)
from wakewise.control.velocity_reference import FULL_M_S, FULL_RAD_S
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, euler_from_quat, matrix_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal, Pilot
from wakewise.operation.teleop.arbitration import filtered_velocity, level_frame, limit_lead
from wakewise.operation.teleop.input import CENTRED, Controls
from wakewise.operation.teleop.motion import TURN_RAD_S2

ANSWER_S = 0.5
"""How much later the vehicle answers a velocity; estimate, from the trackers' bandwidth of two radians a second."""
STICKS = StickDeflection(
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

    reference: Pilot
    X_BC: Pose
    target_W_m: Array
    dt_s: float
    seed: int
    person: OperatorModel = field(init=False)
    _state: OperatorModelState = field(init=False)
    _place_W_m: Array = field(init=False)
    _velocity_m_s: Array = field(init=False)
    _change_m_s2: Array = field(init=False)
    _heading_rad: float = 0.0
    _turn_rad_s: float = 0.0

    def __post_init__(self) -> None:
        self.person = sample_operator(self.seed, STICKS)
        self._begin(np.zeros(3), 0.0)

    def _begin(self, place_W_m: Array, heading_rad: float) -> None:
        self._state, self._place_W_m, self._heading_rad = begin(self.person), place_W_m, heading_rad
        self._velocity_m_s, self._change_m_s2, self._turn_rad_s = np.zeros(3), np.zeros(3), 0.0

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Where the sticks have led to, moving as they ask, at the wished roll and pitch."""
        wished = self.reference.goal(time_s, estimate)
        roll_rad, pitch_rad, _ = euler_from_quat(wished.X_WB.q)
        if time_s <= 0.0:
            self._begin(np.array(estimate.X_WB.p_m), float(euler_from_quat(estimate.X_WB.q)[2]))
        view = CameraMotion.of(estimate.X_WB, estimate.nu_B, self.X_BC)
        wish = CameraMotion.of(wished.X_WB, wished.nu_B, self.X_BC)
        self._state, asked = steer(
            self.person, self._state, self.dt_s, view, wish, viewed_point(wished, self.X_BC, self.target_W_m)
        )
        before_m_s, before_rad_s = self._velocity_m_s, self._turn_rad_s
        self._velocity_m_s, self._change_m_s2 = filtered_velocity(before_m_s, self._change_m_s2, asked[:3], self.dt_s)
        self._turn_rad_s = limit_slew(before_rad_s, float(asked[3]), self.dt_s, TURN_RAD_S2)
        self._heading_rad += 0.5 * (before_rad_s + self._turn_rad_s) * self.dt_s
        # In the frame of the goal's heading: the estimate's own would steer with its noise.
        frame = level_frame(self._heading_rad)
        velocity_W = frame @ self._velocity_m_s
        way_W = frame @ (0.5 * (before_m_s + self._velocity_m_s))
        self._place_W_m = limit_lead(self._place_W_m, way_W, estimate, self.dt_s)
        q = quat_from_euler(roll_rad, pitch_rad, self._heading_rad)
        R_BW = matrix_from_quat(q).T
        turn_W = np.array([0.0, 0.0, self._turn_rad_s])
        return Goal(
            X_WB=Pose(self._place_W_m, q),
            nu_B=np.concatenate([R_BW @ velocity_W, R_BW @ turn_W]),
        )


def viewed_point(wished: Goal, X_BC: Pose, target_W_m: Array) -> Array:
    """What the wished picture has in its middle, shape (3,), as far off as the target is."""
    X_WC = wished.X_WB @ X_BC
    axis_W = X_WC.R[:, 2]
    return np.asarray(X_WC.p_m + axis_W * float((target_W_m - X_WC.p_m) @ axis_W))


@dataclass(kw_only=True, eq=False)
class SimulatedOperatorInput:
    """A `ControlSource` with eyes: a drawn person who would like to see what a pilot says.

    Parameters
    ----------
    wish : Pilot
        What the person would like to see: goals by the clock.
    X_BC : Pose
        Camera mount.
    target_W_m : ndarray, shape (3,)
        What is to be kept in the picture.
    dt_s : float
        Time between two looks.
    seed : int
        Which person it is.
    pressed : tuple of str
        What the person presses on taking the sticks.
    """

    reference: Pilot
    X_BC: Pose
    target_W_m: Array
    dt_s: float
    seed: int
    pressed: tuple[str, ...] = ("operator",)
    person: OperatorModel = field(init=False)
    _state: OperatorModelState = field(init=False)
    _controls: Controls = CENTRED

    def __post_init__(self) -> None:
        self.person = sample_operator(self.seed, STICKS)
        self._state = begin(self.person)

    def look(self, time_s: float, estimate: BodyState, share: float) -> None:
        """See where the vehicle is, and move the sticks; `share` is what full stick asks for, of the fastest."""
        if time_s <= 0.0:
            self._state = begin(self.person)
        wished = self.reference.goal(time_s, estimate)
        view = CameraMotion.of(estimate.X_WB, estimate.nu_B, self.X_BC)
        wish = CameraMotion.of(wished.X_WB, wished.nu_B, self.X_BC)
        seen = viewed_point(wished, self.X_BC, self.target_W_m)
        self._state, asked = steer(self.person, self._state, self.dt_s, view, wish, seen)
        full = share * np.array([FULL_M_S, FULL_M_S, FULL_M_S, FULL_RAD_S])
        pushed = np.clip(asked / full, -1.0, 1.0)
        first = time_s <= 0.0
        self._controls = Controls(axes=np.array([*pushed, 0.0]), pressed=self.pressed if first else ())

    def read(self, time_s: float) -> Controls:  # noqa: ARG002  (of the last look)
        """The sticks as they were moved on the last look."""
        return self._controls
