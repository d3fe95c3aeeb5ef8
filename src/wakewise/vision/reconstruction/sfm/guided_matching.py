"""Guided matching: photos with roughly known poses are matched along epipolar lines.

A pose error of 5 mm and 5 mrad moves an epipolar line by about 15 mrad at half a metre, so a band about the line holds
the partner and a tenth of the features. Matches are verified by refining the relative pose to the least Sampson
distance (R. Hartley and A. Zisserman, Multiple View Geometry, 2nd ed., Cambridge 2004, section 11.4.3), from the known
pose on. A pair that does not verify is matched without poses.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.geometry import matrix_from_quat, quat_from_rotvec, skew
from wakewise.core.interfaces import Progress
from wakewise.core.jit.njit import njit
from wakewise.core.threads import in_order
from wakewise.vision.reconstruction.sfm.colmap import open_database, pycolmap
from wakewise.vision.reconstruction.sfm.pairs import Pairs

BAND_RAD = 0.04
"""Half width of the band about an epipolar line, in units of depth: room for poses off by 6 mm at 0.5 m, or 5 mrad."""
CELL = 0.05
"""Side of the cells that features are sorted into, in units of depth."""
RATIO, MAX_ANGLE_RAD = 0.7, 0.7
"""Lowe's ratio, and the largest angle between descriptors as COLMAP has it. In a band there are fewer rivals, so the
ratio is lower than COLMAP's 0.8: with that, cameras came out a third less precise."""
SCALE = 512.0
"""Length of a stored descriptor: square roots of shares, 512 times."""
VERIFIED_PX, MIN_VERIFIED, MIN_SHARE = 4.0, 15, 0.7
"""Largest Sampson distance of a verified match; how many a pair must have, and what share of its matches."""
MAX_TURN_RAD = 0.06
"""Between the known turn of a pair and the one that its matches fit."""
MOST_STEPS, SMALL_STEP = 8, 1e-5
MOST_BYTES = 5e8
"""Of all photos' descriptors, which are held in memory."""
Poses = dict[str, tuple[Array, Array]]
"""R_WC, shape (3, 3), and p_WC_m, shape (3,), by photo name."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoFeatures:
    """Features of a photo: `xy` (n, 2) on the plane at unit depth, distortion undone; `descriptors` (n, 128)."""

    xy: Array
    descriptors: NDArray[np.uint8]

    def __post_init__(self) -> None:
        freeze(self, xy=(None, 2))


@dataclass(frozen=True, kw_only=True, eq=False)
class RelativePose:
    """Camera 2 from camera 1: x_2 = R_21 x_1 + s t_2 with an unknown length s; t_2 is a unit vector."""

    R_21: Array
    t_2: Array

    def __post_init__(self) -> None:
        freeze(self, R_21=(3, 3), t_2=(3,))

    @property
    def essential(self) -> Array:
        """E, shape (3, 3): x_2' E x_1 = 0."""
        return skew(self.t_2) @ self.R_21

    @classmethod
    def between(cls, R_WC1: Array, p_WC1_m: Array, R_WC2: Array, p_WC2_m: Array) -> RelativePose | None:
        """From two poses; None where both cameras are in one place."""
        t = R_WC2.T @ (p_WC1_m - p_WC2_m)
        length = float(np.linalg.norm(t))
        return cls(R_21=R_WC2.T @ R_WC1, t_2=t / length) if length > 1e-9 else None


def match_by_poses(
    database: Path, pairs: Pairs, poses: Poses, threads: int, progress: Progress, most_bytes: float = MOST_BYTES
) -> Pairs:
    """Match pairs along epipolar lines and write those that verify into COLMAP's database; return the others.

    `poses`: R_WC, shape (3, 3), and p_WC_m, shape (3,), by photo name; a pair without both is returned. `most_bytes`:
    of descriptors in memory; where there are more, all pairs are returned.
    """
    with open_database(database) as link:
        images = {image.name: image for image in link.read_all_images() if image.name in poses}
        cameras = {camera.camera_id: camera for camera in link.read_all_cameras()}
        if 128.0 * link.num_descriptors() > most_bytes:
            return pairs
        read = {name: _rays_of_features(link, image, cameras[image.camera_id]) for name, image in images.items()}
    features = {name: rays for name, rays in read.items() if rays is not None}
    focal = {name: cameras[image.camera_id].mean_focal_length() for name, image in images.items()}

    def one(pair: tuple[str, str]) -> tuple[IntArray, RelativePose] | None:
        if pair[0] not in features or pair[1] not in features:
            return None
        a, b = (features[name] for name in pair)
        pose = RelativePose.between(*poses[pair[0]], *poses[pair[1]])
        if pose is None:
            return None
        matches = match_pair(a, b, pose)
        fitted, right = verify(a.xy[matches[:, 0]], b.xy[matches[:, 1]], pose, max(focal[name] for name in pair))
        return (matches[right], fitted) if pose_supported(right, pose, fitted) else None

    found = []
    for done, result in enumerate(in_order(one, pairs, threads)):
        progress(done, len(pairs), "matches along epipolar lines")
        found.append(result)
    with open_database(database) as link:
        for pair, result in zip(pairs, found, strict=True):
            if result is not None:
                _write(link, images[pair[0]].image_id, images[pair[1]].image_id, *result)
    return [pair for pair, result in zip(pairs, found, strict=True) if result is None]


