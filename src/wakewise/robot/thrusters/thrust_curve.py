"""What one thruster makes of a pulse at a supply voltage: thrust, speed, power, and the pulse for a demand.

What thrusts a thruster can hold: none below its least, and above it those of whole steps of the command.

A brushless motor without sensors turns from a least speed on, or not at all, and its speed controller takes pulses of
whole microseconds. Between rest and the least thrust lies a gap that no command reaches.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, freeze, frozen
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit

NEUTRAL_US = 1500.0
"""The stick's middle by the convention of radio-control speed controllers; taken where the table is silent there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CurveSide:
    """One direction of a thruster at v voltages, on k knots that sit at the same share of the way at every voltage.

    Share 0 is the slowest running pulse, share 1 the outermost pulse of the table. Sharing them lets two voltages be
    mixed although they start to run at different pulses: mixing at equal pulses would smear the start.

    `share`, shape (k,): from 0 to 1, increasing. `silent_us`, `first_us`, `last_us`, shape (v,): outermost pulse
    without thrust, the slowest running pulse and the outermost pulse of the table. `thrust_N`, shape (v, k):
    magnitudes, never falling along k. `rpm`, `power_W`, shape (v, k): magnitudes; None if the table has none.
    """

    share: Array
    silent_us: Array
    first_us: Array
    last_us: Array
    thrust_N: Array
    rpm: Array | None = None
    power_W: Array | None = None

    def __post_init__(self) -> None:
        freeze(self, share=(None,), silent_us=(None,))
        voltages, knots = self.silent_us.size, self.share.size
        freeze(self, first_us=(voltages,), last_us=(voltages,), thrust_N=(voltages, knots))
        for field in ("rpm", "power_W"):
            if getattr(self, field) is not None:
                freeze(self, **{field: (voltages, knots)})
        if knots < 2 or self.share[0] != 0.0 or self.share[-1] != 1.0 or not np.all(np.diff(self.share) > 0.0):
            raise InputError("thrust curve: shares must increase from 0 to 1, at least two of them")
        if np.any(self.thrust_N < 0.0) or np.any(np.diff(self.thrust_N, axis=1) < 0.0):
            raise InputError("thrust curve: thrust must be a magnitude that never falls away from neutral")


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustCurve:
    """A thruster's static map at one or several supply voltages, straight between knots and between voltages.

    Thrust is positive forward; a pulse is the servo pulse in microseconds. Every method takes arrays of any shape, and
    one supply voltage, which may be left out where the table has only one. A pulse beyond the table counts as its
    outermost pulse and a thrust beyond the limits as the limit: that is how a thruster saturates.

    Between `silent_us` and `first_us` (4 us apart in a fine table) the thruster is taken to run at its slowest. A
    desired thrust below the first one that can be held is rounded to none or to that first step, whichever is nearer.

    `supply_V`, shape (v,): increasing. `neutral_us`: the pulse that is sent for no thrust. `notes`: what was found and
    done when the table was read, one sentence each. Raises InputError from every method: if a pulse or thrust is not
    finite, or the voltage lies outside the table.
    """

    name: str
    source: str
    supply_V: Array
    neutral_us: float
    forward: CurveSide
    reverse: CurveSide
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, supply_V=(None,))
        if self.supply_V.size == 0 or not np.all(np.diff(self.supply_V) > 0.0) or self.supply_V[0] <= 0.0:
            raise InputError(f"thrust curve {self.name}: voltages must be positive and increase")
        for side in (self.forward, self.reverse):
            if side.silent_us.size != self.supply_V.size:
                raise InputError(f"thrust curve {self.name}: needs as many rows as voltages")

    def thrust_N(self, pwm_us: ArrayLike, supply_V: float | None = None) -> Array:
        """Thrust at pulses of any shape; zero in the deadband."""
        pulse = _finite(pwm_us, "pulse")
        mix = self._mix(supply_V)
        thrust = np.zeros_like(pulse)
        for sign, side in self._sides():
            silent, first, last = mix(side.silent_us), mix(side.first_us), mix(side.last_us)
            running = sign * (pulse - silent) > 0.0
            share = (pulse - first) / (last - first)
            # `interp` holds its ends: the slowest running thrust below share 0, saturation above 1.
            thrust = np.where(running, sign * np.interp(share, side.share, mix(side.thrust_N)), thrust)
        return thrust

    def pwm_us(self, thrust_N: ArrayLike, supply_V: float | None = None) -> Array:
        """Pulse for desired thrusts of any shape; where a thrust has several, the one nearest to neutral."""
        return self._along(
            thrust_N,
            supply_V,
            lambda _, side, share, mix: mix(side.first_us) + share * (mix(side.last_us) - mix(side.first_us)),
            at_rest=self.neutral_us,
        )

    def delivered_N(self, thrust_N: ArrayLike, supply_V: float | None = None) -> Array:
        """Thrust that a desired thrust turns into: limited, and rounded below the first step; any shape."""
        return self._signed("thrust_N", thrust_N, supply_V)

    def rpm(self, thrust_N: ArrayLike, supply_V: float | None = None) -> Array:
        """Rotor speed in revolutions per minute at delivered thrusts of any shape; negative in reverse."""
        return self._signed("rpm", thrust_N, supply_V)

    def power_W(self, thrust_N: ArrayLike, supply_V: float | None = None) -> Array:
        """Electrical power at delivered thrusts of any shape; none at rest, since tables leave standby out."""
        return np.abs(self._signed("power_W", thrust_N, supply_V))

    def limits_N(self, supply_V: float | None = None) -> tuple[float, float]:
        """Lowest (negative) and highest thrust at a voltage."""
        mix = self._mix(supply_V)
        return -float(mix(self.reverse.thrust_N)[-1]), float(mix(self.forward.thrust_N)[-1])

    def first_step_N(self, supply_V: float | None = None) -> tuple[float, float]:
        """Smallest thrusts that can be held: reverse (negative) and forward."""
        mix = self._mix(supply_V)
        return -float(mix(self.reverse.thrust_N)[0]), float(mix(self.forward.thrust_N)[0])

    def deadband_us(self, supply_V: float | None = None) -> tuple[float, float]:
        """Outermost pulses that give no thrust, both included."""
        mix = self._mix(supply_V)
        return float(mix(self.reverse.silent_us)), float(mix(self.forward.silent_us))

    def pulse_limits_us(self, supply_V: float | None = None) -> tuple[float, float]:
        """Outermost pulses of the table."""
        mix = self._mix(supply_V)
        return float(mix(self.reverse.last_us)), float(mix(self.forward.last_us))

    def voltage(self, supply_V: float | None = None) -> float:
        """Check a supply voltage; left out, it is the table's only one."""
        low, high = float(self.supply_V[0]), float(self.supply_V[-1])
        if supply_V is None:
            if low != high:
                raise InputError(f"thrust curve {self.name}: which supply voltage? It holds {low:g} to {high:g} V")
            return low
        if not low <= supply_V <= high:
            raise InputError(
                f"thrust curve {self.name}: supply_V = {supply_V:g}, the table holds {low:g} to {high:g} V"
            )
        return float(supply_V)

    def _sides(self) -> tuple[tuple[float, CurveSide], tuple[float, CurveSide]]:
        return (1.0, self.forward), (-1.0, self.reverse)

    def _mix(self, supply_V: float | None) -> Mix:
        at = self.voltage(supply_V)
        upper = min(max(int(np.searchsorted(self.supply_V, at)), 1), self.supply_V.size - 1)
        if self.supply_V.size == 1:
            return lambda rows: np.asarray(rows)[0]
        below, above = float(self.supply_V[upper - 1]), float(self.supply_V[upper])
        weight = (at - below) / (above - below)

        def mix(rows: Array | None) -> Array:
            values = np.asarray(rows)
            return np.asarray((1.0 - weight) * values[upper - 1] + weight * values[upper])

        return mix

    def _along(self, thrust_N: ArrayLike, supply_V: float | None, value: Along, *, at_rest: float) -> Array:
        """Read `value` off each side where the desired thrust lies on it."""
        desired = _finite(thrust_N, "thrust")
        mix = self._mix(supply_V)
        result = np.full_like(desired, at_rest)
        for sign, side in self._sides():
            thrusts = mix(side.thrust_N)
            target = np.clip(sign * desired, thrusts[0], thrusts[-1])
            # Half the first step is where it is as near as nothing; a curve that starts at zero has no step.
            runs = (sign * desired > 0.0) & (sign * desired >= 0.5 * thrusts[0]) & (thrusts[-1] > 0.0)
            result = np.where(runs, value(sign, side, _shares(target, thrusts, side.share), mix), result)
        return result

    def _signed(self, field: str, thrust_N: ArrayLike, supply_V: float | None) -> Array:
        """A column of the table at delivered thrusts, negative in reverse, 0 at rest."""
        if getattr(self.forward, field) is None or getattr(self.reverse, field) is None:
            raise InputError(f"thrust curve {self.name}: its table has no column {field}")
        return self._along(
            thrust_N,
            supply_V,
            lambda sign, side, share, mix: sign * np.interp(share, side.share, mix(getattr(side, field))),
            at_rest=0.0,
        )


