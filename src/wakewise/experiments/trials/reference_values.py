"""What to hold a flight's figures against: the water without it, thrusts shared out as `dp` does, grains that move."""

from __future__ import annotations

import numpy as np
import polars as pl

from wakewise.allocation import disturbance_of, min_norm_allocation
from wakewise.control import vehicle_layout
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.experiments.trials.metrics import Figures, MetricsCollector
from wakewise.operation import Parts
from wakewise.simulation.tank import TankSettings, tank_ambient
from wakewise.simulation.tank.grains import threshold_stress_Pa
from wakewise.wake import InfluenceModel

INSTANTS = 400
"""At most so many control steps, spread evenly over the flight, are shared out anew."""
LOOKS = 200
"""Instants at which the water's own motion is looked at."""


def add_reference_values(gathering: MetricsCollector, parts: Parts, steps: pl.DataFrame) -> None:
    """Add disturbance_flown, disturbance_least_thrusts, ambient_speed_m_s and grain_threshold_Pa, or why there is none.

    `steps` is the table of steps.parquet from the first leg on.
    """
    try:
        gathering.add(allocation_figures(parts, steps))
    except InputError as fault:
        gathering.missing(("disturbance_flown", "disturbance_least_thrusts"), str(fault))
    gathering.add({"ambient_speed_m_s": ambient_speed_m_s(parts, steps["time_s"].to_numpy())})
    threshold = grain_threshold_Pa(parts.scenario.tank)
    gathering.add({"grain_threshold_Pa": threshold})
    if threshold is None:
        gathering.missing(("grain_threshold_Pa",), "neither bed nor water holds loose grains (tank.silt)")


def allocation_figures(parts: Parts, steps: pl.DataFrame, instants: int = INSTANTS) -> Figures:
    """Mean D of the thrusts commanded, and of the least thrusts that make the same wrenches from the same poses.

    Both by the wake model of `scenario.control.wake` over the target's own points, at the estimated poses.

    Raises
    ------
    InputError
        If the table lacks a command or an estimate.
    """
    vehicle = parts.vehicle
    commands = [f"command_{i + 1}_N" for i in range(len(vehicle.thrusters))]
    places, turns = [f"est_{a}_m" for a in "xyz"], [f"est_q{a}" for a in "wxyz"]
    lost = [name for name in (*commands, *places, *turns) if name not in steps.columns]
    if lost:
        raise InputError(f"steps: no column {lost[0]}, needs commands and estimates of every step")
    picks = np.unique(np.linspace(0, steps.height - 1, min(instants, steps.height)).astype(int))
    some = steps[picks]
    thrusts, p, q = (some.select(names).to_numpy().astype(np.float64) for names in (commands, places, turns))
    known = np.isfinite(np.column_stack([thrusts, p, q])).all(axis=1)
    if not known.any():
        raise InputError("steps: no step has both a command and an estimate")
    view = InfluenceModel.of(vehicle, parts.region, parts.wake, parts.scenario.control.superposition)
    layout = vehicle_layout(vehicle)
    flown, least = [], []
    for T, place, turn in zip(thrusts[known], p[known], q[known], strict=True):
        G = view.gram(Pose(place, turn))
        shared = min_norm_allocation(layout, layout.B @ T).thrusts_N
        flown.append(disturbance_of(G, T))
        least.append(disturbance_of(G, shared))
    return {"disturbance_flown": float(np.mean(flown)), "disturbance_least_thrusts": float(np.mean(least))}


def ambient_speed_m_s(parts: Parts, time_s: Array, looks: int = LOOKS) -> float:
    """Mean speed of the water's own motion over the surface points of a region and the times of a flight."""
    region = parts.region
    surface = region.points_W_m[region.distance_m <= 0.0]
    points = surface if len(surface) else region.points_W_m
    ambient = tank_ambient(parts.scenario.tank, parts.seeds.tank())
    when = np.linspace(float(time_s[0]), min(float(time_s[-1]), ambient.end_s), looks)
    return float(np.mean([np.linalg.norm(ambient.velocity(points, float(t)), axis=1).mean() for t in when]))


def grain_threshold_Pa(tank: TankSettings) -> float | None:
    """Stress from which the bed's grains move, as the tank itself takes it; None where there are no grains."""
    silt = tank.silt
    if silt.load_kg_m2 == 0.0 and silt.suspended_mg_l == 0.0:
        return None
    if silt.threshold_Pa is not None:
        return silt.threshold_Pa
    return threshold_stress_Pa(silt.grain_m, silt.grain_density_kg_m3, tank.density_kg_m3)
