"""Measured speeds of one thruster's jet, the regions of a jet, and R2 scores of wake models.

Jet frame J: origin at the centre of the disk, x along the jet (downstream). Angles are off the jet's axis and distances
from the disk's centre, as in the paper.

R2 = 1 - sum (u - model)^2 / sum (u - mean)^2 of the axial speed in m/s. The mean is taken per thrust, so that stronger
thrusts explain nothing; `r2_*_pooled` takes one mean over all thrusts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.interfaces import WakeModel
from wakewise.wake.disturbance import unit_velocity
from wakewise.wake.jets import AxialJet
from wakewise.wake.point_files import COLUMNS, PointTable, read_point_table

__all__ = [
    "COLUMNS",
    "CORE",
    "FAR",
    "WAKE",
    "JetRegion",
    "JetSamples",
    "WakeScores",
    "joined",
    "predicted_speed",
    "read_samples",
    "score",
    "score_speeds",
]

_REQUIRED = ("x_m", "thrust_N", "u_m_s")


@dataclass(frozen=True, kw_only=True, eq=False)
class JetSamples:
    """Where, how hard and how fast; all arrays of shape (n,).

    `x_m` and `r_m` are cylindrical coordinates in the jet frame, `thrust_N` magnitudes, `speed_m_s` the axial component
    of the velocity and `across_m_s` the size of the rest of it (0 where it was not measured).
    """

    x_m: Array
    r_m: Array
    thrust_N: Array
    speed_m_s: Array
    across_m_s: Array
    disk_diameter_m: float
    title: str = "samples"
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, x_m=(None,), r_m=(None,), thrust_N=(None,), speed_m_s=(None,), across_m_s=(None,))
        sizes = {len(getattr(self, name)) for name in ("x_m", "r_m", "thrust_N", "speed_m_s", "across_m_s")}
        if len(sizes) > 1:
            raise InputError(f"{self.title}: columns of {sorted(sizes)} rows, all must have the same")
        if not self.disk_diameter_m > 0.0:
            raise InputError(f"{self.title}: disk_diameter_m {self.disk_diameter_m:g}, must be greater than 0")
        if np.any(self.r_m < 0.0):
            raise InputError(f"{self.title}: negative radius {self.r_m.min():g} m, must not be below 0")
        if np.any(self.thrust_N <= 0.0):
            raise InputError(f"{self.title}: thrust_N {self.thrust_N.min():g}, must be greater than 0 (a magnitude)")

    def __len__(self) -> int:
        return len(self.x_m)

    @property
    def disk_area_m2(self) -> float:
        """Area of the disk."""
        return 0.25 * math.pi * self.disk_diameter_m**2

    @property
    def distance_m(self) -> Array:
        """Distance from the disk's middle, shape (n,)."""
        return np.hypot(self.x_m, self.r_m)

    @property
    def angle_rad(self) -> Array:
        """Angle off the jet's direction, shape (n,)."""
        return np.arctan2(self.r_m, self.x_m)

    @property
    def thrusts_N(self) -> Array:
        """The different thrusts, ascending."""
        return np.unique(self.thrust_N)

    def take(self, chosen: BoolArray) -> JetSamples:
        """The rows where `chosen`, shape (n,), is True."""
        return JetSamples(
            x_m=self.x_m[chosen],
            r_m=self.r_m[chosen],
            thrust_N=self.thrust_N[chosen],
            speed_m_s=self.speed_m_s[chosen],
            across_m_s=self.across_m_s[chosen],
            disk_diameter_m=self.disk_diameter_m,
            title=self.title,
            warnings=self.warnings,
        )


def joined(parts: Sequence[JetSamples]) -> JetSamples:
    """Rows of several sets about the same disk, in order, with the warnings of all."""
    first = parts[0]
    fields = ("x_m", "r_m", "thrust_N", "speed_m_s", "across_m_s")
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in fields}
    warnings = tuple(dict.fromkeys(words for part in parts for words in part.warnings))
    return JetSamples(**arrays, disk_diameter_m=first.disk_diameter_m, title=first.title, warnings=warnings)


@dataclass(frozen=True, kw_only=True)
class JetRegion:
    """Part of a jet: nearer to the axis than an angle, between two distances from the disk's middle."""

    name: str
    angle_rad: float
    nearest_m: float
    farthest_m: float

    def holds(self, samples: JetSamples) -> BoolArray:
        """Which rows lie in it, shape (n,)."""
        distance = samples.distance_m
        return np.asarray(
            (samples.angle_rad < self.angle_rad) & (distance >= self.nearest_m) & (distance <= self.farthest_m)
        )


