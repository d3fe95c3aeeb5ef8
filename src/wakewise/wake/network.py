"""A small neural network for a jet that remembers how its thruster pushed: features, forward pass, its numbers.

Rival of the jets of this room, after L. Vendruscolo, E. Sebastian, A. Prorok and A. Shankar, Wake Up to the Past, arXiv
2603.22472 (2026): predictors of wakes need the history of the states and the transport delay, and some 18,000 weights
are enough. What is known of theirs is the abstract; the layers here are our own choice of that size.

One jet, points in cylindrical coordinates of its frame: x along the jet from the disk's middle, r off its axis, D the
disk's diameter, R = sqrt(x^2 + r^2). With M(t) = T(t) / rho, the flux of momentum, and M* the greatest of it that is
remembered, dimensions leave nothing else than

    velocity = sqrt(M*) / (R + D) f(x / D, r / D, M(t - delays) / M*)
    delays in units of t* = (R^2 / 6.6 + R D) / sqrt(M*)

t* is about the time that a starting jet's front takes to R: it is at 2.57 M^(1/4) t^(1/2). So transport delay is in the
coordinates, four times the thrust in half the time gives twice the speed exactly, and a steady jet goes with sqrt(T).
f is a perceptron with two hidden layers of tanh; the part across is nil on the axis by construction.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError

EDGES = np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.3, 1.7, 2.4, 3.5, 6.0])
"""Delays in t* between which the thrust is averaged: finer than a tenth of t* a jet's own front is blurred."""
INPUTS = 5 + len(EDGES) - 1
HIDDEN = 124
"""Of both hidden layers: 17,982 weights in all."""
OUTPUTS = 2
FRONT = 6.6
"""Square of the 2.57 of a starting jet's front."""
NEAREST_D, FARTHEST_D = 0.5, 24.0
"""Range of R / D that f is asked in; nearer it stays, farther it is the same along the same direction."""
_NARROW, _TIP_D = 0.12, 3.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """Weights of f; `weights[k]`, shape (n_k, n_k+1), and `biases[k]`, shape (n_k+1,)."""

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]

    def __post_init__(self) -> None:
        sizes = (INPUTS, *(w.shape[1] for w in self.weights))
        if len(self.weights) != len(self.biases) or sizes[-1] != OUTPUTS:
            raise InputError(f"network: {len(self.weights)} layers to {sizes[-1]} values, allowed {OUTPUTS} values")
        for k, (w, b) in enumerate(zip(self.weights, self.biases, strict=True)):
            if w.shape != sizes[k : k + 2] or b.shape != sizes[k + 1 : k + 2]:
                raise InputError(f"network: layer {k} has shapes {w.shape} and {b.shape}, allowed {sizes[k : k + 2]}")
            if not (np.isfinite(w).all() and np.isfinite(b).all()):
                raise InputError(f"network: layer {k} holds NaN or infinity, every weight must be finite")
        frozen = {"weights": self.weights, "biases": self.biases}
        for name, arrays in frozen.items():
            object.__setattr__(self, name, tuple(_read_only(a) for a in arrays))

    @classmethod
    def drawn(cls, rng: np.random.Generator, hidden: tuple[int, ...] = (HIDDEN, HIDDEN)) -> Network:
        """Weights to begin a training with (X. Glorot and Y. Bengio 2010: variance 2 / (inputs + outputs))."""
        sizes = (INPUTS, *hidden, OUTPUTS)
        pairs = list(pairwise(sizes))
        return cls(
            weights=tuple(rng.normal(0.0, np.sqrt(2.0 / (a + b)), (a, b)) for a, b in pairs),
            biases=tuple(np.zeros(b) for _, b in pairs),
        )

    @property
    def size(self) -> int:
        """How many numbers were trained."""
        return sum(w.size + b.size for w, b in zip(self.weights, self.biases, strict=True))

    def forward(self, inputs: Array) -> Array:
        """Values of f, shape (n, 2), that across not yet scaled, of inputs, shape (n, INPUTS)."""
        values = inputs
        for w, b in zip(self.weights[:-1], self.biases[:-1], strict=True):
            values = np.tanh(values @ w + b)
        out: Array = values @ self.weights[-1] + self.biases[-1]
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class JetPoints:
    """Points of one jet, as f sees them.

    `x_D` and `r_D`, shape (n,), over the disk's diameter; `r_D` must not be negative.
    """

    x_D: Array
    r_D: Array

    def __post_init__(self) -> None:
        freeze(self, x_D=(None,), r_D=(len(self.x_D),))

    @property
    def away_D(self) -> Array:
        """R / D, shape (n,)."""
        return np.asarray(np.hypot(self.x_D, self.r_D))

    @property
    def _within(self) -> tuple[Array, Array]:
        """Places x / D and r / D moved along the ray from the disk into the range that f is asked in.

        The middle of the disk counts as on the axis before it.
        """
        away = self.away_D
        scale = np.clip(away, NEAREST_D, FARTHEST_D) / np.maximum(away, 1e-9)
        return np.where(away > 0.0, self.x_D * scale, NEAREST_D), self.r_D * scale

    @property
    def slope(self) -> Array:
        """Distance off the axis in widths of a jet, shape (n,); 0 on the axis."""
        x, r = self._within
        return np.asarray(r / (_NARROW * (np.maximum(x, 0.0) + _TIP_D)))

    @property
    def across_share(self) -> Array:
        """What the second value of f is multiplied by: 0 on the axis, 1 far off it."""
        return np.asarray(self.slope / (1.0 + self.slope))

    def delays(self) -> Array:
        """t* in D / sqrt(M*) x D, shape (n,): multiply by D^2 / sqrt(M*)."""
        away = self.away_D
        return np.asarray(away**2 / FRONT + away)

    def inputs(self, history: Array) -> Array:
        """Inputs of the network, shape (n, INPUTS), from M over M* in each bin of delay, shape (n, len(EDGES) - 1)."""
        x, r = self._within
        away = np.hypot(x, r)
        slope = self.slope
        places = (
            2.0 * np.log(away / NEAREST_D) / np.log(FARTHEST_D / NEAREST_D) - 1.0,
            x / away,
            r / away,
            slope / (1.0 + slope),
            np.exp(-(slope**2)),
        )
        return np.column_stack([*places, np.sqrt(np.clip(history, 0.0, 1.0))])


