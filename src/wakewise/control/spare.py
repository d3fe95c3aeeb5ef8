"""Spare thrusts shared out anew at every step, with what single jets do not show: jets that meet, and the bed."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from wakewise.allocation import Layout
from wakewise.control.carried import Carried, HandsOver
from wakewise.control.meeting import meeting_view
from wakewise.control.settings import ControlSettings
from wakewise.control.thrift import sharer_of, weights_of
from wakewise.control.watch import APART_S, EVERY_S, JUMP_EVERY_S, Watch
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, Command, Controller, Goal, WakeModel
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake.influence import InfluenceMatrices, InfluenceModel


@dataclass(frozen=True, eq=False)
class SpareState:
    """The other controller's state, the thrusts last told, shape (n,), and when they were last shared out (freely).

    `seen` are the matrices of the last search.
    """

    inner: Any
    thrusts_N: Array
    age_s: float = np.inf
    disturbance: float | None = None
    free_age_s: float = np.inf
    seen: InfluenceMatrices | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Respared:
    """The wrench of another controller, made with the gentlest thrusts; implements
    `wakewise.core.interfaces.Controller`.

    The motion is the other's; what its plan does not know (jets that meet, the bed) only moves spare thrusts, by the
    exact allocator, so it can neither slow the plan nor make it swing. Where jets go is looked up `EVERY_S`, as often
    as plans are made; in between shares follow the wrench by the matrix of then.
    The price on change keeps shares near to the last ones, and for good where another minimum lies apart (the load on
    one diagonal pair of verticals or the other). So every `JUMP_EVERY_S` they are sought without it, on a step of its
    own, and taken where that is better by more than `WORTH` (see `watch`). A step on which the other fell back is flown
    as it is.
    """

    name: str
    inner: Controller[Any]
    watch: Watch

    @property
    def layout(self) -> Layout:
        """Thrusters and their limits."""
        return self.watch.layout

    def init(self) -> SpareState:
        """State before the first step."""
        return SpareState(inner=self.inner.init(), thrusts_N=np.zeros(self.layout.B.shape[1]))

    def carried(self, state: SpareState) -> Carried:
        """What another method can go on with; asked only where the other controller hands over, too."""
        return replace(cast(HandsOver, self.inner).carried(state.inner), thrusts_N=state.thrusts_N)

    def resumed(self, carried: Carried) -> SpareState:
        """State before the first step after another method's: shares are sought near its thrusts."""
        return SpareState(inner=cast(HandsOver, self.inner).resumed(carried), thrusts_N=carried.thrusts_N)

    def step(self, state: SpareState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[SpareState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        inner, command = self.inner.step(state.inner, dt_s, estimate, goal)
        if command.fallback is not None:
            return SpareState(inner=inner, thrusts_N=command.thrusts_N), command
        watch, wrench = self.watch, command.wrench_B
        if state.seen is not None and state.age_s + 1e-6 < EVERY_S:
            moved = watch.moved(wrench, state.thrusts_N)
            due = state.free_age_s + 1e-6 >= JUMP_EVERY_S and state.age_s + 1e-6 >= APART_S
            if due and watch.allowed(moved):
                # Such a step has no time to share the change out, too.
                held = self._jumped(replace(state, thrusts_N=moved, free_age_s=0.0), wrench, estimate)
            else:
                held = replace(state, thrusts_N=watch.follow(wrench, state.seen, state.thrusts_N).thrusts_N)
            told = self._told(inner, held.thrusts_N, dt_s)
            held = replace(held, inner=told, age_s=held.age_s + dt_s, free_age_s=held.free_age_s + dt_s)
            return held, replace(command, thrusts_N=held.thrusts_N, disturbance=held.disturbance)
        shared = watch.share_out(wrench, estimate, state.thrusts_N)
        if shared is None:
            words = "wake model not finite: thrusts of the plan"
            return SpareState(inner=inner, thrusts_N=command.thrusts_N), replace(command, fallback=words)
        found, seen = shared
        # The first search is made with the first plan, the next ones between two plans.
        age_s = dt_s if math.isfinite(state.age_s) else EVERY_S - APART_S + dt_s
        told = self._told(inner, found.thrusts_N, dt_s)
        new = SpareState(told, found.thrusts_N, age_s, found.disturbance, state.free_age_s + dt_s, seen)
        return new, replace(command, thrusts_N=found.thrusts_N, disturbance=found.disturbance)

    def _jumped(self, state: SpareState, wrench_B: Array, estimate: BodyState) -> SpareState:
        """The state with better shares from elsewhere, if there are any."""
        anew = self.watch.jump(wrench_B, estimate, state.thrusts_N, state.seen)
        if anew is None:
            return state
        found, seen = anew
        return replace(state, thrusts_N=found.thrusts_N, disturbance=found.disturbance, seen=seen)

    def _told(self, inner: Any, thrusts_N: Array, dt_s: float) -> Any:
        """The other controller's state, told what was flown in place of its thrusts, if it can be told."""
        tell = getattr(self.inner, "told", None)
        return inner if tell is None else tell(inner, thrusts_N, dt_s)


def respared(
    controller: Controller[Any], vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> Respared:
    """A planning controller whose wrenches are shared out anew, with the same weights.

    Arguments as for `make_controller`; `region` with what the levers add but for drift, `wake` with the floor if it is
    to count.
    """
    return Respared(name=controller.name, inner=controller, watch=watching(vehicle, region, wake, settings))


def watching(vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings) -> Watch:
    """What a method watches with the levers of its settings. Arguments as for `respared`."""
    sharer = sharer_of(vehicle, settings)
    view = InfluenceModel.of(vehicle, region, wake, settings.superposition)
    return Watch(
        view=meeting_view(view, sharer.layout) if settings.levers.meet else view,
        levers=settings.levers,
        sharer=sharer,
        weights=weights_of(settings, view.total_weight),
    )
