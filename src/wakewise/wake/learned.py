"""Wake model `learned`: a small neural network of a jet with the thruster's thrust history.

Trained on simulated jets of the tank and the lattice Boltzmann solver (`wakewise_paper.learned_wake`), so its scores in
the tank are circular to that degree. It has the radial velocity and the inflow towards a jet's sides, which the other
models leave out. As a `WakeModel` the thrust is steady; `LearnedWake.velocity` takes a history. Size and inputs follow
L. Vendruscolo, E. Sebastian, A. Prorok and A. Shankar, Wake Up to the Past, arXiv 2603.22472 (2026), of which only the
abstract was available: history of states, transport delay, about 18,000 weights.

Points are in cylindrical coordinates of the jet: x along it from the disk's centre, r off its axis, D the disk's
diameter, R = sqrt(x^2 + r^2). With M(t) = T(t) / rho and M* its maximum over the history, dimensional analysis gives

    velocity = sqrt(M*) / (R + D) f(x / D, r / D, M(t - delays) / M*)
    delays in units of t* = (R^2 / 6.6 + R D) / sqrt(M*)

t* is about the time in which a starting jet's front reaches R (2.57 M^(1/4) t^(1/2)). Four times the thrust in half the
time therefore gives exactly twice the speed, and a steady jet goes with sqrt(T). f is a perceptron with two hidden
tanh layers; its radial component is zero on the axis by construction.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import WakeModel
from wakewise.core.size_limits import check_arrays
from wakewise.wake.wall_jet import WALL_SPEED, ImpingingJet, wall_velocity

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

    `times_s`, shape (k,): rising; row i of the thrusts holds until the next time, the last one on. `thrusts_N`, shape
    (k,): not negative.
    """
    ends = np.append(times_s[1:], np.inf)
    felt = (times_s < now_s) & (ends > now_s - memory_s)
    return float(np.max(thrusts_N[felt], initial=0.0))


def history_bins(times_s: Array, thrusts_N: Array, now_s: float, delays_s: Array, greatest_N: float) -> Array:
    """Mean thrust between the edges of delay over the greatest, shape (n, len(EDGES) - 1); at rest before the start.

    - `times_s`, `thrusts_N`, shape (k,): as for `remembered`.
    - `delays_s`, shape (n,): t* of each point.
    - `greatest_N`: more than 0.
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


CIRCULAR = "circular to a degree: trained on draws of the tank's own water"
"""To be printed wherever it is judged in the tank."""
MEMORY_S = 60.0
"""How long a thrust counts for what a history is measured by; a wake a metre away is older at 0.02 N only."""
SHIPPED = Path(__file__).parent / "data" / "learned.npz"
_ROWS, _COLUMNS = 96, 257  # of the table, by log R and by the angle's root; within 2 % of the exit speed of f itself


@dataclass(frozen=True, kw_only=True, eq=False)
class LearnedWake:
    """A trained network as a wake model."""

    network: Network
    # Depth of a bed along which jets run out as in `wakewise.wake.wall_jet`; None for free jets alone.
    bed_z_m: float | None = None
    water_density_kg_m3: float = FRESH_WATER_KG_M3
    _table: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.bed_z_m is not None and not np.isfinite(self.bed_z_m):
            raise InputError(f"wake model learned: bed_z_m {self.bed_z_m:g}, must be finite")
        table = steady_table(self.network)
        table.setflags(write=False)
        object.__setattr__(self, "_table", table)

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "learned" if self.bed_z_m is None else "learned+floor"

    @property
    def free(self) -> LearnedWake:
        """The same without a floor."""
        return LearnedWake(network=self.network, water_density_kg_m3=self.water_density_kg_m3)

    def unit_velocity(self, points_W_m: Array, origins_W_m: Array, directions_W: Array, area_m2: Array) -> Array:
        """Velocity per square root of newton, shape (m, n, 3): see `wakewise.core.interfaces.WakeModel`.

        f at an even push is a function of place alone: it is looked up in a table, bilinear.
        """
        points, origins, directions = (np.asarray(a, dtype=np.float64) for a in (points_W_m, origins_W_m, directions_W))
        diameter = np.sqrt(4.0 * np.asarray(area_m2, dtype=np.float64) / np.pi)
        away = points[None] - origins[:, None]
        along = np.einsum("mnx,mx->mn", away, directions)
        outward = away - along[..., None] * directions[:, None]
        across = np.linalg.norm(outward, axis=2)
        distance = np.hypot(along, across)
        steady = self._looked_up(distance / diameter[:, None], np.arctan2(across, along))
        scale = 1.0 / (np.sqrt(self.water_density_kg_m3) * (distance + diameter[:, None]))
        outward = outward / np.maximum(across, 1e-12)[..., None]
        velocity = scale[..., None] * (steady[0][..., None] * directions[:, None] + steady[1][..., None] * outward)
        if self.bed_z_m is not None:
            floor = np.array([self.bed_z_m, WALL_SPEED / np.sqrt(self.water_density_kg_m3)])
            velocity = velocity + wall_velocity(
                np.ascontiguousarray(points),
                np.ascontiguousarray(origins),
                np.ascontiguousarray(directions),
                np.asarray(area_m2, dtype=np.float64),
                floor,
            )
        return np.asarray(velocity)

    def velocity(
        self,
        points_W_m: Array,
        origin_W_m: Array,
        direction_W: Array,
        area_m2: float,
        times_s: Array,
        thrusts_N: Array,
        now_s: float,
    ) -> Array:
        """Velocity of one jet that pushed as told, free of any floor, shape (n, 3), in m/s.

        - `origin_W_m`, `direction_W`, shape (3,): middle of the disk and unit direction of the jet; a thruster that
          turns round has two jets.
        - `times_s`, `thrusts_N`, shape (k,): rising times; each thrust holds from its time to the next, the last one
          on. Not negative.
        - Shapes: `points_W_m` (n, 3).

        Raises InputError if times do not rise or a thrust is negative.
        """
        if len(times_s) != len(thrusts_N) or np.any(np.diff(times_s) <= 0.0):
            raise InputError(f"wake model learned: {len(times_s)} times, {len(thrusts_N)} thrusts, must rise and pair")
        if np.any(thrusts_N < 0.0):
            raise InputError(f"wake model learned: thrust {np.min(thrusts_N):g} N, a jet's must not be negative")
        greatest = remembered(times_s, thrusts_N, now_s, MEMORY_S)
        if greatest == 0.0:
            return np.zeros((len(points_W_m), 3))
        away = np.asarray(points_W_m, dtype=np.float64) - origin_W_m
        along = away @ direction_W
        outward = away - along[:, None] * direction_W
        across = np.linalg.norm(outward, axis=1)
        diameter = float(np.sqrt(4.0 * area_m2 / np.pi))
        points = JetPoints(x_D=along / diameter, r_D=across / diameter)
        root = np.sqrt(greatest / self.water_density_kg_m3)
        delays_s = points.delays() * diameter**2 / root
        f = shape(self.network, points, history_bins(times_s, thrusts_N, now_s, delays_s, greatest))
        scale = root / (diameter * (points.away_D + 1.0))
        outward = outward / np.maximum(across, 1e-12)[:, None]
        return np.asarray(scale[:, None] * (f[:, :1] * direction_W + f[:, 1:] * outward))

    def _looked_up(self, away_D: Array, angle_rad: Array) -> Array:
        """Values of f at an even push, shape (2, m, n), bilinear by the log of R and the root of the angle."""
        rows = np.log(np.clip(away_D, NEAREST_D, FARTHEST_D) / NEAREST_D) * ((_ROWS - 1) / _SPAN)
        columns = np.sqrt(angle_rad / np.pi) * (_COLUMNS - 1)
        i = np.minimum(rows.astype(np.int64), _ROWS - 2)
        j = np.minimum(columns.astype(np.int64), _COLUMNS - 2)
        a, b = rows - i, columns - j
        t = self._table
        low = (1.0 - b) * t[:, i, j] + b * t[:, i, j + 1]
        return np.asarray((1.0 - a) * low + a * ((1.0 - b) * t[:, i + 1, j] + b * t[:, i + 1, j + 1]))


_SPAN = float(np.log(FARTHEST_D / NEAREST_D))


def shape(network: Network, points: JetPoints, history: Array) -> Array:
    """Values of f along and across the jet, shape (n, 2); `history` as for `JetPoints.inputs`."""
    f = network.forward(points.inputs(history))
    f[:, 1] *= points.across_share
    return f


def steady_table(network: Network) -> Array:
    """Values of f for an even push, shape (2, rows, columns), by the log of R and the angle's root."""
    away = NEAREST_D * np.exp(np.linspace(0.0, _SPAN, _ROWS))
    angle = np.pi * np.linspace(0.0, 1.0, _COLUMNS) ** 2
    R, theta = (a.ravel() for a in np.meshgrid(away, angle, indexing="ij"))
    points = JetPoints(x_D=R * np.cos(theta), r_D=R * np.abs(np.sin(theta)))
    even = np.ones((len(R), len(EDGES) - 1))
    return np.ascontiguousarray(shape(network, points, even).T.reshape(2, _ROWS, _COLUMNS))


