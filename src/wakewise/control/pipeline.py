"""The control pipeline: from an estimate and a goal to thrusts, in six named stages.

    goal, estimate
      | 1 reference        hull attitude where the camera tilts               attitude_optimizer.py
      | 2 input check      finite, pose known; else the last thrusts fade     failsafe.py
      | 3 motion           MPC and tracking, PID, autopilot or plug-in        mpc_controller.py, pid.py, ...
      | 4 allocation       one wrench to n thrusts                            null_space_allocation.py, ...
      | 5 failsafe         wrong, missing or late answers                     failsafe.py
      | 6 thruster model   PWM in the dead zone                               thruster_pwm.py
      v
    thrusts

A method is a motion stage, which turns a goal into a wrench, and an allocator with its weights. `methods.py` makes all
of them. Stages 5 and 6 are added where a flight is built (`with_failsafe`, `with_pwm`). All methods share one state,
`PipelineState`.

A wrench becomes thrusts in `Pipeline._allocate`. Two motion stages bring thrusts of their own. The MPC optimises
thrusts, so its plan has them; the methods `mpc` and `mpc-smooth` fly these, and all MPC methods do on a step of
trouble. ArduSub has no wrench: its mixer is part of what is compared.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from wakewise.allocation import Layout, min_norm_allocation
from wakewise.control.failsafe import Failsafe, Incidents, faded, input_trouble
from wakewise.control.null_space_allocation import FULL, Allocator, vehicle_layout
from wakewise.control.pid import Pid, PidState, make_pid
from wakewise.control.settings import ControlSettings
from wakewise.control.thruster_pwm import ThrusterPwm
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, Command, Controller, Goal
from wakewise.robot.vehicles import Vehicle

if TYPE_CHECKING:
    from wakewise.allocation import Allocation
    from wakewise.control.ardusub import ArduSubState
    from wakewise.control.attitude_optimizer import AttitudeOptimizer, AttitudeSearch
    from wakewise.control.manual import ManualState
    from wakewise.planning import Horizon
    from wakewise.wake.influence import InfluenceMatrices


@dataclass(frozen=True, kw_only=True, eq=False)
class PipelineState:
    """All that a method remembers between two steps. Fields of stages that a method lacks keep their defaults.

    Shapes: thrusts (n,), forces and moments (3,), twists (6,). Ages are in seconds; infinite means never.
    """

    thrusts_N: Array
    """Thrusts of the last step, before the dead zone: where allocation and plan go on from."""
    pid: PidState
    saturated: bool = False
    """Whether the thrusters could not make all of the last wrench: the integral then does not grow."""
    goal_nu: Array | None = None
    """The goal's twist of the step before."""

    # 1 Reference: the hull's pitch about the camera's hinge (attitude_optimizer.py).
    pitch_offset_rad: float = 0.0
    pitch_rate_rad_s: float = 0.0
    pitch_target_rad: float = 0.0
    load_force_W_N: Array | None = None
    load_moment_B_Nm: Array | None = None
    attitude_search: AttitudeSearch | None = None
    attitude_age_s: float = 0.0

    # 3 Motion: the plan and how it is flown (mpc_controller.py).
    plan: Horizon | None = None
    plan_age_s: float = 0.0
    plan_trouble: str | None = None
    plan_thrusts_N: Array | None = None
    """What the thrusters gave at the plan's start, by the planned commands alone."""
    plan_force_W_N: Array | None = None
    """The load's force that the plan holds against."""
    load_moment_mean_B_Nm: Array | None = None
    """The load's moment, averaged, that the next plan holds against."""
    correction_gain: Array | None = None
    """Thrusts per unit of a correcting wrench, shape (n, 6)."""
    tracking_scale: float = 1.0
    """Factor of the plan's tracking weights."""
    null_shift_N: Array | None = None
    """Commands beside the planned ones, in the null space."""
    null_shift_given_N: Array | None = None
    """What of them the thrusters give by now."""
    backup_saturated: bool = False
    """As `saturated`, of the PID that flies where there is no plan."""

    # 3 Motion: autopilots and plug-ins.
    manual: ManualState | None = None
    ardusub: ArduSubState | None = None
    plugin: object = None
    """State of a controller from outside, of whatever type that has."""

    # 4 Allocation (null_space_allocation.py).
    influence: InfluenceMatrices | None = None
    """Matrices of the last search."""
    disturbance: float | None = None
    """D of the thrusts that the last search found."""
    search_age_s: float = np.inf
    restart_age_s: float = np.inf

    # 5 Failsafe (failsafe.py).
    begun: bool = False
    sent_N: Array | None = None
    failsafe_pid: PidState | None = None
    failsafe_saturated: bool = False
    failed_s: float = 0.0
    late_s: float = 0.0
    gave_up: str | None = None

    # 6 Thruster model (thruster_pwm.py).
    pwm_direction: Array | None = None
    pwm_owed_N_s: Array | None = None

    # Change of method in flight (bumpless_transfer.py).
    method: str = ""
    method_thrusts_N: Array | None = None
    transfer_N: Array | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Demand:
    """What a motion stage asks of the allocation.

    `thrusts_N`, shape (n,), are the stage's own; they are flown where the pipeline has no allocator, and where there is
    `trouble`. `disturbance` is their D. `allocator` stands in for the pipeline's. `goal` is the one flown, where the
    stage chose another.
    """

    wrench_B: Array
    thrusts_N: Array | None = None
    disturbance: float | None = None
    trouble: str | None = None
    allocator: WrenchAllocator | None = None
    goal: Goal | None = None


