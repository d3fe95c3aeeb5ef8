"""The Gram matrix of D: how fast, and equal to the sum over points."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from wakewise.experiments.benches.cases import REGION, VEHICLE, cases
from wakewise.experiments.benches.timing import BenchOptions, timed_us
from wakewise.wake import disturbance, gram, point_disturbance, wake_model


def run(options: BenchOptions) -> dict[str, Any]:
    """The Gram matrix of D against the sum over points in NumPy."""
    X_WB, _ = cases(1)[0]
    origins, axes = X_WB.apply(VEHICLE.thruster_positions_B_m), VEHICLE.thruster_axes_B @ X_WB.R.T
    thrusts = np.linspace(-3.0, 4.0, 8)
    place = (REGION.points_W_m, REGION.weights, origins, axes, VEHICLE.disk_areas_m2)
    result: dict[str, Any] = {}
    for name in ("paper", "jet"):
        model = wake_model(name)
        by_matrix = disturbance(gram(model, *place), thrusts)
        by_points = point_disturbance(model, *place, thrusts)
        result[name] = {
            "gram": timed_us(partial(gram, model, *place), 2000),
            "points_numpy": timed_us(partial(point_disturbance, model, *place, thrusts), 300),
            "gram_vs_points_rel_error": abs(by_matrix - by_points) / max(by_points, 1e-300),
        }
    return result
