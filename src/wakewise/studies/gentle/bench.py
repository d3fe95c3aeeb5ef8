"""What each method does to the target's water, in the tank and in the paper's own world, and what each lever is worth.

Every method flies the same vehicle, the same unknown trim (drawn per seed, +-1 N), sensors, estimator and mission: a
hover on an orbit of 40 deg and an arc of one of 20 deg, both legs and the way between them in one figure, over a
silty bed in the default current. Seed k is the same draw for all methods, so flights are compared in pairs; intervals
are 95 % of a bootstrap over pairs. Flow `parcels` is the tank's own water; flow `paper` is circular
(`wakewise.operation.instant_water`) and says so.

How long, and how many. A jet of 0.1 N needs 5 s to a target 0.7 m away, and its remains drift there with 3 cm/s in 15
to 20 s, so a flight needs settling and hover of 23 s and an arc of 15 s to show what a method does; 43 s it is. Methods
fly all seeds. Levers fly fewer: they are large or they are nothing, and pairs tell which.

Flights are kept (`flight_store`): a run that was stopped goes on, and a second one only flies what is new.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from wakewise.errors import InputError
from wakewise.studies import side_by_side
from wakewise.studies.flight_store import FlightStore, store_folder
from wakewise.studies.gentle.figures import flow_figures
from wakewise.studies.gentle.flight import FIGURES, Trial, World, fly_trial
from wakewise.studies.gentle.levers import Entry, entries, method_trial
from wakewise.studies.side_by_side import Failure, Key, Row
from wakewise.trials.timing import BenchOptions

METHODS = ("dp", "pseudo-inverse", "unaware", "smooth", "wake-aware")
WORLDS: tuple[World, ...] = ("parcels", "paper")
LEVER_SEEDS = {"parcels": 3, "paper": 2}
"""Levers fly the first seeds only. The first three hover abreast, upstream and downstream of the target; the intervals
of so few pairs are narrower than their 95 %."""

_pool = side_by_side.processes


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is wished and not known yet, and gather figures, reductions and levers of each flow.

    Raises
    ------
    InputError
        If a method, flow or lever is not known.
    """
    methods = _known("methods", options.methods, METHODS)
    worlds = _known("flows", options.flows, WORLDS)
    tables = {world: _wished_levers(world, options.levers) for world in WORLDS if world in worlds}
    trials = planned_trials(methods, tables, options.seeds)
    began = time.monotonic()
    rows, failures, kept = fly_all(trials, options)
    flows: dict[str, Any] = {}
    for world, table in tables.items():
        flights: dict[str, dict[int, Row]] = {}
        for (where, name, seed), row in rows.items():
            if where == world:
                flights.setdefault(name, {})[seed] = row
        flows[world] = flow_figures(world, flights, methods, table)
    return {
        "flows": flows,
        "flights": len(trials),
        "flown": len(trials) - kept - len(failures),
        "failed": len(failures),
        "failures": [vars(failure) for failure in failures],
        "flight_cpu_s": _cpu_s(rows),
        "wall_s": time.monotonic() - began,
        "why": why(rows, worlds, methods),
    }


def planned_trials(methods: tuple[str, ...], tables: dict[World, dict[str, Entry]], seeds: int) -> dict[Key, Trial]:
    """Flights to make: each method on seeds 1 to `seeds`, each lever on the first few of them."""
    trials: dict[Key, Trial] = {}
    for world, table in tables.items():
        for seed in range(1, seeds + 1):
            for method in methods:
                trials[world, method, seed] = method_trial(world, method, seed)
        for entry in table.values():
            for seed in range(1, min(seeds, LEVER_SEEDS[world]) + 1):
                trials[world, entry.name, seed] = entry.trial(world, seed)
    return trials


def fly_all(trials: dict[Key, Trial], options: BenchOptions) -> tuple[dict[Key, Row], list[Failure], int]:
    """Figures of all flights, those that failed, and how many were known already."""
    store = FlightStore(options.store or store_folder(), options.fresh)
    return side_by_side.fly_all(trials, fly_trial, store, options, _pool)


def why(rows: dict[Key, Row], worlds: tuple[World, ...], methods: tuple[str, ...]) -> dict[str, str]:
    """Reasons of what could not be computed."""
    reasons: dict[str, str] = {}
    for figure in FIGURES:
        without = sorted({key[0] for key, row in rows.items() if row.get(figure) is None})
        if without:
            reasons[figure] = f"no figure from flow {', '.join(without)}"
    if "bed_speed_p95_m_s" in reasons:
        reasons["bed_speed_p95_m_s"] = "flow paper has no bed"
    for world in (w for w in WORLDS if w not in worlds):
        reasons[world] = "this flow was left out"
    for method in (m for m in METHODS if m not in methods):
        reasons[method] = "this method was left out"
    return reasons


def _known(what: str, wished: tuple[str, ...] | None, allowed: tuple[Any, ...]) -> tuple[Any, ...]:
    """The wished names in the bench's order; all if None."""
    for name in wished or ():
        if name not in allowed:
            raise InputError(f"{what}: '{name}' is not known, allowed: {', '.join(allowed)}")
    return tuple(name for name in allowed if wished is None or name in wished)


def _wished_levers(world: World, wished: tuple[str, ...] | None) -> dict[str, Entry]:
    """Lines of the lever table, those that they are held against included; all if None, `none` for none."""
    table = entries(world)
    if wished is None:
        return table
    every = {name for w in WORLDS for name in entries(w)}
    for name in wished:
        if name not in every and name != "none":
            raise InputError(f"levers: '{name}' is not known, allowed: none, {', '.join(sorted(every))}")
    chosen = {name for name in wished if name in table}
    chosen |= {table[name].base for name in chosen if table[name].base in table}
    return {name: entry for name, entry in table.items() if name in chosen}


def _cpu_s(rows: dict[Key, Row]) -> float | None:
    """Mean CPU time of a flight."""
    known = [row["cpu_s"] for row in rows.values() if row.get("cpu_s") is not None]
    return float(np.mean(np.array(known, dtype=np.float64))) if known else None
