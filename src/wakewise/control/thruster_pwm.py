"""Thruster model: pulse-width modulation (PWM) of thrusts in the dead zone, so that their mean is right.

A thruster that is asked for less than its least thrust can only run at the least or rest. What it was not given is
owed, as an impulse. Once that is enough for a whole pulse, the thruster runs at its least thrust until nothing is owed.
For a steady demand w below the least thrust L this gives pulses of L t / (L - w) and pauses of L t / w, with t the
shortest pulse, so neither is ever shorter than t. Above the least thrust the same debt picks the step of the command,
which keeps the mean right there, too (first-order sigma-delta modulation; R. Schreier and G. C. Temes 2005,
Understanding Delta-Sigma Data Converters, ISBN 0-471-46585-2).

Why pulses have a least length. A rotor needs its lag to get up to speed. In a shorter pulse, that of one control step,
it would turn at a speed between rest and the least one, which a motor without sensors cannot do. One lag is our own
estimate, since no maker states how long a start takes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from wakewise.core.arrays import Array, frozen
from wakewise.core.interfaces import Command
from wakewise.core.jit.njit import njit
from wakewise.robot.thrusters import ThrustSteps
from wakewise.robot.thrusters.thrust_curve import nearest
from wakewise.robot.vehicles import Vehicle

if TYPE_CHECKING:
    from wakewise.control.pipeline import PipelineState


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrusterPwm:
    """Stage 6 of the pipeline: thrusts of any size become thrusts that can be held.

    `lower_N`, `upper_N` and `shortest_s`, shape (n,), are limits and the shortest pulse of each thruster. The stages
    before are told nothing of the pulses.
    """

    steps: ThrustSteps
    lower_N: Array
    upper_N: Array
    shortest_s: Array

    @classmethod
    def of(cls, vehicle: Vehicle, pulse_s: float | None = None) -> Self | None:
        """For a vehicle as it is believed to be; None where its thrust is continuous.

        `pulse_s` is the shortest pulse and pause; None: each thruster's own lag.
        """
        steps = vehicle.thrust_steps
        if steps is None:
            return None
        return cls(
            steps=steps,
            lower_N=vehicle.thrust_lower_N,
            upper_N=vehicle.thrust_upper_N,
            shortest_s=vehicle.time_constants_s if pulse_s is None else np.full(len(vehicle.thrusters), pulse_s),
        )

    def step(self, state: PipelineState, dt_s: float, command: Command) -> tuple[PipelineState, Command]:
        """The command as the thrusters can follow it for `dt_s` seconds."""
        n = len(self.shortest_s)
        direction = np.zeros(n) if state.pwm_direction is None else state.pwm_direction
        owed = np.zeros(n) if state.pwm_owed_N_s is None else state.pwm_owed_N_s
        demanded = np.minimum(np.maximum(command.thrusts_N, self.lower_N), self.upper_N)
        direction, owed, thrusts = pulsed(direction, owed, demanded, dt_s, self.steps, self.shortest_s)
        sent = np.minimum(np.maximum(thrusts, self.lower_N), self.upper_N)
        state = replace(state, pwm_direction=direction, pwm_owed_N_s=owed)
        return state, replace(command, thrusts_N=sent)


def pulsed(
    direction: Array, owed_N_s: Array, demanded_N: Array, dt_s: float, steps: ThrustSteps, shortest_s: Array
) -> tuple[Array, Array, Array]:
    """Which way each thruster runs (-1, 0, 1), the impulse that it owes in N s, and its thrust, shape (n,) each.

    The mean of the thrusts over time is that of the demanded ones. `direction` and `owed_N_s` are those of the step
    before; thrusts are held for `dt_s`. A pulse or a pause lasts at least `shortest_s`, or one step where that is
    longer. Owed is never more than the least thrust times the shortest pulse and one step, as long as the demand lies
    within the thruster's limits.
    """
    n = len(demanded_N)
    before = frozen(direction, (n,), "direction"), frozen(owed_N_s, (n,), "owed")
    least = (steps.least_forward_N, steps.least_reverse_N)
    running, owed, thrusts = _pulses(*before, demanded_N, dt_s, shortest_s, *least, steps.levels)
    return running, owed, thrusts


@njit
def _pulses(
    running: Array, owed: Array, desired: Array, dt: float, shortest: Array, least_forward: float, least_reverse: float,
    levels: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Which way each thruster runs, what it owes, and its thrust, shape (n,) each; arguments as for `pulsed`."""
    n = desired.size
    ways, owes, thrusts = np.zeros(n), np.empty(n), np.zeros(n)
    for i in range(n):
        span, demand = max(shortest[i], dt), desired[i]
        if demand >= least_forward or demand <= -least_reverse:
            ways[i] = 1.0 if demand >= least_forward else -1.0
            # What is owed is made up for over a pulse; the way the thruster runs stays that of the demand.
            level = demand + owed[i] / span
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
        owes[i] = owed[i] + (demand - thrusts[i]) * dt
    return ways, owes, thrusts
