"""Points of water just above the bed around the target's foot, as part of the region that a controller spares."""

from __future__ import annotations

import numpy as np

from wakewise.control.settings import AllocationSettings
from wakewise.core.arrays import Array, IntArray
from wakewise.scene.targets import Region

BED_POINTS, BED_RADIUS_M, BED_WEIGHT = 80, 0.3, 0.5
"""How many bed points there are: enough for one in a square of 6 cm; how far from the target's foot they reach: three
of a coral's own radii; and their weight together, over that of the region: the bed counts half of the target."""
BED_HEIGHTS_M = (0.01, 0.03)
"""Bed points lie between these heights: where a wall jet half a metre from its strike point is fastest."""
GOLDEN_RAD = float(np.pi * (3.0 - np.sqrt(5.0)))
"""Angle of a sunflower's spiral, which spreads points evenly over a disk (H. Vogel, Math. Biosci. 44 (1979) 179)."""


def with_bed_points(region: Region, settings: AllocationSettings, bed_z_m: float | None = None) -> Region:
    """The region and, if `include_bed` is on, a disk of points just above the bed around the target's foot.

    `bed_z_m` is the bed's depth; None: the lowest point of the region. The weights of the bed points add up to
    `BED_WEIGHT` times those of the region.
    """
    if not settings.include_bed:
        return region
    foot = region.points_W_m[_surface(region), :2].mean(axis=0)
    bed = float(region.points_W_m[:, 2].max()) if bed_z_m is None else bed_z_m
    k = np.arange(BED_POINTS)
    reach = BED_RADIUS_M * np.sqrt((k + 0.5) / BED_POINTS)
    low, high = BED_HEIGHTS_M
    # Heights by the golden ratio, so that every part of the disk has low and high points.
    height = low + (high - low) * ((k + 1) * 0.6180339887498949 % 1.0)
    ring = np.stack(
        [foot[0] + reach * np.cos(GOLDEN_RAD * k), foot[1] + reach * np.sin(GOLDEN_RAD * k), bed - height], axis=1
    )
    share = BED_WEIGHT * float(region.weights.sum()) / BED_POINTS
    return _joined(region, ring, np.full(BED_POINTS, share), reach)


def _surface(region: Region) -> IntArray:
    """Numbers of the points on the target's surface; of all points where none is."""
    found = np.flatnonzero(region.distance_m <= 0.0)
    return found if len(found) else np.arange(len(region.weights))


def _joined(region: Region, points_W_m: Array, weights: Array, distance_m: Array) -> Region:
    """The region and more points of water, none of them on the target's surface, whatever their distance."""
    return Region(
        points_W_m=np.concatenate([region.points_W_m, points_W_m]),
        weights=np.concatenate([region.weights, weights]),
        # What reads surface points must not take them for it.
        distance_m=np.concatenate([region.distance_m, np.maximum(distance_m, 1e-3)]),
    )
