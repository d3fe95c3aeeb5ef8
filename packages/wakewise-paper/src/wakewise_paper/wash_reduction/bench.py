"""The study of wash: what each method does to the target's water where users have the trouble; `wakewise bench gentle`.

Scenarios are files (`scenarios/`), stratified over trim and the side of the current (`scenario_files.py`); the
library's worlds count as scenarios, too. Seed k of a scenario is one world for all methods, so flights are compared in
pairs. The headline was chosen beforehand (`headline.py`, docs/research-log/0033). The paper's own world is circular and
says so (`paper.py`). What no controller can pass by sharing thrusts is worked out where that is wanted
(`energy_optimum.py`). Mechanisms of `wake-aware` are switched one by one: each is compared with the method without it,
all others on (left out), and with the method without any (alone).

A campaign makes and keeps the flights: a run that was stopped goes on, and a second one flies what is new.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.control import MAKERS
from wakewise.core.errors import InputError
from wakewise.experiments.campaigns import ProcessExecutor
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.statistics import log_reduction_pct, mean_figures, pairs_of, reduction_pct
from wakewise.experiments.campaigns.study import (
    Key,
    Row,
    StudyResult,
    missing,
    run_study,
    selected,
    store_folder,
)
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation.worlds.library import load_world
from wakewise_paper.wash_reduction.energy_optimum import bound_trial
from wakewise_paper.wash_reduction.flight import FIGURES, TRIM, wash_trial
from wakewise_paper.wash_reduction.headline import PLACE, RIVALS, SPEED, WRONG, headline, tag_of
from wakewise_paper.wash_reduction.optimum_figures import bound_figures
from wakewise_paper.wash_reduction.paper import FIGURES as PAPER_FIGURES
from wakewise_paper.wash_reduction.paper import METHODS as PAPER_METHODS
from wakewise_paper.wash_reduction.paper import PAPER, paper_trial
from wakewise_paper.wash_reduction.paper import SEEDS as PAPER_SEEDS
from wakewise_paper.wash_reduction.scenario_files import WORLD, names_of, title_of, trim_of

MODEL_FIGURES = ("rmse_mm", "completeness_pct", "success_pct")
BOUND = "bound"

_engine = ProcessExecutor

Settings = dict[str, Any]

MECHANISMS: dict[str, Settings] = {
    "advection": {"allocation.advection": False},
    "merging-jets": {"allocation.merging_jets": False},
    "wall-jets": {"wake.floor": False},
    "attitude": {"allocation.optimize_attitude": False},
    "power-limit": {"allocation.power_limit": False},
}
"""Fields of `ControlSettings` that take a mechanism away, by its name. Sharing out (`allocation.null_space`) is no
mechanism of its own:
the others need it."""

NONE = "wake-aware, no mechanisms"
MECHANISM_SEEDS = 3
"""Mechanisms fly the first seeds only, which have all trims and all sides once."""


def selected_mechanisms(requested: tuple[str, ...] | None) -> tuple[str, ...]:
    """Names of the mechanisms to switch; none if not given, `all` for all.

    Raises
    ------
    InputError
        If one is not known.
    """
    names = () if requested is None or requested == ("none",) else requested
    for name in names:
        if name not in (*MECHANISMS, "all"):
            raise InputError(f"mechanisms: '{name}' is not known, allowed: none, all, {', '.join(MECHANISMS)}")
    return tuple(MECHANISMS) if "all" in names else tuple(name for name in MECHANISMS if name in names)


def without(*names: str) -> Settings:
    """Fields that take these mechanisms away."""
    merged: Settings = {}
    for name in names:
        merged |= MECHANISMS[name]
    return merged


def mechanism_settings(names: tuple[str, ...]) -> dict[str, Settings]:
    """Settings of the flights that judge some mechanisms, by what the flight is called."""
    if not names:
        return {}
    table = {NONE: without(*MECHANISMS)}
    for name in names:
        table[without_name(name)] = without(name)
        table[only_name(name)] = without(*(other for other in MECHANISMS if other != name))
    return table


def without_name(name: str) -> str:
    """What the flight without a mechanism is called."""
    return f"wake-aware without {name}"


def only_name(name: str) -> str:
    """What the flight with a mechanism alone is called."""
    return f"wake-aware, {name} alone"


METHODS = (
    "dp",
    "manual",
    "manual-careful",
    "no-forward-jets",
    "weighted-pseudo-inverse",
    "ardusub",
    "pseudo-inverse",
    "mpc",
    "mpc-smooth",
    "allocation-only",
    "wake-aware",
    "wake-aware+trim",
    "dp+trim",
    "no-forward-jets+trim",
)
"""The first is what the others are held against."""


def flown_methods(requested: tuple[str, ...] | None) -> tuple[tuple[str, ...], dict[str, str]]:
    """Methods to fly, in the bench's order, and why others are not.

    Raises
    ------
    InputError
        If a name is none of the bench's.
    """
    selected("methods", requested, METHODS)
    reasons: dict[str, str] = {}
    for name in METHODS:
        if requested is not None and name not in requested:
            reasons[name] = "this method was left out"
        elif name.removesuffix(TRIM) not in MAKERS:
            reasons[name] = "there is no such method yet"
    return tuple(name for name in METHODS if name not in reasons), reasons


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is wanted and not known yet; scenarios' tables, the headline, the paper's world.

    Raises
    ------
    InputError
        If a scenario, method or mechanism is not known.
    """
    began = time.monotonic()
    requested = options.scenarios
    scenarios = names_of(None if requested is None else tuple(name for name in requested if name != PAPER))
    with_paper = requested is None or PAPER in requested
    methods, reasons = flown_methods(options.methods)
    mechanisms = selected_mechanisms(options.mechanisms)
    trials = planned_trials(scenarios, methods, mechanisms, options.seeds)
    papers = paper_trials(methods, options.seeds) if with_paper else {}
    bounds = bound_trials(scenarios, options.bound)
    folder = options.store or store_folder("gentle")
    expected = sum(flight_s(*key[:2]) for key in missing(trials, folder, options))
    words = f"{len(trials)} flights, some {expected / 60.0 / options.workers:.0f} min of {options.workers} free cores"
    options.progress(0, max(len(trials), 1), words)
    made = run_study("gentle", trials | papers | bounds, folder, options, _engine)
    flown, unbound = made.part(trials), made.part(bounds)
    return {
        "scenarios": {name: scenario_figures(name, methods, mechanisms, flown) for name in scenarios},
        "headline": headline(
            by_method(flown.rows),
            {(scenario, seed): trim_of(scenario, seed) for scenario, _, seed in trials},
            {(name, (scenario, seed)) for scenario, name, seed in flown.failures},
        ),
        "bound": bound_figures(unbound.rows) if options.bound else None,
        "flows": {PAPER: paper_figures(made.part(papers).rows, methods)} if with_paper else {},
        **made.part([*trials, *papers]).counts,
        "failed": len(made.failures),
        "failures": [vars(failure) for failure in made.failures.values()],
        "flight_cpu_s": _cpu_s(flown.rows),
        "wall_s": time.monotonic() - began,
        "why": reasons | why(mechanisms, with_paper),
    }


