"""Rows and exposures of a flight as they come: kept in memory, or written in parts beside where they belong.

Parts keep a flight of an hour as small in memory as one of a minute, and leave what was flown where a process is
killed: each part is whole or not there.

What is kept of each opening of the shutter, as a record and as the arrays of exposures.npz.
"""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import FlakeCloud, ScalarGrid

STANCE = ("tips_m", "tip_speeds_m_s", "shift_m")
"""Fields of an exposure that tell of a target that yields."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExposureRecord:
    """One opening of the shutter: true camera poses across it, the estimate at its middle, the silt in the water.

    `X_WC_before` are true poses of the camera before, oldest first, which automatic exposure goes by; else none.
    `flakes` are those that drift before the camera; None where nobody knows, so that they are drawn for each
    photograph.
    Of a target that yields also, as in `wakewise.core.interfaces.TargetDeformation`, how it stood at its opening:
    `tips_m` and `tip_speeds_m_s` (k, 2), `shift_m` (2,).
    """

    time_s: float
    X_WC_true: tuple[Pose, ...]
    X_WC_est: Pose
    silt: ScalarGrid
    X_WC_before: tuple[Pose, ...] = ()
    flakes: FlakeCloud | None = None
    tips_m: Array | None = None
    tip_speeds_m_s: Array | None = None
    shift_m: Array | None = None


def write_exposures(path: Path, exposures: list[ExposureRecord], exposure_s: float) -> None:
    """Write what each photograph needs to be rendered later."""
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, exposure_s=np.array(exposure_s), **exposure_arrays(exposures))


def exposure_arrays(exposures: list[ExposureRecord]) -> dict[str, Any]:
    """What an exposure is, as the arrays that are kept of it; silt in single precision."""
    before = [[X.p_m for X in e.X_WC_before] for e in exposures], [[X.q for X in e.X_WC_before] for e in exposures]
    metered = {"X_WC_before_p_m": np.array(before[0]), "X_WC_before_q": np.array(before[1])}
    stance = {name: [getattr(e, name) for e in exposures] for name in STANCE}
    return (metered if exposures[0].X_WC_before else {}) | {
        **{name: np.array(values) for name, values in stance.items() if values[0] is not None},
        "time_s": np.array([e.time_s for e in exposures]),
        "X_WC_p_m": np.array([[X.p_m for X in e.X_WC_true] for e in exposures]),
        "X_WC_q": np.array([[X.q for X in e.X_WC_true] for e in exposures]),
        "X_WC_est_p_m": np.array([e.X_WC_est.p_m for e in exposures]),
        "X_WC_est_q": np.array([e.X_WC_est.q for e in exposures]),
        "silt_origin_W_m": exposures[0].silt.origin_W_m,
        "silt_spacing_m": np.array(exposures[0].silt.spacing_m),
        "silt_kg_m3": np.array([e.silt.values for e in exposures], dtype=np.float32),
        **_outer_arrays([e.silt.outer for e in exposures]),
        **_flake_arrays([e.flakes for e in exposures]),
    }


def packed(number: int, exposure: ExposureRecord) -> bytes:
    """An exposure and its number as bytes, in the arrays of the flight's record."""
    file = io.BytesIO()
    np.savez(file, number=np.array(number), **exposure_arrays([exposure]))
    return file.getvalue()


def unpacked(message: bytes) -> tuple[int, ExposureRecord]:
    """What `packed` packed."""
    with np.load(io.BytesIO(message)) as data:
        number = int(data["number"])
    return number, read_exposures(io.BytesIO(message))[0]


def _flake_arrays(clouds: list[FlakeCloud | None]) -> dict[str, Any]:
    """Arrays of the drifting flakes, one after the other; nothing where they are not known."""
    known = [cloud for cloud in clouds if cloud is not None]
    if len(known) < len(clouds) or not known:
        return {}
    one = known[0]
    return {
        "flakes": np.array([len(cloud.p_W_m) for cloud in known]),
        "flake_p_W_m": np.concatenate([cloud.p_W_m for cloud in known]).astype(np.float32),
        "flake_v_W_m_s": np.concatenate([cloud.v_W_m_s for cloud in known]).astype(np.float16),
        "flake_looks": np.concatenate([cloud.looks for cloud in known]).astype(np.float16),
        "flake_box_W_m": np.stack([one.low_W_m, one.high_W_m]),
        "flake_limits": np.array([one.per_m3, one.depth_m, *one.slopes]),
    }


