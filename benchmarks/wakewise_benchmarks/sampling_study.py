"""How near the disturbance of 300 points comes to that of 100,000, over poses, corals and wake models.

Fifty poses stand round each coral, 0.5 to 0.9 m from its middle and above it. Every other one has the vehicle's origin
there, turned any way; the others have one thruster there, its axis through a place drawn evenly in the sphere that
holds the region. Eight random thrusts are taken with both signs: a hundred cases, in which jets hit head on, graze and
miss. Errors are relative to the D of the reference; where that is less than a thousandth of the largest of the hundred,
relative to this thousandth. Since a narrow jet misses in many cases, median and 95th percentile are also given over
the cases above it alone, which are said to touch.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.robot.vehicles import Vehicle, load_vehicle
from wakewise.scene.targets import Target, coral, place_on_bed, region_measure, sample_region, stony_kinds
from wakewise.scene.targets.region import SHELL_M
from wakewise.scene.targets.sampling import NEGLIGIBLE
from wakewise.scene.targets.sampling import sampling_error_pct as error_by_case_pct
from wakewise.wake import disturbance, gram, wake_model

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
