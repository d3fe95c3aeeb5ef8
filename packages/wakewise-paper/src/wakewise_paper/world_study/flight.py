"""Flights and scans of the study of worlds: one world of the library, one method, one seed."""

from __future__ import annotations

from wakewise.experiments.campaigns.definition import MODEL_SOURCES, PlannedTrial
from wakewise.experiments.campaigns.flights import MODEL
from wakewise.experiments.campaigns.study import flight_trial, study_trial
from wakewise.experiments.campaigns.task import Task
from wakewise_paper import flights

SOURCES = (*flights.SOURCES, "wakewise_paper:world_study")
FLIGHT, SCAN = "flight", "model"
FLIGHT_FIGURES = (
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "target_pressure_mean_Pa",
    "bed_shear_p95_Pa",
    "bed_over_threshold_pct",
    "bed_over_threshold_s",
    "silt_lifted_g",
    "silt_suspended_max_g",
    "ray_optical_depth",
    "exposure_optical_depth",
    "sway_rms_mm",
    "sway_wash_mm",
    "target_drag_peak_N",
    "target_stress_peak_Pa",
    "position_rmse_mm",
    "estimate_rmse_mm",
    "energy_kJ",
    "sign_flips_per_s",
    "collisions",
    "fallbacks",
)
"""Of each flight, from the end of settling on."""

MODEL_FIGURES = ("rmse_mm", "completeness_pct", "completeness_1mm_pct", "success", "registered_images")
"""Of each scan. A scan that gave no model is a failure: no success, and no rmse to take a mean of."""


def short_flight(world: str, method: str, seed: int, duration_s: float | None = None) -> PlannedTrial:
    """Hover on the middle orbit and fly part of the lowest, from a side that the seed draws, in the quick preset."""
    fields = {"world": world, "method": method, "seed": seed}
    setup: dict[str, dict[str, object]] = {flights.HOVER_AND_ARC: {}}
    return flight_trial(
        world, method, seed, fields, setup=setup, duration_s=duration_s, sources=flights.SOURCES, variation=FLIGHT
    )


def scan(world: str, method: str, seed: int) -> PlannedTrial:
    """A whole quick scan and its model: what `wakewise scan --world` makes."""
    settings = {
        "scenario": {"world": world, "method": method, "seed": seed},
        "preset": "quick",
        "keep": "figures",
    }
    task = Task(name=f"{SCAN}/{world}/{method}/{seed}", work=MODEL, settings=settings, sources=MODEL_SOURCES)
    return study_trial(world, method, seed, task, SCAN)
