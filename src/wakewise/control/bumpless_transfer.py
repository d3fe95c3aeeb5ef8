"""Bumpless transfer: one of several methods flies, and a change between them is not felt.

The new method goes on with what the old one has learned or done: the PID's integral, the goal's last twist, and the
thrusts last sent, at which a plan begins and from which an allocation is searched. What the two methods would do
differently at that moment is left. That difference of thrusts is flown on, fading with `FADE_S`. So the first thrusts
after a change are the last ones before it, and the new method's own feedback is in force at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from wakewise.allocation import Layout
from wakewise.control.failsafe import with_outer_stages
from wakewise.control.pipeline import Demand, MotionStage, Pipeline, PipelineState
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, Goal

FADE_S = 0.5
"""Time constant of the fading: a thruster's lag five times over, a quarter of the planner's horizon."""
GONE_N = 1e-3
"""Difference of thrust that is not worth a step's arithmetic any more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchStage(MotionStage):
    """Stages 1 to 4 of one of several pipelines, as `wanted` says at each step.

    `methods` are pipelines by the names that `wanted` gives; the first flies where it gives another. What `wanted`
    gives is the one thing here that is not state.
    """

    methods: Mapping[str, Pipeline]
    wanted: Callable[[], str]
    layout: Layout

    def begin(self, state: PipelineState) -> PipelineState:
        """State before the first step."""
        which, rest = self._which(), state.thrusts_N
        return replace(self.methods[which].begin(), method=which, method_thrusts_N=rest, transfer_N=np.zeros_like(rest))

    def step(self, state: PipelineState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PipelineState, Demand]:
        """Decide the thrusts for the next `dt_s` seconds."""
        which, sent_N = self._which(), state.thrusts_N
        switches = which != state.method
        if switches:
            state = transferred(state, self.methods[which])
        elif state.method_thrusts_N is not None:
            state = replace(state, thrusts_N=state.method_thrusts_N)
        state, command = self.methods[which].decide(state, dt_s, estimate, goal)
        left = np.zeros_like(sent_N) if state.transfer_N is None else state.transfer_N
        left = sent_N - command.thrusts_N if switches else np.exp(-dt_s / FADE_S) * left
        thrusts, wrench = command.thrusts_N, command.wrench_B
        if np.abs(left).max(initial=0.0) < GONE_N:
            left = np.zeros_like(left)
        else:
            thrusts = np.clip(command.thrusts_N + left, self.layout.lower_N, self.layout.upper_N)
            wrench = wrench + self.layout.B @ (thrusts - command.thrusts_N)
        state = replace(state, method=which, method_thrusts_N=state.thrusts_N, transfer_N=left)
        return state, Demand(
            wrench_B=wrench,
            thrusts_N=thrusts,
            disturbance=command.disturbance,
            trouble=command.fallback,
            goal=command.goal,
        )

    def expected(self, state: PipelineState) -> Array | None:
        """State that the plan of the method that flies expects now, shape (13,)."""
        return self.methods[state.method].expected(state) if state.method in self.methods else None

    def _which(self) -> str:
        wanted = self.wanted()
        return wanted if wanted in self.methods else next(iter(self.methods))


def transferred(state: PipelineState, to: Pipeline) -> PipelineState:
    """State of a method that takes over: begun anew, but for what bumpless transfer hands over."""
    new = replace(
        to.begin(),
        thrusts_N=state.thrusts_N,
        plan_thrusts_N=state.thrusts_N,
        pid=replace(state.pid, goal_nu=state.goal_nu),
        goal_nu=state.goal_nu,
    )
    return with_outer_stages(new, state)


def switched(name: str, methods: Mapping[str, Pipeline], wanted: Callable[[], str], layout: Layout) -> Pipeline:
    """A pipeline that is one of several, as `wanted` says at each step; `name` is what it is called in tables."""
    stage = SwitchStage(methods=methods, wanted=wanted, layout=layout)
    return Pipeline(name=name, layout=layout, motion=stage, checks_input=False)