def save_network(path: Path, network: Network, words: str) -> None:
    """Write a network in float32 with what it was trained on, whole or not at all."""
    arrays: dict[str, Any] = {f"w{k}": w.astype(np.float32) for k, w in enumerate(network.weights)}
    arrays |= {f"b{k}": b.astype(np.float32) for k, b in enumerate(network.biases)}
    with whole_file(path) as temporary:
        np.savez_compressed(temporary, words=np.array(words), **arrays)


def load_network(path: Path = SHIPPED) -> Network:
    """Read a network.

    Raises InputError if the file is missing or is none.
    """
    try:
        check_arrays(path)
        with np.load(path) as data:
            layers = sum(name.startswith("w") and name[1:].isdigit() for name in data.files)
            return Network(
                weights=tuple(np.asarray(data[f"w{k}"], dtype=np.float64) for k in range(layers)),
                biases=tuple(np.asarray(data[f"b{k}"], dtype=np.float64) for k in range(layers)),
            )
    except (OSError, KeyError, ValueError) as fault:
        raise InputError(f"{path}: no network of a wake model ({type(fault).__name__}), train one anew") from None


@cache
def shipped() -> Network:
    """The network that comes with the package."""
    return load_network()


def learned_wake(bed_z_m: float | None = None) -> LearnedWake:
    """The model `learned`, with wall jets on a bed if its depth is given."""
    return LearnedWake(network=shipped(), bed_z_m=bed_z_m)


# Beside both kinds of model and without pydantic, which computers on vehicles lack.


def bed_of(wake: WakeModel) -> float | None:
    """Depth of the bed (m) that a model knows of; None for models of free jets."""
    return wake.bed_z_m if isinstance(wake, ImpingingJet | LearnedWake) else None


def free_jet(wake: WakeModel) -> WakeModel:
    """The free jet of a model, without its floor."""
    if isinstance(wake, ImpingingJet):
        return wake.jet
    return wake.free if isinstance(wake, LearnedWake) else wake
