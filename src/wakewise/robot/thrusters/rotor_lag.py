"""How delivered thrust follows commanded thrust: four lag models, each with its exact step for a constant command.

A state has shape (order, n) for n thrusters, so that a plant steps all its thrusters at once. Commands are commanded
thrusts, or anything that steady thrust is proportional to. Dead time is kept apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError


class LagModel(Protocol):
    """A lag without dead time."""

    @property
    def name(self) -> str:
        """What the model is called in words."""

    @property
    def mean_delay_s(self) -> float:
        """Area between a unit step and the response to it, from rest at no command."""

    def rest(self, commands: ArrayLike) -> Array:
        """State, shape (order, n), that has settled at commands, shape (n,)."""

    def step(self, state: Array, commands: ArrayLike, dt_s: float) -> Array:
        """State after `dt_s` of constant commands, shape (n,); exact for any `dt_s`."""

    def thrust(self, state: Array) -> Array:
        """Thrust, shape (n,), in the unit of the commands."""

    def response(self, commands: Array, dt_s: float) -> Array:
        """Thrust at the start of each interval, shape (m,), of commands, shape (m,), held for `dt_s` each.

        Starts settled at the first command; equals `step` repeated.
        """


@dataclass(frozen=True, kw_only=True)
class FirstOrderLag:
    """dT/dt = (command - T) / time constant."""

    time_constant_s: float

    name = "first order"

    def __post_init__(self) -> None:
        _positive("time_constant_s", self.time_constant_s)

    @property
    def mean_delay_s(self) -> float:
        """The time constant."""
        return self.time_constant_s

    def rest(self, commands: ArrayLike) -> Array:
        """State, shape (1, n): the thrusts."""
        return np.atleast_1d(np.asarray(commands, dtype=np.float64))[None, :]

    def step(self, state: Array, commands: ArrayLike, dt_s: float) -> Array:
        """Exponential approach to the settled state; see `LagModel.step`."""
        target = self.rest(commands)
        return np.asarray(target + np.exp(-dt_s / self.time_constant_s) * (state - target))

    def thrust(self, state: Array) -> Array:
        """The state itself."""
        return np.asarray(state[0])

    def response(self, commands: Array, dt_s: float) -> Array:
        """See `LagModel.response`."""
        kept = float(np.exp(-dt_s / self.time_constant_s))
        start = commands[0]
        return np.asarray(start + _filtered([0.0, 1.0 - kept], [1.0, -kept], commands - start))


@dataclass(frozen=True, kw_only=True)
class RotorLag(FirstOrderLag):
    """A rotor whose speed lags, and thrust as the square of speed: dn/dt = (n_command - n) / time constant, T ~ n|n|.

    Thrust as the square of propeller speed at rest in still water is in e.g. T. Fossen, Handbook of Marine Craft
    Hydrodynamics and Motion Control, 2nd ed. 2021, section 9. The state is the signed root of thrust.
    """

    name = "rotor, thrust as speed squared"

    @property
    def mean_delay_s(self) -> float:
        """1.5 time constants: the integral of 1 - (1 - exp(-t/tau))^2."""
        return 1.5 * self.time_constant_s

    def rest(self, commands: ArrayLike) -> Array:
        """State, shape (1, n): the signed roots of thrust."""
        return _signed_root(super().rest(commands))

    def thrust(self, state: Array) -> Array:
        """Square of the state, with its sign."""
        return np.asarray(state[0] * np.abs(state[0]))

    def response(self, commands: Array, dt_s: float) -> Array:
        """See `LagModel.response`."""
        speed = super().response(_signed_root(commands), dt_s)
        return speed * np.abs(speed)


@dataclass(frozen=True, kw_only=True)
class SecondOrderLag:
    """T'' = w^2 (command - T) - 2 z w T', which overshoots for a damping ratio z below 1."""

    natural_rad_s: float
    damping_ratio: float

    name = "second order"

    def __post_init__(self) -> None:
        _positive("natural_rad_s", self.natural_rad_s)
        _positive("damping_ratio", self.damping_ratio)

    @property
    def mean_delay_s(self) -> float:
        """2 z / w, the first moment of the impulse response."""
        return 2.0 * self.damping_ratio / self.natural_rad_s

    def rest(self, commands: ArrayLike) -> Array:
        """State, shape (2, n): the thrusts and their rates."""
        target = np.atleast_1d(np.asarray(commands, dtype=np.float64))
        return np.stack([target, np.zeros_like(target)])

    def step(self, state: Array, commands: ArrayLike, dt_s: float) -> Array:
        """Matrix exponential; see `LagModel.step`."""
        target = self.rest(commands)
        return np.asarray(target + self.transition(dt_s) @ (state - target))

    def thrust(self, state: Array) -> Array:
        """First row of the state."""
        return np.asarray(state[0])

    def response(self, commands: Array, dt_s: float) -> Array:
        """See `LagModel.response`."""
        phi = self.transition(dt_s)
        push = np.array([1.0 - phi[0, 0], -phi[1, 0]])
        numerator = [0.0, push[0], phi[0, 1] * push[1] - phi[1, 1] * push[0]]
        denominator = [1.0, -np.trace(phi), phi[0, 0] * phi[1, 1] - phi[0, 1] * phi[1, 0]]
        start = commands[0]
        return np.asarray(start + _filtered(numerator, denominator, commands - start))

    def transition(self, dt_s: float) -> Array:
        """exp(A dt), shape (2, 2), in closed form for A = [[0, 1], [-w^2, -2 z w]]."""
        w, z = self.natural_rad_s, self.damping_ratio
        # A has eigenvalues s +- q; q is imaginary below critical damping, where cosh and sinh become cos and sin.
        s, q = -z * w, w * np.sqrt(complex(z * z - 1.0))
        # In exponentials, since exp(s t) cosh(q t) overflows halfway for long steps of a slow, damped lag.
        rising, falling = np.exp((s + q) * dt_s), np.exp((s - q) * dt_s)
        even = 0.5 * (rising + falling).real
        odd = (0.5 * (rising - falling) / q).real if abs(q) * dt_s > 1e-6 else dt_s * float(np.exp(s * dt_s))
        system = np.array([[0.0, 1.0], [-w * w, -2.0 * z * w]])
        return np.asarray(even * np.eye(2) + odd * (system - s * np.eye(2)))