Mix = Callable[[Array | None], Array]
Along = Callable[[float, CurveSide, Array, Mix], Array]


def _shares(target: Array, thrusts: Array, share: Array) -> Array:
    """Share where a never-falling curve first reaches each target; on a flat `interp` would leave that open."""
    above = np.clip(np.searchsorted(thrusts, target, side="left"), 1, thrusts.size - 1)
    low, rise = thrusts[above - 1], thrusts[above] - thrusts[above - 1]
    part = np.divide(target - low, rise, out=np.zeros_like(target), where=rise > 0.0)
    return np.asarray(share[above - 1] + part * (share[above] - share[above - 1]))


def _finite(value: ArrayLike, what: str) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if not np.all(np.isfinite(array)):
        raise InputError(f"thrust curve: {what} holds NaN or infinity, every element must be finite")
    return array


PULSE_STEP_US = 1.0
"""Autopilots state servo pulses in whole microseconds (MAVLink, message SERVO_OUTPUT_RAW: uint16, us)."""

_TOLERANCE_N = 1e-9  # a demand for the least thrust itself is met however it was rounded
_NO_LEVELS = frozen([], (0,), "levels_N")


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustSteps:
    """The thrusts that one thruster can hold.

    `least_forward_N`, `least_reverse_N`: smallest running thrusts, both as magnitudes; 0 where there is no gap.
    `levels_N`, shape (m,): all running thrusts, increasing, reverse ones negative; None: any beyond the least ones.
    Raises InputError if a least thrust is negative or not finite, or a level lies in the gap.
    """

    least_forward_N: float
    least_reverse_N: float
    levels_N: Array | None = None

    def __post_init__(self) -> None:
        for field in ("least_forward_N", "least_reverse_N"):
            value = getattr(self, field)
            if not math.isfinite(value) or value < 0.0:
                raise InputError(f"{field}: {value:g}, must be finite and at least 0")
        if self.levels_N is not None:
            freeze(self, levels_N=(None,))
            low, high = -self.least_reverse_N + _TOLERANCE_N, self.least_forward_N - _TOLERANCE_N
            if not np.all(np.diff(self.levels_N) > 0.0) or np.any((self.levels_N > low) & (self.levels_N < high)):
                raise InputError("levels_N: must increase, and none may lie below the least thrusts")

    @classmethod
    def of_curve(cls, curve: ThrustCurve, supply_V: float) -> ThrustSteps:
        """Steps of a thruster that follows a curve at a voltage and is commanded in whole microseconds.

        Raises InputError if the voltage lies outside the table.
        """
        low, high = curve.pulse_limits_us(supply_V)
        thrusts = curve.thrust_N(np.arange(math.ceil(low), math.floor(high) + 1, PULSE_STEP_US), supply_V)
        reverse, forward = curve.first_step_N(supply_V)
        return cls(
            least_forward_N=forward, least_reverse_N=-reverse, levels_N=np.unique(thrusts[np.abs(thrusts) > 0.0])
        )

    @property
    def levels(self) -> Array:
        """`levels_N` as kernels take them: empty where all thrusts beyond the least are held."""
        return _NO_LEVELS if self.levels_N is None else self.levels_N

    def delivered_N(self, desired_N: ArrayLike) -> Array:
        """Thrusts that desired thrusts of any shape turn into: none below the least, else the nearest step."""
        thrusts = np.array(desired_N, dtype=np.float64, order="C")
        _deliver(thrusts.reshape(-1), self.levels, self.least_forward_N, self.least_reverse_N)
        return thrusts

    def nearest_N(self, desired_N: ArrayLike) -> Array:
        """The running thrusts nearest to desired ones of any shape, in the same direction (0 counts as forward).

        The outermost step stands for all beyond it.
        """
        desired = np.asarray(desired_N, dtype=np.float64)
        forward = desired >= 0.0
        beyond = np.where(
            forward, np.maximum(desired, self.least_forward_N), np.minimum(desired, -self.least_reverse_N)
        )
        if self.levels_N is None or not self.levels_N.size:
            return np.asarray(beyond)
        above = np.clip(np.searchsorted(self.levels_N, beyond), 1, max(self.levels_N.size - 1, 1))
        high, low = self.levels_N[np.minimum(above, self.levels_N.size - 1)], self.levels_N[above - 1]
        found = np.where(beyond - low < high - beyond, low, high)
        # A thruster that runs one way only is not turned about to be near.
        return np.where(np.sign(found) == np.where(forward, 1.0, -1.0), found, 0.0)


