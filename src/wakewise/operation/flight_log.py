"""Rows and exposures of a flight as they come: kept in memory, or written in parts beside where they belong.

Parts keep a flight of an hour as small in memory as one of a minute, and leave what was flown where a process is
killed: each part is whole or not there.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.files import whole_file
from wakewise.operation.exposures import ExposureRecord, packed, unpacked

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


def hands_part(folder: Path, part: int) -> Path:
    """Where a part's record of hands lies."""
    return folder / PARTS / f"controls-{part:06d}.parquet"


def parts_hands(folder: Path) -> pl.DataFrame | None:
    """What the hands did in all parts in a trial's folder; None where nobody's were kept."""
    found = sorted((folder / PARTS).glob("controls-*.parquet"))
    return pl.concat([pl.read_parquet(path) for path in found]) if found else None


def parts_exposures(folder: Path, count: int) -> Iterator[ExposureRecord]:
    """The first `count` exposures of the parts in a trial's folder."""
    for path in sorted((folder / PARTS).glob("exposure-*.npz"))[:count]:
        yield unpacked(path.read_bytes())[1]


def drop_parts(folder: Path) -> None:
    """Remove the parts from a trial's folder."""
    shutil.rmtree(folder / PARTS, ignore_errors=True)