def _rays_of_features(link: pycolmap.Database, image: pycolmap.Image, camera: pycolmap.Camera) -> PhotoFeatures | None:
    """Features of a photo as rays; None where the lens has no ray for one of them."""
    places = np.asarray(link.read_keypoints(image.image_id), dtype=np.float64)[:, :2].reshape(-1, 2)
    xy = np.asarray(camera.cam_from_img(places)).reshape(-1, 2)
    if not np.isfinite(xy).all():
        return None
    return PhotoFeatures(
        xy=xy,
        descriptors=np.asarray(link.read_descriptors(image.image_id).data, dtype=np.uint8).reshape(-1, 128),
    )


def _write(link: pycolmap.Database, one: int, two: int, matches: IntArray, pose: RelativePose) -> None:
    rows = matches.astype(np.uint32)
    geometry = pycolmap.TwoViewGeometry()
    geometry.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
    geometry.E = pose.essential
    geometry.inlier_matches = rows
    link.write_matches(one, two, rows)
    link.write_two_view_geometry(one, two, geometry)


def match_pair(first: PhotoFeatures, second: PhotoFeatures, pose: RelativePose) -> IntArray:
    """Rows of features that are each other's nearest along the epipolar lines, clearly so; shape (k, 2)."""
    E = pose.essential
    if len(first.xy) == 0 or len(second.xy) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    middle = E @ np.append(first.xy.mean(axis=0), 1.0)
    places = second.xy
    if abs(middle[0]) > abs(middle[1]):
        # Lines go up rather than across: with x and y exchanged they go across.
        E, places = E[[1, 0, 2]], places[:, ::-1]
    low = places.min(axis=0)
    cell = np.floor((places - low) / CELL).astype(np.int64)
    across, down = cell.max(axis=0) + 1
    key = cell[:, 0] * down + cell[:, 1]
    order = np.argsort(key, kind="stable")
    begins = np.searchsorted(key[order], np.arange(across * down + 1)).astype(np.int64)
    pairs = _match_band(
        first.descriptors.astype(np.float32),
        np.array(first.xy),
        second.descriptors[order].astype(np.float32),
        np.ascontiguousarray(places[order]),
        begins,
        int(down),
        low,
        np.ascontiguousarray(E),
        BAND_RAD,
    )
    pairs[:, 1] = order[pairs[:, 1]]
    return pairs


@njit(nogil=True, fastmath={"reassoc", "contract"})
def _dot(a: Any, b: Any) -> Any:
    """Product of two descriptors: whole numbers below 2^24, so single precision is exact in any order."""
    total = np.float32(0.0)
    for k in range(a.shape[0]):
        total += a[k] * b[k]
    return total


