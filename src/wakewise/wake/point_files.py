"""Readers of velocities at points: CSV with this package's columns, PIVlab text, Tecplot, DaVis.

A column's unit is in its name ("x_m", "x [mm]", "U m/s") and is converted to SI with a note. Rows without a velocity
(NaN, empty, masked) are left out and counted. Columns that are not used are named.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, text_of

COLUMNS: dict[str, str] = {
    "x_m": "along the jet from the disk's middle",
    "r_m": "distance from the jet's axis; or y_m and z_m",
    "y_m": "across the jet",
    "z_m": "across the jet",
    "thrust_N": "magnitude of the thrust that made the jet",
    "u_m_s": "speed along the jet",
    "v_m_s": "optional, velocity along y (or along r)",
    "w_m_s": "optional, velocity along z (or around the axis)",
    "disk_diameter_m": "optional, the same on every row",
}
"""Columns of a data file and what they hold."""
MOST_BYTES = 50_000_000
"""Some 500,000 velocities; a larger file is of another kind."""
_SPEEDS = ("u_m_s", "v_m_s", "w_m_s")
_LIMIT_M, _LIMIT_M_S, _LIMIT_N = 100.0, 100.0, 1e6
_NAMES = {
    "x": "x_m", "y": "y_m", "z": "z_m", "r": "r_m", "u": "u_m_s", "v": "v_m_s", "w": "w_m_s",
    "vx": "u_m_s", "vy": "v_m_s", "vz": "w_m_s", "velocity u": "u_m_s", "velocity v": "v_m_s", "velocity w": "w_m_s",
    "thrust": "thrust_N", "disk diameter": "disk_diameter_m",
}  # fmt: skip
"""What programs and people call a column, in small letters and without its unit."""
_LENGTHS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}
_UNITS: dict[str, dict[str, float]] = {
    "m": _LENGTHS,
    "m_s": {f"{unit}/s": factor for unit, factor in _LENGTHS.items()},
    "N": {"n": 1.0, "kgf": GRAVITY_M_S2, "gf": 1e-3 * GRAVITY_M_S2, "lbf": 4.4482216152605},
}
_SPOKEN = {"m": "m, mm or cm", "m_s": "m/s, mm/s or cm/s", "N": "N, kgf, gf or lbf"}
_FLAGS: dict[str, tuple[str, Callable[[float], bool]]] = {
    "isvalid": ("masked", lambda value: value > 0.0),
    "chc": ("masked", lambda value: value > 0.0),
    "isnan": ("masked", lambda value: value == 0.0),
    "vector type": ("masked or interpolated", lambda value: value == 1.0),
    "typevector": ("masked or interpolated", lambda value: value == 1.0),
}
"""Columns that say of a row whether it was measured: what the others are called, and which values are kept."""
_NOTHING = {"", "nan", "na", "n/a", "null", "none", "-", "--", "masked"}
_BRACKETS = re.compile(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]\s*\Z")
_BEHIND = re.compile(r"(.*?)[\s_]+((?:mm|cm|m)(?:[/_]s)?|px(?:/frame)?|N|kgf|gf|lbf)\Z", re.IGNORECASE)
_TECPLOT = re.compile(
    r"\s*(TITLE|VARIABLES|ZONE|DATASETAUXDATA|STRANDID|SOLUTIONTIME|DATAPACKING|(DT|[IJKFT])\s*=)", re.IGNORECASE
)
_PIVLAB = re.compile(r"\s*(PIVlab by|FRAME:)", re.IGNORECASE)
_BRACKETED = re.compile(r"[^\])]+[\])]")


@dataclass(frozen=True, kw_only=True, eq=False)
class PointTable:
    """Columns in SI by the names of `COLUMNS`, each shape (n,), the file's line of each row, and what is to be said.

    `plane` says that places are known in a plane only: there is y_m, neither z_m nor r_m.
    """

    columns: dict[str, Array]
    lines: IntArray
    notes: tuple[str, ...]
    plane: bool


@dataclass(frozen=True)
class _Column:
    """A column as the file has it: its label, what it holds ("" for nothing that is used), and its unit in SI."""

    label: str
    holds: str
    factor: float = 1.0


@dataclass(frozen=True)
class _Layout:
    """What stands above the numbers: labels, where the numbers begin, what parts them; whether a program wrote it."""

    labels: list[str]
    rows: list[tuple[int, str]]
    separator: str | None
    of_a_program: bool


def read_point_table(path: Path) -> PointTable:
    """Columns of a file of velocities at points.

    Raises InputError if the file cannot be read, a needed unit is not said, a column is unknown in a file of our own
    columns, or a row holds something else than numbers; the message names the line.
    """
    layout = _layout(path, _lines(path))
    columns = [_column(path, label, layout.of_a_program) for label in layout.labels]
    used = [column.holds for column in columns if column.holds]
    if len(set(used)) < len(used):
        raise InputError(f"{path}: a column is there twice, each must be there once")
    dropped: Counter[str] = Counter()
    numbers, lines = [], []
    for line, text in layout.rows:
        values = _row(path, line, _cells(text, layout.separator, len(columns)), columns, dropped)
        if values is not None:
            numbers.append(values)
            lines.append(line)
    table = np.array(numbers).reshape(len(numbers), len(columns))
    named = {column.holds: table[:, i] for i, column in enumerate(columns) if column.holds in COLUMNS}
    if layout.of_a_program and sum(name in named for name in _SPEEDS) > 1:
        still = np.all([named[name] == 0.0 for name in _SPEEDS if name in named], axis=0)
        dropped["exactly 0, as programs write masked ones,"] += int(still.sum())
        named, lines = _kept(named, ~still), [line for line, out in zip(lines, still, strict=True) if not out]
    if not lines:
        reported = ", ".join(f"{count} {reason}" for reason, count in dropped.items() if count)
        raise InputError(f"{path}: no velocity is left: {reported or 'there are no rows'}")
    return PointTable(
        columns=named,
        lines=np.array(lines),
        notes=_notes(columns, dropped),
        plane="y_m" in named and not {"z_m", "r_m"} & set(named) and layout.of_a_program,
    )


def _kept(columns: dict[str, Array], rows: BoolArray) -> dict[str, Array]:
    return {name: values[rows] for name, values in columns.items()}


def _notes(columns: list[_Column], dropped: Counter[str]) -> tuple[str, ...]:
    notes = [f"{count} vectors {reason.rstrip(',')} left out" for reason, count in dropped.items() if count]
    if turned := [f"{c.label} times {c.factor:g}" for c in columns if c.holds in COLUMNS and c.factor != 1.0]:
        notes.append(f"turned into SI by the units in their names: {', '.join(turned)}")
    if unused := [column.label for column in columns if not column.holds]:
        notes.append(f"columns not used: {', '.join(unused)}")
    return tuple(notes)


def _lines(path: Path) -> list[str]:
    try:
        return text_of(path, MOST_BYTES, "utf-8-sig").splitlines()
    except YamlError as fault:
        raise InputError(f"{path}: cannot be read ({fault.reason})") from None
    except (OSError, UnicodeDecodeError) as fault:
        reason = fault.strerror if isinstance(fault, OSError) else "it is no text"
        raise InputError(f"{path}: cannot be read ({reason})") from None


def _layout(path: Path, text: list[str]) -> _Layout:
    """Find the labels and the rows below them."""
    lines = [(n, line) for n, line in enumerate(text, 1) if line.strip() and not line.startswith("#")]
    head = 0
    while head < len(lines) and _TECPLOT.match(lines[head][1]):
        head += 1
        while head < len(lines) and lines[head][1].lstrip().startswith('"'):
            head += 1
    if head:
        return _tecplot(path, text, lines, head)
    while head < len(lines) and _PIVLAB.match(lines[head][1]):
        head += 1
    if len(lines) < head + 2:
        raise InputError(f"{path}: no rows, needs a line of column names and one line per point")
    first = lines[head][1]
    separator = next((mark for mark in (";", "\t", ",") if mark in first), None)
    if separator is None:
        labels = [part.strip() for part in _BRACKETED.findall(first)] or first.split()
    else:
        labels = [_bare(part) for part in first.split(separator)]
    if all(_is_number(label) for label in labels):
        raise InputError(
            f"{path} line {lines[head][0]}: numbers where names of columns should stand; write a line such as "
            "'x [mm], y [mm], u [m/s], v [m/s]' above them"
        )
    by_a_program = head > 0 or any(_BRACKETS.match(label) for label in labels)
    return _Layout(labels, lines[head + 1 :], separator, by_a_program)


def _tecplot(path: Path, text: list[str], lines: list[tuple[int, str]], head: int) -> _Layout:
    """Labels of VARIABLES; where they say no unit, as PIVlab's, those of a comment that says the same names."""
    said = " ".join(line for _, line in lines[:head])
    variables = re.search(r"VARIABLES\s*=((?:[\s,]*\"[^\"]*\")+)", said, re.IGNORECASE)
    if variables is None:
        raise InputError(f'{path}: a Tecplot file without VARIABLES = "x [m]", ..., so its columns are not known')
    if re.search(r"\b(F|DATAPACKING)\s*=\s*BLOCK\b", said, re.IGNORECASE):
        raise InputError(f"{path}: a Tecplot file in blocks, needs one line per point (F=POINT)")
    rows = lines[head:]
    again = next((n for n, line in rows if _TECPLOT.match(line)), None)
    if again is not None:
        raise InputError(f"{path} line {again}: a second zone, needs a file with one; export the mean, or one field")
    labels = re.findall(r'"([^"]*)"', variables[1])
    spoken = {
        label.split("[")[0].strip().lower(): label
        for line in text
        if line.startswith("#")
        for label in re.findall(r"[\w?]+ \[[^\]]*\]", line)
    }
    labels = [spoken.get(label.strip().lower(), label.strip()) for label in labels]
    by_commas = bool(rows) and len(rows[0][1].split(",")) == len(labels) > 1
    return _Layout(labels, rows, "," if by_commas else None, True)


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _bare(cell: str) -> str:
    """A cell without the quotes that some programs put round it."""
    return cell.strip().strip("\"'").strip()


