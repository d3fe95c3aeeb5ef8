"""Visibility of a surface in a photograph: inside the picture, near, at a small angle, not hidden (depth buffer).

The surface is divided into patches with a few samples each. It is the surface at its estimated place: the target of
mission and controller, or a model reconstructed so far. Ground truth is not used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.jit.njit import njit

PATCHES, SAMPLES_PER_PATCH = 800, 10
"""A patch of a coral of 15 cm is then a square of 1 cm, with samples 3.5 mm apart."""
CLEARANCE_M = 0.010
"""What stands less than this above the bed does not count, as in evaluations: sand touches it."""
REACH_M = 0.003
"""A place counts as in the model when the model comes as near as this: what `completeness_pct` is defined by."""
WINDOW_SPACINGS = 3.0
"""Stereo compares surroundings of about so many distances of samples, 7.5 mm on a coral of 15 cm: they have to be shown
as well. Larger and smaller targets are taken to be photographed from as much farther and nearer."""
BEST = 255
"""Quality of a sample that is faced squarely, with all of its surroundings shown."""
NORMAL_SHARE = 0.15
"""Two samples that face opposite ways are as far apart as this share of the target's radius twice: the two sides of a
branch become two patches."""
SHIELD_CELLS = 80
"""What hides is kept in cells of this share of the target's largest extent: 2 mm of 15 cm, finer than a branch."""
ROUNDS = 6
SEED = 0


