"""Which parts of a mapped patch need a closer look: those seen poorly, and those whose relief hides surface.

The patch is divided into cells in plan. A cell's need is the area in it that is not seen well, and half of the area by
which it exceeds that of a slope of 48 degrees: what stands steeper was mapped in parts only. Parts are discs, chosen
one after the other by the need that they hold (greedy maximum coverage: G. L. Nemhauser et al. 1978, doi
10.1007/BF01588971).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import convolve, maximum_filter, minimum_filter

from wakewise.core.arrays import Array, BoolArray, freeze

CELL_M = 0.05
STEEPEST = 3.0
"""Area of the surface over that in plan, at most: 70 degrees. What is steeper is most often a wrong height."""
RELIEF_SHARE, STEEP = 0.5, 1.5
LEAST_SHARE = 0.02
"""A part is not worth an orbit for less of the patch's need, once there are as many as asked for."""
AROUND = 1.5
"""Heights of a part are those within so many of its radii."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PatchNeed:
    """Need of each cell of a patch in plan, m2, shape (n, k), and the middle of cell (0, 0), shape (2,)."""

    need_m2: Array
    origin_m: Array

    def __post_init__(self) -> None:
        freeze(self, need_m2=(None, None), origin_m=(2,))


def need_of(points_W_m: Array, covered: BoolArray, middle_m: Array, size_m: Array) -> PatchNeed:
    """Need of a patch by mapped points, shape (n, 3), and whether each is seen well, shape (n,).

    `middle_m`, `size_m`, shape (2,): of the patch, north and east. Cells without a point are seen poorly, and as high
    as the cells about them.
    """
    low = np.asarray(middle_m) - 0.5 * np.asarray(size_m)
    shape = tuple(np.maximum(np.round(np.asarray(size_m) / CELL_M).astype(int), 1).tolist())
    cell = np.floor((points_W_m[:, :2] - low) / CELL_M).astype(np.int64)
    inside = ((cell >= 0) & (cell < shape)).all(axis=1)
    number = np.ravel_multi_index(tuple(cell[inside].T), shape)
    count = np.bincount(number, minlength=shape[0] * shape[1]).reshape(shape)
    well = np.bincount(number, covered[inside], shape[0] * shape[1]).reshape(shape)
    poorly = np.where(count > 0, 1.0 - well / np.maximum(count, 1), 1.0)
    height = np.bincount(number, -points_W_m[inside, 2], shape[0] * shape[1]).reshape(shape)
    height = _filled(np.where(count > 0, height / np.maximum(count, 1), np.nan))
    slope = (maximum_filter(height, 3) - minimum_filter(height, 3)) / (2.0 * CELL_M)
    area = np.minimum(np.sqrt(1.0 + slope**2), STEEPEST)
    need = CELL_M**2 * (area * poorly + RELIEF_SHARE * np.maximum(area - STEEP, 0.0))
    return PatchNeed(need_m2=need, origin_m=low + 0.5 * CELL_M)


def choose_parts(patch: PatchNeed, radius_m: float, least: int, most: int) -> Array:
    """Middles in plan, shape (k, 2), of `least` to `most` parts of this radius, the neediest first."""
    reach = round(radius_m / CELL_M)
    offset = np.arange(-reach, reach + 1)
    disc = (offset[:, None] ** 2 + offset**2 <= reach**2).astype(np.float64)
    left, total, parts = patch.need_m2.copy(), float(patch.need_m2.sum()), list[Array]()
    rows, columns = np.indices(left.shape)
    while len(parts) < most:
        held = convolve(left, disc, mode="constant")
        best = np.unravel_index(int(np.argmax(held)), held.shape)
        if held[best] <= 0.0 or (len(parts) >= least and held[best] < LEAST_SHARE * total):
            break
        parts.append(patch.origin_m + CELL_M * np.array(best))
        left[(rows - best[0]) ** 2 + (columns - best[1]) ** 2 <= reach**2] = 0.0
    return np.array(parts).reshape(-1, 2)


def everywhere(middle_m: Array, size_m: Array, radius_m: float) -> Array:
    """Middles in plan of parts of this radius, side by side over a whole patch, shape (k, 2)."""
    counts = np.maximum(np.ceil(np.asarray(size_m) / (2.0 * radius_m) - 1e-9).astype(int), 1)
    axes = [m + s * ((np.arange(n) + 0.5) / n - 0.5) for m, s, n in zip(middle_m, size_m, counts, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def middle_of(points_W_m: Array, plan_m: Array, radius_m: float, depth_m: float) -> Array:
    """Middle of a part, shape (3,): halfway between its lowest and its highest points, outliers left out.

    `plan_m`, shape (2,): its middle in plan. `depth_m` where nothing of it is mapped.
    """
    near = np.linalg.norm(points_W_m[:, :2] - plan_m, axis=1) < AROUND * radius_m
    if not near.any():
        return np.array([*plan_m, depth_m])
    top, foot = np.quantile(points_W_m[near, 2], (0.05, 0.95))
    return np.array([*plan_m, 0.5 * float(top + foot)])


def _filled(height: Array) -> Array:
    """Heights, shape (n, k), NaN replaced by the mean of what lies about it."""
    height = height.copy()
    kernel = np.ones((3, 3))
    while (lacking := np.isnan(height)).any():
        if lacking.all():
            return np.zeros_like(height)
        count = convolve((~lacking).astype(np.float64), kernel, mode="constant")
        mean = convolve(np.where(lacking, 0.0, height), kernel, mode="constant") / np.maximum(count, 1.0)
        height = np.where(lacking & (count > 0), mean, height)
    return height