def _column(path: Path, label: str, of_a_program: bool) -> _Column:
    """What a column holds, by its label."""
    if label in COLUMNS:
        return _Column(label, label)
    parted = _BRACKETS.match(label) or _BEHIND.match(label)
    name, unit = (parted[1], parted[2]) if parted else (label, "")
    name = " ".join(name.replace("_", " ").split()).lower()
    if name in _FLAGS:
        return _Column(label, f"flag {name}")
    holds = _NAMES.get(name)
    if holds is None or (not parted and not of_a_program):
        if of_a_program:
            return _Column(label, "")
        raise InputError(f"{path}: unknown column '{label}', allowed {', '.join(COLUMNS)}, or 'x [mm]', 'u [m/s]'")
    kind = "N" if holds == "thrust_N" else "m_s" if holds in _SPEEDS else "m"
    unit = unit.lower().replace("_s", "/s").replace(" ", "")
    if unit.startswith("px"):
        raise InputError(
            f"{path}: column '{label}' is in pixels; calibrate it where it was made, needed is one of {_SPOKEN[kind]}"
        )
    if unit not in _UNITS[kind]:
        reported = f"has the unit '{unit}'" if unit else "says no unit"
        raise InputError(
            f"{path}: column '{label}' {reported}, needs one of {_SPOKEN[kind]} in brackets behind its name"
        )
    return _Column(label, holds, _UNITS[kind][unit])


