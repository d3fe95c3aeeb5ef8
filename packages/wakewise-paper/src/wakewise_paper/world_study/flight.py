"""One short flight, or one whole scan with its model, in a world of the library, by one method, with one seed."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.operation import Parts, Scenario, fly
from wakewise.operation.loop import Step
from wakewise.scene.missions import SETTLING
from wakewise.vision.evaluation import flight_figures
from wakewise_paper.wash_reduction.paper import WATER_EVERY_S
from wakewise_paper.wash_reduction.routes import gentle_route

FLIGHT_FIGURES = (
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "target_pressure_mean_Pa",
    "bed_shear_p95_Pa",
    "silt_lifted_g",
    "silt_suspended_max_g",
    "ray_optical_depth",
    "exposure_optical_depth",
    "sway_rms_mm",
    "sway_wash_mm",
    "position_rmse_mm",
    "estimate_rmse_mm",
    "energy_kJ",
    "sign_flips_per_s",
    "collisions",
    "fallbacks",
)
"""Of each flight, from the end of settling on."""

MODEL_FIGURES = ("rmse_mm", "completeness_pct", "success", "registered_images")
"""Of each scan. A scan that gave no model is a failure: no success, and no rmse to take a mean of."""


@dataclass(frozen=True, kw_only=True)
class WorldTrial:
    """One flight to make, or one scan; hashable and plain, so that it can be handed to a worker.

    Parameters
    ----------
    world, method : str
    seed : int
    flow : str or None
        Water in place of the world's own.
    duration_s : float or None
        Only the first part of the flight.
    """

    world: str
    method: str
    seed: int
    flow: str | None = None
    duration_s: float | None = None

    def scenario(self) -> Scenario:
        """The quick preset in that world: what `wakewise scan --world` flies. Other flows hold the target still."""
        held = {} if self.flow is None else {"target.elasticity": "none"}
        return Scenario.preset("quick", world=self.world, method=self.method, seed=self.seed, flow=self.flow, **held)


def short_flight(trial: WorldTrial) -> Parts:
    """Hover on the middle orbit and fly part of the lowest, from a side that the seed draws."""
    parts = trial.scenario().parts()
    mission = parts.scenario.mission
    azimuth = float(np.random.default_rng([trial.seed, 7]).uniform(-np.pi, np.pi))
    elevations = sorted(mission.elevations_deg)
    route = gentle_route(
        parts.target.centre_W_m,
        mission.standoff_m,
        azimuth,
        elevations_deg=(elevations[len(elevations) // 2], elevations[0]),
    )
    return parts.replace(route=route)


def fly_trial(trial: WorldTrial) -> dict[str, float | None]:
    """Figures of one short flight."""
    return flown_figures(short_flight(trial), trial.duration_s)


def flown_figures(
    parts: Parts, duration_s: float | None, watch: Callable[[Step, Any], None] | None = None
) -> dict[str, float | None]:
    """Figures of a flight of these parts, or of its first part, looked at by `watch` as in `wakewise.fly`."""
    began = time.process_time()
    # The mission's own check has seen the orbits that this hovers on and flies along.
    flown = fly(parts, checked=False, water_every_s=WATER_EVERY_S, duration_s=duration_s, watch=watch).steps
    frame = flown.filter(pl.col("leg") != SETTLING)
    figures: dict[str, Any] = flight_figures(frame if frame.height else flown)
    return {key: figures.get(key) for key in FLIGHT_FIGURES} | {"cpu_s": time.process_time() - began}


def scan_trial(trial: WorldTrial) -> dict[str, float | None]:
    """Figures of a whole quick scan and its model; the trial's folder is thrown away."""
    from wakewise.experiments.trials import run_trial

    began = time.process_time()
    scenario = trial.scenario()
    light = scenario.replace(**{"reconstruction.mesh": False})
    with tempfile.TemporaryDirectory(prefix="wakewise-world-") as folder:
        figures = run_trial(light, Path(folder) / "trial")
    found: dict[str, float | None] = {key: figures.get(key) for key in (*MODEL_FIGURES, "target_speed_mean_m_s")}
    found["success"] = float(bool(figures["success"]))
    return found | {"cpu_s": time.process_time() - began}
