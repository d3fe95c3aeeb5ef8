"""Thrusts below the least one sent as pulses, so that their mean is right; the same for every method.

A thruster that is asked for less than its least thrust can only run at the least or rest. What it was not given is
owed, as an impulse: once that is enough for a whole pulse the thruster runs at its least thrust until nothing is owed
any more. For a steady wish w below the least thrust L this gives pulses of L t / (L - w) and pauses of L t / w, with t
the shortest pulse, so neither is ever shorter than t. Above the least thrust the same debt picks the step of the
command, which keeps the mean right there, too (first-order sigma-delta modulation; R. Schreier and G. C. Temes 2005,
Understanding Delta-Sigma Data Converters, ISBN 0-471-46585-2).

Why pulses have a least length. A rotor needs its lag to get up to speed; a shorter pulse, that of one control step,
would have it turn at a speed between rest and the least one, which is what a motor without sensors cannot do. One lag
is an estimate of ours, since no maker states how long a start takes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.interfaces import BodyState, Command, Controller, Goal
from wakewise.core.jit.njit import njit
from wakewise.robot.thrusters import ThrustSteps
from wakewise.robot.thrusters.thrust_curve import nearest
from wakewise.robot.vehicles import Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class PulseState:
    """Which way each thruster runs (-1, 0, 1) and the impulse in N s that it still owes, both shape (n,)."""

    running: Array
    owed_N_s: Array

    def __post_init__(self) -> None:
        freeze(self, running=(None,), owed_N_s=(None,))

    @classmethod
    def at_rest(cls, thrusters: int) -> PulseState:
        """Nothing runs and nothing is owed."""
        return cls(running=np.zeros(thrusters), owed_N_s=np.zeros(thrusters))


def pulsed(
    state: PulseState, wished_N: Array, dt_s: float, steps: ThrustSteps, shortest_s: Array
) -> tuple[PulseState, Array]:
    """Thrusts that can be held, whose mean over time is that of the wished ones.

    Parameters
    ----------
    state : PulseState
    wished_N : ndarray, shape (n,)
    dt_s : float
        How long they will be held.
    steps : ThrustSteps
    shortest_s : ndarray, shape (n,)
        Shortest pulse and pause of each thruster; one step where that is longer.

    Returns
    -------
    PulseState, ndarray of shape (n,)
        What is owed after the step, and the thrusts. Owed is never more than the least thrust times the shortest pulse
        and one step, as long as the wishes lie within the thruster's limits.
    """
    least = (steps.least_forward_N, steps.least_reverse_N)
    running, owed, thrusts = _pulses(state.running, state.owed_N_s, wished_N, dt_s, shortest_s, *least, steps.levels)
    return PulseState(running=running, owed_N_s=owed), thrusts


@njit
def _pulses(running, owed, wished, dt, shortest, least_forward, least_reverse, levels):  # type: ignore[no-untyped-def]
    """Which way each thruster runs, what it owes, and its thrust, shape (n,) each; arguments as for `pulsed`."""
    n = wished.size
    ways, owes, thrusts = np.zeros(n), np.empty(n), np.zeros(n)
    for i in range(n):
        span, wish = max(shortest[i], dt), wished[i]
        if wish >= least_forward or wish <= -least_reverse:
            ways[i] = 1.0 if wish >= least_forward else -1.0
            # What is owed is made up for over a pulse; the way the thruster runs stays that of the wish.
            level = wish + owed[i] / span
            if not level * ways[i] > 0.0:
                level = least_forward if ways[i] > 0.0 else -least_reverse
            thrusts[i] = nearest(level, least_forward, least_reverse, levels)
        else:
            if running[i] * owed[i] > 0.0:
                ways[i] = running[i]
            elif owed[i] >= least_forward * span or owed[i] <= -least_reverse * span:
                ways[i] = 1.0 if owed[i] >= least_forward * span else -1.0
            if ways[i] != 0.0:
                thrusts[i] = least_forward if ways[i] > 0.0 else -least_reverse
        owes[i] = owed[i] + (wish - thrusts[i]) * dt
    return ways, owes, thrusts


@dataclass(frozen=True, kw_only=True, eq=False)
class PulsedState:
    """The controller's own state and that of its thrusters' pulses."""

    inner: Any
    pulses: PulseState


@dataclass(frozen=True, kw_only=True, eq=False)
class Pulsed:
    """Any controller, with its thrusts turned into those that can be held; implements `Controller`.

    Parameters
    ----------
    inner : Controller
        Asks for thrusts of any size and is told nothing of the pulses.
    steps : ThrustSteps
    lower_N, upper_N, shortest_s : ndarray, shape (n,)
        Limits of the thrusters, and their shortest pulses.
    """

    inner: Controller[Any]
    steps: ThrustSteps
    lower_N: Array
    upper_N: Array
    shortest_s: Array

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.inner.name

    def init(self) -> PulsedState:
        """State before the first step."""
        return PulsedState(inner=self.inner.init(), pulses=PulseState.at_rest(len(self.shortest_s)))

    def step(self, state: PulsedState, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[PulsedState, Command]:
        """Decide the thrusts for the next `dt_s` seconds."""
        inner, command = self.inner.step(state.inner, dt_s, estimate, goal)
        wished = np.minimum(np.maximum(command.thrusts_N, self.lower_N), self.upper_N)
        pulses, thrusts = pulsed(state.pulses, wished, dt_s, self.steps, self.shortest_s)
        sent = replace(command, thrusts_N=np.minimum(np.maximum(thrusts, self.lower_N), self.upper_N))
        return PulsedState(inner=inner, pulses=pulses), sent


def in_pulses(controller: Controller[Any], vehicle: Vehicle, pulse_s: float | None = None) -> Controller[Any]:
    """The controller as a vehicle with a least thrust flies it; the controller itself where thrust is continuous.

    Parameters
    ----------
    controller : Controller
    vehicle : Vehicle
        As it is believed to be.
    pulse_s : float, optional
        Shortest pulse and pause; None: each thruster's own lag.
    """
    steps = vehicle.thrust_steps
    if steps is None:
        return controller
    n = len(vehicle.thrusters)
    return Pulsed(
        inner=controller,
        steps=steps,
        lower_N=vehicle.thrust_lower_N,
        upper_N=vehicle.thrust_upper_N,
        shortest_s=vehicle.time_constants_s if pulse_s is None else np.full(n, pulse_s),
    )
