"""A log as a table with one row for each tick of one clock, and as a folder (table, facts, parameters).

Columns that a trial's `steps.parquet` has, too, have the same names and meanings: the estimated pose (`est_`), thrusts
and wrench.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.files import whole_file, write_json, write_text
from wakewise.core.geometry import quat_from_euler
from wakewise_ardusub.logs.channels import HELD_S, MODES, SERVOS, ChannelSeries, VehicleLog
from wakewise_ardusub.logs.replay_allocation import ReplayedAllocation

RATE_HZ = 10.0
MOST_ROWS = 500_000
LINE_S = 2.0
"""Longest gap that depth and attitude are drawn straight across."""
_POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
STICKS = ("forward", "right", "down", "turn")
_STATED = ("depth VFR_HUD", "depth AHRS2", "depth CTUN", "depth BARO")
_FRESH_KG_M3 = 1000.0
_ROUNDING_S = 1e-3
"""Stamps are rounded; a tick this much after the last sample still has it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LogTable:
    """Rows of a log at `rate_hz`: time_s, sticks, servo_i_us, depth_m, attitude, armed, mode, voltage_V, est_ poses.

    `depth_from` says which source the depth is of, None without any. What was not known at a time is null.
    """

    rows: pl.DataFrame
    rate_hz: float
    depth_from: str | None


def tabulate(log: VehicleLog, rate_hz: float = RATE_HZ) -> LogTable:
    """Resample a log: commands, states and voltage hold their last value, depth and attitude go straight between two.

    A log longer than `MOST_ROWS` at that rate gets as many rows, at a lower one.
    """
    rate = min(rate_hz, MOST_ROWS / max(log.duration_s, 1e-9))
    time_s = np.arange(int(log.duration_s * rate + _ROUNDING_S) + 1) / rate
    columns: dict[str, Array | list[str | None]] = {"time_s": time_s}
    sticks = _held(log, "sticks", time_s, 4)
    columns |= {f"stick_{name}": sticks[:, i] for i, name in enumerate(STICKS)}
    servo = _held(log, "servo", time_s, SERVOS)
    columns |= {f"servo_{i + 1}_us": servo[:, i] for i in range(SERVOS)}
    depth, source = depth_series(log)
    columns["depth_m"] = _straight(depth, time_s, 1)[:, 0]
    attitude = log.series.get("attitude")
    if attitude is not None:
        known = np.isfinite(attitude.values).all(axis=1)
        unwound = np.unwrap(attitude.values[known], axis=0)
        attitude = ChannelSeries(time_s=attitude.time_s[known].copy(), values=unwound)
    turned = _straight(attitude, time_s, 3)
    for i, name in enumerate(("roll", "pitch", "heading")):
        angle = turned[:, i]
        columns[f"{name}_rad"] = np.mod(angle, 2.0 * np.pi) if name == "heading" else _wound(angle)
    columns |= _pose(log, depth, turned, time_s)
    columns["armed"] = _held(log, "armed", time_s, 1)[:, 0]
    mode = _held(log, "mode", time_s, 1)[:, 0]
    modes = MODES if log.identity.is_ardusub else {}
    columns["mode"] = [None if np.isnan(m) else modes.get(int(m), f"mode {int(m)}") for m in mode]
    columns["voltage_V"] = _held(log, "voltage", time_s, 1)[:, 0]
    rows = pl.DataFrame(columns, schema_overrides={"mode": pl.String}).with_columns(pl.col(pl.Float64).fill_nan(None))
    return LogTable(rows=rows.with_columns(pl.col("armed") > 0.5), rate_hz=rate, depth_from=source)


def _pose(log: VehicleLog, depth: ChannelSeries | None, turned: Array, time_s: Array) -> dict[str, Array]:
    """Where the vehicle believed to be, as a trial has it; a place that nobody knew is unknown but for its depth."""
    place = _straight(log.series.get("position"), time_s, 3)
    if np.isnan(place).all():
        place[:, 2] = _straight(depth, time_s, 1)[:, 0]
    attitude = np.full((len(time_s), 4), np.nan)
    known = np.isfinite(turned).all(axis=1)
    attitude[known] = quat_from_euler(*turned[known].T)
    return {f"est_{name}": column for name, column in zip(_POSE, np.column_stack([place, attitude]).T, strict=True)}


def _held(log: VehicleLog, channel: str, time_s: Array, width: int) -> Array:
    """The last sample before each tick, NaN before the first and where it is older than may be; shape (n, width)."""
    series = log.series.get(channel)
    result = np.full((len(time_s), width), np.nan)
    if series is None:
        return result
    last = np.searchsorted(series.time_s, time_s + 1e-9, side="right") - 1
    # The autopilot's own log says states when they change, not again and again.
    longest = np.inf if log.kind == "dataflash" and channel in ("armed", "mode") else HELD_S[channel]
    known = (last >= 0) & (time_s - series.time_s[np.maximum(last, 0)] <= longest)
    result[known] = series.values[last[known]]
    return result