def _read_flakes(data: Any, count: int) -> list[FlakeCloud | None]:
    """The flakes of each exposure; None of files of before they were kept."""
    if "flakes" not in data:
        return [None] * count
    ends = np.cumsum(data["flakes"])
    low, high = data["flake_box_W_m"]
    per_m3, depth_m, across, along = (float(v) for v in data["flake_limits"])
    parts = [np.split(data[f"flake_{name}"].astype(np.float64), ends[:-1]) for name in ("p_W_m", "v_W_m_s", "looks")]
    return [
        FlakeCloud(
            p_W_m=p, v_W_m_s=v, looks=looks, low_W_m=low, high_W_m=high, per_m3=per_m3, depth_m=depth_m,
            slopes=(across, along),
        )
        for p, v, looks in zip(*parts, strict=True)
    ]  # fmt: skip


def _outer_arrays(grids: list[ScalarGrid | None]) -> dict[str, Any]:
    """Arrays of the silt's outer grids; nothing where there are none."""
    known = [grid for grid in grids if grid is not None]
    if len(known) < len(grids) or not known:
        return {}
    return {
        "silt_outer_origin_W_m": known[0].origin_W_m,
        "silt_outer_spacing_m": np.array(known[0].spacing_m),
        "silt_outer_kg_m3": np.array([grid.values for grid in known], dtype=np.float32),
    }


def read_exposures(path: Path | IO[bytes]) -> list[ExposureRecord]:
    """Read what `write_exposures` wrote, or the same arrays from an open file."""
    with np.load(path) as data:
        origin, spacing = data["silt_origin_W_m"], float(data["silt_spacing_m"])
        p, q, silt = data["X_WC_p_m"], data["X_WC_q"], data["silt_kg_m3"]
        est_p, est_q = data["X_WC_est_p_m"], data["X_WC_est_q"]
        none = np.empty((len(p), 0))
        before_p, before_q = data.get("X_WC_before_p_m", none), data.get("X_WC_before_q", none)
        flakes = _read_flakes(data, len(p))
        outers: list[ScalarGrid | None] = [None] * len(p)
        if "silt_outer_kg_m3" in data:  # not in files of before there was one
            far, coarse = data["silt_outer_origin_W_m"], float(data["silt_outer_spacing_m"])
            outers = [ScalarGrid(origin_W_m=far, spacing_m=coarse, values=v) for v in data["silt_outer_kg_m3"]]
        stance = {name: data[name] for name in STANCE if name in data}
        return [
            ExposureRecord(
                time_s=float(time_s),
                X_WC_true=tuple(Pose(p[k, i], q[k, i]) for i in range(p.shape[1])),
                X_WC_est=Pose(est_p[k], est_q[k]),
                silt=ScalarGrid(origin_W_m=origin, spacing_m=spacing, values=silt[k], outer=outers[k]),
                X_WC_before=tuple(Pose(*X) for X in zip(before_p[k], before_q[k], strict=True)),
                flakes=flakes[k],
                **{name: values[k] for name, values in stance.items()},
            )
            for k, time_s in enumerate(data["time_s"])
        ]


PARTS = ".flight"
"""Folder of a flight's parts within that of its trial; gone when the flight is whole."""
TAGS = {"exposing": pl.Boolean, "collision": pl.Boolean, "fallback": pl.String, "leg": pl.String}
TIMINGS = ("solve_ms", "behind_ms", "answer_ms")


def _nothing(part: int) -> None:
    """Do nothing about a part."""


