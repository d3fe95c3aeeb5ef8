"""Coded targets in photographs: ArUco and AprilTag squares by their four corners, a ChArUco board by its inner ones.

S. Garrido-Jurado et al., Pattern Recognition 47(6), 2014, doi 10.1016/j.patcog.2014.01.005; E. Olson, AprilTag, ICRA
2011, doi 10.1109/ICRA.2011.5979561; as OpenCV's aruco module has them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import cv2
import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress
from wakewise.vision.reconstruction.calibration import CalibrationBoard, board_detector
from wakewise.vision.reconstruction.dense import in_order
from wakewise.vision.reconstruction.photos import Image, PhotoStore
from wakewise.vision.reconstruction.scale.bars import FAMILIES

Sightings = dict[int, dict[str, Array]]
"""By target and photograph, its corners in pixels, shape (4, 2), clockwise from its first, centres at +0.5."""
TRIED, TRIED_PX = 12, 1600
"""Photographs, spread over the set, that the family of the targets is told by, and the longest side they are looked at
with: ten families are tried on each."""


def find_marks(
    store: PhotoStore, names: list[str], wanted: tuple[int, ...], family: str | None, threads: int, progress: Progress
) -> tuple[str, Sightings]:
    """The targets' family and where each target of it is seen.

    Raises
    ------
    InputError
        If none of the wanted targets is seen.
    """
    if family is None:
        family = _told(store, names, wanted, threads, progress)
    out: Sightings = {}
    jobs = in_order(lambda name: _found(_grey(store.image(name)), [family]), names, threads)
    for done, (name, found) in enumerate(zip(names, jobs, strict=True)):
        progress(done, len(names), "targets")
        for number, corners in found[family].items():
            out.setdefault(number, {})[name] = corners
    return family, out


def _told(store: PhotoStore, names: list[str], wanted: tuple[int, ...], threads: int, progress: Progress) -> str:
    """The family that most of the wanted targets are seen of, over photographs from all of the set."""
    some = names[:: max(1, -(-len(names) // TRIED))]
    count = dict.fromkeys(FAMILIES, 0)
    for done, found in enumerate(in_order(lambda name: _found(_small(store.image(name)), FAMILIES), some, threads)):
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


def _small(image: Image) -> Image:
    grey = _grey(image)
    shrink = TRIED_PX / max(grey.shape)
    if shrink >= 1.0:
        return grey
    return np.asarray(cv2.resize(grey, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def find_squares(grey: Image, family: str) -> dict[int, Array]:
    """Corners in pixels (centres at +0.5), shape (4, 2), of the targets in a grey photograph by number.

    A target that a photograph shows twice is none that could be told apart, and is left out.
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

    Raises
    ------
    StageError
        If no marker of a known dictionary is in the photographs that are looked at first.
    """
    some = names[:: max(1, -(-len(names) // TRIED))]
    _, detector = board_detector([_grey(store.image(name)) for name in some], board)
    places = np.asarray(detector.getBoard().getChessboardCorners(), dtype=np.float64)

    def one(name: str) -> Any:
        corners, numbers, _, _ = detector.detectBoard(_grey(store.image(name)))
        return ([], []) if numbers is None else (np.asarray(corners).reshape(-1, 1, 2), np.ravel(numbers))

    out: dict[int, dict[str, Array]] = {}
    # One at a time: the detector is one.
    for done, name in enumerate(names):
        progress(done, len(names), "board")
        for corner, number in zip(*one(name), strict=True):
            out.setdefault(int(number), {})[name] = np.asarray(corner, dtype=np.float64) + 0.5
    return dict(enumerate(places)), out


def _grey(image: Image) -> Image:
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
