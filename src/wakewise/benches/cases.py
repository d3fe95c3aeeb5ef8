"""The vehicle, target and poses that benches share."""

from __future__ import annotations

import numpy as np

from wakewise.arrays import Array
from wakewise.geometry import Pose, look_at, quat_from_matrix
from wakewise.targets import coral, place_on_bed, sample_region
from wakewise.vehicles import load_vehicle

VEHICLE = load_vehicle("paper")
TARGET = place_on_bed("branching", coral("branching", 0), 1.5)
REGION = sample_region(TARGET, 300, np.random.default_rng(0))


def cases(count: int) -> list[tuple[Pose, Array]]:
    """Poses round the target that look at it, each with a wrench of station keeping."""
    rng = np.random.default_rng(1)
    drawn = []
    for _ in range(count):
        azimuth, elevation, reach = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 1.3), rng.uniform(0.5, 0.9)
        away = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), -np.sin(elevation)])
        eye = TARGET.centre_W_m + reach * away
        X_WB = Pose(eye, quat_from_matrix(look_at(eye, TARGET.centre_W_m)))
        drawn.append((X_WB, rng.normal(size=6) * [3, 3, 3, 0.2, 0.3, 0.3]))
    return drawn