@dataclass(kw_only=True, eq=False)
class FlightLog:
    """What was recorded, in the order of time.

    Parameters
    ----------
    folder : Path, optional
        Where parts go; without it all stays in memory.
    keep : bool
        Without it rows are dropped after a while and exposures at once.
    chunk_rows : int
        How many rows a part has at most; one that holds a photograph ends with it.
    names : list of str
        Of the numbers of a row, given with the first one.
    beside : callable
        Called with the number of a part when it is written or dropped.

    Attributes
    ----------
    count : int
        Rows so far.
    opened : int
        Exposures so far.
    exposures : list of ExposureRecord
        Those that are kept in memory.
    """

    folder: Path | None = None
    keep: bool = True
    chunk_rows: int = 500
    names: list[str] = field(default_factory=list)
    beside: Callable[[int], None] = _nothing
    exposures: list[ExposureRecord] = field(default_factory=list)
    count: int = 0
    opened: int = 0
    rows: list[Array] = field(default_factory=list)
    tags: dict[str, list[bool | str]] = field(default_factory=lambda: {name: [] for name in TAGS})
    timings: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in TIMINGS})
    _parts: int = 0
    _full: bool = False

    def add(self, numbers: Array, tags: dict[str, bool | str], solve_ms: float) -> None:
        """Take in the row of one step."""
        if self._full:
            self.flush()
        self.rows.append(numbers)
        for name, value in tags.items():
            self.tags[name].append(value)
        self.timings["solve_ms"].append(solve_ms)
        self.count += 1
        self._full |= len(self.rows) >= self.chunk_rows

    def timed(self, behind_s: float, answer_s: float) -> None:
        """Say of the last row how late its step was and how long the answer to its controls took."""
        self.timings["behind_ms"].append(1e3 * behind_s)
        self.timings["answer_ms"].append(1e3 * answer_s)

    def expose(self, exposure: ExposureRecord) -> None:
        """Take in an exposure, of the last row."""
        if self.folder is not None:
            with whole_file(self.folder / f"exposure-{self.opened:06d}.npz") as path:
                path.write_bytes(packed(self.opened, exposure))
            self._full = True
        elif self.keep:
            self.exposures.append(exposure)
        self.opened += 1

    def flush(self) -> None:
        """Write what is in memory as a part, where parts are written."""
        self._full = False
        if self.keep and self.folder is None:
            return
        if self.folder is not None and self.rows:
            with whole_file(self.folder / f"steps-{self._parts:06d}.parquet") as path:
                self.frame().write_parquet(path)
        self.beside(self._parts)
        self._parts += 1
        self.rows.clear()
        for tag in self.tags.values():
            tag.clear()
        for timing in self.timings.values():
            timing.clear()

    def frame(self) -> pl.DataFrame:
        """The rows in memory as a table, timings last and null where they are not known."""
        table = np.array(self.rows).reshape(len(self.rows), -1)
        numbers = {name: table[:, i] for i, name in enumerate(self.names)}
        tags = [pl.Series(name, self.tags[name], dtype=kind) for name, kind in TAGS.items()]
        lacks = {name: [None] * (len(self.rows) - len(values)) for name, values in self.timings.items()}
        timings = [pl.Series(name, [*self.timings[name], *lacks[name]], dtype=pl.Float64) for name in TIMINGS]
        return pl.DataFrame(numbers).with_columns(*tags, *timings)


def steps_of(table: pl.LazyFrame) -> pl.LazyFrame:
    """What of the rows is steps.parquet: nothing that depends on the machine."""
    return table.drop(TIMINGS)


def timings_of(table: pl.LazyFrame) -> pl.DataFrame:
    """What of the rows is timings.parquet: `solve_ms`, and of a flight by the clock how late and slow each step was."""
    timings = table.select(TIMINGS).collect()
    return timings.select(name for name in TIMINGS if timings[name].null_count() < timings.height)


def has_parts(folder: Path) -> bool:
    """Whether a trial's folder holds parts of a flight."""
    return any((folder / PARTS).glob("steps-*.parquet"))


def parts_table(folder: Path) -> pl.LazyFrame:
    """The rows of all parts in a trial's folder."""
    return pl.scan_parquet(sorted((folder / PARTS).glob("steps-*.parquet")))


def controls_part(folder: Path, part: int) -> Path:
    """Where a part's record of the controls lies."""
    return folder / PARTS / f"controls-{part:06d}.parquet"


def parts_controls(folder: Path) -> pl.DataFrame | None:
    """The controls of all parts in a trial's folder; None if none were recorded."""
    found = sorted((folder / PARTS).glob("controls-*.parquet"))
    return pl.concat([pl.read_parquet(path) for path in found]) if found else None


def parts_exposures(folder: Path, count: int) -> Iterator[ExposureRecord]:
    """The first `count` exposures of the parts in a trial's folder."""
    for path in sorted((folder / PARTS).glob("exposure-*.npz"))[:count]:
        yield unpacked(path.read_bytes())[1]


def drop_parts(folder: Path) -> None:
    """Remove the parts from a trial's folder."""
    shutil.rmtree(folder / PARTS, ignore_errors=True)
