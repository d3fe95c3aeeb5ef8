"""Motion between successive pictures, and sharpness, brightness and contrast of each.

Motion is the similarity transform of the picture: tracked points (B. D. Lucas and T. Kanade, IJCAI 1981, in pyramids)
between frames of a film, SIFT features (D. G. Lowe, IJCV 60, 2004, doi 10.1023/B:VISI.0000029664.99615.94) between
photographs, with RANSAC.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.core.threads import in_order
from wakewise.vision.image_decoding import AS_STORED, grey_of, read_picture, shrunk
from wakewise.vision.reconstruction.photos.photo_folder import Image
from wakewise.vision.reconstruction.photos.video_frames import opened_film, sharpness_of

SHARPNESS_PX, MOTION_PX = 1280, 640
"""Longest sides at which sharpness and motion are measured."""
FRAMES_PER_S = 4.0
"""Frames a second of a film that are looked at."""
DARK_GREY, UNIFORM_GREY = 12.0, 4.0
"""Mean and standard deviation of grey levels (of 255) below which a picture is dark or uniform."""
_FEATURES, _RATIO, _LEAST_INLIERS = 800, 0.8, 12
_TOLERANCE_PX, _SCALE_RANGE = 8.0, 0.8
"""Relief moves features off a similarity by so much in a reduced picture; a greater log scale is a false match."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PictureStatistics:
    """Of n pictures: sharpness, brightness, contrast, each of shape (n,), and size in px, shape (n, 2).

    `motion`, shape (n - 1, 4), is from each to the next: shift of the picture's middle to the right and down, in widths
    of the picture, rotation in rad (from right to down), logarithm of the scale. NaN where it was not found.
    """

    sharpness: Array
    brightness: Array
    contrast: Array
    size_px: IntArray
    motion: Array

    @property
    def dark(self) -> BoolArray:
        """Which pictures are dark."""
        return np.asarray(self.brightness < DARK_GREY)

    @property
    def uniform(self) -> BoolArray:
        """Which pictures show nothing."""
        return np.asarray(self.contrast < UNIFORM_GREY)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Picture:
    figures: tuple[float, float, float]
    size: tuple[int, int]
    small: Image
    features: tuple[Any, Any] | None


def photo_statistics(
    files: list[Path], threads: int = 2, progress: Progress = no_progress
) -> tuple[PictureStatistics, list[int]]:
    """Statistics of photographs in the order of time, and the indices of those that are read."""
    found = in_order(lambda path: _looked_at(read_picture(path, AS_STORED), features=True), files, threads)
    return _collected(enumerate(found), len(files), _matched, progress)


def film_statistics(film: Path, progress: Progress = no_progress) -> tuple[PictureStatistics, list[int], Array]:
    """Statistics of some frames of a film, their numbers, and their times in s, by the film where it states them.

    Raises InputError if the film cannot be read.
    """
    with opened_film(film) as reader:
        rate = float(reader.get(cv2.CAP_PROP_FPS))
        rate = rate if np.isfinite(rate) and 0.1 < rate < 1000.0 else 30.0
        expected = max(int(reader.get(cv2.CAP_PROP_FRAME_COUNT)), 1)
        stated: dict[int, float] = {}
        frames = _frames(reader, max(1, round(rate / FRAMES_PER_S)), stated)
        statistics, numbers = _collected(frames, expected, _tracked, progress)
    if len(numbers) < 2:
        raise InputError(
            f"{film}: {len(numbers)} of its frames can be decoded; convert it, for example to H.264 in MP4"
        )
    at_s = np.array([stated[number] for number in numbers])
    # A film of variable frame rate says when each frame is; some backends say nothing.
    return statistics, numbers, at_s if (np.diff(at_s) > 0.0).all() else np.array(numbers) / rate


def _frames(reader: Any, stride: int, stated: dict[int, float]) -> Iterator[tuple[int, _Picture | None]]:
    number = 0
    while reader.grab():
        if number % stride == 0:
            stated[number] = 1e-3 * float(reader.get(cv2.CAP_PROP_POS_MSEC))
            ok, image = reader.retrieve()
            yield number, _looked_at(image if ok else None, features=False)
        number += 1


