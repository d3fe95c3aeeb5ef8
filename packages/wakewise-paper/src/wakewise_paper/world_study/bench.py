"""What each method leaves of each world of the library, over seeds that each draw their own world.

A short flight (hover on one orbit, part of a lower one, from a side that the seed draws) gives water, silt, sway,
position and energy; a whole quick scan gives the model. Seed k is one world for all methods, so that flights are
compared in pairs; intervals are 95 % by Student's t over seeds. A campaign makes and
keeps flights and scans: a run that was stopped goes on, and a second one flies what is new.

Emergent in these figures are: how jets decay, merge, meet walls and drift, within the laws that the tank is given
(`wakewise.simulation.tank.validation_limits` says how well each is met); what the bed lets go; how the target bends;
what the camera makes of it. Typed in are those laws' constants, each with a source, and the worlds' numbers (`wakewise
world show NAME`).
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from wakewise.experiments.campaigns import ProcessExecutor
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.statistics import mean_figures, reduction_pct
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.campaigns.study import (
    FlightFailure,
    Key,
    Row,
    numbers,
    run_study,
    selected,
    store_folder,
)
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import load_scenario
from wakewise.operation.worlds.library import load_world, world_names
from wakewise_paper.world_study.flight import FLIGHT, FLIGHT_FIGURES, MODEL_FIGURES, SCAN, scan, short_flight
from wakewise_paper.world_study.lattice_comparison import JUDGED, judge_table, judge_trials

METHODS = (
    "dp",
    "manual",
    "manual-careful",
    "ardusub",
    "mpc",
    "mpc-smooth",
    "no-forward-jets",
    "weighted-pseudo-inverse",
    "allocation-only",
    "wake-aware",
)
"""The first is what the others are held against."""

EMERGENT = (
    "decay and merging of jets within the given laws, wall jets' paths, drift, erosion and settling, the target's "
    "bending, photographs and models"
)
TYPED_IN = "constants of the laws and numbers of the worlds, each with its source (wakewise world show NAME)"

RATIOS = (
    ("target_speed_mean_m_s", "target_speed"),
    ("exposure_speed_mean_m_s", "exposure_speed"),
    ("bed_shear_p95_Pa", "bed_shear"),
    ("silt_lifted_g", "silt_lifted"),
    ("silt_suspended_max_g", "silt_suspended"),
    ("ray_optical_depth", "ray_optical_depth"),
    ("sway_rms_mm", "sway"),
    ("sway_wash_mm", "sway_wash"),
    ("position_rmse_mm", "position"),
    ("energy_kJ", "energy"),
)
"""Figures whose ratio to the first method is told, and the ratio's name."""


TrialKey = tuple[str, str, str, int]
"""Kind of trial or flow, world, method and seed."""