@njit
def _deliver(thrusts_N: Array, levels_N: Array, least_forward_N: float, least_reverse_N: float) -> None:
    """Turn desired thrusts, shape (n,), in place into those held: 0 in the gap, else as `ThrustSteps.nearest_N`."""
    for i in range(thrusts_N.shape[0]):
        desired = thrusts_N[i]
        runs = desired >= least_forward_N - _TOLERANCE_N or desired <= -least_reverse_N + _TOLERANCE_N
        thrusts_N[i] = nearest(desired, least_forward_N, least_reverse_N, levels_N) if runs else 0.0


@njit
def nearest(desired_N: float, least_forward_N: float, least_reverse_N: float, levels_N: Array) -> float:
    """`ThrustSteps.nearest_N` of one demand; of no levels all are held."""
    forward, last = desired_N >= 0.0, levels_N.shape[0] - 1
    found = max(desired_N, least_forward_N) if forward else min(desired_N, -least_reverse_N)
    if last < 0:
        return float(found)
    above = min(max(np.searchsorted(levels_N, found), 1), max(last, 1))
    low, high = levels_N[above - 1], levels_N[min(above, last)]
    found = low if found - low < high - found else high
    # A thruster that runs one way only is not turned about to be near.
    return float(found) if (found > 0.0 if forward else found < 0.0) else 0.0
