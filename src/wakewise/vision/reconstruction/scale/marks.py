"""Coded targets: ArUco and AprilTag squares and ChArUco corners in photographs, and their triangulation.

S. Garrido-Jurado et al., Pattern Recognition 47(6), 2014, doi 10.1016/j.patcog.2014.01.005; E. Olson, AprilTag, ICRA
2011, doi 10.1109/ICRA.2011.5979561; by OpenCV's aruco module. Triangulation: the point nearest to the rays, then least
squares in pixels (R. Hartley and A. Zisserman, Multiple View Geometry, 2nd ed., Cambridge 2004, sections 12.2 and
12.5).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress
from wakewise.core.threads import in_order
from wakewise.vision.image_decoding import grey_of, shrunk
from wakewise.vision.reconstruction.photos.calibration import CalibrationBoard, board_detector
from wakewise.vision.reconstruction.photos.photo_folder import Image, PhotoStore
from wakewise.vision.reconstruction.scale.bars import FAMILIES
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto

Sightings = dict[int, dict[str, Array]]
"""By target and photograph, its corners in pixels, shape (4, 2), clockwise from its first, centres at +0.5."""
TRIED, TRIED_PX = 12, 1600
"""Photographs, spread over the set, in which ten families of targets are tried, and their longest side."""


def find_targets(
    store: PhotoStore, names: list[str], wanted: tuple[int, ...], family: str | None, threads: int, progress: Progress
) -> tuple[str, Sightings]:
    """The targets' family and where each target of it is seen.

    Raises InputError if none of the given targets is seen.
    """
    if family is None:
        family = _told(store, names, wanted, threads, progress)
    out: Sightings = {}
    jobs = in_order(lambda name: _found(grey_of(store.image(name)), [family]), names, threads)
    for done, (name, found) in enumerate(zip(names, jobs, strict=True)):
        progress(done, len(names), "targets")
        for number, corners in found[family].items():
            out.setdefault(number, {})[name] = corners
    return family, out


def _told(store: PhotoStore, names: list[str], wanted: tuple[int, ...], threads: int, progress: Progress) -> str:
    """The family with most of the given targets, over photographs spread over the set."""
    some = names[:: max(1, -(-len(names) // TRIED))]
    count = dict.fromkeys(FAMILIES, 0)
    for done, found in enumerate(
        in_order(lambda name: _found(shrunk(grey_of(store.image(name)), TRIED_PX), FAMILIES), some, threads)
    ):
        progress(done, len(some), "targets")
        for name, marks in found.items():
            count[name] += sum(number in marks for number in wanted)
    best = max(count, key=lambda name: count[name])
    if count[best] == 0:
        raise InputError(
            f"bars: no target {', '.join(str(n) for n in wanted)} of any family ({', '.join(FAMILIES)}) is seen in "
            f"{len(some)} photos spread over the {len(names)}; see docs/scale.md for what targets can be read"
        )
    return best


def _found(grey: Image, families: Iterable[str]) -> dict[str, dict[int, Array]]:
    return {family: find_squares(grey, family) for family in families}


def find_squares(grey: Image, family: str) -> dict[int, Array]:
    """Corners in pixels (centres at +0.5), shape (4, 2), of the targets in a grey photograph by number.

    A target that a photograph shows twice is ambiguous and left out.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, FAMILIES[family]))
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(grey)
    if numbers is None:
        return {}
    plain = [int(number) for number in np.ravel(numbers)]
    return {
        number: np.asarray(four, dtype=np.float64).reshape(4, 2) + 0.5
        for number, four in zip(plain, corners, strict=True)
        if plain.count(number) == 1
    }


