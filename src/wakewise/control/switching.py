"""Two methods under one hand: flown by one or the other as a switch says, with no jump between them.

What goes over is what either has learned or done (`Carried`): the tracker's integral and the thrusts last sent, at
which a plan begins and from which shares are sought. What is left is what the two would do differently at the very
moment, such as a plan that lets its goal go where the tracker pulls towards it. That difference of thrusts is flown on
for a while, fading with `FADE_S`: the first thrusts after a switch are the last ones before it, and the new method's
own feedback is in force at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wakewise.allocation import Layout
from wakewise.control.carried import HandsOver
from wakewise.core.arrays import Array, freeze
from wakewise.core.interfaces import BodyState, Command, Controller, Goal

FADE_S = 0.5
"""Time constant of the fading: a thruster's lag five times over, a quarter of the planner's horizon."""
GONE_N = 1e-3
"""Difference of thrust that is not worth a step's arithmetic any more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SwitchState:
    """Which method flies, its state, the thrusts last sent, and what of the difference is left; shape (n,) each."""

    flown: str
    inner: Any
    thrusts_N: Array
    left_N: Array

    def __post_init__(self) -> None:
        freeze(self, thrusts_N=(None,), left_N=(None,))


@dataclass(frozen=True, kw_only=True, eq=False)
class Switched:
    """One of several methods, as `wanted` says at each step; implements `wakewise.core.interfaces.Controller`.

    Parameters
    ----------
    name : str
        What it is called in tables, whichever flies.
    methods : mapping
        Controllers by the names that `wanted` gives; the first flies where it gives another.
    wanted : callable
        Asked at each step; what it gives is the one thing here that is not state.
    layout : Layout
        Limits of the thrusters, and what wrench they make.
    """

    name: str
    methods: Mapping[str, Controller[Any]]
    wanted: Callable[[], str]
    layout: Layout

    def init(self) -> SwitchState:
        """State before the first step."""
        which, rest = self._which(), np.zeros(self.layout.B.shape[1])
        return SwitchState(flown=which, inner=self.methods[which].init(), thrusts_N=rest, left_N=rest)

    def step(self, state: SwitchState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[SwitchState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        which, inner = self._which(), state.inner
        switches = which != state.flown
        if switches:
            inner = self._handed(state, which)
        inner, command = self.methods[which].step(inner, dt_s, estimate, goal)
        left = state.thrusts_N - command.thrusts_N if switches else np.exp(-dt_s / FADE_S) * state.left_N
        if np.abs(left).max(initial=0.0) < GONE_N:
            new = replace(state, flown=which, inner=inner, thrusts_N=command.thrusts_N, left_N=np.zeros_like(left))
            return new, command
        thrusts = np.clip(command.thrusts_N + left, self.layout.lower_N, self.layout.upper_N)
        more_B = self.layout.B @ (thrusts - command.thrusts_N)
        sent = replace(command, thrusts_N=thrusts, wrench_B=command.wrench_B + more_B)
        return SwitchState(flown=which, inner=inner, thrusts_N=thrusts, left_N=left), sent

    def _which(self) -> str:
        wanted = self.wanted()
        return wanted if wanted in self.methods else next(iter(self.methods))

    def _handed(self, state: SwitchState, which: str) -> Any:
        """State of the method that takes over; one that cannot take anything over begins anew."""
        before, after = self.methods[state.flown], self.methods[which]
        if isinstance(before, HandsOver) and isinstance(after, HandsOver):
            return after.resumed(replace(before.carried(state.inner), thrusts_N=state.thrusts_N))
        return after.init()
