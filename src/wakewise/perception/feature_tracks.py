"""Features tracked from picture to picture: corners (Shi and Tomasi 1994), pyramidal Lucas-Kanade, back and forth.

A feature is kept where tracking it back from the new picture returns to where it was (Z. Kalal, K. Mikolajczyk, J.
Matas 2010, Forward-backward error, doi 10.1109/ICPR.2010.675). Where features have ended, corners are found anew: far
apart over the whole picture, and closer together where the target is.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.perception.calibrated_camera import CalibratedCamera

Grey = NDArray[np.uint8]
WINDOW_PX, LEVELS = 11, 3
MOST_BACK_PX = 0.5
"""Largest distance by which a feature tracked back may miss its place."""
ROUNDED_PX = 1.5
"""A picture of another size has the camera's shape if its height, brought to the camera's width, fits to this."""
FEW = 0.08
"""Corners are found anew once more than this share of the features is missing: that takes as long as tracking."""
QUALITY = 0.01
"""Least cornerness over the best of the picture."""
LEAST_CONTRAST = 2.0
"""Grey levels of standard deviation below which a picture shows nothing to track: about the noise of a dim sensor."""
SHORTEST_S = 1e-3
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 20, 0.02)


@dataclass(frozen=True, kw_only=True, eq=False)
class FeatureTracks:
    """Features of the last picture: their numbers, shape (n,), pixels, (n, 2), and speeds in px/s, (n, 2)."""

    ids: IntArray
    pixels: Array
    speeds: Array
    next_id: int = 0
    picture: Grey | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.ids)

    def kept(self, which: BoolArray) -> FeatureTracks:
        """Those features that are chosen, shape (n,)."""
        return replace(self, ids=self.ids[which], pixels=self.pixels[which], speeds=self.speeds[which])

    def at_middle(self, camera: CalibratedCamera) -> Array:
        """Pixels as if all rows were read at the middle of the readout, shape (n, 2)."""
        late_s = camera.readout_s * ((self.pixels[:, 1] + 0.5) / camera.height - 0.5)
        return np.asarray(self.pixels - late_s[:, None] * self.speeds)


NO_TRACKS = FeatureTracks(ids=np.zeros(0, np.int64), pixels=np.zeros((0, 2)), speeds=np.zeros((0, 2)))


def grey_picture(image: NDArray[Any]) -> Grey:
    """A picture as grey levels, shape (h, w), from grey or RGB, uint8.

    Raises
    ------
    InputError
        If it is not such a picture.
    """
    picture = np.asarray(image)
    if picture.dtype != np.uint8 or picture.ndim not in (2, 3) or min(picture.shape[:2]) < 16:
        raise InputError(
            f"picture: shape {picture.shape} of {picture.dtype}, needs (h, w) or (h, w, 3) of uint8, 16 px at least"
        )
    if picture.ndim == 2:
        return np.ascontiguousarray(picture)
    if picture.shape[2] != 3:
        raise InputError(f"picture: {picture.shape[2]} colours, needs red, green and blue, or grey alone")
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), dtype=np.uint8)


def has_shape(shape: tuple[int, ...], camera: CalibratedCamera) -> bool:
    """Whether a picture of this shape, (height, width), is as wide for its height as the camera's; see `ROUNDED_PX`."""
    return abs(shape[0] * camera.width / shape[1] - camera.height) <= ROUNDED_PX


def fitted(picture: Grey, camera: CalibratedCamera) -> Grey:
    """A grey picture in the camera's size; one of another shape is left for the tracker to refuse."""
    if picture.shape == (camera.height, camera.width) or not has_shape(picture.shape, camera):
        return picture
    way = cv2.INTER_AREA if picture.shape[1] > camera.width else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(picture, (camera.width, camera.height), interpolation=way), dtype=np.uint8)


def track(tracks: FeatureTracks, picture: Grey, after_s: float, guess: Array | None = None) -> FeatureTracks:
    """Features of the last picture found again in the next, which was taken `after_s` later.

    `guess`, shape (n, 2): where they are expected, NaN where nothing is known; their last pixels if not given.
    """
    last = tracks.picture
    if not len(tracks) or last is None or last.shape != picture.shape:
        return replace(NO_TRACKS, next_id=tracks.next_id, picture=picture)
    before = tracks.pixels.astype(np.float32)
    start = before if guess is None else np.where(np.isfinite(guess), guess, tracks.pixels).astype(np.float32)
    more: dict[str, Any] = {
        "winSize": (WINDOW_PX, WINDOW_PX),
        "maxLevel": LEVELS,
        "criteria": _CRITERIA,
        "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
    }
    after, found, _ = cv2.calcOpticalFlowPyrLK(last, picture, before, start.copy(), **more)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(picture, last, after, before.copy(), **more)
    height, width = picture.shape
    kept = (found[:, 0] == 1) & (returned[:, 0] == 1) & (np.linalg.norm(back - before, axis=1) <= MOST_BACK_PX)
    kept &= (after[:, 0] >= 0) & (after[:, 0] < width) & (after[:, 1] >= 0) & (after[:, 1] < height)
    pixels = after.astype(np.float64)
    speeds = (pixels - tracks.pixels) / max(after_s, SHORTEST_S)
    return replace(tracks, pixels=pixels, speeds=speeds, picture=picture).kept(kept)


def shows_nothing(picture: Grey) -> bool:
    """Whether a picture has less contrast than a dim sensor's noise; a sixteenth of its pixels say so."""
    return float(picture[::4, ::4].std()) < LEAST_CONTRAST


def replenish(
    tracks: FeatureTracks,
    picture: Grey,
    most: int,
    apart_px: float,
    where: NDArray[np.uint8] | None = None,
    quality: float = QUALITY,
) -> FeatureTracks:
    """The same features and new corners, so far from each other and from those that are there, up to `most` in all.

    None are added where fewer than `FEW` of `most` are missing.

    `where`, shape (h, w): new ones only where it is not 0; everywhere if not given. `quality`: least cornerness over
    the best.
    """
    room = most - len(tracks)
    if room <= FEW * most or shows_nothing(picture):
        return tracks
    free = np.full(picture.shape, 255, np.uint8) if where is None else where.copy()
    for u, v in np.round(tracks.pixels).astype(int):
        cv2.circle(free, (int(u), int(v)), round(apart_px), 0, -1)
    found = cv2.goodFeaturesToTrack(picture, room, quality, apart_px, mask=free)
    if found is None:
        return tracks
    new = found[:, 0].astype(np.float64)
    speed = np.median(tracks.speeds, axis=0) if len(tracks) else np.zeros(2)
    return FeatureTracks(
        ids=np.concatenate([tracks.ids, tracks.next_id + np.arange(len(new))]),
        pixels=np.concatenate([tracks.pixels, new]),
        speeds=np.concatenate([tracks.speeds, np.tile(speed, (len(new), 1))]),
        next_id=tracks.next_id + len(new),
        picture=picture,
    )