def find_board(
    store: PhotoStore, names: list[str], board: CalibrationBoard, progress: Progress
) -> tuple[Mapping[int, Array], dict[int, dict[str, Array]]]:
    """A ChArUco board's inner corners: places on it in m, shape (3,), and by photograph in pixels, shape (1, 2).

    Raises StageError if no marker of a known dictionary is found.
    """
    some = names[:: max(1, -(-len(names) // TRIED))]
    _, detector = board_detector([grey_of(store.image(name)) for name in some], board)
    places = np.asarray(detector.getBoard().getChessboardCorners(), dtype=np.float64)

    def one(name: str) -> Any:
        corners, numbers, _, _ = detector.detectBoard(grey_of(store.image(name)))
        return ([], []) if numbers is None else (np.asarray(corners).reshape(-1, 1, 2), np.ravel(numbers))

    out: dict[int, dict[str, Array]] = {}
    # One photograph at a time: there is one detector.
    for done, name in enumerate(names):
        progress(done, len(names), "board")
        for corner, number in zip(*one(name), strict=True):
            out.setdefault(int(number), {})[name] = np.asarray(corner, dtype=np.float64) + 0.5
    return dict(enumerate(places)), out


MOST_ERROR_PX = 3.0
"""Largest error of an observation; beyond, the target was misread or moved."""
LEAST_SIGMA_PX = 0.1
"""Of a corner in a photograph, however well the photographs agree (refined corners in sharp pictures reach this)."""
LEAST_ANGLE_DEG = 2.0
STEPS, SHIFT = 10, 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class TriangulatedPoint:
    """A point of the model, its covariance, shape (3, 3), photographs it rests on and their rms error in px."""

    point_W: Array
    covariance: Array
    photos: tuple[str, ...]
    error_px: float
    angle_deg: float

    def __post_init__(self) -> None:
        freeze(self, point_W=(3,), covariance=(3, 3))


def place(views: Mapping[str, RegisteredPhoto], seen: Mapping[str, Array]) -> TriangulatedPoint | None:
    """The point that photographs show at these pixels, each of shape (2,); None where fewer than two agree on one.

    Outliers are removed one after the other, the worst first.
    """
    names = [name for name in sorted(seen) if name in views]
    while len(names) >= 2:
        point = _met(views, seen, names)
        if point is None:
            return None
        point, error, slope = _refined(views, seen, names, point)
        worst = np.linalg.norm(error.reshape(-1, 2), axis=1)
        if worst.max() <= MOST_ERROR_PX:
            angle = _widest_deg(views, names, point)
            if angle < LEAST_ANGLE_DEG:
                return None
            freedom = max(error.size - 3, 1)
            sigma = max(LEAST_SIGMA_PX, float(np.sqrt((error**2).sum() / freedom)))
            return TriangulatedPoint(
                point_W=point,
                covariance=np.asarray(sigma**2 * np.linalg.inv(slope.T @ slope), dtype=np.float64),
                photos=tuple(names),
                error_px=float(np.sqrt((worst**2).mean())),
                angle_deg=angle,
            )
        if len(names) == 2:
            return None
        names.pop(int(worst.argmax()))
    return None


def _met(views: Mapping[str, RegisteredPhoto], seen: Mapping[str, Array], names: list[str]) -> Array | None:
    """The point nearest to all rays; None where they run side by side or it lies behind a camera."""
    total, sums = np.zeros((3, 3)), np.zeros(3)
    for name in names:
        ray = views[name].R_CW.T @ views[name].rays(seen[name][None])[0]
        ray = ray / np.linalg.norm(ray)
        across = np.eye(3) - np.outer(ray, ray)
        total += across
        sums += across @ views[name].p_WC_m
    if np.linalg.eigvalsh(total)[0] < 1e-9 * len(names):
        return None
    point = np.asarray(np.linalg.solve(total, sums), dtype=np.float64)
    ahead = all(float(views[name].depth_of(point)) > 0.0 for name in names)
    return point if ahead else None


def _refined(
    views: Mapping[str, RegisteredPhoto], seen: Mapping[str, Array], names: list[str], point: Array
) -> tuple[Array, Array, Array]:
    """The point of least squares in pixels, its errors, shape (2 n,), and their slopes, shape (2 n, 3)."""

    def errors(at: Array) -> Array:
        return np.concatenate([views[name].project(at[None])[0][0] - seen[name] for name in names])

    slope = np.zeros((2 * len(names), 3))
    for _ in range(STEPS):
        here = errors(point)
        step = SHIFT * max(float(views[names[0]].depth_of(point)), 1e-12)
        for axis in range(3):
            move = step * np.eye(3)[axis]
            slope[:, axis] = (errors(point + move) - errors(point - move)) / (2.0 * step)
        change = np.linalg.lstsq(slope, -here, rcond=None)[0]
        point = np.asarray(point + change, dtype=np.float64)
        if np.linalg.norm(change) < 1e-3 * step:
            break
    return point, errors(point), slope


def _widest_deg(views: Mapping[str, RegisteredPhoto], names: list[str], point: Array) -> float:
    """Largest angle between two lines of sight."""
    rays = np.array([point - views[name].p_WC_m for name in names])
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return float(np.degrees(np.arccos(np.clip((rays @ rays.T).min(), -1.0, 1.0))))
