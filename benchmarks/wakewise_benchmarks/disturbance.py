"""The Gram matrix of D: how fast, with and without derivatives; equal to the sum over points; linear in number."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.experiments.trials.timing import BenchOptions, timed_us
from wakewise.wake import (
    WakeSettings,
    disturbance,
    disturbance_slopes,
    gauss_newton,
    gram,
    gram_with_derivatives,
    point_disturbance,
    wake_model,
)
from wakewise.wake.models import OWN_MODELS
from wakewise_benchmarks.cases import VEHICLE, bench_region, bench_target, cases
from wakewise_benchmarks.sampling_study import sampling_errors

THRUSTS_N = np.linspace(-3.0, 4.0, 8)
COUNTS = (100, 300, 1000, 3000, 10000)
PAPER_US = 1000.0
"""The paper: less than a millisecond for D of 300 points and 8 thrusters."""


def run(options: BenchOptions) -> dict[str, Any]:
    """Times of every model at several poses, from Python, checks included; the slowest model is the headline."""
    poses = [X_WB for X_WB, _ in cases(4)]
    region = (bench_region().points_W_m, bench_region().weights)
    models = {name: wake_model(name) for name in OWN_MODELS}
    models["jet+floor"] = wake_model(WakeSettings(model="jet", floor=True), bench_target().bed_z_m)
    rows = {}
    for done, (name, model) in enumerate(models.items()):
        options.progress(done, len(models) + 1, name)
        rows[name] = _times(model, region, poses)
    free = [row for name, row in rows.items() if name != "jet+floor"]
    growth = _growth(poses[0])
    options.progress(len(models), len(models) + 1, "300 points against 100,000")
    sampling = sampling_errors()
    return {
        "points": len(bench_region().points_W_m),
        "thrusters": len(VEHICLE.thrusters),
        "gram_us": max(row["gram_us"] for row in free),
        "gram_with_derivatives_us": max(row["gram_with_derivatives_us"] for row in free),
        "disturbance_gradient_us": max(row["disturbance_gradient_us"] for row in free),
        "gauss_newton_us": max(row["gauss_newton_us"] for row in free),
        "gram_vs_points_rel_error": max(row["gram_vs_points_rel_error"] for row in rows.values()),
        "sampling_error_pct": max(rows["worst"]["touched_median_pct"] for rows in sampling.values()),
        "sampling": sampling,
        "paper_us": PAPER_US,
        "models": rows,
        "gram_us_by_points": growth,
        "linearity": growth[str(COUNTS[-1])] / growth[str(COUNTS[1])] / (COUNTS[-1] / COUNTS[1]),
    }


def _times(model: WakeModel, region: tuple[Array, Array], poses: list[Pose]) -> dict[str, float]:
    """Medians over poses of the median times of one model, and its greatest error."""
    body = (VEHICLE.thruster_positions_B_m, VEHICLE.thruster_axes_B, VEHICLE.disk_areas_m2)
    spans: dict[str, list[float]] = {}
    worst = 0.0
    for X_WB in poses:
        world = (*region, X_WB.apply(body[0]), body[1] @ X_WB.R.T, body[2])
        work: dict[str, Callable[[], Any]] = {
            "gram_us": partial(gram, model, *world),
            "gram_with_derivatives_us": partial(gram_with_derivatives, model, *region, X_WB, *body),
            "disturbance_gradient_us": partial(disturbance_slopes, model, *region, X_WB, *body, THRUSTS_N),
            "gauss_newton_us": partial(gauss_newton, model, *region, X_WB, *body, THRUSTS_N),
        }
        for name, call in work.items():
            spans.setdefault(name, []).append(timed_us(call, 400)["median_us"])
        spans.setdefault("points_numpy_us", []).append(
            timed_us(partial(point_disturbance, model, *world, THRUSTS_N), 60)["median_us"]
        )
        for superposition in ("coherent", "incoherent"):
            by_matrix = disturbance(gram(model, *world, superposition), THRUSTS_N)
            by_points = point_disturbance(model, *world, THRUSTS_N, superposition)
            worst = max(worst, abs(by_matrix - by_points) / max(by_points, 1e-300))
    return {name: float(np.median(span)) for name, span in spans.items()} | {"gram_vs_points_rel_error": worst}


def _growth(X_WB: Pose) -> dict[str, float]:
    """Time of the paper's model for more and more points, drawn from the region again and again."""
    world = (X_WB.apply(VEHICLE.thruster_positions_B_m), VEHICLE.thruster_axes_B @ X_WB.R.T, VEHICLE.disk_areas_m2)
    rng = np.random.default_rng(0)
    growth = {}
    for count in COUNTS:
        rows = rng.integers(0, len(bench_region().points_W_m), count)
        call = partial(gram, wake_model("paper"), bench_region().points_W_m[rows], bench_region().weights[rows], *world)
        growth[str(count)] = timed_us(call, 300)["median_us"]
    return growth
