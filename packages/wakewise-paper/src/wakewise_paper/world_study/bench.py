"""What each method leaves of each world of the library, over seeds that each draw their own world.

A short flight (hover on one orbit, part of a lower one, from a side that the seed draws) gives water, silt, sway,
position and energy; a whole quick scan gives the model. Seed k is one world for all methods, so that flights are
compared in pairs; intervals are 95 % of a bootstrap over seeds. Flights and scans are kept: a run that was stopped goes
on, and a second one only flies what is new.

Emergent in these figures are: how jets decay, merge, meet walls and drift, within the laws that the tank is given
(`wakewise.simulation.tank.validation_limits` says how well each is met); what the bed lets go; how the target bends;
what the camera makes of it. Typed in are those laws' constants, each with a source, and the worlds' numbers (`wakewise
world show NAME`).
"""

from __future__ import annotations

import time
from typing import Any

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns import ProcessExecutor
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import load_scenario
from wakewise.operation.worlds.library import load_world, world_names
from wakewise_paper import flight_batches
from wakewise_paper.flight_batches import PHOTOGRAPHS, FlightFailure, FlightStore, Key, Row, store_folder
from wakewise_paper.world_study.figures import method_figures, ratios
from wakewise_paper.world_study.flight import FLIGHT_FIGURES, MODEL_FIGURES, WorldTrial
from wakewise_paper.world_study.lattice_comparison import JUDGED, judge_table, judge_trials

METHODS = ("dp", "manual", "ardusub", "mpc", "mpc-smooth", "no-forward-jets", "allocation-only", "wake-aware")
"""The first is what the others are held against."""

EMERGENT = (
    "decay and merging of jets within the given laws, wall jets' paths, drift, erosion and settling, the target's "
    "bending, photographs and models"
)
TYPED_IN = "constants of the laws and numbers of the worlds, each with its source (wakewise world show NAME)"

_engine = ProcessExecutor
_FLY, _SCAN = (f"wakewise_paper.world_study.flight:{name}_trial" for name in ("fly", "scan"))
_JUDGE = "wakewise_paper.world_study.lattice_comparison:judged_trial"


def run(options: BenchOptions) -> dict[str, Any]:
    """Fly what is wished and not known yet, and gather each world's table.

    Raises
    ------
    InputError
        If a world or method is not known.
    """
    began = time.monotonic()
    worlds = _known("worlds", options.worlds, world_names())
    methods = _known("methods", options.methods, METHODS)
    flights = planned(worlds, methods, options.seeds)
    scans = planned(worlds, methods, options.models)
    folder = options.store or store_folder("worlds")
    flown, lost, kept = flight_batches.fly_all(flights, _FLY, FlightStore(folder, options.fresh), options, _engine)
    models, failed, had = flight_batches.fly_all(
        scans, _SCAN, FlightStore(folder, options.fresh, PHOTOGRAPHS), options, _engine
    )
    judged, unjudged, seen = flight_batches.fly_all(
        judge_trials(options.judge, tuple(name for name in JUDGED if name in worlds)),
        _JUDGE,
        FlightStore(folder, options.fresh),
        options,
        _engine,
    )
    known = FlightStore(folder, False, PHOTOGRAPHS)
    for name in worlds:  # models of an earlier run count, too
        for method in methods:
            for seed in range(options.models + 1, options.seeds + 1):
                row = known.load(WorldTrial(world=name, method=method, seed=seed), _SCAN)
                if row is not None:
                    models[name, method, seed] = row
    return {
        "default_world": load_scenario("quick", None, {}).world,
        "worlds": {name: world_figures(name, methods, flown, models, lost + failed) for name in worlds},
        "judge": judge_table(judged) if options.judge else None,
        "why": {} if options.judge else {"judge": "not flown; --judge sets for how many seeds"},
        "emergent": EMERGENT,
        "typed_in": TYPED_IN,
        "flights": len(flights),
        "models": len(models),
        "failed": len(lost) + len(failed) + len(unjudged),
        "failures": [vars(failure) for failure in (*lost, *failed, *unjudged)],
        "known_already": kept + had + seen,
        "wall_s": time.monotonic() - began,
    }


def planned(worlds: tuple[str, ...], methods: tuple[str, ...], seeds: int) -> dict[Key, WorldTrial]:
    """Each method in each world on seeds 1 to `seeds`; seed by seed, so that a run that is stopped has whole worlds."""
    return {
        (world, method, seed): WorldTrial(world=world, method=method, seed=seed)
        for seed in range(1, seeds + 1)
        for world in worlds
        for method in methods
    }


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
        told = method_figures(rows, FLIGHT_FIGURES)
        told |= {key: value for key, value in method_figures(scans, MODEL_FIGURES).items() if key != "flights"}
        success = told.pop("success")
        told["success_pct"] = None if success is None else 100.0 * success
        told.pop("success_interval")
        told["models"] = len(scans)
        told["failures"] = [failure.reason for failure in lost]
        told["against"] = {methods[0]: ratios(base, rows)} if method != methods[0] else {}
        told["why"] = why(told)
        tables[method] = told
    return {"title": world.file.title, "why": world.file.why, "methods": tables}


def why(figures: dict[str, Any]) -> dict[str, str]:
    """Reasons of what could not be computed."""
    reasons: dict[str, str] = {}
    for key in (*FLIGHT_FIGURES, *MODEL_FIGURES, "success_pct"):
        if key not in figures or figures[key] is not None:
            continue
        if key in ("sway_rms_mm", "sway_wash_mm"):
            reasons[key] = "the target is rigid"
        elif key in (*MODEL_FIGURES, "success_pct"):
            reasons[key] = "no scan was made; --models sets for how many seeds" if not figures["models"] else "no model"
        else:
            reasons[key] = "no flight gave it"
    return reasons


def _of(rows: dict[Key, Row], world: str, method: str) -> dict[int, Row]:
    return {seed: row for (where, who, seed), row in rows.items() if (where, who) == (world, method)}


def _known(what: str, wished: tuple[str, ...] | None, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """The wished names in the bench's order; all if None."""
    for name in wished or ():
        if name not in allowed:
            raise InputError(f"{what}: '{name}' is not known, allowed: {', '.join(allowed)}")
    return tuple(name for name in allowed if wished is None or name in wished)
