"""Accuracy and completeness of a cloud against depth maps of surveyed cameras, such as a rendered laser scan."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.core.size_limits import check_arrays
from wakewise.vision.evaluation.cloud_to_surface import voxel_downsample

THRESHOLDS_MM = (5, 10, 20, 50)


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthView:
    """Depth along the optical axis in m on a regular grid over a photograph, 0 where unknown, shape (h, w).

    K, shape (3, 3), is the camera matrix in pixels of the grid, R_WC its rotation to the world, p_WC_m its centre.
    """

    depth_m: Array
    K: Array
    R_WC: Array
    p_WC_m: Array

    def __post_init__(self) -> None:
        freeze(self, depth_m=(None, None), K=(3, 3), R_WC=(3, 3), p_WC_m=(3,))


@dataclass(frozen=True, kw_only=True)
class DepthScore:
    """A cloud against depth maps; `DEPTH_DEFINITIONS` defines each figure."""

    accuracy_median_mm: float
    accuracy_p90_mm: float
    accuracy_rmse_mm: float
    accuracy_cap_mm: float
    compared_pct: float
    completeness_median_mm: float
    completeness_5mm_pct: float
    completeness_10mm_pct: float
    completeness_20mm_pct: float
    completeness_50mm_pct: float
    cloud_points: int
    truth_points: int
    truth_spacing_mm: float


DEPTH_DEFINITIONS: dict[str, tuple[str, str]] = {
    "accuracy_median_mm": ("mm", "median distance from a point of the model, thinned to the truth's spacing, to the "
                           "plane through the nearest true point, of points nearer than accuracy_cap_mm to one"),
    "accuracy_p90_mm": ("mm", "90th percentile of the same"),
    "accuracy_rmse_mm": ("mm", "root mean square of the same"),
    "accuracy_cap_mm": ("mm", "points farther than this from any true point are not compared: the truth has holes"),
    "compared_pct": ("%", "share of the model's points that are compared"),
    "completeness_median_mm": ("mm", "median distance from a true point to the nearest point of the model"),
    **{f"completeness_{t}mm_pct": ("%", f"share of true points with a point of the model within {t} mm")
       for t in THRESHOLDS_MM},
    "cloud_points": ("", "points of the model after thinning"),
    "truth_points": ("", "true points, from all depth maps, thinned"),
    "truth_spacing_mm": ("mm", "distance of neighbouring true points, median"),
}  # fmt: skip


def read_depth_views(depths: Path, cameras: Path) -> list[DepthView]:
    """Depth maps of an .npz file and the cameras of a folder, in order of name.

    `depths`: holds `depth`, shape (n, h, w), m along the optical axis, 0 where unknown: the middle of each w/W by h/H
    block. `cameras`: folder of n `.camera` files (C. Strecha et al., CVPR 2008, doi 10.1109/CVPR.2008.4587706). Raises
    InputError if a file is missing or does not hold this.
    """
    if not depths.is_file():
        raise InputError(f"{depths}: does not exist; an .npz file with an array depth (n, h, w) is needed")
    files = sorted(cameras.glob("*.camera")) if cameras.is_dir() else []
    shape = check_arrays(depths).get("depth")
    if shape is None:
        raise InputError(f"{depths}: is no .npz file with an array depth (n, h, w)")
    if len(shape) != 3 or shape[0] != len(files) or len(files) == 0:
        raise InputError(f"{depths}: depth has shape {shape}, {cameras} holds {len(files)} .camera files")
    try:
        with np.load(depths) as file:
            stack = np.asarray(file["depth"], dtype=np.float64)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        raise InputError(f"{depths}: is no .npz file with an array depth (n, h, w)") from None
    return [_view(depth, path) for depth, path in zip(stack, files, strict=True)]


def _view(depth_m: Array, path: Path) -> DepthView:
    try:
        rows = [
            [float(w) for w in line.split()] for line in path.read_text(encoding="utf-8").splitlines() if line.strip()
        ]
        K, R_WC, centre, (width, height) = np.array(rows[:3]), np.array(rows[4:7]), np.array(rows[7]), rows[8]
    except (ValueError, IndexError, UnicodeDecodeError):
        raise InputError(f"{path}: is no .camera file (K, zeros, R, centre, image size)") from None
    rows_, columns = depth_m.shape
    # Pixel j of the grid is the middle of its block.
    shrink = np.array([[columns / width, 0, -0.5], [0, rows_ / height, -0.5], [0, 0, 1]])
    return DepthView(depth_m=np.where(np.isfinite(depth_m), depth_m, 0.0), K=shrink @ K, R_WC=R_WC, p_WC_m=centre)


def true_points(view: DepthView) -> tuple[Array, Array]:
    """Points, shape (n, 3), in the world and unit normals, of pixels whose neighbours are on the same surface."""
    z = view.depth_m
    v, u = np.indices(z.shape, dtype=np.float64)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(view.K).T @ view.R_WC.T
    points = rays * z[..., None] + view.p_WC_m
    right, down = points[1:-1, 2:] - points[1:-1, :-2], points[2:, 1:-1] - points[:-2, 1:-1]
    normals = np.cross(right, down)
    length = np.linalg.norm(normals, axis=-1)
    middle = z[1:-1, 1:-1]
    around = (z[1:-1, 2:], z[1:-1, :-2], z[2:, 1:-1], z[:-2, 1:-1])
    # Across an edge the depth jumps by more than 2 %: no plane there.
    good = (middle > 0) & (length > 0)
    for other in around:
        good &= (other > 0) & (np.abs(other - middle) < 0.02 * middle)
    return points[1:-1, 1:-1][good], (normals[good] / length[good][:, None])


def compare_depths(cloud_W_m: Array, views: list[DepthView], cap_m: float = 0.1) -> DepthScore:
    """Score a cloud in the cameras' frame against depth maps.

    `cloud_W_m` has shape (n, 3). `cap_m`: points farther than this from any true point are not compared. Raises
    InputError if the depth maps hold no surface; StageError if nothing of the cloud is near it.
    """
    parts = [true_points(view) for view in views]
    points, normals = (np.concatenate(column) for column in zip(*parts, strict=True))
    if len(points) < 100:
        raise InputError(f"depth maps: hold {len(points)} points on surfaces, at least 100 are needed")
    rng = np.random.default_rng(0)
    some = rng.choice(len(points), size=min(len(points), 2000), replace=False)
    steps = [np.linalg.norm(np.diff(part[0], axis=0), axis=1) for part in parts if len(part[0]) > 1]
    spacing = float(np.median(np.concatenate(steps)))
    pick = rng.choice(len(points), size=min(len(points), 400_000), replace=False)
    truth, tree = points[pick], KDTree(points[pick])
    even = voxel_downsample(cloud_W_m, spacing)
    distance, nearest = (np.asarray(found) for found in tree.query(even, distance_upper_bound=cap_m))
    near = np.isfinite(distance)
    if near.sum() < 100:
        far = float(np.median(np.linalg.norm(even.mean(axis=0) - points[some], axis=1)))
        raise StageError(
            f"model: {near.sum()} of its {len(even)} points lie within {cap_m * 1e3:g} mm of the true surface, "
            f"which is {far:.3g} m from its middle; is it in the cameras' frame and in metres?"
        )
    rows = pick[nearest[near]]
    offset_mm = 1e3 * np.abs(np.einsum("ij,ij->i", even[near] - points[rows], normals[rows]))
    gap_mm = 1e3 * np.asarray(KDTree(even).query(truth)[0])
    shares = {f"completeness_{t}mm_pct": 100.0 * float((gap_mm < t).mean()) for t in THRESHOLDS_MM}
    return DepthScore(
        accuracy_median_mm=float(np.median(offset_mm)),
        accuracy_p90_mm=float(np.percentile(offset_mm, 90)),
        accuracy_rmse_mm=float(np.sqrt((offset_mm**2).mean())),
        accuracy_cap_mm=1e3 * cap_m,
        compared_pct=100.0 * float(near.mean()),
        completeness_median_mm=float(np.median(gap_mm)),
        cloud_points=len(even),
        truth_points=len(truth),
        truth_spacing_mm=1e3 * spacing,
        **shares,
    )
