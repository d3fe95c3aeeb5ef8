"""Tests of a sparse model by the photographs, independent of the observations that were cut.

The mean reprojection error after cutting is small for wrong models too. A wrong model does not agree with all verified
image pairs (Sampson distance: R. Hartley and A. Zisserman, Multiple View Geometry, 2nd ed., Cambridge 2004, section
11.4.3), does not predict observations that were left out, does not cover the photographs, or changes if each photograph
has intrinsics of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.vision.reconstruction.sfm.colmap import open_database, pycolmap

GRID = (8, 6)
"""Cells across and down that a photograph is divided into for its coverage."""
PAIR_MATCHES, PAIR_PX, PAIR_SHARE = 30, 4.0, 0.5
"""Least matches of a verified pair that counts; it agrees if this share of them lies this near their epipolar lines."""
MOST_RAYS = 12
"""Most observations of a point that its widest angle is computed from."""

LEAST_OBSERVATIONS, LEAST_COVERAGE_PCT, LEAST_ANGLE_DEG = 50.0, 10.0, 2.0
LEAST_AGREEING_PCT, MOST_HELD_OUT_PX, MOST_UNCUT_PX, MOST_CUT_PCT = 90.0, 1.5, 1.2, 30.0
LEAST_KEPT_PCT, LEAST_REGISTERED = 40.0, 0.5
"""Bounds of a sound model; the bench `traps` measures what each detects."""


@dataclass(frozen=True, kw_only=True)
class ModelEvidence:
    """Figures of a model by the photographs.

    observations_per_photo: median number of sparse points that a registered photo sees. coverage_pct: median share of
    a photo's cells with features that hold a sparse point. angle_deg: median over points of the widest angle between
    two of their rays. agreeing_pairs_pct: share of the verified pairs of registered photos whose matches lie near the
    model's epipolar lines; None where no pair has enough. held_out_px: median distance between where a point is seen
    and where it should be by its other observations alone, over tracks of three and more; None without such.
    """

    observations_per_photo: float
    coverage_pct: float
    angle_deg: float
    agreeing_pairs_pct: float | None
    held_out_px: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Observations:
    """Every observation: row of its point, row of its photo, pixel; in order of the points."""

    point: IntArray
    photo: IntArray
    xy: Array
    points_W: Array
    centres_W: Array


def evidence(model: pycolmap.Reconstruction, database: Path) -> ModelEvidence:
    """Compare a model with the photographs' features and the verified matches in the database."""
    images = sorted((image for image in model.images.values() if image.has_pose), key=lambda one: one.name)
    seen = _observations(model, images)
    count = np.bincount(seen.photo, minlength=len(images))
    return ModelEvidence(
        observations_per_photo=float(np.median(count)) if len(count) else 0.0,
        coverage_pct=_coverage_pct(images),
        angle_deg=_angle_deg(seen),
        agreeing_pairs_pct=_agreeing_pct(images, database),
        held_out_px=_held_out_px(images, seen),
    )


def quality_warnings(found: ModelEvidence, *, uncut_px: float, cut_pct: float) -> list[str]:
    """Reasons against a model, each with its figure; none for a sound one."""
    out = []
    if found.observations_per_photo < LEAST_OBSERVATIONS:
        out.append(f"a photo sees {found.observations_per_photo:.0f} points (median), {LEAST_OBSERVATIONS:g} are safe")
    if found.coverage_pct < LEAST_COVERAGE_PCT:
        out.append(
            f"points cover {found.coverage_pct:.0f} % of a photo (median), {LEAST_COVERAGE_PCT:g} % are safe: overlap "
            "is too small or the match rests on a part of the picture"
        )
    if found.angle_deg < LEAST_ANGLE_DEG:
        out.append(
            f"rays meet at {found.angle_deg:.1f} deg (median), {LEAST_ANGLE_DEG:g} are safe: the camera turned more "
            "than it moved, depths are guesses"
        )
    if found.agreeing_pairs_pct is not None and found.agreeing_pairs_pct < LEAST_AGREEING_PCT:
        out.append(
            f"{found.agreeing_pairs_pct:.0f} % of the pairs that match agree with the model, {LEAST_AGREEING_PCT:g} % "
            "must: photos of different things that look alike, or mirrored ones"
        )
    if found.held_out_px is not None and found.held_out_px > MOST_HELD_OUT_PX:
        out.append(
            f"points are {found.held_out_px:.1f} px off where other photos say, at most {MOST_HELD_OUT_PX:g} is sound"
        )
    if uncut_px > MOST_UNCUT_PX or cut_pct > MOST_CUT_PCT:
        out.append(
            f"before cutting the mean error was {uncut_px:.2f} px and {cut_pct:.0f} % of the observations had to go; "
            f"{MOST_UNCUT_PX:g} px and {MOST_CUT_PCT:g} % are sound: a lens that does not fit, or things that moved"
        )
    return out


