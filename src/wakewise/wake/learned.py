"""`learned`: a wake model that was trained on the tank's parcels and the lattice, as a rival of the laws of jets.

It knows of the tank what its training draws say (see `wakewise_paper.learned_wake`), so in the tank it is *circular
to that degree*; none of our own models is. It gives the radial part and the slow inflow towards a jet's sides, which
they leave out. As a `WakeModel` a thruster has always pushed as it does now; `LearnedWake.velocity` takes a history.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.size_limits import check_arrays
from wakewise.wake.network import (
    EDGES,
    FARTHEST_D,
    NEAREST_D,
    JetPoints,
    Network,
    history_bins,
    remembered,
)
from wakewise.wake.wall_jet import WALL_SPEED, wall_velocity

CIRCULAR = "circular to a degree: trained on draws of the tank's own water"
"""To be printed wherever it is judged in the tank."""
MEMORY_S = 60.0
"""How long a thrust counts for what a history is measured by; a wake a metre away is older at 0.02 N only."""
SHIPPED = Path(__file__).parent / "data" / "learned.npz"
_ROWS, _COLUMNS = 96, 257  # of the table, by log R and by the angle's root; within 2 % of the exit speed of f itself


@dataclass(frozen=True, kw_only=True, eq=False)
class LearnedWake:
    """A trained network as a wake model.

    Parameters
    ----------
    network : Network
    bed_z_m : float or None
        Depth of a bed along which jets run out as in `wakewise.wake.wall_jet`; None for free jets alone.
    water_density_kg_m3 : float
    """

    network: Network
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

        Parameters
        ----------
        points_W_m : ndarray, shape (n, 3)
        origin_W_m, direction_W : ndarray, shape (3,)
            Middle of the disk and unit direction of the jet; a thruster that turns round has two jets.
        area_m2 : float
        times_s, thrusts_N : ndarray, shape (k,)
            Rising times; each thrust holds from its time to the next, the last one on. Not negative.
        now_s : float

        Raises
        ------
        InputError
            If times do not rise or a thrust is negative.
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
    arrays = {f"w{k}": w.astype(np.float32) for k, w in enumerate(network.weights)}
    arrays |= {f"b{k}": b.astype(np.float32) for k, b in enumerate(network.biases)}
    with whole_file(path) as temporary:
        np.savez_compressed(temporary, words=np.array(words), **arrays)  # type: ignore[arg-type]


def load_network(path: Path = SHIPPED) -> Network:
    """Read a network.

    Raises
    ------
    InputError
        If the file is missing or is none.
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
