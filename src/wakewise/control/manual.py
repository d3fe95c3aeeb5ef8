"""`manual`: a person at two sticks, the autopilot that such vehicles have, and direct allocation.

Flown as BlueROV2 and its kin are flown, in ArduSub's ALT_HOLD: sticks for forward and right push straight through, at
the pilot's gain; the stick for down asks for a rate of climb and holds the depth where it is let go, that for turn
asks for a rate and holds the heading; roll and pitch are held level, or at the angle that is set. The wrench is
shared out by the pseudo-inverse, which for ArduSub's vectored_6dof frame is its motor factors up to a scale per axis.
The person sees what the estimator says, late (`wakewise.control.operator_model`), and knows neither jets nor target's
water.

Assumed, in favour of the person: the autopilot holds depth, heading and attitude with the gains of `dp` and knows the
righting moment; full stick makes the least thrust that any mix of thrusters reaches along its axis; the angle of
pitch is set as the mission wants it. ArduSub's factory rates: 5 m/s of climb and 3.375 x 45 deg/s of turn at full
stick (PILOT_SPEED_UP, ACRO_YAW_P, 4.0.0), both times the pilot's gain.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.control.null_space_allocation import least_thrust_allocator, vehicle_layout
from wakewise.control.operator_model import (
    CameraMotion,
    OperatorModel,
    OperatorModelState,
    StickDeflection,
    begin,
    sample_operator,
    steer,
)
from wakewise.control.operator_population import POPULATION, OperatorPopulation
from wakewise.control.pid import Pid, PidState, make_pid
from wakewise.control.pipeline import Demand, MotionStage, Pipeline, PipelineState
from wakewise.control.settings import ControlSettings
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, euler_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState, Goal, WakeModel
from wakewise.planning import Surroundings
from wakewise.robot.vehicles import Vehicle, restoring_wrench
from wakewise.scene.targets import Region

CLIMB_M_S, TURN_RAD_S = 5.0, math.radians(3.375 * 45.0)
"""What full stick asks for at gain 1 (ArduSub 4.0.0, BlueROV2)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ManualState:
    """OperatorModel, the autopilot's set points, and its integral of depth (N). `depth_m` is None before the first
    step.
    """

    person: OperatorModelState
    depth_m: float | None = None
    heading_rad: float = 0.0
    lift_N: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ManualStage(MotionStage):
    """Motion stage flown by hand: sticks and autopilot give the wrench."""

    person: OperatorModel
    pid: Pid
    X_BC: Pose
    middle_W_m: Array

    def begin(self, state: PipelineState) -> PipelineState:
        """State before the first step."""
        return replace(state, manual=ManualState(person=begin(self.person)))

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the wrench for the next `dt_s` seconds."""
        before = state.manual or ManualState(person=begin(self.person))
        goal_view = CameraMotion.of(goal.X_WB, goal.nu_B, self.X_BC)
        now = CameraMotion.of(estimate.X_WB, estimate.nu_B, self.X_BC)
        person, asked = steer(self.person, before.person, dt_s, now, goal_view, self._watched(goal))
        manual = replace(before, person=person)
        pid, manual, wrench = self._autopilot(state, manual, dt_s, estimate, goal, asked)
        return replace(state, pid=pid, manual=manual, goal_nu=goal.nu_B), Demand(wrench_B=wrench)

    def _watched(self, goal: Goal) -> Array:
        """What the desired picture has in its middle, shape (3,): on its axis, as far as the target is."""
        X_WC = goal.X_WB @ self.X_BC
        axis_W = X_WC.R[:, 2]
        return np.asarray(X_WC.p_m + axis_W * float((self.middle_W_m - X_WC.p_m) @ axis_W))

    def _autopilot(
        self, state: PipelineState, manual: ManualState, dt_s: float, estimate: BodyState, goal: Goal, asked: Array
    ) -> tuple[PidState, ManualState, Array]:
        """Hold depth, heading and attitude where sticks left them; the next states and the wrench in B, shape (6,)."""
        R_WB, nu = estimate.X_WB.R, estimate.nu_B
        forward, right, climb_m_s, turn_rad_s = asked
        _, _, heading_rad = euler_from_quat(estimate.X_WB.q)
        v_W = R_WB @ nu[:3]
        depth_m, held_rad = manual.depth_m, manual.heading_rad
        if depth_m is None:
            depth_m, held_rad = float(estimate.X_WB.p_m[2]), float(heading_rad)
        depth_m, held_rad = depth_m + climb_m_s * dt_s, held_rad + turn_rad_s * dt_s
        roll_rad, pitch_rad, _ = euler_from_quat(goal.X_WB.q)
        held = Pose(estimate.X_WB.p_m, quat_from_euler(roll_rad, pitch_rad, held_rad))
        saturated = state.saturated
        R_GW = held.R.T
        # As the place is where the vehicle is and the velocity what it has, only attitude is steered by this.
        level = Goal(X_WB=held, nu_B=np.concatenate([R_GW @ v_W, R_GW @ np.array([0.0, 0.0, turn_rad_s])]))
        pid, wrench = self.pid.correction(state.pid, dt_s, estimate, level, saturated=saturated)
        weight_B = restoring_wrench(self.pid.body, estimate.X_WB.q)
        error_m, k = depth_m - float(estimate.X_WB.p_m[2]), self.pid
        lift_N = manual.lift_N
        if not saturated:
            lift_N = float(np.clip(lift_N + k.ki[2] * error_m * dt_s, -k.integral_limit[2], k.integral_limit[2]))
        down_N = k.kp[2] * error_m + k.kd[2] * (climb_m_s - v_W[2]) + lift_N - float((R_WB @ weight_B[:3])[2])
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        force_W = np.array([c * forward - s * right, s * forward + c * right, down_N])
        moment_B = wrench[3:] - restoring_wrench(self.pid.body, held.q)[3:]
        after = replace(manual, depth_m=depth_m, heading_rad=held_rad, lift_N=lift_N)
        return pid, after, np.concatenate([R_WB.T @ force_W, moment_B])


def vehicle_sticks(vehicle: Vehicle, pid: Pid) -> StickDeflection:
    """What the sticks of a vehicle do: force forward and right, rate of climb and of turn."""
    reach = np.abs(vehicle.allocation_matrix) @ np.minimum(-vehicle.thrust_lower_N, vehicle.thrust_upper_N)
    body = pid.body
    return StickDeflection(
        inertia=np.array([body.mass_matrix[0, 0], body.mass_matrix[1, 1], 0.0, 0.0]),
        drag=np.array([body.linear_damping[0, 0], body.linear_damping[1, 1], 0.0, 0.0]),
        full=np.array([reach[0], reach[1], CLIMB_M_S, TURN_RAD_S]),
        lag_s=np.full(4, float(vehicle.time_constants_s.max())),
    )


def manual(
    vehicle: Vehicle,
    region: Region,
    wake: WakeModel,
    settings: ControlSettings,
    _: Surroundings | None = None,
    *,
    name: str = "manual",
    people: OperatorPopulation = POPULATION,
) -> Pipeline:
    """`manual`: the person whom the trial's seed draws; the wake model is only asked what D the thrusts cause.

    A seed draws the same person of other `people`, but for the ranges in which these differ.
    """
    pid, layout = make_pid(vehicle, settings), vehicle_layout(vehicle)
    motion = ManualStage(
        person=sample_operator(settings.operator_seed or 0, vehicle_sticks(vehicle, pid), people),
        pid=pid,
        X_BC=vehicle.X_BC,
        middle_W_m=np.average(region.points_W_m, axis=0, weights=region.weights),
    )
    allocator = least_thrust_allocator(layout, vehicle, region, wake, settings)
    return Pipeline(name=name, layout=layout, motion=motion, allocator=allocator)
