"""Registered photos for the dense stages: intrinsics, pose, depth range, region, and stereo partners."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import StageError
from wakewise.vision.reconstruction.photos.lenses import distort, lens_of, undistort
from wakewise.vision.reconstruction.sfm.colmap import pycolmap

# Best angle between two views for stereo: less is imprecise, more changes the appearance. Measured on corals; a flat
# wall allows more.
BEST_ANGLE_DEG, ANGLE_SPREAD_DEG = 13.0, 8.0
ANGLES_DEG = (3.0, 35.0)
MIN_SHARED = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class RegionOfInterest:
    """A region of interest in the model's frame."""

    centre_W_m: Array
    radius_m: float

    def __post_init__(self) -> None:
        freeze(self, centre_W_m=(3,))


@dataclass(frozen=True, kw_only=True, eq=False)
class RegisteredPhoto:
    """One registered photo. R_CW and p_WC_m place the camera; depth limits in m hold for what it should see.

    Of OpenCV's lens, `focal_px` is fx and `stretch` fy / fx; `radial` is k1 and `bend` the rest: k2, p1, p2, or of a
    fisheye k2, k3, k4.
    """

    name: str
    width: int
    height: int
    focal_px: float
    centre_px: Array
    radial: float
    R_CW: Array
    p_WC_m: Array
    near_m: float
    far_m: float
    focus_W_m: Array
    seen: IntArray
    stretch: float = 1.0
    bend: Array = field(default_factory=lambda: np.zeros(3))
    fisheye: bool = False

    def __post_init__(self) -> None:
        freeze(self, centre_px=(2,), R_CW=(3, 3), p_WC_m=(3,), focus_W_m=(3,), bend=(3,))

    def depth_of(self, points_W_m: Array) -> Array:
        """Distance along the optical axis, shape (n,)."""
        return np.asarray((np.asarray(points_W_m) - self.p_WC_m) @ self.R_CW[2])

    @property
    def focals_px(self) -> Array:
        """Focal lengths across and down, shape (2,)."""
        return self.focal_px * np.array([1.0, self.stretch])

    def project(self, points_W_m: Array) -> tuple[Array, Array]:
        """Pixels, shape (n, 2), and depths, shape (n,), of points, shape (n, 3); pixels hold where the depth is > 0."""
        points = (np.asarray(points_W_m) - self.p_WC_m) @ self.R_CW.T
        xy = points[:, :2] / np.maximum(points[:, 2:], 1e-9)
        images = distort(xy, np.append(self.radial, self.bend), fisheye=self.fisheye)
        return self.focals_px * images + self.centre_px, points[:, 2]

    def rays(self, pixels: Array) -> Array:
        """Directions with unit z in the camera frame, shape (n, 3), of pixels, shape (n, 2), distortion undone."""
        images = (np.asarray(pixels) - self.centre_px) / self.focals_px
        xy = undistort(images, np.append(self.radial, self.bend), fisheye=self.fisheye)
        return np.concatenate([xy, np.ones((len(xy), 1))], axis=1)


def camera_centres(sparse: Path) -> dict[str, Array]:
    """Where each registered photo of a sparse model was taken from, by its name, shape (3,) in the model's frame."""
    images = pycolmap.Reconstruction(sparse).images.values()
    return {one.name: np.asarray(one.projection_center()) for one in images if one.has_pose}


def read_views(sparse: Path, region: RegionOfInterest | None) -> tuple[tuple[RegisteredPhoto, ...], Array]:
    """Registered photos of a sparse model, in order of name, and the sparse points, shape (n, 3).

    Depth limits come from the region, or from the 1st and 99th percentile of what each photo sees of the sparse points,
    widened by a quarter.
    """
    model = pycolmap.Reconstruction(sparse)
    ids = sorted(model.points3D.keys())
    row_of = {point_id: row for row, point_id in enumerate(ids)}
    points = np.array([model.points3D[i].xyz for i in ids]).reshape(-1, 3)
    views = []
    for image in sorted(model.images.values(), key=lambda one: one.name):
        if not image.has_pose:
            continue
        seen = np.array(sorted({row_of[p.point3D_id] for p in image.points2D if p.has_point3D()}), dtype=np.int64)
        pose = image.cam_from_world().matrix()
        R, centre = pose[:, :3], np.asarray(image.projection_center())
        if region is not None:
            middle = float(R[2] @ (region.centre_W_m - centre))
            near, far = max(middle - 1.2 * region.radius_m, 0.2 * middle), middle + 1.2 * region.radius_m
            focus = region.centre_W_m
            if middle <= 0.0:
                continue
        else:
            if len(seen) < MIN_SHARED:
                continue
            depth = (points[seen] - centre) @ R[2]
            near, far = 0.8 * float(np.percentile(depth, 1)), 1.25 * float(np.percentile(depth, 99))
            focus = np.median(points[seen], axis=0)
            if near <= 0.0:
                continue
        lens = lens_of(image.camera)
        fx, fy, cx, cy, k1, *bend = lens.params
        views.append(
            RegisteredPhoto(
                name=image.name,
                width=lens.width,
                height=lens.height,
                focal_px=float(fx),
                centre_px=np.array([cx, cy]),
                radial=float(k1),
                R_CW=R,
                p_WC_m=centre,
                near_m=near,
                far_m=far,
                focus_W_m=focus,
                seen=seen,
                stretch=float(fy / fx),
                bend=np.array(bend),
                fisheye=lens.fisheye,
            )
        )
    if len(views) < 2:
        raise StageError(f"dense: {len(views)} registered photos see the region, at least 2 must")
    return tuple(views), points


def rank_partners(
    views: tuple[RegisteredPhoto, ...], points: Array, region: RegionOfInterest | None, most: int
) -> list[list[int]]:
    """For each view the best others for stereo, best first, at most `most`.

    Weight: how many sparse points both see (alike for all when the region is given: nearly all points lie around it),
    times how near the angle between the two lines of sight is to the best one.
    """
    out: list[list[int]] = []
    for i, view in enumerate(views):
        scored = []
        for j, other in enumerate(views):
            if i == j:
                continue
            shared = np.intersect1d(view.seen, other.seen, assume_unique=True)
            if region is not None:
                anchors, weight = region.centre_W_m[None], 1.0
            elif len(shared) >= MIN_SHARED:
                anchors, weight = points[shared], float(len(shared))
            else:
                continue
            angle = float(np.median(_angle_deg(anchors - view.p_WC_m, anchors - other.p_WC_m)))
            if ANGLES_DEG[0] <= angle <= ANGLES_DEG[1]:
                scored.append((-weight * np.exp(-(((angle - BEST_ANGLE_DEG) / ANGLE_SPREAD_DEG) ** 2)), j))
        out.append([j for _, j in sorted(scored)[:most]])
    return out


def _angle_deg(a: Array, b: Array) -> Array:
    """Angle between rows, shape (n,)."""
    cosine = np.einsum("ij,ij->i", a, b) / (np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1))
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
