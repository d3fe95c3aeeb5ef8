"""From the parts that a flight by hand left to the folder of a trial: at its end, or after it was cut off."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose
from wakewise.core.optional_dependencies import has
from wakewise.operation.flight_log import drop_parts, has_parts, parts_exposures, parts_hands, parts_table, steps_of
from wakewise.operation.recorder import write_record
from wakewise.operation.teleop.input.control_log import TRACE_FILE
from wakewise.operation.trial_folder import write_views

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts

_SEEN = ("time_s", *(f"goal_{axis}_m" for axis in "xyz"), *(f"goal_q{axis}" for axis in "wxyz"), "goal_tilt_deg")


def collect_flight(parts: Parts, folder: Path) -> bool:
    """Make of a flight's parts what a trial's flight leaves; False where there are none, or the flight is whole.

    Of planned.csv: a flight by hand has no plan, so it says where the camera was wished to be at each photograph. Rows
    and photographs are as many as both were kept of, so a flight that was cut off ends a moment early.
    """
    if (folder / "steps.parquet").exists() or not has_parts(folder):
        drop_parts(folder)
        return False
    table = parts_table(folder)
    seen = table.filter("exposing").select(_SEEN).collect()
    exposures = list(parts_exposures(folder, seen.height))
    write_views(parts, folder, [(parts.route.photo(k), *_view(parts, seen, k)) for k in range(seen.height)])
    hands = parts_hands(folder)
    if hands is not None:
        with whole_file(folder / TRACE_FILE) as path:
            hands.write_parquet(path)
    if has("logs"):
        from wakewise.operation.telemetry import write_mcap

        write_mcap(steps_of(table), folder / "log.mcap")
    write_record(folder, table, exposures, parts.scenario.imaging.window_s)
    drop_parts(folder)
    return True


def _view(parts: Parts, seen: pl.DataFrame, k: int) -> tuple[float, Pose]:
    """When photograph k was taken and the camera's wished pose then."""
    time_s, *place, tilt_deg = (float(value) for value in seen.row(k))
    joint, X_BC = parts.vehicle.tilt, parts.vehicle.X_BC
    mount = X_BC if joint is None else joint.mount(X_BC, math.radians(tilt_deg))
    return time_s, Pose(np.array(place[:3]), np.array(place[3:])) @ mount
