"""What thrusts a thruster can hold: none below its least, and above it those of whole steps of the command.

A brushless motor without sensors turns from a least speed on, or not at all, and its speed controller takes pulses of
whole microseconds. Between rest and the least thrust lies a gap that no command reaches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, freeze, frozen
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit
from wakewise.robot.thrusters.thrust_curve import ThrustCurve

PULSE_STEP_US = 1.0
"""Autopilots state servo pulses in whole microseconds (MAVLink, message SERVO_OUTPUT_RAW: uint16, us)."""

_TOLERANCE_N = 1e-9  # a wish for the least thrust itself is met however it was rounded
_NO_LEVELS = frozen([], (0,), "levels_N")


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustSteps:
    """The thrusts that one thruster can hold.

    Parameters
    ----------
    least_forward_N, least_reverse_N : float
        Smallest running thrusts, both as magnitudes; 0 where there is no gap.
    levels_N : ndarray, shape (m,), or None
        All running thrusts, increasing, reverse ones negative; None: any beyond the least ones.

    Raises
    ------
    InputError
        If a least thrust is negative or not finite, or a level lies in the gap.
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

        Raises
        ------
        InputError
            If the voltage lies outside the table.
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

    def delivered_N(self, wished_N: ArrayLike) -> Array:
        """Thrusts that wished thrusts of any shape turn into: none below the least, else the nearest step."""
        thrusts = np.array(wished_N, dtype=np.float64, order="C")
        _deliver(thrusts.reshape(-1), self.levels, self.least_forward_N, self.least_reverse_N)
        return thrusts

    def nearest_N(self, wished_N: ArrayLike) -> Array:
        """The running thrusts nearest to wished ones of any shape, in the wish's own direction (0 counts as forward).

        The outermost step stands for all beyond it.
        """
        wished = np.asarray(wished_N, dtype=np.float64)
        forward = wished >= 0.0
        beyond = np.where(forward, np.maximum(wished, self.least_forward_N), np.minimum(wished, -self.least_reverse_N))
        if self.levels_N is None or not self.levels_N.size:
            return np.asarray(beyond)
        above = np.clip(np.searchsorted(self.levels_N, beyond), 1, max(self.levels_N.size - 1, 1))
        high, low = self.levels_N[np.minimum(above, self.levels_N.size - 1)], self.levels_N[above - 1]
        found = np.where(beyond - low < high - beyond, low, high)
        # A thruster that runs one way only is not turned about to be near.
        return np.where(np.sign(found) == np.where(forward, 1.0, -1.0), found, 0.0)


@njit
def _deliver(thrusts_N: Array, levels_N: Array, least_forward_N: float, least_reverse_N: float) -> None:
    """Turn wished thrusts, shape (n,), in place into those held: 0 in the gap, else as `ThrustSteps.nearest_N`."""
    for i in range(thrusts_N.shape[0]):
        wished = thrusts_N[i]
        runs = wished >= least_forward_N - _TOLERANCE_N or wished <= -least_reverse_N + _TOLERANCE_N
        thrusts_N[i] = nearest(wished, least_forward_N, least_reverse_N, levels_N) if runs else 0.0


@njit
def nearest(wished_N: float, least_forward_N: float, least_reverse_N: float, levels_N: Array) -> float:
    """`ThrustSteps.nearest_N` of one wish; of no levels all are held."""
    forward, last = wished_N >= 0.0, levels_N.shape[0] - 1
    found = max(wished_N, least_forward_N) if forward else min(wished_N, -least_reverse_N)
    if last < 0:
        return float(found)
    above = min(max(np.searchsorted(levels_N, found), 1), max(last, 1))
    low, high = levels_N[above - 1], levels_N[min(above, last)]
    found = low if found - low < high - found else high
    # A thruster that runs one way only is not turned about to be near.
    return float(found) if (found > 0.0 if forward else found < 0.0) else 0.0
