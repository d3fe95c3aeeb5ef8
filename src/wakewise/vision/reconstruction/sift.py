"""SIFT features of photos by OpenCV, written as COLMAP keeps its own.

D. G. Lowe, Distinctive image features from scale-invariant keypoints, IJCV 60(2), 2004,
doi 10.1023/B:VISI.0000029664.99615.94; descriptors as square roots of their L1-normalised entries (R. Arandjelovic and
A. Zisserman, CVPR 2012, doi 10.1109/CVPR.2012.6248018), 512 times which is stored in a byte, as COLMAP does.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import BoolArray
from wakewise.vision.reconstruction.photos import Image, PhotoStore
from wakewise.vision.reconstruction.settings import ReconstructionSettings

# OpenCV always doubles a photo first; the doubled one is kept to what COLMAP takes at most (its max_image_size).
PEAK_THRESHOLD = 0.02
"""Smallest SIFT contrast, grey levels 0 to 1, over all 3 scales of an octave."""
MAX_DOUBLED_PX = 3200
# Photos whose grey levels (1st to 99th percentile) span less are stretched to twice that, at most 8 times: the contrast
# threshold would drop everything in the dark or in haze.
LEAST_SPAN, MOST_GAIN = 64.0, 8.0


class Features(NamedTuple):
    """keypoints (n, 4) float32: x, y (pixel centres at +0.5), scale in px, angle in rad; descriptors (n, 128) uint8."""

    keypoints: NDArray[np.float32]
    descriptors: NDArray[np.uint8]


def photo_features(image: Image, settings: ReconstructionSettings) -> Features:
    """The strongest features of a photo, blue-first colours of shape (h, w, 3), in pixels of the photo."""
    grey = stretched(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))
    height, width = grey.shape
    wanted = 1.0 if settings.first_octave == -1 else 0.5
    shrink = min(wanted, MAX_DOUBLED_PX / (2.0 * max(height, width)))
    small = grey
    if shrink < 1.0:
        size = (max(1, round(width * shrink)), max(1, round(height * shrink)))
        small = np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    # Without the precise upscale keypoints are a quarter of a pixel to the right and below.
    detector = cv2.SIFT.create(
        nfeatures=settings.max_features, contrastThreshold=PEAK_THRESHOLD, enable_precise_upscale=True
    )
    points, raw = detector.detectAndCompute(small, None)
    if not points:
        return Features(np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8))
    scale = np.array([width / small.shape[1], height / small.shape[0]])
    place = (np.array([point.pt for point in points]) + 0.5) * scale
    # OpenCV's size is the diameter of what is described, twice the scale.
    more = np.array([(0.5 * point.size * scale[0], np.radians(point.angle)) for point in points])
    # OpenCV may keep a few more than asked for, those with several directions.
    keep = np.argsort([-point.response for point in points], kind="stable")[: settings.max_features]
    root = np.sqrt(raw / np.maximum(raw.sum(axis=1, keepdims=True), 1e-12))
    return Features(
        np.concatenate([place, more], axis=1).astype(np.float32)[keep],
        np.clip(np.rint(512.0 * root), 0, 255).astype(np.uint8)[keep],
    )


def within(features: Features, mask: BoolArray | None) -> Features:
    """Features less those whose pixel a mask, shape (h, w), hides."""
    if mask is None:
        return features
    column, row = np.floor(features.keypoints[:, :2]).astype(np.int64).T
    kept = mask[np.clip(row, 0, mask.shape[0] - 1), np.clip(column, 0, mask.shape[1] - 1)]
    return Features(features.keypoints[kept], features.descriptors[kept])


def stretched(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A photo of little contrast with more of it; any other as it is."""
    low, high = (float(v) for v in np.percentile(grey[::4, ::4], (1.0, 99.0)))
    span = high - low
    if span >= LEAST_SPAN:
        return grey
    gain = min(2.0 * LEAST_SPAN / max(span, 1.0), MOST_GAIN)
    return np.clip(np.rint((grey.astype(np.float32) - low) * gain + 32.0), 0, 255).astype(np.uint8)


def folder_features(store: PhotoStore, names: list[str], settings: ReconstructionSettings) -> Iterator[Features]:
    """Features of each photo, in order, several photos at a time."""

    def one(name: str) -> Features:
        return photo_features(store.image(name), settings)

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with ThreadPoolExecutor(settings.threads) as pool:
            try:
                yield from pool.map(one, names)
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise
    finally:
        cv2.setNumThreads(before)
