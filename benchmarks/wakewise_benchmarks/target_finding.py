"""Finding the target with the camera: how soon, how well, what it is worth, and how still the vehicle is held by it.

Written down before the flights:

- Seeds 4201 to 4210, flown for nothing else (4101 to 4103 were flown while the perception was made). Starts are drawn
  0.8 to 1.1 m from the target, which is in the picture but not in its middle. Optical tracking is off. A flight looks
  from two sides, approaches, holds for `HOLD_S` and flies one orbit.
- `found`: a body is proposed whose centre is within the target's radius of the true one. Errors of the centre are of
  its place relative to the camera: what a controller needs. The first is that when the target is accepted.
- `found_pct` counts flights in which a body was so proposed within 10 s.
- While holding, from `SETTLED_S` on, the position is judged by its distance from its mean, and the attitude as well.
  The estimate's mean error, the offset between the map's frame and the world's, is stated beside it
  (`hold_mean_error_mm`); the NEES is that of the error without it.
- Whole scans with models (`--models`, in `SCAN_WORLD`): what the coverage of the mapped surface said of the
  photographs against what the model has, patch by patch. `whole` is the preset's scan; `least-overlap` has one ring
  of `LEAST_VIEWS`, and no further photographs.
- Wash is the mean over approach, hold and orbit, with the region found, with that of the surveyed target, and of `dp`
  on the same mission; kept is the share of the reduction against `dp` that the found region keeps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.stats import chi2

from wakewise.control import make_controller
from wakewise.core.arrays import Array
from wakewise.core.geometry import quat_conjugate, quat_multiply, rotvec_from_quat
from wakewise.core.interfaces import TruthProvider
from wakewise.experiments.campaigns.definition import FLIGHT_SOURCES, MODEL_SOURCES, PlannedTrial
from wakewise.experiments.campaigns.flights import MODEL, scenario_of
from wakewise.experiments.campaigns.statistics import Interval, geometric_ratio, mean_interval, share_interval
from wakewise.experiments.campaigns.study import Row, run_study, selected, store_folder, study_trial
from wakewise.experiments.campaigns.task import Figures, Task, WorkProgress
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import Flight, fly
from wakewise.operation.finding.camera_estimator import CameraEstimator
from wakewise.operation.loop import Step
from wakewise.vision.evaluation import flight_figures

FIRST_SEED, MOST_SEEDS = 4201, 100
HOLD_S, SETTLED_S = 20.0, 5.0
WORLDS: dict[str, dict[str, Any]] = {
    "payload": {"world": "payload"},
    "still": {"world": "payload", "tank.current.velocity_m_s": (0.0, 0.0, 0.0), "tank.current.turbulence_m_s": 0.0},
    "silt": {"world": "mud"},
    "particles": {"world": "payload", "imaging.flakes_per_m3": 15000.0},
    "sway": {"world": "sheltered"},
    "rolling-shutter": {"world": "payload", "imaging.kind": "rov-video"},
}
"""Fields of a scenario by name; `still` is the tank without current."""
ARMS: dict[str, dict[str, Any]] = {
    "found": {},
    "known": {"known_region": True},
    "dp": {"method": "dp", "known_region": True},
}
AGES_S = (0.05, 0.3)
"""Ages of the region beside the default of 0.1 s, flown in `AGE_WORLD` alone."""
AGE_WORLD = "payload"
SCAN_WORLD, LEAST_VIEWS = "payload", 16
SCANS: dict[str, dict[str, Any]] = {
    "whole": {},
    "least-overlap": {"mission.elevations_deg": (30.0,), "mission.views": (LEAST_VIEWS,), "find.further_views": 0},
}
"""Fields of a scenario by name, of scans of which models are made."""
SCAN_FIGURES = ("coverage_agreement_pct", "coverage_predicted_pct", "completeness_visible_pct", "rmse_mm")
LEAST_WASH_M_S = 0.005
"""Where `dp` leaves less, there is no wash to reduce, and its reduction says nothing."""
SOURCES = (*FLIGHT_SOURCES, "perception", "vision/imaging", "wakewise_benchmarks:target_finding.py")
STAGE = f"{__name__}:find_stage"


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is wanted and not known yet, and gather the figures; worlds are those of `WORLDS`."""
    began = time.monotonic()
    worlds = selected("--worlds", options.worlds, tuple(WORLDS))
    arms = selected("--methods", options.methods, tuple(ARMS))
    seeds = range(FIRST_SEED, FIRST_SEED + min(options.seeds, MOST_SEEDS))
    trials = {
        (world, arm, seed): planned(world, arm, seed, ARMS[arm]) for seed in seeds for world in worlds for arm in arms
    }
    if AGE_WORLD in worlds and set(arms) == set(ARMS):  # what is kept is told beside the other arms
        for age_s in AGES_S:
            name = f"found/{1e3 * age_s:.0f}ms"
            trials |= {(AGE_WORLD, name, seed): planned(AGE_WORLD, name, seed, {"latency_s": age_s}) for seed in seeds}
    if SCAN_WORLD in worlds and "found" in arms:
        models = range(FIRST_SEED, FIRST_SEED + options.models)
        trials |= {(SCAN_WORLD, name, seed): planned_scan(name, seed) for seed in models for name in SCANS}
    made = run_study("target", trials, options.store or store_folder("target"), options)
    rows = {world: {key[1:]: row for key, row in made.rows.items() if key[0] == world} for world in worlds}
    every = {(world, *key): row for world in worlds for key, row in rows[world].items()}
    failed = {key for key in made.failures if key[1] == "found"}
    return {
        **figures_of(every, len(failed)),
        "worlds": {
            world: figures_of(
                {(world, *key): row for key, row in rows[world].items()}, sum(key[0] == world for key in failed)
            )
            for world in worlds
        },
        **coverage_figures(made.rows),
        "ages": {f"{1e3 * age_s:.0f}": wash_kept(every, f"found/{1e3 * age_s:.0f}ms") for age_s in AGES_S},
        **made.counts,
        "wall_s": time.monotonic() - began,
    }