class WrenchAllocator(Protocol):
    """Stage 4: from a wrench to thrusts."""

    @property
    def layout(self) -> Layout:
        """Thrusters and their limits."""

    def allocate(
        self, state: PipelineState, wrench_B: Array, estimate: BodyState, dt_s: float
    ) -> tuple[PipelineState, Allocation | None]:
        """Thrusts that make a wrench, shape (6,), within limits; None if the wake model gives what is not finite."""


class MotionStage(ABC):
    """Stage 3: from an estimate and a goal to a `Demand`."""

    def begin(self, state: PipelineState) -> PipelineState:
        """Fill in what the stage remembers before its first step."""
        return state

    @abstractmethod
    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the wrench for the next `dt_s` seconds."""

    def allocated(self, state: PipelineState, found: Allocation, dt_s: float) -> PipelineState:
        """Take in how the stage's wrench was allocated."""
        del dt_s
        return replace(state, saturated=found.scale < FULL)

    def expected(self, state: PipelineState) -> Array | None:
        """State that the stage's plan expects now, shape (13,); None where there is no plan."""
        del state
        return None


@dataclass(frozen=True, kw_only=True, eq=False)
class TrackingStage(MotionStage):
    """PID towards the goal (see `pid.py`), with feed-forward unless it is to be a plain one."""

    pid: Pid
    feed_forward: bool = True

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the wrench for the next `dt_s` seconds."""
        decide = self.pid.wrench if self.feed_forward else self.pid.correction
        pid, wrench = decide(state.pid, dt_s, estimate, goal, saturated=state.saturated)
        if not np.isfinite(wrench.sum()):
            return hold(state, dt_s, "wrench not finite")
        return replace(state, pid=pid, goal_nu=goal.nu_B), Demand(wrench_B=wrench)


@dataclass(frozen=True, kw_only=True, eq=False)
class PluginStage(MotionStage):
    """A controller that is no `Pipeline`: from outside, or one of ours round another."""

    controller: Controller[Any]
    thrusters: int

    def begin(self, state: PipelineState) -> PipelineState:
        """Ask the controller for its own state."""
        return replace(state, plugin=self.controller.init())

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Ask the controller; raises TypeError if it does not answer a Command of so many thrusts."""
        answer: Any = self.controller.step(state.plugin, dt_s, estimate, goal)
        plugin, command = answer if isinstance(answer, tuple) and len(answer) == 2 else (None, None)
        if not isinstance(command, Command) or len(command.thrusts_N) != self.thrusters:
            got = answer if command is None else command
            given = f"of {len(got.thrusts_N)} thrusts" if isinstance(got, Command) else getattr(got, "shape", "")
            words = f"must answer a Command of {self.thrusters} thrusts after its state, not"
            raise TypeError(f"{words} {type(got).__name__} {given}".rstrip())
        return replace(state, plugin=plugin), Demand(
            wrench_B=command.wrench_B,
            thrusts_N=command.thrusts_N,
            disturbance=command.disturbance,
            trouble=command.fallback,
            goal=command.goal,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Pipeline:
    """A method: its stages in order; implements `wakewise.core.interfaces.Controller`.

    `layout` has the thrusters and their limits. `checks_input` is off for plug-ins, which may make use of an estimate
    that is lost; `lost_m` is the standard deviation of the position from which on a pose is lost. `allocator` is None
    where the motion stage's own thrusts are flown. `sent_by` makes the thrusts that are sent in place of those that
    the method goes on with (an ablation).
    """

    name: str
    layout: Layout
    motion: MotionStage
    attitude: AttitudeOptimizer | None = None
    checks_input: bool = True
    lost_m: float | None = None
    allocator: WrenchAllocator | None = None
    sent_by: WrenchAllocator | None = None
    failsafe: Failsafe | None = None
    pwm: ThrusterPwm | None = None
    incidents: Incidents = field(default_factory=Incidents)

    def init(self) -> PipelineState:
        """State before the first step."""
        return self.begin() if self.failsafe is None else self.failsafe.begin(self)

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        if self.failsafe is None:
            state, command = self.decide(state, dt_s, estimate, goal)
        else:
            state, command = self.failsafe.step(self, state, dt_s, estimate, goal)
        return (state, command) if self.pwm is None else self.pwm.step(state, dt_s, command)

    def expected(self, state: PipelineState) -> Array | None:
        """State that the plan expects now, shape (13,); None where there is no plan."""
        return self.motion.expected(state)

    def blank(self) -> PipelineState:
        """Thrusters at rest and nothing remembered."""
        return PipelineState(thrusts_N=np.zeros(self.layout.B.shape[1]), pid=PidState.zero())

    def begin(self) -> PipelineState:
        """State before the first step, of stages 1 to 4."""
        return self.motion.begin(self.blank())

    def decide(
        self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[PipelineState, Command]:
        """Stages 1 to 4."""
        flown = None
        if self.attitude is not None:
            state, flown = self.attitude.step(state, dt_s, estimate, goal)
        goal = goal if flown is None else flown
        trouble = input_trouble(estimate, goal, self.lost_m) if self.checks_input else None
        if trouble is not None:
            self.incidents.count(*trouble)
            state, demand = hold(state, dt_s, trouble[1])
        else:
            state, demand = self.motion.step(state, dt_s, estimate, goal)
        state, command = self._allocate(state, demand, dt_s, estimate)
        if self.sent_by is not None and command.fallback is None:
            _, sent = self.sent_by.allocate(state, command.wrench_B, estimate, dt_s)
            if sent is not None:
                command = replace(command, thrusts_N=sent.thrusts_N, disturbance=sent.disturbance)
        return state, command if flown is None else replace(command, goal=flown)

    def _allocate(
        self, state: PipelineState, demand: Demand, dt_s: float, estimate: BodyState
    ) -> tuple[PipelineState, Command]:
        """Stage 4: the one place where a wrench becomes thrusts."""
        own, trouble = demand.thrusts_N, demand.trouble
        allocator = demand.allocator or self.allocator
        if own is not None and (trouble is not None or allocator is None):
            return self._as_demanded(state, demand, own, trouble)
        if allocator is None:
            raise ValueError(f"{self.name}: a wrench without an allocator")
        state, found = allocator.allocate(state, demand.wrench_B, estimate, dt_s)
        words = None
        if found is None:
            if own is not None:
                return self._as_demanded(state, demand, own, "wake model not finite: thrusts of the plan")
            state, words = without_search(state), "wake model not finite: least thrusts"
            found = min_norm_allocation(allocator.layout, demand.wrench_B)
        if own is None and found.scale < FULL and words is None:
            words = f"thrusters saturated: {100.0 * found.scale:.0f} % of the wrench"
        if demand.allocator is not None:
            state = without_search(state)
        state = self.motion.allocated(replace(state, thrusts_N=found.thrusts_N), found, dt_s)
        command = Command(
            thrusts_N=found.thrusts_N,
            wrench_B=demand.wrench_B,
            # A plan's wrench is allocated anew at each step, and its D is that of the last search.
            disturbance=found.disturbance if own is None else state.disturbance,
            fallback="; ".join(part for part in (trouble, words) if part) or None,
            goal=demand.goal,
        )
        return state, command

    def _as_demanded(
        self, state: PipelineState, demand: Demand, own_N: Array, trouble: str | None
    ) -> tuple[PipelineState, Command]:
        """The motion stage's own thrusts; a search for better ones begins anew after them."""
        command = Command(
            thrusts_N=own_N,
            wrench_B=demand.wrench_B,
            disturbance=demand.disturbance,
            fallback=trouble,
            goal=demand.goal,
        )
        state = replace(state, thrusts_N=own_N)
        return state if self.allocator is None else without_search(state), command


def hold(state: PipelineState, dt_s: float, why: str) -> tuple[PipelineState, Demand]:
    """The last thrusts, fading: what is flown where there is nothing to control by. A plan is given up."""
    thrusts = faded(state.thrusts_N, dt_s)
    state = replace(state, plan=None, plan_thrusts_N=thrusts, plan_trouble=None)
    words = f"{why}: holding the last thrusts, fading"
    return state, Demand(wrench_B=np.zeros(6), thrusts_N=thrusts, trouble=words)


def without_search(state: PipelineState) -> PipelineState:
    """The state of a method that looks for its allocation anew."""
    return replace(state, influence=None, disturbance=None, search_age_s=np.inf, restart_age_s=np.inf)


def pipeline_of(controller: Controller[Any], layout: Layout) -> Pipeline:
    """A controller as a pipeline: the controller itself if it is one, else with it as the motion stage."""
    if isinstance(controller, Pipeline):
        return controller
    name = str(getattr(controller, "name", type(controller).__name__))
    stage = PluginStage(controller=controller, thrusters=layout.B.shape[1])
    return Pipeline(name=name, layout=layout, motion=stage, checks_input=False)


def with_failsafe(
    controller: Controller[Any],
    vehicle: Vehicle,
    settings: ControlSettings,
    *,
    enforce: bool = False,
    strict: bool | None = None,
    foreign: bool = False,
    reported_by: Allocator | None = None,
) -> Pipeline:
    """A controller with stage 5.

    `enforce` where the world does not wait for its controller, `foreign` for one from outside, `strict` as in
    `Failsafe`. `reported_by` tells what D the failsafe's thrusts cause; None: nobody does.
    """
    layout = vehicle_layout(vehicle)
    failsafe = Failsafe(
        pid=make_pid(vehicle, settings),
        allocator=reported_by or Allocator(layout=layout),
        enforce=enforce,
        strict=strict,
        foreign=foreign,
    )
    return replace(pipeline_of(controller, layout), failsafe=failsafe)


def with_pwm(pipeline: Pipeline, vehicle: Vehicle, pulse_s: float | None = None) -> Pipeline:
    """A pipeline with stage 6 where the vehicle's thrust is not continuous; `pulse_s` as in `ThrusterPwm.of`."""
    return replace(pipeline, pwm=ThrusterPwm.of(vehicle, pulse_s))
