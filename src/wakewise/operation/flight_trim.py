"""Trim from a flight's record: which of its steps are a hover, and what they say of the ballast."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl

from wakewise.control.ballast_from_hover import HoverTrim, hover_trim
from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.operation.parts import Parts
from wakewise.operation.recorder import LOAD
from wakewise.operation.scenario import read_scenario
from wakewise.robot.vehicles import Vehicle

LEARNING_S = 4.0
"""The estimator knows a vehicle's load that long after the start: from 1 N unknown to some hundredths."""
LEAST_S = 2.0
"""A shorter hover says nothing: its spread would be that of one gust."""
_AT_REST = 1e-3
_SLOW_M_S, _SLOW_RAD_S = 0.02, 0.05


def hover_mask(steps: pl.DataFrame) -> BoolArray:
    """Which steps of a record are a hover: a goal at rest (1 mm/s, 1 mrad/s), a vehicle nearly so, load known."""
    twist = ("u_m_s", "v_m_s", "w_m_s", "p_rad_s", "q_rad_s", "r_rad_s")
    goal, own = (_table(steps, [f"{who}_{name}" for name in twist]) for who in ("goal", "est"))
    rested = np.all(np.abs(goal) <= _AT_REST, axis=1)
    slow = (np.linalg.norm(own[:, :3], axis=1) <= _SLOW_M_S) & (np.linalg.norm(own[:, 3:], axis=1) <= _SLOW_RAD_S)
    time_s = steps["time_s"].to_numpy()
    return np.asarray(rested & slow & (time_s >= time_s[0] + LEARNING_S))


def flight_trim(vehicle: Vehicle, steps: pl.DataFrame) -> HoverTrim:
    """What the hovers of a flight say of the trim of its vehicle.

    `vehicle`: as it was believed to be, ballast included. `steps`: its record, as in steps.parquet.

    Raises InputError if the record holds no load (it is of an older version), or no hover of two seconds.
    """
    n = len(vehicle.thrusters)
    needed = [*LOAD, *(f"command_{i + 1}_N" for i in range(n))]
    missing = [name for name in needed if name not in steps.columns]
    if missing:
        raise InputError(f"trim: the flight's record has no column {missing[0]}; fly it again")
    still = hover_mask(steps)
    time_s = steps["time_s"].to_numpy()
    lasts_s = float(still.sum()) * float(np.median(np.diff(time_s))) if len(time_s) > 1 else 0.0
    if lasts_s < LEAST_S:
        raise InputError(
            f"trim: {lasts_s:.1f} s of hover after the first {LEARNING_S:g} s, at least {LEAST_S:g} s are needed; "
            "fly longer, or hover (mission.settle_s)"
        )
    kept = steps.filter(still)
    return hover_trim(
        vehicle, _table(kept, [f"est_q{a}" for a in "wxyz"]), _table(kept, [*LOAD]), _table(kept, needed[len(LOAD) :])
    )


def folder_trim(folder: Path) -> tuple[Parts, HoverTrim]:
    """The same of a trial's folder, and the parts that were flown.

    Raises InputError if it is no trial's folder, or as `flight_trim`.
    """
    from wakewise.operation.trial_folder import changed_files  # it needs OpenCV, and a flight, which needs none, this

    if not (folder / "steps.parquet").is_file() or not (folder / "scenario.yaml").is_file():
        raise InputError(f"{folder}: not the folder of a trial that was flown, needs scenario.yaml and steps.parquet")
    scenario = read_scenario(folder / "scenario.yaml")
    if changed := changed_files(folder / "scenario.yaml", scenario):
        raise InputError(f"{folder}: {changed[0]} since it was flown; give what was flown, or fly again")
    parts = scenario.parts()
    try:
        steps = pl.read_parquet(folder / "steps.parquet")
    except (OSError, pl.exceptions.PolarsError) as fault:
        raise InputError(f"{folder / 'steps.parquet'}: cannot be read ({str(fault).splitlines()[0]})") from None
    return parts, flight_trim(parts.vehicle, steps)


def ballast_proposal(vehicle: Vehicle, steps: pl.DataFrame) -> str | None:
    """What a flight proposes for the ballast of the next one, in one line; None where it proposes nothing."""
    try:
        found = flight_trim(vehicle, steps)
    except InputError:  # no hover, or an older record: nothing is known, nothing is proposed
        return None
    return found.words if found.worth else None


def _table(steps: pl.DataFrame, names: list[str]) -> Array:
    return steps.select(names).to_numpy().astype(np.float64)