def _cells(text: str, separator: str | None, count: int) -> list[str]:
    cells = text.split(separator)
    if len(cells) == count + 1 and not cells[-1].strip():
        cells.pop()  # some programs end each line with the mark
    cells = [_bare(cell) for cell in cells]
    return cells if separator == "," else [cell.replace(",", ".") for cell in cells]


def _row(path: Path, line: int, cells: list[str], columns: list[_Column], dropped: Counter[str]) -> list[float] | None:
    """Numbers of a row in SI; None, and counted, where a velocity is missing or masked."""
    if len(cells) != len(columns):
        raise InputError(f"{path} line {line}: {len(cells)} values, needs {len(columns)}")
    values: list[float] = []
    why = ""
    for column, cell in zip(columns, cells, strict=True):
        if not column.holds:
            values.append(math.nan)
            continue
        if cell.lower() in _NOTHING and column.holds in _SPEEDS:
            why = why or "NaN or empty"
            values.append(math.nan)
            continue
        value = _number(path, line, column, cell)
        if column.holds.startswith("flag "):
            words, is_kept = _FLAGS[column.holds.removeprefix("flag ")]
            why = why or ("" if is_kept(value) else words)
        values.append(value)
    if why:
        dropped[why] += 1
        return None
    return values


def _number(path: Path, line: int, column: _Column, cell: str) -> float:
    try:
        value = column.factor * float(cell)
    except ValueError:
        raise InputError(f"{path} line {line}: {column.label} is '{cell[:20]}', must be a number") from None
    limit = _LIMIT_N if column.holds == "thrust_N" else _LIMIT_M_S if column.holds.endswith("_m_s") else _LIMIT_M
    if not abs(value) <= limit:
        raise InputError(
            f"{path} line {line}: {column.label} is {cell[:20]}, must be a number between -{limit:g} and {limit:g}"
            + (f" {column.holds.partition('_')[2].replace('_s', '/s')}" if column.factor != 1.0 else "")
        )
    return value
