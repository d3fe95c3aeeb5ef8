"""What each method does to the target's water where users have the trouble, and what each mechanism is worth there.

Scenarios are files (`scenarios/`), stratified over trim and the side of the current (`strata.py`); the library's
worlds count as scenarios, too. Seed k of a scenario is one world for all methods, so flights are compared in pairs;
the headline was chosen beforehand (`headline.py`, docs/research-log/0033). The paper's own world is circular and says
so (`paper.py`). What no controller could pass by sharing thrusts out is worked out where that is wished (`bound.py`).

Flights are kept (`flight_store`): a run that was stopped goes on, and a second one only flies what is new.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.experiments.campaigns import ProcessExecutor
from wakewise.experiments.trials.timing import BenchOptions
from wakewise_paper import flight_batches
from wakewise_paper.flight_batches import FlightFailure, FlightStore, Key, store_folder
from wakewise_paper.wash_reduction.energy_optimum import BoundTrial
from wakewise_paper.wash_reduction.figures import (
    SPEED,
    Row,
    bound_figures,
    log_reduction_pct,
    means,
    pairs_of,
    reduction_pct,
)
from wakewise_paper.wash_reduction.flight import FIGURES
from wakewise_paper.wash_reduction.paper import FIGURES as PAPER_FIGURES
from wakewise_paper.wash_reduction.paper import METHODS as PAPER_METHODS
from wakewise_paper.wash_reduction.paper import SEEDS as PAPER_SEEDS
from wakewise_paper.wash_reduction.paper import PaperWashTrial
from wakewise_paper.wash_reduction.plan import (
    MECHANISMS,
    METHODS,
    NONE,
    flight_s,
    flown_methods,
    only_name,
    planned_trials,
    selected_mechanisms,
    without_name,
)
from wakewise_paper.wash_reduction.scenario_files import names_of, title_of, trim_of
from wakewise_paper.wash_reduction.summary_table import PLACE, RIVALS, WRONG, headline, tag_of

MODEL_FIGURES = ("rmse_mm", "completeness_pct", "success_pct")
PAPER = "paper"

_engine = ProcessExecutor
_FLY, _FLY_PAPER = "wakewise_paper.wash_reduction.flight:fly_trial", "wakewise_paper.wash_reduction.paper:fly_paper"
_BOUND = "wakewise_paper.wash_reduction.energy_optimum:fly_bound"


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is wished and not known yet; scenarios' tables, the headline, the paper's world.

    Raises
    ------
    InputError
        If a scenario, method or mechanism is not known.
    """
    wished = options.scenarios
    scenarios = names_of(None if wished is None else tuple(name for name in wished if name != PAPER))
    with_paper = wished is None or PAPER in wished
    methods, reasons = flown_methods(options.methods)
    mechanisms = selected_mechanisms(options.mechanisms)
    began = time.monotonic()
    trials = planned_trials(scenarios, methods, mechanisms, options.seeds)
    folder = options.store or store_folder()
    store = FlightStore(folder, options.fresh)
    expected = sum(flight_s(trial) for trial in trials.values() if store.load(trial, _FLY) is None)
    words = f"{len(trials)} flights, some {expected / 60.0 / options.workers:.0f} min of {options.workers} free cores"
    options.progress(0, max(len(trials), 1), words)
    rows, failures, kept = flight_batches.fly_all(trials, _FLY, store, options, _engine)
    papers: dict[Key, Row] = {}
    lost: list[FlightFailure] = []
    known = 0
    if with_paper:
        papers, lost, known = flight_batches.fly_all(
            paper_trials(methods, options.seeds), _FLY_PAPER, store, options, _engine
        )
    bounds: dict[Key, Row] = {}
    unbound: list[FlightFailure] = []
    if options.bound:
        bounds, unbound, _ = flight_batches.fly_all(
            bound_trials(scenarios, options.bound), _BOUND, store, options, _engine
        )
    failed = {(failure.name, (failure.flow, failure.seed)) for failure in failures}
    trims = {(scenario, seed): trim_of(scenario, seed) for scenario, _, seed in trials}
    return {
        "scenarios": {name: scenario_figures(name, methods, mechanisms, rows, failures) for name in scenarios},
        "headline": headline(by_method(rows), trims, failed),
        "bound": bound_figures(bounds) if options.bound else None,
        "flows": {PAPER: paper_figures(papers, methods)} if with_paper else {},
        "flights": len(trials) + len(papers) + len(lost),
        "flown": len(rows) + len(papers) - kept - known,
        "failed": len(failures) + len(lost) + len(unbound),
        "failures": [vars(failure) for failure in (*failures, *lost, *unbound)],
        "flight_cpu_s": _cpu_s(rows),
        "wall_s": time.monotonic() - began,
        "why": reasons | why(mechanisms, with_paper),
    }


def bound_trials(scenarios: tuple[str, ...], seeds: int) -> dict[Key, BoundTrial]:
    """Flights whose sharings are judged."""
    return {
        (scenario, "bound", seed): BoundTrial(scenario=scenario, seed=seed)
        for seed in range(1, seeds + 1)
        for scenario in scenarios
    }


def by_method(rows: Mapping[Key, Row]) -> dict[str, dict[tuple[str, int], Row]]:
    """Rows by method or mechanism, then by scenario and seed."""
    found: dict[str, dict[tuple[str, int], Row]] = {}
    for (scenario, name, seed), row in rows.items():
        found.setdefault(name, {})[scenario, seed] = row
    return found