class TriangleSurface(Protocol):
    """Triangles: vertices, shape (n, 3), in m, and faces, shape (m, 3), counter-clockwise seen from outside."""

    @property
    def vertices_m(self) -> Array:
        """Corners, shape (n, 3)."""
        ...

    @property
    def faces(self) -> IntArray:
        """Indices of corners, shape (m, 3)."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfacePatches:
    """Samples spread evenly over a surface, the patch that each belongs to, and the surface itself, which hides."""

    # points_W_m, normals: shape (n, 3): samples, each standing for the same area, and unit outward normals.
    points_W_m: Array
    normals: Array
    patch: IntArray  # shape (n,): number of the patch of each sample; every one from 0 on has at least one
    area_m2: float  # of the surface that counts
    # Shape (m, 3, 3): corners of the triangles that hide what lies behind them: the surface, a little coarser.
    shield_W_m: Array
    shield_off_m: float = 0.0  # how far they may lie off the surface
    neighbours: IntArray = field(init=False)  # shape (p, 2): samples within `REACH_M` of each other

    def __post_init__(self) -> None:
        freeze(self, points_W_m=(None, 3), normals=(None, 3), shield_W_m=(None, 3, 3))
        patch = np.array(self.patch, dtype=np.int64)
        if patch.shape != (len(self.points_W_m),) or len(patch) == 0:
            raise InputError(f"patch: shape {patch.shape}, allowed ({len(self.points_W_m)},) with at least one sample")
        patch.setflags(write=False)
        object.__setattr__(self, "patch", patch)
        pairs = KDTree(self.points_W_m).query_pairs(REACH_M, output_type="ndarray").astype(np.int64)
        pairs.setflags(write=False)
        object.__setattr__(self, "neighbours", pairs)

    @property
    def count(self) -> int:
        """How many patches there are."""
        return int(self.patch.max()) + 1

    @property
    def samples(self) -> IntArray:
        """How many samples each patch has, which is its share of the area; shape (patches,)."""
        return np.bincount(self.patch, minlength=self.count)

    @cached_property
    def _windows(self) -> tuple[IntArray, Array]:
        """Pairs of samples within the window of each other, shape (p, 2), and how many each window has, shape (n,)."""
        n = len(self.points_W_m)
        reach_m = WINDOW_SPACINGS * math.sqrt(self.area_m2 / n)
        pairs = KDTree(self.points_W_m).query_pairs(reach_m, output_type="ndarray").astype(np.int64)
        return pairs, np.float64(1.0) + np.bincount(pairs.ravel(), minlength=n)

    def shown_about(self, shown: BoolArray) -> Array:
        """Share of the samples in the window of each, itself counted, that are shown; shape (n,)."""
        (one, other), held, n = self._windows[0].T, self._windows[1], len(shown)
        return np.asarray((shown + np.bincount(one, shown[other], n) + np.bincount(other, shown[one], n)) / held)

    def spread(self, found: BoolArray) -> BoolArray:
        """What lies within `REACH_M` of what was found, and that itself, shape (n,)."""
        reached = found.copy()
        one, other = self.neighbours.T
        reached[one[found[other]]] = True
        reached[other[found[one]]] = True
        return reached

    def mean(self, values: Array | BoolArray) -> Array:
        """Mean over each patch of values of its samples, shape (n,) or (n, d)."""
        columns = values.reshape(len(values), -1)
        sums = [np.bincount(self.patch, column, self.count) for column in columns.T.astype(np.float64)]
        return (np.stack(sums, axis=1) / self.samples[:, None]).reshape(self.count, *values.shape[1:])


def patches_of(
    surface: TriangleSurface, bed_z_m: float | None = None, count: int = PATCHES, per_patch: int = SAMPLES_PER_PATCH
) -> SurfacePatches:
    """Cut the part of a surface that counts in evaluations into patches of about the same area.

    - `surface`: in the world: a target's mesh where it is believed to be, or a model's.
    - `bed_z_m`: depth of the bed; what stands less than `CLEARANCE_M` above it does not count. None: all counts.
    - `count`, `per_patch`: patches, and samples of each in the mean; where the surface lies patchily there are somewhat
      fewer.

    Raises InputError if nothing of it counts, or `count` or `per_patch` is below 1.
    """
    if count < 1 or per_patch < 1:
        raise InputError(f"coverage: {count} patches of {per_patch} samples, both must be at least 1")
    rng = np.random.default_rng(SEED)
    corners = np.asarray(surface.vertices_m, dtype=np.float64)[np.asarray(surface.faces)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(cross, axis=1)
    counts = 1.0 if bed_z_m is None else corners[:, :, 2].mean(axis=1) < bed_z_m - CLEARANCE_M
    total = np.cumsum(twice_area * counts)
    if len(corners) == 0 or not total[-1] > 0.0:
        raise InputError(
            f"coverage: nothing of the target is {CLEARANCE_M:g} m or more above the bed, nothing to photograph"
        )
    n = count * per_patch
    face = np.searchsorted(total, (np.arange(n) + rng.random(n)) / n * total[-1], side="right").clip(max=len(total) - 1)
    root, v = np.sqrt(rng.random(n)), rng.random(n)
    a, b, c = corners[face].transpose(1, 0, 2)
    points = a + (b - a) * (root * (1.0 - v))[:, None] + (c - a) * (root * v)[:, None]
    normals = cross[face] / twice_area[face, None]
    shield, off_m = _shield(np.asarray(surface.vertices_m), np.asarray(surface.faces))
    return SurfacePatches(
        points_W_m=points,
        normals=normals,
        patch=clustered(points, normals, count, rng),
        area_m2=0.5 * float(total[-1]),
        shield_W_m=shield,
        shield_off_m=off_m,
    )


def clustered(points: Array, normals: Array, count: int, rng: np.random.Generator) -> IntArray:
    """Patch of each sample, shape (n,): neighbours in place and facing, by Lloyd's iteration from a random few."""
    reach = 0.5 * float(np.linalg.norm(np.ptp(points, axis=0)))
    places = np.concatenate([points, NORMAL_SHARE * max(reach, 1e-12) * normals], axis=1)
    middles = places[rng.choice(len(places), size=min(count, len(places)), replace=False)]
    for _ in range(ROUNDS):
        nearest = np.asarray(KDTree(middles).query(places)[1], dtype=np.int64)
        held = np.bincount(nearest, minlength=len(middles))
        sums = np.stack([np.bincount(nearest, column, len(middles)) for column in places.T], axis=1)
        middles = sums[held > 0] / held[held > 0, None]
    nearest = np.asarray(KDTree(middles).query(places)[1], dtype=np.int64)
    return np.asarray(np.unique(nearest, return_inverse=True)[1], dtype=np.int64).reshape(-1)


def _shield(vertices: Array, faces: IntArray) -> tuple[Array, float]:
    """Triangles that hide, shape (m, 3, 3), and how far they may lie off: vertices gathered in the cells of a grid."""
    cell = float(np.ptp(vertices, axis=0).max()) / SHIELD_CELLS
    keys = np.floor((vertices - vertices.min(axis=0)) / max(cell, 1e-12)).astype(np.int64)
    _, member, held = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    member = member.reshape(-1)
    middles = np.stack([np.bincount(member, column, len(held)) for column in vertices.T], axis=1) / held[:, None]
    # Faces of a coarse mesh keep their corners; of a fine one those within one cell fall together.
    coarse = np.sort(member[faces], axis=1)
    whole = (coarse[:, 0] != coarse[:, 1]) & (coarse[:, 1] != coarse[:, 2])
    off_m = float(np.linalg.norm(vertices - middles[member], axis=1).max())
    return middles[np.unique(coarse[whole], axis=0)], off_m