def planned(world: str, arm: str, seed: int, more: Mapping[str, Any]) -> PlannedTrial:
    """One flight."""
    fields = {
        "tank.sensors.tracking_rate_hz": 0.0,
        "mission.elevations_deg": (30.0,),
        "mission.views": (20,),
        **WORLDS[world],
        "method": str(more.get("method", "wake-aware")),
        "seed": seed,
        "pilot": "find",
        "find.hold_s": HOLD_S,
        "find.further_views": 0,
        "perception.latency_s": float(more.get("latency_s", 0.1)),
    }
    settings = {"scenario": fields, "preset": "quick", "known_region": bool(more.get("known_region", False))}
    task = Task(name=f"{world}/{arm}/{seed}", work=STAGE, settings=settings, sources=SOURCES)
    return study_trial(world, arm, seed, task)


def planned_scan(name: str, seed: int) -> PlannedTrial:
    """One whole scan and its model."""
    fields = {
        "tank.sensors.tracking_rate_hz": 0.0,
        **WORLDS[SCAN_WORLD],
        **SCANS[name],
        "seed": seed,
        "pilot": "find",
    }
    settings = {"scenario": fields, "preset": "quick", "keep": "figures"}
    sources = (*MODEL_SOURCES, *SOURCES)
    return study_trial(
        SCAN_WORLD, name, seed, Task(name=f"{name}/{seed}", work=MODEL, settings=settings, sources=sources)
    )


