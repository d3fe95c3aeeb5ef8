"""From a maker's table of pulses and thrusts to a thrust curve: read, check, make monotone, say what was done.

Thrust curves by name or by file: those that come with the package, and tables of users.
"""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from scipy.optimize import isotonic_regression

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.csv_separators import other_separator
from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import NEUTRAL_US, CurveSide, ThrustCurve

KGF_N = GRAVITY_M_S2
"""Newton per kilogram-force, by definition (3rd CGPM, 1901)."""

COLUMNS = {
    "supply_V": "supply_V",
    "supply_V_sheet": "supply_V",
    "pwm_us": "pwm_us",
    "PWM (µs)": "pwm_us",
    "rpm": "rpm",
    "RPM": "rpm",
    "thrust_N": "thrust_N",
    "force_kgf": "force_kgf",
    "Force (Kg f)": "force_kgf",
    "power_W": "power_W",
    "Power (W)": "power_W",
    "current_A": "current_A",
    "Current (A)": "current_A",
    "voltage_V": "voltage_V",
    "Voltage (V)": "voltage_V",
    "efficiency_g_per_W": "efficiency_g_per_W",
    "Efficiency (g/W)": "efficiency_g_per_W",
}
"""Every column that is understood, with what it means; the names with spaces are those of Blue Robotics' workbook."""

PULSES_US = (500.0, 2500.0)
GRAMS_PER_WATT = (2.5, 80.0)
"""Thrust over electrical power of a thruster at its highest power, in gram-force per watt.

A T200 has 10 to 22 there (20 to 10 V). Taking newton for kilogram-force or the reverse is a factor of 9.8, which puts
it outside at one voltage at least.
"""

SILENT_SHARE = 1e-3
"""A thrust below this share of the largest at its voltage is the load cell's zero."""

RESOLVED_US = 10.0
"""If silence and the first running pulse are further apart than this, the table does not show where running starts."""

NOISE_N, NOISE_SHARE = 0.3, 0.03
"""How far a reading may lie from the nearest monotone curve: newton, or share of the largest thrust if that is more."""

POWER_W, POWER_SHARE = 0.5, 0.05
"""How far power may lie from voltage times current before the row's electrical readings are left out."""

BAD_ROWS_SHARE = 0.1
"""If more of the rows contradict themselves, the columns are not what they are called."""

LARGEST_TABLE_CHARACTERS = 5_000_000


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrustRows:
    """The rows of a table in newton, checked one by one; shape (n,) each, in the order of the file.

    `line` is the line of the file that a row came from, `rpm` and `power_W` hold NaN where unknown.
    """

    line: Array
    supply_V: Array
    pwm_us: Array
    thrust_N: Array
    rpm: Array
    power_W: Array
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = np.asarray(self.line).size
        freeze(self, line=(count,), supply_V=(count,), pwm_us=(count,), thrust_N=(count,))


def read_thrust_table(path: Path | str) -> ThrustCurve:
    """Read a CSV of thrust against pulse, at one or several supply voltages, into a curve.

    Needed columns: `pwm_us`, `thrust_N` (positive forward; or the maker's `force_kgf`, x 9.80665), and `supply_V` (or
    the maker's `supply_V_sheet`, or lacking both `voltage_V`). Understood besides: `rpm`, `power_W`, `current_A`,
    `voltage_V`, `efficiency_g_per_W` (not used), and the headings of Blue Robotics' workbook. Lines that start with #
    are comments. Rows come in any order.

    At each voltage the thrust is replaced by the nearest never-falling curve (isotonic regression: T. Robertson et
    al., Order Restricted Statistical Inference, 1988). A row whose power is
    not voltage times current keeps its thrust and loses its electrical readings; `notes` says so.

    Raises InputError if the file cannot be read, a column is unknown or missing, a cell is no finite number, a pulse
    repeats or is outside 500 to 2500 us, thrust falls by more than noise, no row is silent, a voltage has fewer than
    three rows, or thrust over power says that newton and kilogram-force are mixed up. The message names the line.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"thrust table {path}: no such file")
    if path.stat().st_size > LARGEST_TABLE_CHARACTERS:
        raise InputError(f"thrust table {path}: {path.stat().st_size} bytes, at most {LARGEST_TABLE_CHARACTERS}")
    try:
        text = path.read_text("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"thrust table {path}: not readable as UTF-8 text ({error})") from error
    return parse_thrust_table(text, str(path), path.stem)


def parse_thrust_table(text: str, where: str, name: str) -> ThrustCurve:
    """Turn the text of a table into a curve; see `read_thrust_table`. `where` is the file's name in messages."""
    comments = [line.lstrip("# ").strip() for line in text.splitlines() if line.startswith("#")]
    try:
        return build_curve(parse_rows(text), name=name, source=" ".join(comments) or where)
    except InputError as error:
        raise InputError(f"thrust table {where}: {error}") from error