def scenario_figures(
    scenario: str,
    methods: tuple[str, ...],
    mechanisms: tuple[str, ...],
    rows: Mapping[Key, Row],
    failures: list[FlightFailure],
) -> dict[str, Any]:
    """Table of one scenario: methods, what `wake-aware` is worth, mechanisms; flights that failed are with their
    method.
    """
    here: dict[str, dict[int, Row]] = {}
    for (where, name, seed), row in rows.items():
        if where == scenario:
            here.setdefault(name, {})[seed] = row
    lost = [failure for failure in failures if failure.flow == scenario]
    strata = {seed: trim_of(scenario, seed) for own in here.values() for seed in own}
    table: dict[str, Any] = {}
    dp = here.get(METHODS[0], {})
    for name in (*methods, WRONG):
        own = here.get(name, {})
        gone = [failure for failure in lost if failure.name == name]
        if not own and not gone:
            continue
        told = means(own.values(), FIGURES)
        told |= dict.fromkeys(MODEL_FIGURES)
        told["failed"] = len(gone)
        told["failures"] = [f"seed {failure.seed}: {failure.reason}" for failure in gone]
        if name != METHODS[0]:
            told |= against(dp, own, METHODS[0], strata)
        told["why"] = {key: _reason(key) for key in (*FIGURES, *MODEL_FIGURES) if told[key] is None}
        table[name] = told
    ours = here.get("wake-aware", {})
    answer: dict[str, Any] = {
        "title": title_of(scenario),
        "dp_target_speed_m_s": table.get(METHODS[0], {}).get(SPEED),
        "methods": table,
    }
    for rival in RIVALS:
        answer |= against(here.get(rival, {}), ours, rival, strata)
    answer["mechanisms"] = {name: mechanism_figures(name, here, strata) for name in mechanisms}
    answer["why"] = {key: "not flown by both" for key, value in answer.items() if key.endswith("pct") and value is None}
    return answer


def against(base: Mapping[int, Row], ours: Mapping[int, Row], rival: str, strata: Mapping[int, str]) -> dict[str, Any]:
    """Reduction of the target's speed against a rival: by logarithms, its worst seed, and by sums."""
    tag = tag_of(rival)
    value, interval, worst = log_reduction_pct(pairs_of(base, ours, SPEED, strata))
    return {
        f"reduction_vs_{tag}_pct": value,
        f"reduction_vs_{tag}_interval_pct": interval,
        f"worst_seed_vs_{tag}_pct": worst,
        f"sums_reduction_vs_{tag}_pct": reduction_pct(base, ours, SPEED)[0],
    }


def mechanism_figures(name: str, here: Mapping[str, Mapping[int, Row]], strata: Mapping[int, str]) -> dict[str, Any]:
    """What a mechanism is worth here: with it and without, all others on; it alone and none."""
    answer: dict[str, Any] = {}
    for key, base, ours in (
        ("left_out", without_name(name), "wake-aware"),
        ("alone", NONE, only_name(name)),
    ):
        pairs = pairs_of(here.get(base, {}), here.get(ours, {}), SPEED, strata)
        answer[f"{key}_pct"], answer[f"{key}_interval_pct"], _ = log_reduction_pct(pairs)
        worse = [ours - theirs for theirs, ours, _ in pairs_of(here.get(base, {}), here.get(ours, {}), PLACE, {})]
        answer[f"{key}_camera_change_mm"] = float(np.mean(worse)) if worse else None
    return answer


def paper_trials(methods: tuple[str, ...], seeds: int) -> dict[Key, PaperWashTrial]:
    """Flights in the paper's own world."""
    return {
        (PAPER, method, seed): PaperWashTrial(method=method, seed=seed)
        for seed in range(1, min(seeds, PAPER_SEEDS) + 1)
        for method in PAPER_METHODS
        if method in methods
    }


def paper_figures(rows: Mapping[Key, Row], methods: tuple[str, ...]) -> dict[str, Any]:
    """Table of the paper's world, and reductions of `wake-aware`; circular, since its wake model is the water."""
    here = {name: {seed: row for (_, who, seed), row in rows.items() if who == name} for name in PAPER_METHODS}
    answer: dict[str, Any] = {
        "circular": True,
        "methods": {name: means(here[name].values(), PAPER_FIGURES) for name in PAPER_METHODS if name in methods},
    }
    for rival in PAPER_METHODS[:-1]:
        for figure, short in ((SPEED, ""), ("disturbance", "_disturbance")):
            value, interval = reduction_pct(here[rival], here["wake-aware"], figure)
            answer[f"reduction_vs_{rival}{short}_pct"] = value
            answer[f"reduction_vs_{rival}{short}_interval_pct"] = interval
    return answer


def why(mechanisms: tuple[str, ...], with_paper: bool) -> dict[str, str]:
    """Reasons of what was not flown."""
    reasons = {} if with_paper else {PAPER: "this flow was left out"}
    for name in MECHANISMS:
        if name not in mechanisms:
            reasons[name] = "this mechanism was not switched; --mechanisms all, or its name"
    return reasons


def _reason(key: str) -> str:
    if key in MODEL_FIGURES:
        return "models are made by `wakewise bench worlds`"
    if key.startswith("sway"):
        return "the targets of these seeds are rigid"
    if key == "exceedance_ambient_pct":
        return "the water is still without the vehicle"
    if key == "float_N":
        return "of +trim alone"
    return "no flight gave it"


def _cpu_s(rows: Mapping[Key, Row]) -> float | None:
    """Mean CPU time of a flight."""
    known = [row["cpu_s"] for row in rows.values() if row.get("cpu_s") is not None]
    return float(np.mean(np.array(known, dtype=np.float64))) if known else None