def _collected(
    pictures: Any, expected: int, motion_of: Callable[[_Picture, _Picture], Array], progress: Progress
) -> tuple[PictureStatistics, list[int]]:
    figures, sizes, motions, kept = [], [], [], []
    before: _Picture | None = None
    for number, picture in pictures:
        progress(min(number, expected), expected, "motion")
        if picture is None:
            continue
        if before is not None:
            motions.append(motion_of(before, picture))
        figures.append(picture.figures)
        sizes.append(picture.size)
        kept.append(number)
        before = picture
    table = np.array(figures, dtype=np.float64).reshape(-1, 3)
    return PictureStatistics(
        sharpness=table[:, 0],
        brightness=table[:, 1],
        contrast=table[:, 2],
        size_px=np.array(sizes, dtype=np.int64).reshape(-1, 2),
        motion=np.array(motions, dtype=np.float64).reshape(-1, 4),
    ), kept


def _looked_at(image: Any, features: bool) -> _Picture | None:
    """What is kept of one picture; None of what is none."""
    if image is None:
        return None
    grey = grey_of(image)
    small = shrunk(grey, MOTION_PX)
    sharp = sharpness_of(shrunk(grey, SHARPNESS_PX))
    found = cv2.SIFT.create(nfeatures=_FEATURES).detectAndCompute(small, None) if features else None
    return _Picture(
        figures=(sharp, float(small.mean()), float(small.std())), size=grey.shape[::-1], small=small, features=found
    )


def _matched(before: _Picture, after: _Picture) -> Array:
    """Motion by matched features."""
    (at_before, tell_before), (at_after, tell_after) = before.features or ((), None), after.features or ((), None)
    if tell_before is None or tell_after is None or min(len(at_before), len(at_after)) < _LEAST_INLIERS:
        return np.full(4, np.nan)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    pairs = matcher.knnMatch(tell_before, tell_after, k=2)
    back = {match.queryIdx: match.trainIdx for match in matcher.match(tell_after, tell_before)}
    good = [
        two[0]
        for two in pairs
        if len(two) == 2 and two[0].distance < _RATIO * two[1].distance and back.get(two[0].trainIdx) == two[0].queryIdx
    ]
    first = np.array([at_before[match.queryIdx].pt for match in good], dtype=np.float32).reshape(-1, 2)
    last = np.array([at_after[match.trainIdx].pt for match in good], dtype=np.float32).reshape(-1, 2)
    return _similarity(first, last, before.small.shape)


def _tracked(before: _Picture, after: _Picture) -> Array:
    """Motion by tracked points."""
    points = cv2.goodFeaturesToTrack(before.small, 300, 0.01, 7)
    if points is None or before.small.shape != after.small.shape:
        return np.full(4, np.nan)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(before.small, after.small, points, None, winSize=(21, 21), maxLevel=4)
    good = found.ravel() == 1
    return _similarity(points.reshape(-1, 2)[good], moved.reshape(-1, 2)[good], before.small.shape)


def _similarity(first: Any, last: Any, shape: tuple[int, ...]) -> Array:
    """Shift of the middle in widths, rotation and log scale of matched points, shapes (k, 2); NaN where unsure."""
    if len(first) < _LEAST_INLIERS:
        return np.full(4, np.nan)
    matrix, inside = cv2.estimateAffinePartial2D(first, last, method=cv2.RANSAC, ransacReprojThreshold=_TOLERANCE_PX)
    if matrix is None or int(inside.sum()) < _LEAST_INLIERS:
        return np.full(4, np.nan)
    middle = 0.5 * np.array(shape[1::-1], dtype=np.float64)
    shift = (matrix[:, :2] @ middle + matrix[:, 2] - middle) / shape[1]
    scale, turn = np.hypot(matrix[0, 0], matrix[1, 0]), np.arctan2(matrix[1, 0], matrix[0, 0])
    if not abs(np.log(max(float(scale), 1e-9))) <= _SCALE_RANGE:
        return np.full(4, np.nan)
    return np.array([*shift, turn, np.log(scale)])
