"""Simulated operator: the pilot `human`, and the stick inputs of the pilot `assisted`.

The operator (`wakewise.control.operator_model`, the same as in the method `manual`) sees the video and flies a
reference route by eye. In `HumanPilot` the sticks command velocities; the goal is the integrated position, limited to a
lead over the vehicle, and any method tracks it. `SimulatedOperatorInput` gives the same operator's stick deflections,
to be used with the assists of `wakewise.operation.teleop.assisted`.
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
"""Delay of the vehicle's velocity after the sticks, as the operator expects it; an estimate from the PID's bandwidth of
2 rad/s.
"""
STICKS = StickDeflection(
    inertia=np.zeros(4),
    drag=np.zeros(4),
    full=np.array([FULL_M_S, FULL_M_S, FULL_M_S, FULL_RAD_S]),
    lag_s=np.full(4, ANSWER_S),
)


@dataclass(kw_only=True, eq=False)
class _OperatorByEye:
    """A simulated operator who flies a reference by eye; its state is reset at time zero.

    `X_BC` is the camera mount, `target_W_m` (3,) the point to be kept in the picture, `dt_s` the time between two calls
    and `seed` selects the operator.
    """

    reference: Pilot
    X_BC: Pose
    target_W_m: Array
    dt_s: float
    seed: int
    operator: OperatorModel = field(init=False)
    _state: OperatorModelState = field(init=False)

    def __post_init__(self) -> None:
        self.operator = sample_operator(self.seed, STICKS)
        self._state = begin(self.operator)

    def _steer(self, time_s: float, estimate: BodyState) -> tuple[Goal, Array]:
        """The reference goal, and the velocities that the operator commands: forward, right, down, turn, shape (4,)."""
        if time_s <= 0.0:
            self._state = begin(self.operator)
        reference = self.reference.goal(time_s, estimate)
        view = CameraMotion.of(estimate.X_WB, estimate.nu_B, self.X_BC)
        wanted = CameraMotion.of(reference.X_WB, reference.nu_B, self.X_BC)
        seen = viewed_point(reference, self.X_BC, self.target_W_m)
        self._state, asked = steer(self.operator, self._state, self.dt_s, view, wanted, seen)
        return reference, asked


@dataclass(kw_only=True, eq=False)
class HumanPilot(_OperatorByEye):
    """A `Pilot` whose goal is the integrated command of the operator's sticks."""

    _place_W_m: Array = field(default_factory=lambda: np.zeros(3))
    _velocity_m_s: Array = field(default_factory=lambda: np.zeros(3))
    _change_m_s2: Array = field(default_factory=lambda: np.zeros(3))
    _heading_rad: float = 0.0
    _turn_rad_s: float = 0.0

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Integrated position and velocity of the sticks' commands, with roll and pitch of the reference."""
        if time_s <= 0.0:
            self._place_W_m = np.array(estimate.X_WB.p_m)
            self._heading_rad = float(euler_from_quat(estimate.X_WB.q)[2])
            self._velocity_m_s, self._change_m_s2, self._turn_rad_s = np.zeros(3), np.zeros(3), 0.0
        reference, asked = self._steer(time_s, estimate)
        roll_rad, pitch_rad, _ = euler_from_quat(reference.X_WB.q)
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


def viewed_point(reference: Goal, X_BC: Pose, target_W_m: Array) -> Array:
    """Point on the optical axis of a goal's camera at the distance of the target, both shape (3,)."""
    X_WC = reference.X_WB @ X_BC
    axis_W = X_WC.R[:, 2]
    return np.asarray(X_WC.p_m + axis_W * float((target_W_m - X_WC.p_m) @ axis_W))


@dataclass(kw_only=True, eq=False)
class SimulatedOperatorInput(_OperatorByEye):
    """A `ControlSource`: stick deflections of the operator. `pressed` are the actions at time zero."""

    pressed: tuple[str, ...] = ("operator",)
    _controls: Controls = CENTRED

    def look(self, time_s: float, estimate: BodyState, share: float) -> None:
        """Compute the deflections from the estimate; full stick means this `share` of the largest speeds."""
        _, asked = self._steer(time_s, estimate)
        full = share * np.array([FULL_M_S, FULL_M_S, FULL_M_S, FULL_RAD_S])
        pushed = np.clip(asked / full, -1.0, 1.0)
        first = time_s <= 0.0
        self._controls = Controls(axes=np.array([*pushed, 0.0]), pressed=self.pressed if first else ())

    def read(self, time_s: float) -> Controls:
        """The stick deflections that the last call of `look` computed."""
        del time_s
        return self._controls