def registration_warnings(registered: int, photos: int) -> list[str]:
    """The reason against a model that registers less than half of the photographs, if it does."""
    if registered >= LEAST_REGISTERED * photos:
        return []
    return [
        f"{registered} of {photos} photos found a place: less than half is a part at best, held together by few views"
    ]


def known_pose_warnings(found: ModelEvidence, *, error_px: float, kept_pct: float | None) -> list[str]:
    """Reasons against given, fixed cameras, by the photographs' features."""
    if kept_pct is None or (found.agreeing_pairs_pct is None and kept_pct < LEAST_KEPT_PCT):
        return ["nothing in the photos confirms the cameras that were given: hardly any features match between them"]
    out = []
    if kept_pct < LEAST_KEPT_PCT:
        out.append(
            f"{kept_pct:.0f} % of the matched features agree with the cameras that were given, {LEAST_KEPT_PCT:g} % "
            "must: another frame, other axes (right, down, ahead are meant) or another lens"
        )
    if found.agreeing_pairs_pct is not None and found.agreeing_pairs_pct < LEAST_AGREEING_PCT:
        out.append(
            f"{found.agreeing_pairs_pct:.0f} % of the pairs that match agree with the cameras that were given, "
            f"{LEAST_AGREEING_PCT:g} % must"
        )
    if error_px > MOST_UNCUT_PX:
        out.append(
            f"mean reprojection error {error_px:.2f} px at the cameras that were given, {MOST_UNCUT_PX:g} is sound"
        )
    return out


def _observations(model: pycolmap.Reconstruction, images: list[pycolmap.Image]) -> _Observations:
    row_of = {image.image_id: k for k, image in enumerate(images)}
    points = [model.points3D[number] for number in sorted(model.points3D)]
    rows = [
        (k, row_of[element.image_id], element.image_id, element.point2D_idx)
        for k, point in enumerate(points)
        for element in point.track.elements
    ]
    table = np.array(rows, dtype=np.int64).reshape(-1, 4)
    places = {image.image_id: np.array([p.xy for p in image.points2D]).reshape(-1, 2) for image in images}
    xy = np.array([places[image][index] for image, index in table[:, 2:].tolist()]).reshape(-1, 2)
    return _Observations(
        point=table[:, 0],
        photo=table[:, 1],
        xy=xy,
        points_W=np.array([point.xyz for point in points]).reshape(-1, 3),
        centres_W=np.array([image.projection_center() for image in images]).reshape(-1, 3),
    )


def _coverage_pct(images: list[pycolmap.Image]) -> float:
    shares = []
    for image in images:
        size = np.array([image.camera.width, image.camera.height])
        spots = np.array([(*p.xy, p.has_point3D()) for p in image.points2D]).reshape(-1, 3)
        cell = np.clip((spots[:, :2] / size * GRID).astype(np.int64), 0, np.array(GRID) - 1)
        number = cell[:, 0] * GRID[1] + cell[:, 1]
        featured = np.unique(number)
        shares.append(len(np.unique(number[spots[:, 2] > 0.0])) / max(len(featured), 1))
    return 100.0 * float(np.median(shares)) if shares else 0.0


def _angle_deg(seen: _Observations) -> float:
    if len(seen.points_W) == 0:
        return 0.0
    ray = seen.points_W[seen.point] - seen.centres_W[seen.photo]
    ray /= np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-300)
    first = np.searchsorted(seen.point, np.arange(len(seen.points_W)))
    length = np.minimum(np.bincount(seen.point, minlength=len(seen.points_W)), MOST_RAYS)
    widest = np.zeros(len(seen.points_W))
    for n in np.unique(length[length > 1]):
        chosen = np.flatnonzero(length == n)
        fan = ray[first[chosen][:, None] + np.arange(n)]
        least = np.einsum("pik,pjk->pij", fan, fan).min(axis=(1, 2))
        widest[chosen] = np.degrees(np.arccos(np.clip(least, -1.0, 1.0)))
    return float(np.median(widest))