GRID = 224
"""Cells of the depth picture over the longer side of the target's box in the photograph."""
LEAST_AHEAD = 0.05
"""What is nearer than this share of the distance to the samples' middle is taken for nothing: no target is there."""


class CameraIntrinsics(Protocol):
    """What is asked of a camera: the size of its picture, and pixels per unit of slope in water in its middle.

    Distortion is left out: it moves the picture's edge by a few pixels, where `VisibilityCriteria.margin` is kept
    anyway.
    """

    @property
    def width(self) -> int:
        """Image width, px."""
        ...

    @property
    def height(self) -> int:
        """Image height, px."""
        ...

    @property
    def focal_px(self) -> float:
        """Pixels per unit of slope in water, in the middle of the image."""
        ...


@dataclass(frozen=True, kw_only=True)
class VisibilityCriteria:
    """What a place on the surface needs to be in the model."""

    # Largest angle between its normal and the way to a camera that counts.
    incidence_rad: float = math.radians(80.0)
    # A pair at an angle a counts where both show the place with a quality (`view_quality`) of at least this times
    # 1 - cos a: the farther apart two cameras are, the more of a place's surroundings only one of them sees, and stereo
    # fails. Chosen on twelve scans (docs/research-log/0097). 0: not asked.
    support: float = 4.0
    # Largest footprint of a pixel: models are held to 3 mm, and a difference of a pixel and a half is what stereo tells
    # apart with some certainty.
    pixel_m: float = 0.002
    # Least and largest angle between the ways to two cameras from which depth comes: what our stereo pairs photographs
    # by. COLMAP's patch-match asks for the same 3 degrees (`filter_min_triangulation_angle`).
    apart_rad: tuple[float, float] = (math.radians(3.0), math.radians(35.0))
    margin: float = 0.01  # share of the picture's width at its edges in which nothing counts
    grid: int = GRID  # cells of the depth picture; fewer are quicker, and enough where samples are far apart
    sharp: float = 0.5  # least sharpness of a photograph that counts, as a share of the sharpest photographs' so far

    def __post_init__(self) -> None:
        low, high = self.apart_rad
        right = 0.0 < self.incidence_rad < 0.5 * math.pi and self.pixel_m > 0.0 and 0.0 < low < high < math.pi
        if not (right and 0.0 <= self.support < math.inf):
            raise InputError(
                f"coverage: incidence {self.incidence_rad:g} rad, pixel {self.pixel_m:g} m, apart {self.apart_rad} "
                f"rad, support {self.support:g}; allowed 0 to pi/2, above 0, two rising angles below pi, 0 or more"
            )


def well_visible(patches: SurfacePatches, X_WC: Pose, lens: CameraIntrinsics, need: VisibilityCriteria) -> BoolArray:
    """Which samples a sharp photograph shows well enough, shape (n,).

    `X_WC`: camera, as it is believed to be.
    """
    R, f = X_WC.R, float(lens.focal_px)
    ahead = float((patches.points_W_m.mean(axis=0) - X_WC.p_m) @ R[:, 2])
    numbers = np.array([f, 0.5 * lens.width, 0.5 * lens.height, need.margin * lens.width])
    limits = np.array(
        [math.cos(need.incidence_rad), f * need.pixel_m, LEAST_AHEAD * abs(ahead), 0.5 * patches.shield_off_m]
    )
    return np.asarray(
        _shown(patches.points_W_m, patches.normals, patches.shield_W_m, X_WC.p_m, R, numbers, limits, need.grid)
    )


def view_quality(
    patches: SurfacePatches, X_WC: Pose, lens: CameraIntrinsics, need: VisibilityCriteria
) -> NDArray[np.uint8]:
    """How well a sharp photograph shows each sample, shape (n,): 0 not at all, else 1 to `BEST`.

    Cosine of the angle of incidence times the share of the sample's surroundings that is shown; `BEST` of whatever is
    shown where `support` is not asked for.
    """
    shown = well_visible(patches, X_WC, lens, need)
    if need.support == 0.0:
        return np.where(shown, BEST, 0).astype(np.uint8)
    ways = X_WC.p_m - patches.points_W_m
    cosines = np.einsum("ni,ni->n", ways, patches.normals) / np.maximum(np.linalg.norm(ways, axis=1), 1e-12)
    quality = np.rint(BEST * cosines * patches.shown_about(shown))
    return np.where(shown, np.maximum(quality, 1.0), 0.0).astype(np.uint8)