CORE = JetRegion(name="A", angle_rad=math.radians(15.0), nearest_m=0.1, farthest_m=0.3)
WAKE = JetRegion(name="B", angle_rad=math.radians(30.0), nearest_m=0.1, farthest_m=0.5)
FAR = JetRegion(name="far", angle_rad=math.radians(15.0), nearest_m=0.4, farthest_m=math.inf)
"""The paper's regions: r below 0.3 m (from 0.1 m, where its measurements begin), 0.1-0.5 m, and beyond 0.4 m."""


def read_samples(path: Path, disk_diameter_m: float | None = None, thrust_N: float | None = None) -> JetSamples:
    """Samples of a file of velocities at points (`wakewise.wake.point_files`); lines that start with # are comments.

    Vectors that are NaN, empty or masked, and points upstream of the disk, are left out with a warning that counts
    them.

    `disk_diameter_m`: needed if the file has no column of that name. `thrust_N`: thrust of all rows; needed if the file
    has no column of that name. Raises InputError if the file is missing, a needed column is not there or is unknown, a
    row holds something that is not a finite number, a negative radius or a thrust that is not positive (the message
    names the line), or no row is left.
    """
    table = read_point_table(path)
    column = table.columns
    for name, value, option in (
        ("disk_diameter_m", disk_diameter_m, "--disk-diameter-m"),
        ("thrust_N", thrust_N, "--thrust"),
    ):
        if name in column and value is not None and np.any(np.abs(column[name] - value) > 1e-9):
            raise InputError(f"{path}: {name} is {column[name][0]:g} in the file and {value:g} in the option {option}")
        if name not in column and value is not None:
            column[name] = np.full(len(table.lines), value)
    _check_columns(path, table)
    return _samples(path, table)


def _check_columns(path: Path, table: PointTable) -> None:
    names = table.columns
    wanted = ", ".join(_REQUIRED) + " and r_m (or y_m, z_m)"
    missing = [name for name in _REQUIRED if name not in names]
    if missing:
        way = "; --thrust gives one thrust for all rows" if missing == ["thrust_N"] else ""
        raise InputError(f"{path}: column {missing[0]} is missing, needed are {wanted}{way}")
    across = ("r_m" in names) != ("y_m" in names and "z_m" in names) and ("y_m" in names) == ("z_m" in names)
    if not across and not table.plane:
        raise InputError(f"{path}: place across the jet unclear, needed is either r_m or both y_m and z_m")
    if "disk_diameter_m" not in names:
        raise InputError(f"{path}: the disk's diameter is not known, give a column or the option --disk-diameter-m")


def _samples(path: Path, table: PointTable) -> JetSamples:
    column = table.columns
    for name, low in (("r_m", "not be negative"), ("thrust_N", "be greater than 0 (a magnitude)")):
        bad = (column[name] < 0 if name == "r_m" else column[name] <= 0) if name in column else np.zeros(1, np.bool_)
        if bad.any():
            k = int(np.argmax(bad))
            raise InputError(f"{path} line {table.lines[k]}: {name} is {column[name][k]:g}, must {low}")
    diameters = np.unique(column["disk_diameter_m"])
    if len(diameters) > 1:
        raise InputError(f"{path}: disk_diameter_m takes {len(diameters)} values, must be the same on every row")
    zero = np.zeros(len(table.lines))
    radius = column["r_m"] if "r_m" in column else np.hypot(column["y_m"], column.get("z_m", zero))
    downstream = column["x_m"] > 0.0
    warnings = list(table.notes)
    if table.plane:
        warnings.append("one plane: taken to hold the jet's axis, with x along it from the disk's middle and y across")
    if not downstream.any():
        raise InputError(
            f"{path}: no point downstream of the disk, all {len(zero)} have x_m <= 0; x must count along the jet from "
            "the disk's middle"
        )
    if not downstream.all():
        warnings.append(
            f"{int((~downstream).sum())} points upstream of the disk (x_m <= 0) left out: no model holds there"
        )
    samples = JetSamples(
        x_m=column["x_m"],
        r_m=radius,
        thrust_N=column["thrust_N"],
        speed_m_s=column["u_m_s"],
        across_m_s=np.hypot(column.get("v_m_s", zero), column.get("w_m_s", zero)),
        disk_diameter_m=float(diameters[0]),
        title=path.name,
        warnings=tuple(warnings),
    )
    return samples.take(downstream)


