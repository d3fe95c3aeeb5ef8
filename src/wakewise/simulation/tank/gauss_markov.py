"""An error that lasts for a while: a stationary first-order Gauss-Markov process per axis."""

from __future__ import annotations

import math

import numpy as np

from wakewise.core.arrays import Array


class GaussMarkovProcess:
    """Three independent processes of standard deviation `sigma` whose values forget themselves within `lasts_s`.

    Exact between any two times: x(t + dt) = a x(t) + sigma sqrt(1 - a^2) n with a = exp(-dt / lasts_s), so that the
    spread is `sigma` from the first value on, however often it is asked for.
    """

    def __init__(self, sigma: float, lasts_s: float, rng: np.random.Generator) -> None:
        self._sigma, self._lasts_s, self._rng = sigma, lasts_s, rng
        self._time_s = 0.0
        self._value = rng.normal(0.0, sigma, 3)

    def at(self, time_s: float) -> Array:
        """The error at a time, not before the last one asked for, shape (3,)."""
        kept = math.exp((self._time_s - time_s) / self._lasts_s)
        spread = self._sigma * math.sqrt(max(1.0 - kept * kept, 0.0))
        self._value = kept * self._value + spread * self._rng.standard_normal(3)
        self._time_s = time_s
        return self._value