@dataclass(frozen=True, kw_only=True)
class SplitLag(FirstOrderLag):
    """A part of the thrust follows at once and the rest by a first-order lag: (1 + share tau s) / (1 + tau s).

    A share above 1 overshoots and sinks back, as thrust does while the water in the duct has yet to speed up
    (A. Healey et al., IEEE J. Oceanic Eng. 20, 1995, 354); a share below 1 leaves a slow tail.
    """

    direct_share: float

    name = "first order with a direct share"

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive("direct_share", self.direct_share)

    @property
    def mean_delay_s(self) -> float:
        """The time constant weighted by the share that lags; negative if the response overshoots."""
        return (1.0 - self.direct_share) * self.time_constant_s

    def rest(self, commands: ArrayLike) -> Array:
        """State, shape (2, n): the last commands and the lagged part's thrusts."""
        target = np.atleast_1d(np.asarray(commands, dtype=np.float64))
        return np.stack([target, target])

    def step(self, state: Array, commands: ArrayLike, dt_s: float) -> Array:
        """Exponential approach of the lagged part; see `LagModel.step`."""
        target = self.rest(commands)
        return np.stack([target[1], target[1] + np.exp(-dt_s / self.time_constant_s) * (state[1] - target[1])])

    def thrust(self, state: Array) -> Array:
        """Both parts together."""
        return np.asarray(self.direct_share * state[0] + (1.0 - self.direct_share) * state[1])

    def response(self, commands: Array, dt_s: float) -> Array:
        """See `LagModel.response`."""
        lagged = super().response(commands, dt_s)
        direct = np.append(commands[:1], commands[:-1])
        return np.asarray(self.direct_share * direct + (1.0 - self.direct_share) * lagged)


def _filtered(numerator: list[float], denominator: list[float], values: Array) -> Array:
    # Loading scipy.signal takes half a second, which only an identification needs.
    from scipy.signal import lfilter

    return np.asarray(lfilter(numerator, denominator, values))


def _signed_root(values: Array) -> Array:
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))


def _positive(field: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise InputError(f"lag: {field} = {value:g}, must be finite and more than 0")
