"""The vehicle, target and poses that benches share."""

from __future__ import annotations

from functools import cache

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, look_at, quat_from_matrix
from wakewise.robot.vehicles import load_vehicle
from wakewise.scene.targets import Region, Target, coral, place_on_bed, sample_region

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
