"""The paper's own world, circular: the planner's model is the water
(`wakewise.operation.worlds.quasi_steady_world`).
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.geometry import Pose
from wakewise.operation import Parts, fly
from wakewise.operation.randomization import Seeds
from wakewise.operation.scenario import Scenario, check_scenario
from wakewise.scene.missions import SETTLING
from wakewise.scene.targets import Region, find_target, sample_region
from wakewise.vision.evaluation import flight_figures
from wakewise.wake import InfluenceModel, WakeSettings, disturbance, wake_model
from wakewise_paper.wash_reduction.routes import STANDOFF_M, gentle_route

WATER_EVERY_S = 0.25
"""How often the water is asked about in the flights of the benches."""
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


@dataclass(frozen=True, kw_only=True)
class PaperWashTrial:
    """One flight there; hashable, so that it can be handed to a worker."""

    method: str
    seed: int


def paper_scenario(trial: PaperWashTrial) -> Scenario:
    """Everything at its default but for the mechanisms, which are off, the belief, the method and the seed."""
    told = {"method": trial.method, "seed": trial.seed, "world": "paper"}
    return check_scenario(told | {"control": {"wake": PAPER_WAKE, "allocation": OFF}}, "gentle bench")


@lru_cache(maxsize=2)
def paper_place(bed_z_m: float) -> tuple[Any, Any]:
    """Target and the region about it; the same for all seeds, but for where each takes the target to be."""
    scenario = Scenario()
    target = find_target(scenario.target.kind, bed_z_m)
    return target, sample_region(target, scenario.target.points, Seeds(0).region())


def true_disturbance(frame: pl.DataFrame, parts: Parts, region: Region, rate_hz: float) -> float:
    """Mean of D in (m/s)^2 of the true thrusts at the true poses about the true target, by the model believed there.

    The same yardstick for all methods, whatever each of them weighs itself; looked at five times a second.
    """
    view = InfluenceModel.of(parts.vehicle, region, wake_model(WakeSettings(**PAPER_WAKE)))
    rows = frame.gather_every(round(0.2 * rate_hz))
    places = rows.select("true_x_m", "true_y_m", "true_z_m").to_numpy()
    turns = rows.select("true_qw", "true_qx", "true_qy", "true_qz").to_numpy()
    thrusts = rows.select(f"thrust_{i + 1}_N" for i in range(len(parts.vehicle.thrusters))).to_numpy()
    steps = zip(places, turns, thrusts, strict=True)
    return float(np.mean([disturbance(view.gram(Pose(p, q)), T) for p, q, T in steps]))


def fly_paper(trial: PaperWashTrial) -> dict[str, float | None]:
    """Figures of one flight, from the end of settling on."""
    began = time.process_time()
    scenario = paper_scenario(trial)
    target, region = paper_place(scenario.tank.size_m[2])
    azimuth = float(np.random.default_rng([trial.seed, 7]).uniform(-np.pi, np.pi))
    parts = scenario.parts().replace(target=target)
    found = parts.found_target.centre_W_m
    parts = parts.replace(
        region=region.moved(found - target.centre_W_m), route=gentle_route(found, STANDOFF_M, azimuth)
    )
    # The arc passes the target at the mission's own standoff, which the mission's check has seen.
    frame = fly(parts, checked=False, water_every_s=WATER_EVERY_S).steps.filter(pl.col("leg") != SETTLING)
    figures: dict[str, Any] = flight_figures(frame)
    out: dict[str, float | None] = {key: figures.get(key) for key in FIGURES}
    out["disturbance"] = true_disturbance(frame, parts, region, scenario.control.rate_hz)
    out["cpu_s"] = time.process_time() - began
    return out
