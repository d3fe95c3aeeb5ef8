"""What is wrong with the places of points and jets; NaN is looked for only once a sum is NaN."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError


def same_sizes(points: Array, weights: Array, origins: Array, axes: Array, areas: Array) -> None:
    """Refuse arrays whose shapes do not belong together.

    Raises
    ------
    InputError
        Naming the array, its shape and the one it should have.
    """
    m = len(areas)
    if points.ndim == 2 and points.shape[1] == 3 and weights.shape == points.shape[:1] and areas.ndim == 1:
        if origins.shape == axes.shape == (m, 3):
            return
    elif areas.ndim != 1:
        raise InputError(f"thrusters' areas: shape {areas.shape}, allowed {(m,)}")
    elif points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"region's points: shape {points.shape}, allowed (n, 3)")
    else:
        raise InputError(f"region's weights: shape {weights.shape}, allowed {points.shape[:1]}")
    what, got = ("thrusters' places", origins.shape) if origins.shape != (m, 3) else ("thrusters' axes", axes.shape)
    raise InputError(f"{what}: shape {got}, allowed {(m, 3)}")


def explain(points: Array, weights: Array, origins: Array, axes: Array, areas: Array) -> InputError:
    """Error that says what a sum over points could not use."""
    for what, value in (
        ("region's points", points),
        ("region's weights", weights),
        ("thrusters' places", origins),
        ("thrusters' axes", axes),
        ("thrusters' areas", areas),
    ):
        if not np.all(np.isfinite(value)):
            row = int(np.argwhere(~np.isfinite(value))[0][0])
            return InputError(f"{what}: row {row} holds NaN or infinity, every element must be finite")
    if np.any(weights < 0.0):
        return InputError(f"region's weights: {np.min(weights):g}, a weight must not be negative")
    if np.any(areas <= 0.0):
        return InputError(f"thrusters' areas: {np.min(areas):g} m2, a disk's area must be more than 0")
    return InputError("disturbance: numbers too large to be summed")