_LEAST_REGION = 8


@dataclass(frozen=True, kw_only=True)
class WakeScores:
    """How well a model meets samples; None where there are too few points or no spread, with the reason in `why`.

    `r2_core` and `r2_wake` are R2 in the paper's regions A and B, `r2` over all points; `r2_vector` counts the velocity
    across the jet, which no model has. `bias_far_pct` is 100 (sum model / sum measured - 1) beyond 0.4 m.
    """

    r2: float | None
    r2_core: float | None
    r2_wake: float | None
    r2_core_pooled: float | None
    r2_wake_pooled: float | None
    r2_vector: float | None
    bias_far_pct: float | None
    points: int
    points_core: int
    points_wake: int
    why: dict[str, str]

    def plain(self) -> dict[str, Any]:
        """As plain values, ready for JSON."""
        return asdict(self)


def predicted_speed(model: WakeModel, samples: JetSamples) -> Array:
    """Axial speed in m/s of a model, ours or one from outside, at the points and thrusts of samples, shape (n,)."""
    if isinstance(model, AxialJet):
        return model.speed(samples.x_m, samples.r_m, samples.thrust_N, samples.disk_area_m2)
    areas, which = np.unique(samples.disk_area_m2, return_inverse=True)
    ahead = np.tile([1.0, 0.0, 0.0], (len(areas), 1))
    points = np.column_stack([samples.x_m, samples.r_m, np.zeros(len(samples))])
    unit = unit_velocity(model, points, np.zeros((len(areas), 3)), ahead, areas)
    return np.asarray(np.sqrt(samples.thrust_N) * unit[which, np.arange(len(samples)), 0])


def score(model: WakeModel, samples: JetSamples) -> WakeScores:
    """Scores of a model on samples."""
    return score_speeds(predicted_speed(model, samples), samples)


def score_speeds(predicted_m_s: Array, samples: JetSamples) -> WakeScores:
    """Scores of predicted axial speeds, shape (n,)."""
    why: dict[str, str] = {}
    core, wake, far = (region.holds(samples) for region in (CORE, WAKE, FAR))
    everything = np.ones(len(samples), dtype=np.bool_)
    keys: dict[str, tuple[BoolArray, bool, bool]] = {
        "r2": (everything, False, False),
        "r2_core": (core, False, False),
        "r2_wake": (wake, False, False),
        "r2_core_pooled": (core, True, False),
        "r2_wake_pooled": (wake, True, False),
        "r2_vector": (everything, False, True),
    }
    values: dict[str, float | None] = {}
    for key, (rows, pooled, vector) in keys.items():
        values[key] = _r2(predicted_m_s[rows], samples.take(rows), pooled=pooled, vector=vector)
        if values[key] is None:
            why[key] = f"{int(rows.sum())} test points there, or all with the same speed"
    total = float(samples.speed_m_s[far].sum())
    bias = 100.0 * (float(predicted_m_s[far].sum()) / total - 1.0) if far.sum() >= _LEAST_REGION and total > 0 else None
    if bias is None:
        why["bias_far_pct"] = f"{int(far.sum())} test points beyond {FAR.nearest_m:g} m"
    return WakeScores(
        **values,
        bias_far_pct=bias,
        points=len(samples),
        points_core=int(core.sum()),
        points_wake=int(wake.sum()),
        why=why,
    )


def _r2(predicted: Array, samples: JetSamples, *, pooled: bool, vector: bool) -> float | None:
    if len(samples) < _LEAST_REGION:
        return None
    u = samples.speed_m_s
    mean = np.full(len(samples), u.mean())
    if not pooled:
        level, row = np.unique(samples.thrust_N, return_inverse=True)
        row = row.ravel()
        mean = (np.bincount(row, u, len(level)) / np.bincount(row, minlength=len(level)))[row]
    # The mean velocity across an axisymmetric jet is nil, so what is across counts whole in both sums.
    across = float(np.sum(samples.across_m_s**2)) if vector else 0.0
    spread = float(np.sum((u - mean) ** 2)) + across
    if spread <= 1e-12 * float(np.sum(u**2)):
        return None
    return 1.0 - (float(np.sum((u - predicted) ** 2)) + across) / spread
