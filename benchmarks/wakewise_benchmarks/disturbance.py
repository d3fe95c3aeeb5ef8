"""The Gram matrix of D: how fast, with and without derivatives; equal to the sum over points; linear in number.

How near the disturbance of 300 points comes to that of 100,000, over poses, corals and wake models.

Fifty poses stand round each coral, 0.5 to 0.9 m from its middle and above it. Every other one has the vehicle's origin
there, turned any way; the others have one thruster there, its axis through a place drawn evenly in the sphere that
holds the region. Eight random thrusts are taken with both signs: a hundred cases, in which jets hit head on, graze and
miss. Errors are relative to the D of the reference; where that is less than a thousandth of the largest of the hundred,
relative to this thousandth. Since a narrow jet misses in many cases, median and 95th percentile are also given over
the cases above it alone, which are said to touch.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.experiments.trials.timing import BenchOptions, timed_us
from wakewise.robot.vehicles import Vehicle, load_vehicle
from wakewise.scene.targets import Target, coral, place_on_bed, region_measure, sample_region, stony_kinds
from wakewise.scene.targets.region import NEGLIGIBLE, SHELL_M
from wakewise.scene.targets.region import sampling_error_pct as error_by_case_pct
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
from wakewise_benchmarks.registry import VEHICLE, bench_region, bench_target, cases

POINTS = 300
REFERENCE_POINTS = 100_000
POSES = 50
BED_Z_M = 1.5


def sampling_errors(seed: int = 0, models: tuple[str, ...] = ("paper", "jet"), points: int = POINTS) -> dict[str, Any]:
    """Errors of D in percent by wake model and coral.

    Parameters
    ----------
    seed : int
        Of the region, the reference and the poses, which are drawn apart.
    models : tuple of str
    points : int

    Returns
    -------
    dict
        Per model and coral: median_pct, p95_pct over all cases; touched_median_pct, touched_p95_pct over those in which
        D is not negligible; touched_share. Per model, under "worst", the largest of each over the corals.
    """
    vehicle = load_vehicle("paper")
    result: dict[str, Any] = {name: {} for name in models}
    for kind in stony_kinds():
        draw, poses, many = np.random.default_rng(seed).spawn(3)
        target = place_on_bed(kind, coral(kind), BED_Z_M)
        region = sample_region(target, points, draw)
        reference = region_measure(target, REFERENCE_POINTS // 2, REFERENCE_POINTS // 2, many)
        cases = _cases(target, vehicle, poses)
        few = (region.points_W_m, region.weights / points)
        for name in models:
            model = wake_model(name)
            D, truth = (
                _disturbances(model, *place, cases, vehicle)
                for place in (few, (reference.points_W_m, reference.weights))
            )
            result[name][kind] = _summary(error_by_case_pct(D, truth), truth)
    for name in models:
        result[name]["worst"] = {
            key: max(result[name][kind][key] for kind in stony_kinds())
            for key in ("median_pct", "p95_pct", "touched_median_pct", "touched_p95_pct")
        }
    return result


def sampling_error_pct(seed: int = 0) -> float:
    """Largest over corals, and over the paper's model and the jet, of the median error over cases that touch."""
    errors = sampling_errors(seed)
    return max(float(errors[name]["worst"]["touched_median_pct"]) for name in errors)


def _cases(target: Target, vehicle: Vehicle, rng: np.random.Generator) -> list[tuple[Pose, Array]]:
    """Poses round a target, turned any way and aimed in turn, with thrusts in N."""
    drawn = []
    for pose in range(POSES):
        azimuth, elevation, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.1, 1.4), rng.uniform(0.5, 0.9)
        away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
        if pose % 2 == 0:
            drawn.append((Pose(target.centre_W_m + reach * away, rng.normal(size=4)), 2.0 * rng.normal(size=8)))
            continue
        aim = rng.normal(size=3)
        aim *= (target.radius_m + SHELL_M) * np.cbrt(rng.random()) / np.linalg.norm(aim)
        thruster = vehicle.thrusters[rng.integers(len(vehicle.thrusters))]
        # The jet of positive thrust leaves along -axis: lay that on the way to the aim, any turn about it.
        way = aim - reach * away
        turn, _ = Rotation.align_vectors(way[None] / np.linalg.norm(way), -thruster.axis_B[None])
        R_WB = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi) * way / np.linalg.norm(way)) * turn
        x, y, z, w = R_WB.as_quat()
        # The thruster, not the body's origin, stands at the drawn place.
        p_WB = target.centre_W_m + reach * away - R_WB.as_matrix() @ thruster.p_BT_m
        drawn.append((Pose(p_WB, np.array([w, x, y, z])), 2.0 * rng.normal(size=8)))
    return drawn


def _disturbances(
    model: WakeModel, points: Array, weights: Array, cases: list[tuple[Pose, Array]], vehicle: Vehicle
) -> Array:
    found = []
    for X_WB, thrusts_N in cases:
        origins, axes = X_WB.apply(vehicle.thruster_positions_B_m), vehicle.thruster_axes_B @ X_WB.R.T
        G = gram(model, points, weights, origins, axes, vehicle.disk_areas_m2)
        found += [disturbance(G, thrusts_N), disturbance(G, -thrusts_N)]
    return np.array(found)


def _summary(error_pct: Array, truth: Array) -> dict[str, float]:
    touched = truth >= NEGLIGIBLE * truth.max()
    return {
        "median_pct": float(np.median(error_pct)),
        "p95_pct": float(np.percentile(error_pct, 95)),
        "touched_median_pct": float(np.median(error_pct[touched])),
        "touched_p95_pct": float(np.percentile(error_pct[touched], 95)),
        "touched_share": float(np.mean(touched)),
    }


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