@njit
def _shown(
    points: Array, normals: Array, shield: Array, centre: Array, R: Array, numbers: Array, limits: Array, grid: int
) -> BoolArray:
    """Which samples face the camera, are near, in the picture, and not behind the shield.

    `numbers`: focal length, half width, half height, margin in px. `limits`: least cosine of incidence, largest depth,
    least depth, how far the shield lies off in the mean. Depths are compared on a grid over the box of the samples that
    pass the other tests.
    """
    n = len(points)
    f, half_w, half_h, margin = numbers[0], numbers[1], numbers[2], numbers[3]
    shown = np.zeros(n, np.bool_)
    u, v, depth, slack = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
    for i in range(n):
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        facing = -(x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2])
        length = math.sqrt(x * x + y * y + z * z)
        cosine = facing / max(length, 1e-12)
        zc = R[0, 2] * x + R[1, 2] * y + R[2, 2] * z
        if not (cosine >= limits[0] and limits[2] < zc <= limits[1]):
            continue
        u[i] = f * (R[0, 0] * x + R[1, 0] * y + R[2, 0] * z) / zc
        v[i] = f * (R[0, 1] * x + R[1, 1] * y + R[2, 1] * z) / zc
        if abs(u[i]) > half_w - margin or abs(v[i]) > half_h - margin:
            continue
        shown[i] = True
        depth[i] = zc
        # Within a cell of the grid an oblique surface has as many depths as its slope makes.
        slack[i] = 1.0 + math.sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine
        left, right, top, bottom = min(left, u[i]), max(right, u[i]), min(top, v[i]), max(bottom, v[i])
    if right < left:
        return shown
    step = max(right - left, bottom - top, 1e-9) / (grid - 1)
    near = _nearest(shield, centre, R, f, limits[2], left, top, step, grid)
    for i in range(n):
        if shown[i]:
            column, row = int((u[i] - left) / step + 0.5), int((v[i] - top) / step + 0.5)
            inverse = near[row, column]
            if inverse > 0.0 and 1.0 / inverse < depth[i] - slack[i] * (1.5 * step * depth[i] / f + limits[3]):
                shown[i] = False
    return shown


@njit
def _nearest(
    shield: Array, centre: Array, R: Array, f: float, least: float, left: float, top: float, step: float, grid: int
) -> Array:
    """Inverse depth of the nearest triangle at each cell's middle, shape (grid, grid), 0 where there is none.

    Inverse depth is a linear function of the place in a picture, so that it needs no division within a triangle.
    """
    near = np.zeros((grid, grid))
    a, b, w = np.empty(3), np.empty(3), np.empty(3)
    for t in range(len(shield)):
        behind = False
        for k in range(3):
            x, y, z = shield[t, k, 0] - centre[0], shield[t, k, 1] - centre[1], shield[t, k, 2] - centre[2]
            zc = R[0, 2] * x + R[1, 2] * y + R[2, 2] * z
            if zc <= least:
                behind = True
                break
            w[k] = 1.0 / zc
            a[k] = (f * (R[0, 0] * x + R[1, 0] * y + R[2, 0] * z) * w[k] - left) / step
            b[k] = (f * (R[0, 1] * x + R[1, 1] * y + R[2, 1] * z) * w[k] - top) / step
        if behind:
            continue
        twice = (a[1] - a[0]) * (b[2] - b[0]) - (a[2] - a[0]) * (b[1] - b[0])
        if abs(twice) < 1e-12:
            continue
        first, last = max(math.ceil(min(b[0], b[1], b[2])), 0), min(int(max(b[0], b[1], b[2])), grid - 1)
        start, stop = max(math.ceil(min(a[0], a[1], a[2])), 0), min(int(max(a[0], a[1], a[2])), grid - 1)
        for row in range(first, last + 1):
            for column in range(start, stop + 1):
                one = ((a[1] - column) * (b[2] - row) - (a[2] - column) * (b[1] - row)) / twice
                two = ((a[2] - column) * (b[0] - row) - (a[0] - column) * (b[2] - row)) / twice
                if one >= 0.0 and two >= 0.0 and one + two <= 1.0:
                    inverse = one * w[0] + two * w[1] + (1.0 - one - two) * w[2]
                    near[row, column] = max(near[row, column], inverse)
    return near