def parse_rows(text: str) -> ThrustRows:
    """Read and check every row by itself; see `read_thrust_table`."""
    if len(text) > LARGEST_TABLE_CHARACTERS:
        raise InputError(f"{len(text)} characters, at most {LARGEST_TABLE_CHARACTERS}")
    numbered = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and not line.startswith("#")]
    try:
        # One line at a time keeps the count of lines right; no cell of a table of numbers spans two.
        cells = [(n, next(csv.reader(io.StringIO(line)))) for n, line in numbered]
    except csv.Error as error:
        raise InputError(f"not a CSV ({error})") from error
    if not cells:
        raise InputError("empty, needs a line of column names and rows")
    columns = _columns(cells[0][1])
    if len(cells) == 1:
        raise InputError("column names but no row")
    table = np.array([_numbers(line, row, columns) for line, row in cells[1:]])
    lines = np.array([float(line) for line, _ in cells[1:]])
    by_name = {column: table[:, index] for index, column in enumerate(columns)}
    supply = by_name.get("supply_V", by_name.get("voltage_V"))
    if supply is None:
        raise InputError("no column supply_V, which is required")
    thrust = by_name["thrust_N"] if "thrust_N" in by_name else KGF_N * by_name["force_kgf"]
    pulse = by_name["pwm_us"]
    for column, values, low, high in (("pwm_us", pulse, *PULSES_US), ("supply_V", supply, 1.0, 1000.0)):
        outside = np.flatnonzero((values < low) | (values > high))
        if outside.size:
            row = int(outside[0])
            raise InputError(f"line {lines[row]:.0f}: {column} = {values[row]:g}, allowed {low:g} to {high:g}")
    unknown = np.full(len(table), math.nan)
    power, notes = _power(by_name, lines, supply, pulse)
    return ThrustRows(
        line=lines,
        supply_V=supply,
        pwm_us=pulse,
        thrust_N=thrust,
        rpm=np.abs(by_name.get("rpm", unknown)),
        power_W=power,
        notes=tuple(notes),
    )