def _held_out_px(images: list[pycolmap.Image], seen: _Observations) -> float | None:
    """Median distance of observations, of tracks of three and more, from the point that the other observations give.

    The point nearest to a bundle of rays in the sense of least squares solves sum(I - d d') x = sum(I - d d') c; to
    leave a ray out its own term is taken away.
    """
    count = np.bincount(seen.point, minlength=len(seen.points_W))
    long = count[seen.point] >= 3
    if not long.any():
        return None
    point, photo = seen.point[long], seen.photo[long]
    direction = np.zeros((len(point), 3))
    wanted = seen.xy[long]
    for k, image in enumerate(images):
        mine = photo == k
        if mine.any():
            flat = np.asarray(image.camera.cam_from_img(wanted[mine])).reshape(-1, 2)
            ray = np.concatenate([flat, np.ones((len(flat), 1))], axis=1) @ image.cam_from_world().rotation.matrix()
            direction[mine] = ray / np.linalg.norm(ray, axis=1, keepdims=True)
    known = np.isfinite(direction).all(axis=1)
    direction[~known] = 0.0
    # An angle is an error in proportion to the distance.
    weight = 1.0 / np.maximum(((seen.points_W[point] - seen.centres_W[photo]) ** 2).sum(axis=1), 1e-300)
    normal = (np.eye(3) - direction[:, :, None] * direction[:, None, :]) * (weight * known)[:, None, None]
    side = np.einsum("nij,nj->ni", normal, seen.centres_W[photo])
    total, right = np.zeros((len(seen.points_W), 3, 3)), np.zeros((len(seen.points_W), 3))
    np.add.at(total, point, normal)
    np.add.at(right, point, side)
    left, rest = total[point] - normal, right[point] - side
    sound = known & (np.linalg.cond(left) < 1e7)
    if not sound.any():
        return None
    place = np.linalg.solve(left[sound], rest[sound][:, :, None])[:, :, 0]
    error = np.full(len(place), np.nan)
    for k, image in enumerate(images):
        mine = photo[sound] == k
        if mine.any():
            matrix = image.cam_from_world().matrix()
            local = place[mine] @ matrix[:, :3].T + matrix[:, 3]
            ahead = np.where(local[:, 2:] > 0.0, local, np.nan)
            error[mine] = np.linalg.norm(np.asarray(image.camera.img_from_cam(ahead)) - wanted[sound][mine], axis=1)
    error[~np.isfinite(error)] = np.inf
    return float(np.median(error))


def _agreeing_pct(images: list[pycolmap.Image], database: Path) -> float | None:
    """Share of the verified pairs whose matches lie near the model's epipolar lines."""
    numbers = {image.image_id: image for image in images}
    spots = {image.image_id: np.array([p.xy for p in image.points2D]).reshape(-1, 2) for image in images}
    agree = []
    with open_database(database) as link:
        pair_ids, geometries = link.read_two_view_geometries()
    for pair_id, geometry in zip(pair_ids, geometries, strict=True):
        one, two = pycolmap.pair_id_to_image_pair(pair_id)
        matches = np.asarray(geometry.inlier_matches)
        if one not in numbers or two not in numbers or len(matches) < PAIR_MATCHES:
            continue
        a, b = numbers[one], numbers[two]
        first = np.asarray(a.camera.cam_from_img(spots[one][matches[:, 0]])).reshape(-1, 2)
        second = np.asarray(b.camera.cam_from_img(spots[two][matches[:, 1]])).reshape(-1, 2)
        pose = b.cam_from_world() * a.cam_from_world().inverse()
        focal = min(a.camera.mean_focal_length(), b.camera.mean_focal_length())
        agree.append(_near_lines(pose, first, second, focal) >= PAIR_SHARE)
    return 100.0 * float(np.mean(agree)) if agree else None


def _near_lines(pose: pycolmap.Rigid3d, first: Array, second: Array, focal_px: float) -> float:
    """Share of matches within reach of their epipolar lines and in front of both cameras."""
    E = np.asarray(pycolmap.essential_matrix_from_pose(pose))
    one, two = (np.concatenate([xy, np.ones((len(xy), 1))], axis=1) for xy in (first, second))
    a, b = one @ E[:2].T, two @ E[:, :2]
    product = np.einsum("ni,ij,nj->n", two, E, one)
    distance = focal_px * np.abs(product) / np.sqrt(np.maximum((a**2).sum(axis=1) + (b**2).sum(axis=1), 1e-24))
    return float((distance < PAIR_PX).mean())