def _straight(series: ChannelSeries | None, time_s: Array, width: int) -> Array:
    """Values on the lines between samples, NaN outside and across long gaps; shape (n, width)."""
    result = np.full((len(time_s), width), np.nan)
    if series is None:
        return result
    good = np.isfinite(series.values).all(axis=1)
    at, values = series.time_s[good], series.values[good]
    if len(at) == 0:
        return result
    after = np.searchsorted(at, time_s)
    before_s, after_s = at[np.maximum(after - 1, 0)], at[np.minimum(after, len(at) - 1)]
    near = (time_s >= at[0]) & (time_s <= at[-1] + _ROUNDING_S) & (after_s - before_s <= LINE_S)
    for i in range(width):
        result[near, i] = np.interp(time_s[near], at, values[:, i])
    return result


def _wound(angle: Array) -> Array:
    """Angles in [-pi, pi)."""
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)


def depth_series(log: VehicleLog) -> tuple[ChannelSeries | None, str | None]:
    """Depth of the first source that ever changes, else of the first there is."""
    found: list[tuple[str, ChannelSeries]] = [
        (name.removeprefix("depth "), log.series[name]) for name in _STATED if name in log.series
    ]
    # The second pressure sensor is the one outside the hull.
    found += [
        (f"SCALED_PRESSURE{'' if i == 1 else i}", _of_pressure(log, i))
        for i in (2, 3, 1)
        if f"pressure {i}" in log.series
    ]
    for name, series in found:
        values = series.values[np.isfinite(series.values)]
        if values.size and np.ptp(values) > 0.0:
            return series, name
    return (found[0][1], found[0][0]) if found else (None, None)


def _of_pressure(log: VehicleLog, number: int) -> ChannelSeries:
    """Depth by hydrostatics from the pressure at the surface: the autopilot's, or the least of the log."""
    series = log.series[f"pressure {number}"]
    at_surface = log.parameters.get(f"BARO{number}_GND_PRESS", 0.0)
    if at_surface < 1e4:
        known = series.values[np.isfinite(series.values)]
        at_surface = float(known.min()) if known.size else np.nan
    gravity = log.parameters.get("BARO_SPEC_GRAV", 1.0)
    density = _FRESH_KG_M3 * (gravity if 0.9 <= gravity <= 1.1 else 1.0)
    return ChannelSeries(time_s=series.time_s, values=(series.values - at_surface) / (density * GRAVITY_M_S2))


STEPS, FACTS, PARAMETERS, PAGE = "steps.parquet", "log.json", "parameters.csv", "report.html"


def log_facts(
    log: VehicleLog, table: LogTable, hindsight: ReplayedAllocation | None, why_not: str | None
) -> dict[str, Any]:
    """What a log held and what it would have saved, as figures; `why_not` says why there is no hindsight."""
    rows = table.rows
    lowest = cast("float | None", rows["depth_m"].min())
    facts: dict[str, Any] = {
        "file": log.path.name,
        "format": log.kind,
        "identity": log.identity.words,
        "system": log.system,
        "other_systems": list(log.others),
        "started_s": log.started_s,
        "duration_s": log.duration_s,
        "records": log.records,
        "bad_records": log.bad_records,
        "bad_by_reason": log.bad,
        "bad_bytes": log.bad_bytes,
        "unread_records": log.unread,
        "cut_short": log.cut_short,
        "clock_jumps": [{"time_s": jump.time_s, "step_s": jump.step_s} for jump in log.jumps],
        "samples": {name: len(series.time_s) for name, series in sorted(log.series.items())},
        "parameters": len(log.parameters),
        "rows": len(rows),
        "rate_hz": table.rate_hz,
        "depth_from": table.depth_from,
        "depth_max_m": None if log.identity.is_other else rows["depth_m"].max(),
        "voltage_min_V": rows["voltage_V"].min(),
        "armed_s": float(rows["armed"].fill_null(False).sum()) / table.rate_hz,
        "modes": {
            mode: count / table.rate_hz
            for mode, count in rows["mode"].drop_nulls().value_counts(sort=True, name="count").iter_rows()
        },
    }
    if log.identity.is_other:
        facts["height_max_m"] = None if lowest is None else -lowest
    if hindsight is None:
        return facts | {"why_no_hindsight": why_not}
    running = int(hindsight.running.sum())
    return facts | {
        "running_s": running / table.rate_hz,
        "motors": list(hindsight.motors),
        "directions": [int(d) for d in hindsight.directions],
        "total_weight": hindsight.total_weight,
        "disturbance_flown": hindsight.total("flown") / max(running, 1),
        "disturbance_least": hindsight.total("least") / max(running, 1),
        "disturbance_gentle": hindsight.total("gentle") / max(running, 1),
        "saved_pct": hindsight.saved_pct("flown"),
        "saved_against_least_pct": hindsight.saved_pct("least"),
    }


def write_folder(
    folder: Path, log: VehicleLog, table: LogTable, hindsight: ReplayedAllocation | None, facts: dict[str, Any]
) -> None:
    """Write the table, the figures and the parameters."""
    rows = table.rows if hindsight is None else pl.concat([table.rows, hindsight.columns()], how="horizontal")
    with whole_file(folder / STEPS) as temporary:
        rows.write_parquet(temporary)
    write_json(folder / FACTS, facts)
    lines = [f"{name},{value:.9g}" for name, value in sorted(log.parameters.items())]
    write_text(folder / PARAMETERS, "\n".join(["name,value", *lines]) + "\n")
