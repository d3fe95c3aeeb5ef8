"""Measured currents from a file: uniform in space, linear between samples."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError

FASTEST_M_S = 3.0
"""Above this a column is taken to be in another unit: few tidal streams, and no tank, run faster."""

_GAP_STEPS = 3.0  # a pause longer than this many median steps is a gap
_LATEST_S = 1e8  # three years; times of the epoch in seconds or milliseconds lie far above
_COLUMNS = (("u", "v", "w"), ("u_m_s", "v_m_s", "w_m_s"), ("north_m_s", "east_m_s", "down_m_s"))


@dataclass(frozen=True, kw_only=True, eq=False)
class CurrentSeries:
    """A uniform current that changes with time, shapes (n,) and (n, 3); time 0 is the start of the trial.

    Raises InputError if there are fewer than two samples, or times do not rise. `velocity` raises it outside the
    series' time.
    """

    name: str
    times_s: Array
    velocities_W_m_s: Array
    uniform: ClassVar[bool] = True

    def __post_init__(self) -> None:
        freeze(self, times_s=(None,), velocities_W_m_s=(len(self.times_s), 3))
        if len(self.times_s) < 2:
            raise InputError(f"{self.name}: {len(self.times_s)} samples, a series needs at least 2")
        if not np.all(np.diff(self.times_s) > 0.0):
            k = int(np.argmin(np.diff(self.times_s) > 0.0)) + 1
            raise InputError(f"{self.name}: time does not rise at sample {k + 1} ({self.times_s[k]:g} s)")

    @property
    def end_s(self) -> float:
        """Last instant that it covers."""
        return float(self.times_s[-1])

    def velocity(self, points_W_m: Array, time_s: float) -> Array:
        """Velocity of the water, shape (n, 3), alike at all points, shape (n, 3)."""
        if not self.times_s[0] - 1e-9 <= time_s <= self.end_s + 1e-9:
            raise InputError(
                f"{self.name}: asked for {time_s:.1f} s, the series covers {self.times_s[0]:.1f} to {self.end_s:.1f} s"
            )
        u = [np.interp(time_s, self.times_s, self.velocities_W_m_s[:, k]) for k in range(3)]
        return np.tile(np.array(u), (len(points_W_m), 1))


def read_current_series(
    path: Path,
    *,
    start_s: float = 0.0,
    stop_s: float | None = None,
    gain: float = 1.0,
    longest_gap_s: float | None = None,
) -> CurrentSeries:
    """Read a series and cut out the part from `start_s` to `stop_s`, both in seconds after its first sample.

    - `path`: ``.csv`` with the columns time_s, u, v and optionally w in m/s, along the tank's x, y and z (or u_m_s...;
      or north_m_s, east_m_s, down_m_s, which are the same axes), or ``.json`` as NOAA's current stations give it: an
      object ``s`` of speeds in cm/s and an object ``d`` of directions in degrees from north through east, towards which
      the water runs, both by time in ms.
    - `gain`: the cut-out is multiplied by this, to make a tank's current of a tidal one.
    - `longest_gap_s`: longest pause between samples; None takes three times the median one. Only the part cut out is
      looked at.

    Raises InputError: naming file and place: no such file, another format, missing columns, times that do not rise,
    gaps, values that are missing or not finite, magnitudes of another unit.
    """
    readers = {".csv": _read_csv, ".json": _read_noaa}
    if path.suffix.lower() not in readers:
        raise InputError(
            f"{path}: '{path.suffix}' files are not read, allowed are .csv (time_s,u,v[,w] in m/s) and .json (NOAA); "
            "there is no reader for NetCDF or HDF5 here, write the velocities as CSV first"
        )
    try:
        times, velocities = readers[path.suffix.lower()](path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, a current series is needed") from None
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path}: cannot be read as text") from None
    times = times - times[0]
    _check_units(path, times, velocities)
    stop = float(times[-1]) if stop_s is None else stop_s
    if not 0.0 <= start_s < stop <= times[-1] + 1e-9:
        raise InputError(f"{path}: asked for {start_s:g} to {stop:g} s, the series covers 0 to {times[-1]:g} s")
    low = max(int(np.searchsorted(times, start_s, side="right")) - 1, 0)
    high = int(np.searchsorted(times, stop, side="left")) + 1
    part = slice(low, high)
    series = CurrentSeries(name=str(path), times_s=times[part] - start_s, velocities_W_m_s=gain * velocities[part])
    _check_gaps(path, times, part, longest_gap_s)
    return series


def _read_csv(path: Path) -> tuple[Array, Array]:
    rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    header = [cell.strip() for cell in rows[0]] if rows else []
    if len(set(header)) < len(header):
        raise InputError(f"{path}: a column is named twice in {', '.join(header)}")
    for names in _COLUMNS:
        if "time_s" in header and names[0] in header and names[1] in header:
            picked = [header.index(name) for name in ("time_s", *names) if name in header]
            break
    else:
        how = other_separator(header)
        raise InputError(f"{path}: columns {', '.join(header) or 'none'}, needed are time_s,u,v[,w] in s and m/s{how}")
    table = np.zeros((len(rows) - 1, 4))
    for k, row in enumerate(rows[1:]):
        for column, at in enumerate(picked):
            text = row[at].strip() if at < len(row) else ""
            try:
                table[k, column] = float(text)
            except ValueError:
                raise InputError(f"{path} line {k + 2}: '{text}' in {header[at]}, a number is needed") from None
            if not math.isfinite(table[k, column]):
                raise InputError(f"{path} line {k + 2}: {text} in {header[at]}, gaps must be filled or cut out first")
    return _rising(path, table[:, 0], table[:, 1:], "line", 2)


def _read_noaa(path: Path) -> tuple[Array, Array]:
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as fault:
        raise InputError(f"{path} line {fault.lineno}: not JSON ({fault.msg})") from None
    if not (isinstance(tree, dict) and isinstance(tree.get("s"), dict) and isinstance(tree.get("d"), dict)):
        raise InputError(f"{path}: needs an object s (cm/s by time in ms) and an object d (degrees by time in ms)")
    speeds, directions = tree["s"], tree["d"]
    if speeds.keys() != directions.keys():
        lone = sorted(speeds.keys() ^ directions.keys())[0]
        raise InputError(f"{path}: time {lone} has a speed or a direction but not both")
    try:
        times = 1e-3 * np.array([float(key) for key in speeds])
        speed = 1e-2 * np.array([float(value) for value in speeds.values()])
        turn = np.array([float(directions[key]) for key in speeds])
    except (TypeError, ValueError):
        raise InputError(f"{path}: a time, speed or direction is no number; gaps must be cut out first") from None
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(speed)) and np.all(np.isfinite(turn))):
        raise InputError(f"{path}: a time, speed or direction is not finite; gaps must be cut out first")
    if len(turn) and (turn.min() < 0.0 or turn.max() > 360.0 or speed.min() < 0.0):
        raise InputError(f"{path}: speeds must be 0 or more and directions 0 to 360 degrees, found otherwise")
    turn = np.radians(turn)
    velocity = np.stack([speed * np.cos(turn), speed * np.sin(turn), np.zeros_like(speed)], axis=1)
    order = np.argsort(times, kind="stable")  # a JSON object has no order of its own, and this station's has none
    return _rising(path, times[order], velocity[order], "sample", 1)


def _rising(path: Path, times_s: Array, velocities: Array, unit: str, first: int) -> tuple[Array, Array]:
    if len(times_s) < 2:
        raise InputError(f"{path}: {len(times_s)} samples, a series needs at least 2")
    steps = np.diff(times_s)
    if not np.all(steps > 0.0):
        k = int(np.argmin(steps > 0.0)) + 1
        raise InputError(
            f"{path} {unit} {first + k}: time {times_s[k]:.10g} s does not come after {times_s[k - 1]:.10g} s"
        )
    return times_s, velocities


def _check_units(path: Path, times_s: Array, velocities_m_s: Array) -> None:
    fastest = float(np.linalg.norm(velocities_m_s, axis=1).max())
    if fastest > FASTEST_M_S:
        guess = "cm/s" if fastest < 100 * FASTEST_M_S else "mm/s or filled gaps"
        raise InputError(
            f"{path}: fastest current {fastest:g} m/s, allowed up to {FASTEST_M_S:g}; looks like {guess}, needs m/s"
        )
    if times_s[-1] > _LATEST_S:
        raise InputError(f"{path}: time_s spans {times_s[-1]:.3g}, which looks like milliseconds, seconds are needed")


def _check_gaps(path: Path, times_s: Array, part: slice, longest_s: float | None) -> None:
    steps = np.diff(times_s)
    allowed = _GAP_STEPS * float(np.median(steps)) if longest_s is None else longest_s
    used = steps[part.start : max(part.start + 1, min(part.stop, len(times_s)) - 1)]
    if used.max() > allowed:
        k = part.start + int(np.argmax(used))
        raise InputError(
            f"{path}: gap of {used.max():g} s after {times_s[k]:g} s, allowed up to {allowed:g} s in the part used"
        )