@njit(nogil=True)
def _match_band(
    own: Any, own_xy: Any, others: Any, others_xy: Any, begins: Any, down: int, low: Any, E: Any, band: float
) -> Any:
    """Mutual nearest neighbours along epipolar lines.

    `others` are sorted by cell, strip by strip of `down` cells each; those of cell c begin at `begins[c]`.
    """
    n, m = own.shape[0], others.shape[0]
    strips = (begins.shape[0] - 1) // down
    best, second, nearest = np.zeros(n, np.float32), np.zeros(n, np.float32), np.full(n, -1, np.int64)
    best_back, second_back = np.zeros(m, np.float32), np.zeros(m, np.float32)
    nearest_back = np.full(m, -1, np.int64)
    top, bottom = low[1], low[1] + down * CELL
    for i in range(n):
        x, y = own_xy[i, 0], own_xy[i, 1]
        a = E[0, 0] * x + E[0, 1] * y + E[0, 2]
        b = E[1, 0] * x + E[1, 1] * y + E[1, 2]
        c = E[2, 0] * x + E[2, 1] * y + E[2, 2]
        reach = band * np.sqrt(a * a + b * b)
        per_b = 1.0 / b if abs(b) > 1e-12 else 1e12
        up = abs(reach * per_b)
        for strip in range(strips):
            left = low[0] + strip * CELL
            one, two = -(a * left + c) * per_b, -(a * (left + CELL) + c) * per_b
            begin, end = max(min(one, two) - up, top), min(max(one, two) + up, bottom)
            if begin > end:
                continue
            first_cell = strip * down + min(int((begin - top) / CELL), down - 1)
            last_cell = strip * down + min(int((end - top) / CELL), down - 1)
            for j in range(begins[first_cell], begins[last_cell + 1]):
                if abs(a * others_xy[j, 0] + b * others_xy[j, 1] + c) > reach:
                    continue
                likeness = _dot(own[i], others[j])
                if likeness > second[i]:
                    if likeness > best[i]:
                        second[i], best[i], nearest[i] = best[i], likeness, j
                    else:
                        second[i] = likeness
                if likeness > second_back[j]:
                    if likeness > best_back[j]:
                        second_back[j], best_back[j], nearest_back[j] = best_back[j], likeness, i
                    else:
                        second_back[j] = likeness
    pairs = np.empty((n, 2), np.int64)
    count = 0
    per_length = 1.0 / (SCALE * SCALE)
    for i in range(n):
        j = nearest[i]
        if j < 0 or nearest_back[j] != i:
            continue
        angle = np.arccos(min(best[i] * per_length, 1.0))
        rival = np.arccos(min(max(second[i], second_back[j]) * per_length, 1.0))
        if angle <= MAX_ANGLE_RAD and angle < RATIO * rival:
            pairs[count, 0], pairs[count, 1] = i, j
            count += 1
    return pairs[:count]


def verify(first_xy: Array, second_xy: Array, pose: RelativePose, focal_px: float) -> tuple[RelativePose, BoolArray]:
    """The relative pose that matches fit best, from a rough one on, and which lie within 4 px of it.

    Gauss-Newton over three turns and two directions of the baseline; weights of Geman and McClure keep wrong matches
    from pulling (P. W. Holland and R. E. Welsch, Communications in Statistics A6(9), 1977, doi
    10.1080/03610927708827533, on reweighted least squares).

    `first_xy`, `second_xy`, shape (n, 2): on the planes at unit depth.
    """
    n = len(first_xy)
    if n < MIN_VERIFIED:
        return pose, np.zeros(n, dtype=np.bool_)
    one, two = (np.concatenate([xy, np.ones((n, 1))], axis=1) for xy in (first_xy, second_xy))
    products = (two[:, :, None] * one[:, None, :]).reshape(n, 9)
    R, t = np.array(pose.R_21), np.array(pose.t_2)
    generators = [skew(axis) for axis in np.eye(3)]
    for _ in range(MOST_STEPS):
        error, per_px = _sampson(skew(t) @ R, one, two, products, focal_px)
        side = np.cross(t, np.eye(3)[np.argmin(np.abs(t))])
        side /= np.linalg.norm(side)
        other = np.cross(t, side)
        slopes = [(skew(t) @ G @ R).ravel() for G in generators] + [(skew(s) @ R).ravel() for s in (side, other)]
        J = (products @ np.stack(slopes, axis=1)) * per_px[:, None]
        spread = max(2.0 * 1.4826 * float(np.median(np.abs(error))), 1.0)
        weighted = J / (1.0 + (error / spread) ** 2)[:, None] ** 2
        step = np.linalg.solve(weighted.T @ J + 1e-9 * np.eye(5), -weighted.T @ error)
        R = matrix_from_quat(quat_from_rotvec(step[:3])) @ R
        t = t + step[3] * side + step[4] * other
        t = t / np.linalg.norm(t)
        if float(np.abs(step).max()) < SMALL_STEP:
            break
    error, _ = _sampson(skew(t) @ R, one, two, products, focal_px)
    return RelativePose(R_21=R, t_2=t), np.asarray(np.abs(error) < VERIFIED_PX)


def _sampson(E: Array, one: Array, two: Array, products: Array, focal_px: float) -> tuple[Array, Array]:
    """Signed Sampson distances in pixels, shape (n,), and what one unit of the epipolar product is worth in them."""
    a, b = one @ E[:2].T, two @ E[:, :2]
    per_px = focal_px / np.sqrt(np.maximum((a**2).sum(axis=1) + (b**2).sum(axis=1), 1e-24))
    return (products @ E.ravel()) * per_px, per_px


def pose_supported(inliers: BoolArray, known: RelativePose, fitted: RelativePose) -> bool:
    """Whether a pair's matches support its pose: enough inliers, a large share, and a rotation near the known one."""
    turn_rad = np.arccos(np.clip(0.5 * (np.trace(fitted.R_21 @ known.R_21.T) - 1.0), -1.0, 1.0))
    return bool(inliers.sum() >= MIN_VERIFIED and inliers.mean() >= MIN_SHARE and turn_rad <= MAX_TURN_RAD)
