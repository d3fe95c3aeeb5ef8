"""What of a surface a photograph shows well enough to be reconstructed: in the picture, near, square on, not hidden."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.jit.njit import njit
from wakewise.scene.missions.surface_patches import SurfacePatches

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
    """What a place on the surface needs to be in the model.

    Parameters
    ----------
    incidence_rad : float
        Largest angle between its normal and the way to a camera that counts. PMVS takes 60 degrees (Y. Furukawa and
        J. Ponce, TPAMI 32(8), 2010, doi 10.1109/TPAMI.2009.161), evaluations call visible what is seen at less than 78;
        of 60, 70 and 78 this one was nearest to what our dense stage made of one coral (docs/research-log/0046).
    pixel_m : float
        Largest footprint of a pixel: models are held to 3 mm, and a difference of a pixel and a half is what stereo
        tells apart with some certainty.
    apart_rad : tuple of float
        Least and largest angle between the ways to two cameras from which depth comes: what our stereo pairs
        photographs by. COLMAP's patch-match asks for the same 3 degrees (`filter_min_triangulation_angle`).
    margin : float
        Share of the picture's width at its edges in which nothing counts.
    sharp : float
        Least sharpness of a photograph that counts, as a share of the sharpest photographs' so far.
    """

    incidence_rad: float = math.radians(70.0)
    pixel_m: float = 0.002
    apart_rad: tuple[float, float] = (math.radians(3.0), math.radians(35.0))
    margin: float = 0.01
    sharp: float = 0.5

    def __post_init__(self) -> None:
        low, high = self.apart_rad
        if not (0.0 < self.incidence_rad < 0.5 * math.pi and self.pixel_m > 0.0 and 0.0 < low < high < math.pi):
            raise InputError(
                f"coverage: incidence {self.incidence_rad:g} rad, pixel {self.pixel_m:g} m, apart {self.apart_rad} "
                "rad; allowed 0 to pi/2, above 0, and two rising angles below pi"
            )


def well_visible(patches: SurfacePatches, X_WC: Pose, lens: CameraIntrinsics, need: VisibilityCriteria) -> BoolArray:
    """Which samples a sharp photograph shows well enough, shape (n,).

    Parameters
    ----------
    patches : SurfacePatches
    X_WC : Pose
        Camera, as it is believed to be.
    lens : CameraIntrinsics
    need : VisibilityCriteria
    """
    R, f = X_WC.R, float(lens.focal_px)
    ahead = float((patches.points_W_m.mean(axis=0) - X_WC.p_m) @ R[:, 2])
    numbers = np.array([f, 0.5 * lens.width, 0.5 * lens.height, need.margin * lens.width])
    limits = np.array(
        [math.cos(need.incidence_rad), f * need.pixel_m, LEAST_AHEAD * abs(ahead), 0.5 * patches.shield_off_m]
    )
    return np.asarray(
        _shown(patches.points_W_m, patches.normals, patches.shield_W_m, X_WC.p_m, R, numbers, limits, GRID)
    )


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
