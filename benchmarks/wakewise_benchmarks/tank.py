"""The world of a trial at the standard preset: how much faster than the clock it runs, and whether its memory is flat.

A flight of the preset is flown once with `dp`; then the thrusts it commanded are played to a fresh tank, which does
the same again (same seed), and that is what is timed: vehicle, water, silt and sensors, the measures that a trial takes
at 10 Hz, and the water's speed at 5,000 points round the target at 10 Hz. `realtime_factor` is by the wall clock and so
of the whole machine, whatever else runs on it; `realtime_factor_one_core` by the processor's time of this process.
`scaling` tells how costs grow (`tank_scaling`).
"""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import Scenario, fly, load_scenario
from wakewise.operation.worlds.makers import tank_world
from wakewise.simulation.tank import Tank
from wakewise_benchmarks.tank_scaling import measure_scaling

FLIGHT_S = 120.0
WARM_UP_S = 10.0
POINTS = 5000
_STEP_S = 0.02
_MEASURE_EVERY = 5
_PAGE_MB = resource.getpagesize() / 1e6


def run(options: BenchOptions) -> dict[str, Any]:
    """Play a recorded flight to the tank and time it, with the processor's time by what it went to."""
    scenario = load_scenario("standard", None, {"method": "dp", "world": "tank"})
    thrusts = _flown(scenario, FLIGHT_S, options)
    tank = _tank(scenario)
    points = _points(tank)
    before_kg = tank.silt.total_kg
    spent = {"water": 0.0, "silt": 0.0, "measures": 0.0, "flow_points": 0.0}
    # Water and silt run beside the rest, each wholly on one thread; the sum at many points is split among threads, but
    # nothing else runs then, since the measures before it have waited for water and silt.
    parts: dict[str, Any] = {"water": tank.water, "silt": tank.silt}
    for name, part in parts.items():
        part.step = _timed(part.step, spent, name, time.thread_time)
    measure = _timed(tank.measure, spent, "measures", time.thread_time)
    look = _timed(tank.excess_velocity, spent, "flow_points", time.process_time)
    times, memory, started = [], [], (0.0, 0.0)
    for k, commands in enumerate(thrusts):
        if k == round(WARM_UP_S / _STEP_S):
            tank.measure()  # so that nothing of the warm-up is under way
            spent.update(dict.fromkeys(spent, 0.0))
            started = (time.perf_counter(), time.process_time())
        tank.step(commands, _STEP_S)
        if k % _MEASURE_EVERY == 0:
            measure()
            look(points)
        if k % 50 == 0:
            times.append(tank.time_s)
            memory.append(_resident_MB())
            options.progress(k, len(thrusts), "playing it again")
    tank.measure()  # so that all of it is done
    wall, cpu = time.perf_counter() - started[0], time.process_time() - started[1]
    seconds = FLIGHT_S - WARM_UP_S
    late = np.array(times) > FLIGHT_S / 2
    growth = np.polyfit(np.array(times)[late], np.array(memory)[late], 1)[0]
    shares = {name: value / seconds for name, value in spent.items()}
    return {
        "realtime_factor": seconds / wall,
        "realtime_factor_one_core": seconds / cpu,
        "cpu_s_per_s": cpu / seconds,
        "cpu_s_per_s_by": {**shares, "vehicle_and_sensors": cpu / seconds - sum(shares.values())},
        "memory_MB": max(memory),
        "memory_growth_MB_per_10min": float(600.0 * growth),
        "mass_error_rel": abs(tank.silt.total_kg - before_kg) / before_kg if before_kg else 0.0,
        "flow_points": POINTS,
        "parcels": tank.water.counts.parcels,
        "rings": tank.water.counts.rings,
        "silt_particles": len(tank.silt.mass_kg),
        "cores": os.cpu_count(),
        "scaling": measure_scaling(options.progress),
    }


def _flown(scenario: Scenario, duration_s: float, options: BenchOptions) -> Array:
    """Commands of the first part of the scenario's flight, shape (n, 8)."""
    steps = round(duration_s / _STEP_S)
    flight = fly(
        scenario,
        duration_s=duration_s,
        water_every_s=np.inf,
        progress=lambda done, _, note="": options.progress(done, steps, note or "flying"),
    )
    return flight.steps.select(f"command_{i + 1}_N" for i in range(len(flight.parts.vehicle.thrusters))).to_numpy()


def _tank(scenario: Scenario) -> Tank:
    """A tank as the flight had it at its start."""
    return tank_world(scenario.parts()).tank()


def _points(tank: Tank) -> Array:
    """Points all over the box of 1.6 x 1.6 x 1 m round the target in which a trial looks at the silt."""
    centre, depth = tank.target.centre_W_m, tank.settings.size_m[2]
    low = np.array([centre[0] - 0.8, centre[1] - 0.8, max(depth - 1.0, 0.0)])
    high = np.array([centre[0] + 0.8, centre[1] + 0.8, depth])
    return np.random.default_rng(0).uniform(low, high, (POINTS, 3))


def _timed(
    work: Callable[..., Any], spent: dict[str, float], name: str, clock: Callable[[], float]
) -> Callable[..., Any]:
    def timed(*args: Any) -> Any:
        began = clock()
        try:
            return work(*args)
        finally:
            spent[name] += clock() - began

    return timed


def _resident_MB() -> float:
    """Memory held now, from the kernel; the peak so far where that is not told."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE_MB
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
