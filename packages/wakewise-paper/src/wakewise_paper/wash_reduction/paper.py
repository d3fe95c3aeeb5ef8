"""The paper's own world, circular: the planner's wake model is the water
(`wakewise.operation.worlds.quasi_steady_world`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.geometry import Pose
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.flights import FlightProbe, settled
from wakewise.experiments.campaigns.study import flight_trial
from wakewise.operation import Parts
from wakewise.operation.scenario import Scenario
from wakewise.operation.scenario.randomization import Seeds
from wakewise.scene.targets import find_target, sample_region
from wakewise.wake import InfluenceModel, WakeSettings, disturbance, wake_model
from wakewise_paper import flights
from wakewise_paper.routes import STANDOFF_M, gentle_route

PAPER = "paper"
PAPER_WAKE: dict[str, Any] = {"model": "paper-calibrated", "edge_width_deg": 3.0, "floor": False}
"""What controllers believe in the paper's world: its own model with a smooth edge."""
OFF = {"null_space": False, "merging_jets": False, "advection": False}
"""The paper's cost: no mechanisms."""
METHODS = ("dp", "mpc", "wake-aware")
SEEDS = 3
FIGURES = (
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "disturbance",
    "position_rmse_mm",
    "velocity_deviation_pct",
    "energy_kJ",
    "cpu_s",
)


def paper_trial(method: str, seed: int) -> PlannedTrial:
    """One flight there: all at its default but for the mechanisms, which are off, the belief, the method and the
    seed.
    """
    return flight_trial(
        PAPER,
        method,
        seed,
        {"method": method, "seed": seed, "world": PAPER, "control": {"wake": PAPER_WAKE, "allocation": OFF}},
        preset=None,
        setup={f"{__name__}:paper_setup": {}},
        probes={f"{__name__}:TrueDisturbance": {}},
        sources=(*flights.SOURCES, "wakewise_paper:wash_reduction"),
    )


@lru_cache(maxsize=2)
def paper_place(bed_z_m: float) -> tuple[Any, Any]:
    """Target and the region about it; the same for all seeds, but for where each takes the target to be."""
    scenario = Scenario()
    target = find_target(scenario.target.kind, bed_z_m)
    return target, sample_region(target, scenario.target.points, Seeds(0).region())


def paper_setup(parts: Parts) -> Parts:
    """Target, region and route there; the arc passes at the mission's own standoff, which the mission's check has
    seen.
    """
    target, region = paper_place(parts.scenario.tank.size_m[2])
    parts = parts.replace(target=target)
    found = parts.surveyed_target.centre_W_m
    route = gentle_route(found, STANDOFF_M, flights.azimuth_of(parts.scenario.seed))
    return parts.replace(region=region.moved(found - target.centre_W_m), route=route)


class TrueDisturbance(FlightProbe):
    """Mean of D of the true thrusts at the true poses about the target, by the model believed there, five times a
    second.

    The same yardstick for all methods, whatever each of them weighs itself.
    """

    def __init__(self, parts: Parts, folder: Path) -> None:
        super().__init__(parts, folder)
        _, region = paper_place(parts.scenario.tank.size_m[2])  # about the true target, not where it is believed to be
        self._view = InfluenceModel.of(parts.vehicle, region, wake_model(WakeSettings(**PAPER_WAKE)))

    def figures(self, steps: pl.DataFrame) -> Mapping[str, float]:
        """`disturbance` in (m/s)^2."""
        rows = settled(steps).gather_every(round(0.2 * self.parts.control.rate_hz))
        places = rows.select("true_x_m", "true_y_m", "true_z_m").to_numpy()
        turns = rows.select("true_qw", "true_qx", "true_qy", "true_qz").to_numpy()
        thrusts = rows.select(f"thrust_{i + 1}_N" for i in range(len(self.parts.vehicle.thrusters))).to_numpy()
        D = [disturbance(self._view.gram(Pose(p, q)), T) for p, q, T in zip(places, turns, thrusts, strict=True)]
        return {"disturbance": float(np.mean(D))}