_engine = ProcessExecutor


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is wanted and not known yet, and gather each world's table.

    Raises
    ------
    InputError
        If a world or method is not known.
    """
    began = time.monotonic()
    worlds = selected("worlds", options.worlds, world_names())
    methods = selected("methods", options.methods, METHODS)
    flights, scans = (
        {(kind, world, method, seed): make(world, method, seed) for world, method, seed in planned(worlds, methods, n)}
        for kind, make, n in ((FLIGHT, short_flight, options.seeds), (SCAN, scan, options.models))
    )
    judged = judge_trials(options.judge, tuple(name for name in JUDGED if name in worlds))
    folder = options.store or store_folder("worlds")
    trials: dict[TrialKey, PlannedTrial] = flights | scans | judged
    made = run_study("worlds", trials, folder, options, _engine)
    flown = {(key[1], key[2], key[3]): row for key, row in made.rows.items() if key in flights}
    models = {(key[1], key[2], key[3]): row for key, row in made.rows.items() if key in scans}
    lost = [failure for key, failure in made.failures.items() if key not in judged]
    models |= earlier_models(worlds, methods, options)
    return {
        "default_world": load_scenario("quick", None, {}).world,
        "worlds": {name: world_figures(name, methods, flown, models, lost) for name in worlds},
        "judge": judge_table(made.part(judged).rows) if options.judge else None,
        "why": {} if options.judge else {"judge": "not flown; --judge sets for how many seeds"},
        "emergent": EMERGENT,
        "typed_in": TYPED_IN,
        "flights": len(flights),
        "models": len(models),
        "failed": len(made.failures),
        "failures": made.counts["failures"],
        "known_already": len(made.known),
        "wall_s": time.monotonic() - began,
    }


def planned(worlds: tuple[str, ...], methods: tuple[str, ...], seeds: int) -> list[Key]:
    """World, method and seed, seed by seed, so that a run that is stopped has whole seeds of all worlds."""
    return [(world, method, seed) for seed in range(1, seeds + 1) for world in worlds for method in methods]


def earlier_models(worlds: tuple[str, ...], methods: tuple[str, ...], options: BenchOptions) -> dict[Key, Row]:
    """Models of further seeds that an earlier run made."""
    store = open_store(options.store or store_folder("worlds"))
    found: dict[Key, Row] = {}
    for world, method, seed in planned(worlds, methods, options.seeds):
        figures = store.figures(scan(world, method, seed).task.key) if seed > options.models else None
        if figures is not None:
            found[world, method, seed] = numbers(figures)
    return found


def world_figures(
    name: str, methods: tuple[str, ...], flown: dict[Key, Row], models: dict[Key, Row], failures: list[FlightFailure]
) -> dict[str, Any]:
    """Table of one world. A flight or scan that failed counts as a failure of its method: no success."""
    world = load_world(name)
    tables: dict[str, Any] = {}
    base = _of(flown, name, methods[0])
    for method in methods:
        rows, scans = _of(flown, name, method), dict(_of(models, name, method))
        lost = [f for f in failures if (f.flow, f.name) == (name, method)]
        for failure in lost:
            scans.setdefault(failure.seed, {"success": 0.0})
        told = mean_figures(rows.values(), FLIGHT_FIGURES)
        told |= {key: value for key, value in mean_figures(scans.values(), MODEL_FIGURES).items() if key != "flights"}
        success = told.pop("success")
        told["success_pct"] = None if success is None else 100.0 * success
        told.pop("success_interval")
        told["models"] = len(scans)
        told["failures"] = [failure.reason for failure in lost]
        told["against"] = {methods[0]: ratios(base, rows)} if method != methods[0] else {}
        told["why"] = why(told)
        tables[method] = told
    return {"title": world.file.title, "why": world.file.why, "methods": tables}


def ratios(base: Mapping[int, Row], other: Mapping[int, Row]) -> dict[str, Any]:
    """How much smaller each figure's mean is than the base's, in percent, over the seeds that both flew.

    With an interval of 95 % over pairs, and of the target's speed the worst and the best seed.
    """
    answer: dict[str, Any] = {}
    for figure, name in RATIOS:
        value, interval = reduction_pct(base, other, figure)
        answer[f"{name}_less_pct"], answer[f"{name}_less_interval_pct"] = value, interval
    each = [
        100.0 * (1.0 - ours / theirs)
        for seed in sorted(set(base) & set(other))
        if (ours := other[seed].get(RATIOS[0][0])) is not None and (theirs := base[seed].get(RATIOS[0][0]))
    ]
    answer["target_speed_less_worst_pct"] = min(each) if each else None
    answer["target_speed_less_best_pct"] = max(each) if each else None
    return answer


def why(figures: dict[str, Any]) -> dict[str, str]:
    """Reasons of what could not be computed."""
    reasons: dict[str, str] = {}
    for key in (*FLIGHT_FIGURES, *MODEL_FIGURES, "success_pct"):
        if key not in figures or figures[key] is not None:
            continue
        if key in ("sway_rms_mm", "sway_wash_mm", "target_drag_peak_N", "target_stress_peak_Pa"):
            reasons[key] = "the target is rigid"
        elif key in ("bed_over_threshold_pct", "bed_over_threshold_s"):
            reasons[key] = "no grains lie on the bed"
        elif key in (*MODEL_FIGURES, "success_pct"):
            reasons[key] = "no scan was made; --models sets for how many seeds" if not figures["models"] else "no model"
        else:
            reasons[key] = "no flight gave it"
    return reasons


def _of(rows: dict[Key, Row], world: str, method: str) -> dict[int, Row]:
    return {seed: row for (where, who, seed), row in rows.items() if (where, who) == (world, method)}
