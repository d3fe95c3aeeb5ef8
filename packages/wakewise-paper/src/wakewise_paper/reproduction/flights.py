"""Work of a campaign: one flight, on station or round the target, in whatever fields of a scenario it is told.

Left in the trial's folder is `series.npz`: thrusts, D and the target's water over time, for the page.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.allocation import disturbance_of
from wakewise.control.null_space_allocation import allocation_context
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import Progress, TruthProvider
from wakewise.operation import Parts, Scenario, fly
from wakewise.operation.loop import Step
from wakewise.scene.missions import SETTLING
from wakewise.vision.evaluation import flight_figures
from wakewise_paper.reproduction.piv_flights import PivRecorder
from wakewise_paper.wash_reduction.ballasted_world import ballasted_world, blocks_of
from wakewise_paper.wash_reduction.paper import WATER_EVERY_S
from wakewise_paper.wash_reduction.routes import gentle_route, station_route

COURSES = ("station", "round")
SERIES = "series.npz"
SERIES_EVERY_S = 0.2

FIGURES = (
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "tracer_speed_mean_m_s",
    "disturbance",
    "ray_optical_depth",
    "silt_lifted_g",
    "sway_rms_mm",
    "sway_wash_mm",
    "position_rmse_mm",
    "path_rmse_mm",
    "estimate_rmse_mm",
    "tracking_rmse_mm",
    "velocity_deviation_pct",
    "roll_pitch_rms_deg",
    "attitude_rmse_deg",
    "energy_kJ",
    "sign_flips_per_s",
    "fallbacks",
    "collisions",
    "solve_ms_median",
    "solve_ms_p99",
)
"""Of each flight, from the end of settling on."""


def fly_one(settings: Mapping[str, Any], folder: Path, progress: Progress) -> dict[str, float | None]:
    """Figures of one flight.

    Parameters
    ----------
    settings : mapping
        `fields` of a scenario by dotted names, over the preset `quick`; `course`, one of `COURSES`; `duration_s`, only
        the first part of it; `piv_instants`, at how many the water is photographed; `ballast`, whether the vehicle is
        trimmed first as its own hover advises.

    Raises
    ------
    InputError
        If the course is not known.
    """
    began = time.process_time()
    parts = course_parts(settings)
    if settings.get("ballast"):
        parts = ballasted_world(parts, blocks_of(parts))
    rate_hz = parts.control.rate_hz
    watch = allocation_context(parts.vehicle, parts.region, parts.wake, parts.control)
    every = max(1, round(SERIES_EVERY_S * rate_hz))
    duration_s = settings.get("duration_s") or parts.route.duration_s
    piv = PivRecorder.over(parts, float(duration_s), int(settings.get("piv_instants") or 0))
    D: list[tuple[float, float]] = []
    solve_ms: list[float] = []
    heard = 0

    def listen(step: Step, witness: TruthProvider | None) -> None:
        nonlocal heard
        heard += 1
        solve_ms.append(1e3 * step.solve_s)
        if heard % every == 1 and step.truth is not None:
            thrusts = step.truth.thrusts_N
            D.append((step.time_s, float(disturbance_of(watch.gram(step.estimate, thrusts), thrusts))))
        piv.look(step.time_s, witness)

    # Courses lie where the mission's own orbits are, or above the target, which their own geometry keeps clear of.
    flown = fly(
        parts,
        checked=False,
        water_every_s=WATER_EVERY_S,
        duration_s=settings.get("duration_s"),
        watch=listen,
        progress=progress,
    ).steps
    frame = flown.filter(pl.col("leg") != SETTLING)
    judged = frame if frame.height else flown
    figures: dict[str, Any] = flight_figures(judged)
    begins_s = float(judged["time_s"][0])
    figures["disturbance"] = float(np.mean([value for at, value in D if at >= begins_s] or [D[-1][1]]))
    figures["solve_ms_median"] = float(np.median(solve_ms[-judged.height :]))
    figures["solve_ms_p99"] = float(np.percentile(solve_ms[-judged.height :], 99))
    _write_series(flown, np.array(D), begins_s, len(parts.vehicle.thrusters), every, folder / SERIES)
    told: dict[str, float | None] = {key: _plain(figures.get(key)) for key in FIGURES}
    return told | piv.figures() | {"cpu_s": time.process_time() - began}


def course_parts(settings: Mapping[str, Any]) -> Parts:
    """Parts of the flight; the side from which it looks is drawn by the scenario's seed."""
    fields = dict(settings["fields"])
    parts = Scenario.preset("quick", **fields).parts()
    return parts.replace(route=_ROUTES[_course(settings)](parts, azimuth_of(parts.scenario.seed)))


def azimuth_of(seed: int) -> float:
    """Where a flight begins, seen from the target, in rad."""
    return float(np.random.default_rng([seed, 7]).uniform(-np.pi, np.pi))


def read_series(folder: Path) -> dict[str, Array] | None:
    """`time_s`, `thrusts_N` (steps, thrusters), `speed_m_s`, `D_time_s`, `D` and `begins_s`; None if there is none."""
    try:
        with np.load(folder / SERIES) as kept:
            return {name: np.asarray(kept[name]) for name in kept.files}
    except (OSError, ValueError, EOFError):
        return None


def _course(settings: Mapping[str, Any]) -> str:
    course = str(settings["course"])
    if course not in COURSES:
        raise InputError(f"course '{course}': not known, allowed: {', '.join(COURSES)}")
    return course


def _station(parts: Parts, azimuth_rad: float) -> Any:
    return station_route(parts.found_target, parts.found_target.centre_W_m, azimuth_rad)


def _round(parts: Parts, azimuth_rad: float) -> Any:
    mission = parts.scenario.mission
    elevations = sorted(mission.elevations_deg)
    return gentle_route(
        parts.found_target.centre_W_m,
        mission.standoff_m,
        azimuth_rad,
        elevations_deg=(elevations[len(elevations) // 2], elevations[0]),
    )


_ROUTES: dict[str, Callable[[Parts, float], Any]] = {"station": _station, "round": _round}


def _write_series(flown: pl.DataFrame, D: Array, begins_s: float, thrusters: int, every: int, path: Path) -> None:
    rows = flown.gather_every(every)
    thrusts = rows.select(f"thrust_{i + 1}_N" for i in range(thrusters)).to_numpy()
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            time_s=rows["time_s"].to_numpy(),
            thrusts_N=thrusts.astype(np.float32),
            speed_m_s=rows["target_speed_mean_m_s"].to_numpy(),
            D_time_s=D[:, 0],
            D=D[:, 1],
            begins_s=np.array(begins_s),
        )


def _plain(value: Any) -> float | None:
    return None if value is None or not np.isfinite(value) else float(value)
