"""What a probe is given: a history of thrusts and points of the world, read from tables and refused where doubtful."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import Vehicle

_NUMBERED = re.compile(r"(?:thrust|thruster|t)?[_ ]?(\d+)", re.IGNORECASE)
_OTHER_UNIT = re.compile(r".*_(mN|kN|MN|kgf?|gf?|lbf?|pct|percent|pwm|us|rpm|rps|rad_s|V|A|W)", re.IGNORECASE)
_GAIN = 1.05  # a thruster may give this much more than its vehicle file says, as those of a trial's tank do
_LONGEST_S = 36_000.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustHistory:
    """Thrusts that hold from one time to the next, shapes (k,) and (k, n); the last row ends the history.

    Raises
    ------
    InputError
        If there are fewer than two rows, times do not rise, go on for more than ten hours or a value is not finite.
    """

    times_s: Array
    thrusts_N: Array

    def __post_init__(self) -> None:
        freeze(self, times_s=(None,), thrusts_N=(len(self.times_s), None))
        if len(self.times_s) < 2:
            raise InputError(f"thrusts: {len(self.times_s)} rows, at least 2 are needed: a start and an end")
        falling = np.flatnonzero(np.diff(self.times_s) <= 0.0)
        if len(falling):
            k = int(falling[0]) + 1
            raise InputError(
                f"thrusts: time_s {self.times_s[k]:g} in row {k + 1} does not come after {self.times_s[k - 1]:g}"
            )
        length_s = float(self.times_s[-1] - self.times_s[0])
        if length_s > _LONGEST_S:
            raise InputError(
                f"thrusts: time_s goes on for {length_s:g} s, allowed up to {_LONGEST_S:g}; seconds are needed"
            )

    @property
    def impulse_N_s(self) -> Array:
        """Time integral of each thrust over the history, shape (n,)."""
        total: Array = np.diff(self.times_s) @ self.thrusts_N[:-1]
        return total


def read_table(path: Path, what: str) -> tuple[list[str], Array]:
    """Read a CSV file of finite numbers under one row of names.

    Raises
    ------
    InputError
        In one line, with file and place.
    """
    try:
        rows = [row for row in csv.reader(path.read_text(encoding="utf-8-sig").splitlines()) if row]
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, {what} is needed") from None
    except (OSError, UnicodeDecodeError):
        raise InputError(f"{path}: cannot be read as text, {what} is needed") from None
    if not rows:
        raise InputError(f"{path}: empty, {what} is needed")
    if how := other_separator(rows[0]):
        raise InputError(f"{path}: {what} is needed{how}")
    header = [name.strip() for name in rows[0]]
    if len(set(header)) < len(header):
        raise InputError(f"{path}: a column is named twice in {', '.join(header)}")
    table = np.empty((len(rows) - 1, len(header)))
    for k, row in enumerate(rows[1:]):
        if len(row) != len(header):
            raise InputError(f"{path} row {k + 1}: {len(row)} values, the header has {len(header)}")
        for j, text in enumerate(row):
            try:
                table[k, j] = float(text)
            except ValueError:
                raise InputError(f"{path} row {k + 1}: '{text}' in {header[j]}, a number is needed") from None
            if not math.isfinite(table[k, j]):
                raise InputError(f"{path} row {k + 1}: {text} in {header[j]}, must be finite")
    return header, table


def read_thrusts(path: Path, vehicle: Vehicle) -> tuple[ThrustHistory, dict[str, str]]:
    """Read a history of thrusts in N, and say which column was taken for which thruster.

    Columns are time_s and one for each thruster, in any order: named as the vehicle names its thrusters (with or
    without ``_N``), or by number from 1 as in steps.parquet (``thrust_1_N``, ``thruster_1``, ``T1``, ``1``). If no
    name is either, the columns are taken in the vehicle's order. Thrusts may be up to 5 % beyond what the vehicle's
    file says that its thrusters give, as those of a trial's tank may be; `probe` itself has no limit.

    Raises
    ------
    InputError
        If the file, a column or a value is bad, or columns and thrusters do not match.
    """
    header, table = read_table(path, "a CSV with time_s and one thrust in N per thruster")
    if "time_s" not in header:
        raise InputError(f"{path}: no column time_s among {', '.join(header)}")
    n = len(vehicle.thrusters)
    columns = [name for name in header if name != "time_s"]
    for name in columns:
        if _thruster_of(name, vehicle) is None and (unit := _OTHER_UNIT.fullmatch(name)):
            raise InputError(f"{path}: column {name} looks like {unit.group(1)}, thrusts are needed in N")
    if len(columns) != n:
        said = {_thruster_of(name, vehicle) for name in columns}
        lacking = [f"thrust_{i + 1}_N" for i in range(n) if i not in said]
        more = f", no column {', '.join(lacking)}" if len(columns) < n and None not in said else ""
        raise InputError(f"{path}: {len(columns)} thrust columns, {vehicle.name} has {n} thrusters{more}")
    places = [_thruster_of(name, vehicle) for name in columns]
    if all(place is None for place in places):
        places = list(range(n))
    if None in places or len(set(places)) < n:
        bad = next((c for c, p in zip(columns, places, strict=True) if p is None or places.count(p) > 1), "")
        raise InputError(f"{path}: column {bad} is not one thruster's alone, use thrust_1_N to thrust_{n}_N")
    thrusts = np.empty((len(table), n))
    for name, place in zip(columns, places, strict=True):
        thrusts[:, place] = table[:, header.index(name)]
    _check_limits(path, vehicle, thrusts)
    taken = {c: vehicle.thrusters[p].name for c, p in zip(columns, places, strict=True) if p is not None}
    try:
        return ThrustHistory(times_s=table[:, header.index("time_s")], thrusts_N=thrusts), taken
    except InputError as fault:
        raise InputError(f"{path}: {fault}") from None


def read_points(path: Path) -> Array:
    """Read points of the world, columns x_m, y_m and z_m in any order, shape (n, 3).

    Raises
    ------
    InputError
    """
    header, table = read_table(path, "a CSV with x_m, y_m, z_m")
    missing = [name for name in ("x_m", "y_m", "z_m") if name not in header]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)} among {', '.join(header)}")
    if not len(table):
        raise InputError(f"{path}: no points under its header")
    return table[:, [header.index(name) for name in ("x_m", "y_m", "z_m")]]


def regular_times(history: ThrustHistory, every_s: float) -> Array:
    """Times at equal steps over a history, its start included, shape (k,).

    Raises
    ------
    InputError
        If the step is not positive, longer than the history, or gives more than a million times.
    """
    length = float(history.times_s[-1] - history.times_s[0])
    if not (math.isfinite(every_s) and every_s > 0.0 and length / every_s < 1e6):
        raise InputError(f"every: {every_s:g} s, must be more than 0 and leave fewer than a million times")
    if every_s > length * (1 + 1e-9):
        raise InputError(f"every: {every_s:g} s, the thrusts go on for {length:g} s only")
    times: Array = history.times_s[0] + every_s * np.arange(math.floor(length / every_s + 1e-9) + 1)
    return np.minimum(times, history.times_s[-1])


def _thruster_of(column: str, vehicle: Vehicle) -> int | None:
    """Index of the thruster that a column is named after, or None."""
    bare = column.removesuffix("_N")
    for i, thruster in enumerate(vehicle.thrusters):
        if thruster.name in (column, bare):
            return i
    found = _NUMBERED.fullmatch(bare)
    number = int(found.group(1)) if found else 0
    return number - 1 if 1 <= number <= len(vehicle.thrusters) else None


def _check_limits(path: Path, vehicle: Vehicle, thrusts_N: Array) -> None:
    low, high = _GAIN * vehicle.thrust_lower_N, _GAIN * vehicle.thrust_upper_N
    beyond = np.argwhere((thrusts_N < low) | (thrusts_N > high))
    if len(beyond):
        k, i = (int(v) for v in beyond[0])
        raise InputError(
            f"{path} row {k + 1}: {thrusts_N[k, i]:g} N for {vehicle.thrusters[i].name} of {vehicle.name}, "
            f"allowed {low[i]:.4g} to {high[i]:.4g} N (what it gives, and 5 %)"
        )
