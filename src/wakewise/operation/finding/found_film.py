"""Film of a flight that finds its target: the camera's pictures with the protected region over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import TargetEstimate
from wakewise.perception import CalibratedCamera
from wakewise.perception.feature_tracks import Grey
from wakewise.vision.image_decoding import decode_picture

Image = NDArray[np.uint8]
STATUS_BGR = {
    "assumed": (190, 190, 190),
    "proposed": (0, 190, 255),
    "tracked": (80, 220, 80),
    "lost": (60, 60, 230),
}
WIDTH, FRAME_MS, MOST_FRAMES = 400, 100, 240
"""Size of the film, how long a frame is shown, and how many there are at most: of a longer flight, fewer a second."""
BAR_PX, QUALITY = 24, 55
TEXT = cv2.FONT_HERSHEY_SIMPLEX


@dataclass(kw_only=True, eq=False)
class FilmFrames:
    """Frames of a flight so far, as JPEG; once there are `2 * MOST_FRAMES`, each second one is kept."""

    frames: list[bytes] = field(default_factory=list)
    every: int = 1
    offered: int = 0

    def clear(self) -> None:
        """Forget an earlier flight."""
        self.frames, self.every, self.offered = [], 1, 0

    def add(
        self, picture: Grey, camera: CalibratedCamera, X_WC: Pose, target: TargetEstimate | None, time_s: float
    ) -> None:
        """Take a picture in."""
        self.offered += 1
        if (self.offered - 1) % self.every:
            return
        image = with_region(picture, camera, X_WC, target)
        height = round(WIDTH * image.shape[0] / image.shape[1])
        small = cv2.resize(image, (WIDTH, height), interpolation=cv2.INTER_AREA)
        words = f"{time_s:5.1f} s  {'' if target is None else target.status}"
        small[-BAR_PX:] //= 3
        cv2.putText(small, words, (8, height - 7), TEXT, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
        self.frames.append(cv2.imencode(".jpg", small)[1].tobytes())
        if len(self.frames) >= 2 * MOST_FRAMES:
            self.frames, self.every = self.frames[::2], 2 * self.every

    def write(self, path: Path) -> None:
        """Write an animated WebP; nothing if there is no frame."""
        every = -(-len(self.frames) // MOST_FRAMES)
        chosen = self.frames[:: max(every, 1)]
        if not chosen:
            return
        film = cv2.Animation()
        film.frames = [_decoded(frame) for frame in chosen]
        film.durations = [FRAME_MS] * len(chosen)
        film.loop_count = 0
        encoded: Any = cv2.imencodeanimation(".webp", film, [cv2.IMWRITE_WEBP_QUALITY, QUALITY])[1]
        with whole_file(path) as temporary:
            temporary.write_bytes(np.asarray(encoded).tobytes())


def with_region(picture: Grey, camera: CalibratedCamera, X_WC: Pose | None, target: TargetEstimate | None) -> Image:
    """A picture with the protected surface and its middle, in the colour of its status; BGR, shape (h, w, 3)."""
    image = np.repeat(picture[:, :, None], 3, axis=2)
    if X_WC is None or target is None:
        return image
    colour = STATUS_BGR[target.status]
    on_surface = target.points_W_m[target.distance_m <= 0.0]
    for u, v in _pixels(on_surface, camera, X_WC):
        cv2.circle(image, (u, v), 2, colour, 1, cv2.LINE_AA)
    for u, v in _pixels(target.centre_W_m[None], camera, X_WC):
        cv2.drawMarker(image, (u, v), colour, cv2.MARKER_CROSS, 16, 1, cv2.LINE_AA)
    return image


def _pixels(points_W_m: NDArray[np.float64], camera: CalibratedCamera, X_WC: Pose) -> Sequence[tuple[int, int]]:
    """Whole pixels of the points that have one."""
    found = camera.pixels((points_W_m - X_WC.p_m) @ X_WC.R)
    near = np.isfinite(found).all(axis=1) & (np.abs(np.nan_to_num(found)) < 1e5).all(axis=1)
    return [(round(float(u)), round(float(v))) for u, v in found[near]]


def _decoded(frame: bytes) -> Image:
    image = decode_picture(frame, "a frame of the film")
    assert image is not None
    return np.asarray(image, dtype=np.uint8)