def planned_trials(
    scenarios: tuple[str, ...], methods: tuple[str, ...], mechanisms: tuple[str, ...], seeds: int
) -> dict[Key, PlannedTrial]:
    """Flights to make, seed by seed, so that a run that is stopped has whole seeds; mechanisms last."""
    trials: dict[Key, PlannedTrial] = {}
    ours = "wake-aware" in methods
    for seed in range(1, seeds + 1):
        for scenario in scenarios:
            for method in methods:
                trials[scenario, method, seed] = wash_trial(scenario, method, seed)
            if ours and has_current(scenario):
                trials[scenario, WRONG, seed] = wash_trial(scenario, "wake-aware", seed, name=WRONG, wrong_current=True)
    table = mechanism_settings(mechanisms) if ours else {}
    for seed in range(1, min(seeds, MECHANISM_SEEDS) + 1):
        for scenario in scenarios:
            for name, control in table.items():
                trials[scenario, name, seed] = wash_trial(scenario, "wake-aware", seed, name=name, control=control)
    return trials


def paper_trials(methods: tuple[str, ...], seeds: int) -> dict[Key, PlannedTrial]:
    """Flights in the paper's own world."""
    return {
        (PAPER, method, seed): paper_trial(method, seed)
        for seed in range(1, min(seeds, PAPER_SEEDS) + 1)
        for method in PAPER_METHODS
        if method in methods
    }


def bound_trials(scenarios: tuple[str, ...], seeds: int) -> dict[Key, PlannedTrial]:
    """Flights whose ways to share thrusts are judged."""
    return {
        (scenario, BOUND, seed): bound_trial(scenario, seed) for seed in range(1, seeds + 1) for scenario in scenarios
    }


def has_current(scenario: str) -> bool:
    """Whether there is a current that can be believed wrong."""
    if not scenario.startswith(WORLD):
        return True
    world = load_world(scenario.removeprefix(WORLD))
    field = "tank.current.velocity_m_s"
    return field in world.randomize or any(world.values.get(field, ()))


def flight_s(scenario: str, name: str) -> float:
    """About how much CPU time a flight takes, in seconds: measured on two cores, for saying how long a run is."""
    base = {"station": 34.0, "nadir": 5.0, "brake": 6.0}.get(scenario.split("/", maxsplit=1)[0], 8.0)
    return base + (3.0 if name.endswith(TRIM) else 0.0)


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
    flown: StudyResult[Key],
) -> dict[str, Any]:
    """Table of one scenario: methods, what `wake-aware` is worth, mechanisms; flights that failed are with their
    method.
    """
    here: dict[str, dict[int, Row]] = {}
    for (where, name, seed), row in flown.rows.items():
        if where == scenario:
            here.setdefault(name, {})[seed] = row
    lost = [failure for failure in flown.failures.values() if failure.flow == scenario]
    strata = {seed: trim_of(scenario, seed) for own in here.values() for seed in own}
    table: dict[str, Any] = {}
    dp = here.get(METHODS[0], {})
    for name in (*methods, WRONG):
        own = here.get(name, {})
        gone = [failure for failure in lost if failure.name == name]
        if not own and not gone:
            continue
        told = mean_figures(own.values(), FIGURES, worst=("solve_ms_p99",))
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


def paper_figures(rows: Mapping[Key, Row], methods: tuple[str, ...]) -> dict[str, Any]:
    """Table of the paper's world, and reductions of `wake-aware`; circular, since its wake model is the water."""
    here = {name: {seed: row for (_, who, seed), row in rows.items() if who == name} for name in PAPER_METHODS}
    answer: dict[str, Any] = {
        "circular": True,
        "methods": {
            name: mean_figures(here[name].values(), PAPER_FIGURES) for name in PAPER_METHODS if name in methods
        },
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
