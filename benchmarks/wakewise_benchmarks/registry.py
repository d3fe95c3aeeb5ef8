"""Which benches there are."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from wakewise.core.errors import InputError
from wakewise.experiments.trials.timing import BenchOptions

BENCHES = {
    "allocator": "exact allocation against SciPy's SLSQP and the pseudo-inverse",
    "campaign": "what a campaign costs: a trial, two workers beside one, what lies between trials, a list of many",
    "cold": "what a user waits for at first: import, --help, compiling, first flight, second flight",
    "disturbance": "the Gram matrix of D against the sum over points",
    "estimator": "the filter in the default tank: error, consistency, ten seconds without a camera",
    "dynamics": "one step of the vehicle, with and without Jacobians, and of many vehicles at once",
    "gentle": "what each method does to the target's water where users have the trouble, and what each lever is worth",
    "planner": "the planner against the paper's recipe and IPOPT",
    "reconstruction": "models of three corals from clear photographs: accuracy, completeness, time and memory",
    "operator": "an operator's velocity obeyed and the target's water spared, by w_track, where users have the trouble",
    "imaging": "one photograph: speed by part, memory, geometry, flat port, features",
    "lattice": "the lattice-Boltzmann solver: cell updates per core beside a plain loop, distance from the twin",
    "link": "physics behind a firmware, the relay, the loop at sea, noise, and what every loss leads to",
    "tank": "the world of a trial against the clock",
    "traps": "photographs that deceive: of each the model is right, or says that it is not",
    "worlds": "what each method leaves of each world in which users have the trouble, models included",
}
"""Name of each bench and what it measures; the module of that name in this folder holds it, or one of `_STUDIES`."""

_STUDIES = {
    "gentle": "wakewise_paper.wash_reduction.bench",
    "operator": "wakewise_paper.operator_study.bench",
    "worlds": "wakewise_paper.world_study.bench",
}


def run_bench(name: str, options: BenchOptions) -> dict[str, Any]:
    """Run one bench and return its figures.

    Raises
    ------
    InputError
        If there is no bench of that name.
    """
    if name not in BENCHES:
        raise InputError(f"bench {name!r}: no such bench, allowed {', '.join(BENCHES)}")
    result: dict[str, Any] = import_module(_STUDIES.get(name, f"wakewise_benchmarks.{name}")).run(options)
    return result