@dataclass(kw_only=True, eq=False)
class FlightJudge:
    """Watches a flight: errors of the target's place relative to the camera, and of the vehicle's."""

    centre_W_m: Array
    rows: list[tuple[float, ...]] = field(default_factory=list)
    status: list[str] = field(default_factory=list)

    def __call__(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Take in one step."""
        del truth_provider
        assert step.truth is not None
        true, seen, target = step.truth.state.X_WB, step.estimate.X_WB, step.estimate.target
        error = math.nan
        if target is not None:
            error = float(
                np.linalg.norm(true.inverse().apply(self.centre_W_m) - seen.inverse().apply(target.centre_W_m))
            )
        turn = rotvec_from_quat(quat_multiply(quat_conjugate(step.goal.X_WB.q), true.q))
        off = seen.p_m - true.p_m
        P = step.estimate.covariance
        spread = np.full(9, math.nan) if P is None else P[:3, :3].ravel()
        self.rows.append((step.time_s, error, *true.p_m, *turn, *off, *spread))
        self.status.append("none" if target is None else target.status)


def find_stage(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:
    """Figures of one flight that finds its target."""
    del folder
    parts = scenario_of(settings).parts()
    if settings["known_region"]:
        controller = make_controller(
            parts.method, parts.vehicle, parts.region, parts.wake, parts.control, parts.surroundings
        )
        parts = parts.replace(controller=controller)
    judge = FlightJudge(centre_W_m=parts.target.centre_W_m)
    return judged(fly(parts, checked=False, watch=judge, progress=progress), judge)


def judged(flight: Flight, judge: FlightJudge) -> dict[str, float | None]:
    """Figures of a flight from its record and its judge."""
    steps, estimator = flight.steps, flight.parts.estimator
    assert isinstance(estimator, CameraEstimator)
    legs, table, status = np.array(steps["leg"]), np.array(judge.rows), np.array(judge.status)
    time_s, error = table[:, 0], table[:, 1]
    right = np.isin(status, ("proposed", "tracked")) & (error < flight.parts.target.radius_m)
    first = int(np.argmax(right)) if right.any() else None
    accepted = np.flatnonzero(status == "tracked")
    hold = np.flatnonzero(legs == "hold")
    hold = hold[time_s[hold] >= time_s[hold[0]] + SETTLED_S] if len(hold) else hold
    scan = np.flatnonzero(np.char.startswith(legs.astype(str), "orbit"))
    away = steps.filter(pl.col("leg") != "look")
    scanned = bool(len(scan))
    told: dict[str, float | None] = {
        "found": float(first is not None),
        "found_s": None if first is None else float(time_s[first]),
        "accepted_s": float(time_s[accepted[0]]) if len(accepted) else None,
        "centre_first_mm": 1e3 * float(error[accepted[0]]) if len(accepted) else None,
        "centre_after_orbit_mm": 1e3 * float(error[scan[-1]]) if len(scan) else None,
        "lost_pct": 100.0 * float(np.mean(status[accepted[0] :] == "lost")) if len(accepted) else None,
        "picture_ms_p99": 1e3 * float(np.percentile(np.array(estimator.seen.picture_s), 99)),
        "age_ms_p99": 1e3 * float(np.percentile(np.array(estimator.seen.age_s), 99)),
        "duration_s": float(time_s[-1]),
        **holding(table[hold]),
    }
    flown = flight_figures(away if away.height else steps)
    for name in ("target_speed_mean_m_s", "energy_kJ", "collisions", "fallbacks", "position_rmse_mm"):
        value = flown[name]
        # A flight that never came near has no wash to speak of, and must not pass for a gentle one.
        told[name] = None if value is None or not scanned else float(value)
    return told


def holding(rows: Array) -> dict[str, float | None]:
    """How still the vehicle was held: about its mean, relative to the target at rest, and how sure the filter was."""
    names = ("hold_rmse_mm", "hold_mean_error_mm", "hold_attitude_deg", "hold_estimate_rmse_mm", "nees_position")
    if len(rows) < 2:
        return dict.fromkeys(names)
    place, turn, off = rows[:, 2:5], rows[:, 5:8], rows[:, 8:11]
    P = rows[:, 11:20].reshape(-1, 3, 3)
    mean_error = float(np.linalg.norm(off.mean(axis=0)))
    off = off - off.mean(axis=0)
    nees = np.einsum("ni,nij,nj->n", off, np.linalg.inv(P), off) if np.isfinite(P).all() else np.array([math.nan])
    return {
        "hold_rmse_mm": 1e3 * _rms(place - place.mean(axis=0)),
        "hold_mean_error_mm": 1e3 * mean_error,
        "hold_attitude_deg": math.degrees(_rms(turn - turn.mean(axis=0))),
        "hold_estimate_rmse_mm": 1e3 * _rms(off),
        "nees_position": float(nees.mean()) if np.isfinite(nees).all() else None,
    }


def _rms(vectors: Array) -> float:
    return float(np.sqrt(np.mean(np.einsum("ni,ni->n", vectors, vectors))))


def figures_of(rows: Mapping[tuple[str, str, int], Row], failed: int) -> dict[str, Any]:
    """Figures of the arm `found` with intervals of 95 %, and the wash that it keeps; a failed flight found nothing."""
    own = [row for key, row in rows.items() if key[1] == "found"]
    n = len(own) + failed
    found = [s for row in own if (s := row["found_s"]) is not None]
    taken = [s for row in own if (s := row["accepted_s"]) is not None]
    soon = sum(s <= 10.0 for s in found)
    told: dict[str, Any] = {
        "flights_of_found": n,
        "found_pct": 100.0 * soon / n if n else None,
        "found_pct_interval": None if not n else [100.0 * end for end in share_interval(soon, n)],
        "found_s_median": float(np.median(found)) if found else None,
        "accepted_s_median": float(np.median(taken)) if taken else None,
    }
    for name in (
        "centre_first_mm",
        "centre_after_orbit_mm",
        "hold_rmse_mm",
        "hold_mean_error_mm",
        "hold_attitude_deg",
        "hold_estimate_rmse_mm",
        "lost_pct",
        "energy_kJ",
    ):
        told[name], told[f"{name}_interval"] = _mean([row[name] for row in own])
    pictures = [row["picture_ms_p99"] for row in own if row["picture_ms_p99"] is not None]
    told["latency_ms_p99"] = max(pictures) if pictures else None
    told["nees_position_mean"], told["nees_in_bounds"] = consistent([row["nees_position"] for row in own])
    return told | {"wash_reduction_kept_pct": None, **wash_kept(rows, "found")}


def coverage_figures(rows: Mapping[tuple[str, str, int], Row]) -> dict[str, Any]:
    """Agreement of coverage and model of whole scans, and figures of each kind of scan, with intervals of 95 %."""
    told: dict[str, Any] = {"scans": {}}
    for name in SCANS:
        own = [row for key, row in rows.items() if key[1] == name]
        told["scans"][name] = {"scans": len(own)}
        for key in SCAN_FIGURES:
            told["scans"][name][key], told["scans"][name][f"{key}_interval"] = _mean([row.get(key) for row in own])
    whole = told["scans"]["whole"]
    return told | {key: whole[key] for key in (SCAN_FIGURES[0], f"{SCAN_FIGURES[0]}_interval")}


def _mean(values: Sequence[float | None]) -> tuple[float | None, Interval | None]:
    known = [float(value) for value in values if value is not None]
    if not known:
        return None, None
    return mean_interval(known)


def consistent(values: Sequence[float | None]) -> tuple[float | None, bool | None]:
    """Mean of the normalised squared errors of three coordinates, and whether it is not above the bound of 97.5 %.

    Flights count as independent. Below the lower bound the filter is less sure than it could be, which is not refused.
    """
    known = [float(value) for value in values if value is not None]
    if not known:
        return None, None
    return float(np.mean(known)), bool(np.mean(known) <= float(chi2.ppf(0.975, 3 * len(known))) / len(known))


def wash_kept(rows: Mapping[tuple[str, str, int], Row], arm: str) -> dict[str, Any]:
    """Wash over that of `dp` with the region found and with the known one, and the share of the reduction kept.

    Of flights in which `dp` leaves `LEAST_WASH_M_S` or more.
    """
    trios = []
    for (world, name, seed), row in rows.items():
        known, dp = rows.get((world, "known", seed)), rows.get((world, "dp", seed))
        if name == arm and known is not None and dp is not None:
            speeds = [each["target_speed_mean_m_s"] for each in (row, known, dp)]
            if all(s is not None for s in speeds):
                trios.append([float(s) for s in speeds if s is not None])
    trios = [trio for trio in trios if trio[2] >= LEAST_WASH_M_S]
    if not trios:
        return {"wash_pairs": 0}
    ours, given, least = np.array(trios).T
    ratio, ends = geometric_ratio(ours, least)
    known_ratio, known_ends = geometric_ratio(given, least)
    against, against_ends = geometric_ratio(ours, given)
    kept = 100.0 * (1.0 - ratio) / (1.0 - known_ratio) if known_ratio < 1.0 else None
    return {
        "wash_pairs": len(trios),
        "wash_over_dp": ratio,
        "wash_over_dp_interval": ends,
        "known_wash_over_dp": known_ratio,
        "known_wash_over_dp_interval": known_ends,
        "wash_over_known": against,
        "wash_over_known_interval": against_ends,
        "wash_reduction_kept_pct": kept,
    }


def show_target(result: Mapping[str, Any]) -> None:
    """A row per world."""
    import typer

    from wakewise.ui.cli.console import format_value, print_table
    from wakewise_paper.cli.bench_wash import show_failures

    columns = (
        ("flights_of_found", "flights"), ("found_pct", "found %"), ("found_s_median", "after s"),
        ("accepted_s_median", "accepted s"),
        ("centre_first_mm", "centre mm"), ("centre_after_orbit_mm", "orbit mm"), ("hold_rmse_mm", "hold mm"),
        ("hold_attitude_deg", "hold deg"), ("wash_over_dp", "wash/dp"), ("known_wash_over_dp", "known/dp"),
        ("wash_reduction_kept_pct", "kept %"), ("latency_ms_p99", "ms p99"), ("nees_position_mean", "NEES"),
    )  # fmt: skip
    rows = [(name, *(row.get(key) for key, _ in columns)) for name, row in (*result["worlds"].items(), ("all", result))]
    print_table("t" + "n" * len(columns), ("world", *(title for _, title in columns)), rows, "target found by camera")
    for age, kept in result["ages"].items():
        typer.echo(
            f"a region {age} ms old keeps {format_value(kept.get('wash_reduction_kept_pct'))} % of the reduction"
        )
    scans = [(name, *(row.get(key) for key in ("scans", *SCAN_FIGURES))) for name, row in result["scans"].items()]
    titles = ("scan", "models", "coverage agrees %", "said %", "modelled %", "RMSE mm")
    print_table("t" + "n" * (len(titles) - 1), titles, scans, "coverage held against the model")
    typer.echo(f"{result['flights']} flights, {result['failed']} failed")
    show_failures(result)