def build_curve(rows: ThrustRows, *, name: str, source: str) -> ThrustCurve:
    """Join checked rows into a curve: monotone at each voltage, both sides on common knots; see `read_thrust_table`."""
    voltages = np.unique(rows.supply_V)
    notes = list(rows.notes)
    cleaned = [_clean(rows, float(voltage), notes) for voltage in voltages]
    _check_unit(voltages, cleaned)
    low, high = max(c.silent_us[0] for c in cleaned), min(c.silent_us[1] for c in cleaned)
    if low > high:
        raise InputError("no pulse is silent at every voltage")
    return ThrustCurve(
        name=name,
        source=source,
        supply_V=voltages,
        neutral_us=NEUTRAL_US if low <= NEUTRAL_US <= high else 0.5 * (low + high),
        forward=_side(cleaned, 1.0, notes),
        reverse=_side(cleaned, -1.0, notes),
        notes=tuple(dict.fromkeys(notes)),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cleaned:
    """The rows of one voltage by rising pulse, shape (m,) each, and the outermost silent pulses."""

    supply_V: float
    line: Array
    pwm_us: Array
    thrust_N: Array
    rpm: Array
    power_W: Array
    silent_us: tuple[float, float]


def _columns(header: list[str]) -> list[str]:
    names = [cell.strip() for cell in header]
    unknown = [name for name in names if name not in COLUMNS]
    if unknown:
        allowed = ", ".join(sorted(set(COLUMNS.values())))
        how = other_separator(header)
        raise InputError(f"unknown column {', '.join(map(repr, unknown[:3]))}, allowed {allowed}{how}")
    columns = [COLUMNS[name] for name in names]
    twice = sorted({column for column in columns if columns.count(column) > 1})
    if twice:
        raise InputError(f"column {', '.join(twice)} given more than once")
    if "pwm_us" not in columns:
        raise InputError("no column pwm_us, which is required")
    if ("thrust_N" in columns) == ("force_kgf" in columns):
        raise InputError("needs either a column thrust_N or a column force_kgf, and not both")
    return columns


def _numbers(line: int, cells: list[str], columns: list[str]) -> list[float]:
    if len(cells) != len(columns):
        raise InputError(f"line {line}: {len(cells)} cells, the header has {len(columns)}")
    values = []
    for cell, column in zip(cells, columns, strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(f"line {line}: {column} = {cell.strip()[:40]!r}, must be a finite number")
        values.append(value)
    return values


def _power(by_name: dict[str, Array], lines: Array, supply: Array, pulse: Array) -> tuple[Array, list[str]]:
    """Electrical power, NaN where it contradicts voltage times current, with a note for each such row."""
    current, voltage = by_name.get("current_A"), by_name.get("voltage_V", supply)
    if "power_W" not in by_name:
        return (np.full(lines.size, math.nan) if current is None else np.abs(current * voltage)), []
    power = by_name["power_W"].copy()
    if np.any(power < 0.0):
        row = int(np.flatnonzero(power < 0.0)[0])
        raise InputError(f"line {lines[row]:.0f}: power_W = {power[row]:g}, must be at least 0")
    if current is None:
        return power, []
    product = np.abs(current * voltage)
    wrong = np.flatnonzero(np.abs(power - product) > np.maximum(POWER_W, POWER_SHARE * np.maximum(power, product)))
    if wrong.size > BAD_ROWS_SHARE * lines.size:
        raise InputError(
            f"line {lines[wrong[0]]:.0f}: power {power[wrong[0]]:g} W, but voltage times current is "
            f"{product[wrong[0]]:.3g} W, and so in {wrong.size} rows of {lines.size}; are the units W, V and A?"
        )
    notes = [
        f"line {lines[row]:.0f} ({supply[row]:g} V, {pulse[row]:g} us): power {power[row]:g} W, but voltage times "
        f"current is {product[row]:.3g} W; its electrical readings are left out"
        for row in wrong
    ]
    power[wrong] = math.nan
    return power, notes


def _clean(rows: ThrustRows, voltage: float, notes: list[str]) -> _Cleaned:
    chosen = np.flatnonzero(rows.supply_V == voltage)
    chosen = chosen[np.argsort(rows.pwm_us[chosen], kind="stable")]
    pulse, thrust = rows.pwm_us[chosen], rows.thrust_N[chosen]
    if chosen.size < 3:
        line = rows.line[chosen[0]]
        raise InputError(f"line {line:.0f}: {chosen.size} row(s) at {voltage:g} V, at least 3 are needed")
    repeated = np.flatnonzero(np.diff(pulse) == 0.0)
    if repeated.size:
        line = rows.line[chosen[repeated[0] + 1]]
        raise InputError(f"line {line:.0f}: pulse {pulse[repeated[0]]:g} us given twice at {voltage:g} V")
    monotone = isotonic_regression(thrust).x
    largest = float(np.abs(thrust).max())
    off = np.abs(monotone - thrust)
    worst = int(np.argmax(off))
    if off[worst] > max(NOISE_N, NOISE_SHARE * largest):
        raise InputError(
            f"line {rows.line[chosen[worst]]:.0f}: thrust {thrust[worst]:.4g} N at {voltage:g} V, {pulse[worst]:g} us "
            f"is {off[worst]:.3g} N from any curve that rises with the pulse; noise of {NOISE_N:g} N is allowed"
        )
    if off[worst] > 0.0:
        moved = int(np.count_nonzero(off))
        notes.append(f"{voltage:g} V: {moved} readings moved by up to {off[worst]:.2g} N so that thrust never falls")
    silent = np.flatnonzero(np.abs(monotone) <= SILENT_SHARE * largest)
    if not silent.size:
        raise InputError(f"no row without thrust at {voltage:g} V, so the neutral pulse is not known")
    if largest == 0.0:
        raise InputError(f"no row with thrust at {voltage:g} V")
    return _Cleaned(
        supply_V=voltage,
        line=rows.line[chosen],
        pwm_us=pulse,
        thrust_N=monotone,
        rpm=rows.rpm[chosen],
        power_W=rows.power_W[chosen],
        silent_us=(float(pulse[silent[0]]), float(pulse[silent[-1]])),
    )


def _check_unit(voltages: Array, cleaned: list[_Cleaned]) -> None:
    low, high = GRAMS_PER_WATT
    for voltage, rows in zip(voltages, cleaned, strict=True):
        if np.all(np.isnan(rows.power_W)) or np.nanmax(rows.power_W) <= 0.0:
            continue
        row = int(np.nanargmax(rows.power_W))
        thrust_N, power_W = abs(rows.thrust_N[row]), rows.power_W[row]
        grams = thrust_N / KGF_N * 1000.0 / power_W
        if not low <= grams <= high:
            raise InputError(
                f"line {rows.line[row]:.0f} ({voltage:g} V, {rows.pwm_us[row]:g} us): {thrust_N:.3g} N from "
                f"{power_W:.4g} W is {grams:.3g} gram-force per watt, plausible is {low:g} to {high:g}; "
                "are newton and kgf mixed up?"
            )


def _side(cleaned: list[_Cleaned], sign: float, notes: list[str]) -> CurveSide:
    """One direction of all voltages on the union of their knots, so that no reading is lost."""
    silent, first, last, sides = [], [], [], []
    # At rest speed and power are zero, but only a table that has the column says so.
    columns_known = [True] + [any(np.isfinite(getattr(c, name)).any() for c in cleaned) for name in ("rpm", "power_W")]
    at_rest = np.where(columns_known, 0.0, math.nan)[:, None]
    for rows in cleaned:
        edge = rows.silent_us[1] if sign > 0.0 else rows.silent_us[0]
        running = np.flatnonzero(sign * (rows.pwm_us - edge) > 0.0)[:: int(sign)]
        pulses = [float(pulse) for pulse in rows.pwm_us[running]]
        columns = np.stack([sign * rows.thrust_N, rows.rpm, rows.power_W])[:, running]
        if not pulses or abs(pulses[0] - edge) > RESOLVED_US:
            direction = "forward" if sign > 0.0 else "reverse"
            notes.append(
                f"{rows.supply_V:g} V, {direction}: the table has no thrust this way"
                if not pulses
                else f"{rows.supply_V:g} V, {direction}: no row between {edge:g} us, silent, and {pulses[0]:g} us; a "
                "straight line is taken, so small thrusts may not be held"
            )
            pulses = [edge, *pulses]
            columns = np.concatenate([at_rest, columns], axis=1)
        if len(pulses) == 1:
            pulses.append(pulses[0] + sign)
            columns = np.repeat(columns, 2, axis=1)
        silent.append(edge)
        first.append(pulses[0])
        last.append(pulses[-1])
        sides.append(((np.array(pulses) - pulses[0]) / (pulses[-1] - pulses[0]), columns))
    share = np.unique(np.concatenate([part for part, _ in sides]))
    thrust, rpm, power = (
        np.array([_onto(share, part, columns[index]) for part, columns in sides]) for index in range(3)
    )
    return CurveSide(
        share=share,
        silent_us=np.array(silent),
        first_us=np.array(first),
        last_us=np.array(last),
        thrust_N=np.maximum.accumulate(np.maximum(thrust, 0.0), axis=1),
        rpm=None if np.any(np.isnan(rpm)) else rpm,
        power_W=None if np.any(np.isnan(power)) else power,
    )


def _onto(share: Array, part: Array, values: Array) -> Array:
    known = np.isfinite(values)
    if not np.any(known):
        return np.full(share.size, math.nan)
    return np.asarray(np.interp(share, part[known], values[known]))


@lru_cache(maxsize=8)
def library_curve(name: str) -> ThrustCurve:
    """Read a thrust curve that comes with the package, such as `t200`.

    Raises InputError if there is none of that name; the message lists those there are.
    """
    if name not in curve_names():
        raise InputError(f"thrust curve {name!r}: not in the library, allowed {', '.join(curve_names())}")
    text = (resources.files("wakewise.robot.thrusters") / "data" / f"{name}.csv").read_text("utf-8")
    return parse_thrust_table(text, f"{name}.csv", name)


def curve_names() -> list[str]:
    """Names of the thrust curves that come with the package, sorted."""
    folder = resources.files("wakewise.robot.thrusters") / "data"
    return sorted(entry.name.removesuffix(".csv") for entry in folder.iterdir() if entry.name.endswith(".csv"))


def load_curve(name_or_path: str) -> ThrustCurve:
    """Read a thrust curve of the library by name, or any table by path (anything with a slash or .csv).

    Raises InputError if there is no such curve or file, or the table cannot be used.
    """
    if name_or_path in curve_names():
        return library_curve(name_or_path)
    path = Path(name_or_path)
    if path.suffix != ".csv" and path.name == name_or_path:
        names = ", ".join(curve_names())
        raise InputError(f"thrust curve {name_or_path!r}: not in the library, allowed {names} or the path of a .csv")
    return read_thrust_table(path)