def remembered(times_s: Array, thrusts_N: Array, now_s: float, memory_s: float) -> float:
    """Largest thrust that pushed in the last `memory_s`; 0 if none did.

    Parameters
    ----------
    times_s : ndarray, shape (k,)
        Rising; row i of the thrusts holds until the next time, the last one on.
    thrusts_N : ndarray, shape (k,)
        Not negative.
    """
    ends = np.append(times_s[1:], np.inf)
    felt = (times_s < now_s) & (ends > now_s - memory_s)
    return float(np.max(thrusts_N[felt], initial=0.0))


def history_bins(times_s: Array, thrusts_N: Array, now_s: float, delays_s: Array, greatest_N: float) -> Array:
    """Mean thrust between the edges of delay over the greatest, shape (n, len(EDGES) - 1); at rest before the start.

    Parameters
    ----------
    times_s, thrusts_N : ndarray, shape (k,)
        As for `remembered`.
    now_s : float
    delays_s : ndarray, shape (n,)
        t* of each point.
    greatest_N : float
        More than 0.
    """
    ends = np.append(times_s[times_s < now_s], now_s)
    count = len(ends) - 1
    if count == 0:
        return np.zeros((len(delays_s), len(EDGES) - 1))
    impulse = np.concatenate([[0.0], np.cumsum(np.diff(ends) * thrusts_N[:count])])
    asked = now_s - delays_s[:, None] * EDGES
    given = np.interp(asked, ends, impulse)
    return np.asarray((given[:, :-1] - given[:, 1:]) / (delays_s[:, None] * np.diff(EDGES) * greatest_N))


def _read_only(values: Array) -> Array:
    out = np.array(values, dtype=np.float64)
    out.setflags(write=False)
    return out
