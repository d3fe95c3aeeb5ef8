"""Which benches there are.

The vehicle, target and poses that benches share.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, look_at, quat_from_matrix
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region, Target, coral, place_on_bed, sample_region

BENCHES = {
    "allocator": "exact allocation against SciPy's SLSQP and the pseudo-inverse",
    "campaign": "what a campaign costs: a trial, two workers beside one, what lies between trials, a list of many",
    "cold": "what a user waits for at first: import, --help, compiling, first flight, second flight",
    "disturbance": "the Gram matrix of D against the sum over points",
    "learning": "environments for learning: steps a second; a small policy beside dp, in the jet model and in the tank",
    "estimator": "the filter in the default tank: error, consistency, ten seconds without a camera",
    "dynamics": "one step of the vehicle, with and without Jacobians, and of many vehicles at once",
    "gentle": "what each method does to the target's water where users have the trouble, and what each "
    "mechanism is worth",
    "front": "wash against energy: our method at several power limits beside every rival, over whole scans",
    "models": "where wash ruins a model: mechanisms one by one, dose and response, what helps",
    "onboard": "one thread of an onboard computer: allocation at 50 Hz, a plan at 10 Hz, memory, five times slower",
    "planner": "the planner against the paper's recipe and IPOPT",
    "reconstruction": "models of three corals from clear photographs: accuracy, completeness, time and memory",
    "operator": "an operator's velocity obeyed and the target's water spared, by w_track, where users have the trouble",
    "target": "the target found, mapped and tracked by the camera: how soon, how well, what it is worth",
    "reef": "a patch of reef in two levels, beside a lawnmower and orbits round everything: path and completeness",
    "survey": "slow lines above a bed on the simulated autopilot: speed, altitude, place, and what every loss leads to",
    "truth": "figures held against data that nobody in this project made: measured, asked, reached, met",
    "photographs": "photographs of 12 Mpx beside plain pycolmap: memory and time by their number, and of 500",
    "imaging": "one photograph: speed by part, memory, geometry, flat port, features",
    "lattice": "the lattice-Boltzmann solver: cell updates per core beside a plain loop, distance from the twin",
    "gpu": "lattice, COLMAP's stages and a neural field on a graphics card, each beside the processor",
    "link": "physics behind a firmware, the relay, the loop at sea, noise, and what every loss leads to",
    "tank": "the world of a trial against the clock",
    "adversarial-photos": "photographs that deceive: of each the model is right, or says that it is not",
    "worlds": "what each method leaves of each world in which users have the trouble, models included",
}
"""Name of each bench and what it measures; the module of that name in this folder holds it, or one of `_MODULES`."""

_MODULES = {
    "adversarial-photos": "wakewise_benchmarks.adversarial_photos",
    "cold": "wakewise_benchmarks.startup_time",
    "front": "wakewise_paper.wash_reduction.energy_front",
    "gentle": "wakewise_paper.wash_reduction.bench",
    "models": "wakewise_paper.model_failure.bench",
    "operator": "wakewise_paper.operator_study.bench",
    "photographs": "wakewise_benchmarks.large_photos",
    "target": "wakewise_benchmarks.target_finding",
    "worlds": "wakewise_paper.world_study.bench",
}


def module_of(name: str) -> str:
    """Dotted name of the module that holds a bench."""
    return _MODULES.get(name, f"wakewise_benchmarks.{name}")


def run_bench(name: str, options: BenchOptions) -> dict[str, Any]:
    """Run one bench and return its figures.

    Raises
    ------
    InputError
        If there is no bench of that name.
    """
    if name not in BENCHES:
        raise InputError(f"bench {name!r}: no such bench, allowed {', '.join(BENCHES)}")
    result: dict[str, Any] = import_module(module_of(name)).run(options)
    return result


VEHICLE = load_vehicle("paper")


@cache
def bench_target() -> Target:
    """A branching coral on the bed at 1.5 m, made when it is first asked for."""
    return place_on_bed("branching", coral("branching", 0), 1.5)


@cache
def bench_region() -> Region:
    """Three hundred points of the water round it; drawing them takes seconds, which an import should not."""
    return sample_region(bench_target(), 300, np.random.default_rng(0))


def cases(count: int) -> list[tuple[Pose, Array]]:
    """Poses round the target that look at it, each with a wrench of station keeping."""
    rng, target = np.random.default_rng(1), bench_target()
    drawn = []
    for _ in range(count):
        azimuth, elevation, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 1.3), rng.uniform(0.5, 0.9)
        away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
        eye = target.centre_W_m + reach * away
        X_WB = Pose(eye, quat_from_matrix(look_at(eye, target.centre_W_m)))
        drawn.append((X_WB, rng.normal(size=6) * [3, 3, 3, 0.2, 0.3, 0.3]))
    return drawn
