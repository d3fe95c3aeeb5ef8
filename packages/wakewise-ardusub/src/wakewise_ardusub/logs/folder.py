"""A read log as a folder: the table, what was found in the file, and the parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import polars as pl

from wakewise.core.files import whole_file, write_json, write_text
from wakewise_ardusub.logs.channels import VehicleLog
from wakewise_ardusub.logs.replay_allocation import ReplayedAllocation
from wakewise_ardusub.logs.table import LogTable

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
