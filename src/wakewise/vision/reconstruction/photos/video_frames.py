"""Sharp frames of a film at even steps of image motion.

One pass measures the motion of the picture (sparse optical flow, B. D. Lucas and T. Kanade, IJCAI 1981, in pyramids)
and the sharpness of each frame. The sharpest frame of each step is taken.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_folder
from wakewise.core.interfaces import Progress, no_progress
from wakewise.core.run_lock import exclusive_run
from wakewise.vision.image_decoding import grey_of, shrunk
from wakewise.vision.reconstruction.photos.photo_folder import Image
from wakewise.vision.reconstruction.sfm.colmap import no_stderr
from wakewise.vision.reconstruction.stages import fingerprint, make_folder, run_stage

VERSION = 1
SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".mts", ".m4v", ".webm", ".mpg", ".mpeg", ".wmv", ".ts")
STEP_SHARE = 0.1
"""Picture's movement between two frames that are taken, as a share of its longer side: 90 % of it overlap."""
MOST_FRAMES, LEAST_FRAMES = 400, 3
ANALYSED_PER_S, ANALYSED_PX = 12.0, 640
"""Frames a second that are analysed at, and the longest side they are analysed at with."""
BLURRED_SHARE = 0.5
"""A frame less sharp than this share of those within two seconds (their 80th percentile) is called blurred."""
NEAR_S = 2.0
READOUT_S = 0.02
"""Rows of small sensors are read one after the other, all in 15 to 30 ms: O. Saurer et al., ICCV 2013, doi
10.1109/ICCV.2013.64, measured such cameras."""
_POINTS, _LEAST_POINTS, _QUALITY = 300, 20, 96


@dataclass(frozen=True, kw_only=True)
class VideoFrames:
    """Frames taken of a film. blurred: of the frames analysed; blurred_taken: of those taken, where none nearby is
    sharper; moved_widths: motion of the picture in all, in widths; motion_px_s: median over the frames taken; skew_px:
    shear by a rolling shutter of READOUT_S at that motion.
    """

    film: str
    width: int
    height: int
    frames_per_s: float
    frames: int
    looked_at: int
    taken: int
    blurred: int
    blurred_taken: int
    moved_widths: float
    motion_px_s: float
    skew_px: float
    step_share: float
    numbers: list[int]

    def lines(self) -> list[str]:
        """In words."""
        return [
            f"{self.film}: {self.taken} of {self.frames} frames taken ({self.width} x {self.height} px), "
            f"{self.looked_at} analysed, {self.blurred} of those blurred"
            + (f"; {self.blurred_taken} blurred ones taken, as nothing near was sharp" if self.blurred_taken else ""),
            f"rolling shutter: is not undone; at {self.motion_px_s:.0f} px/s a sensor that is read out in "
            f"{1e3 * READOUT_S:.0f} ms shears the picture by {self.skew_px:.1f} px (the film does not say its own)",
        ]


def is_film(path: Path) -> bool:
    """Whether a path is a file of a film, by its name."""
    return path.is_file() and path.suffix.lower() in SUFFIXES


def take_frames(film: Path, out: Path, progress: Progress = no_progress) -> tuple[Path, VideoFrames]:
    """Folder of the frames of a film, `out/frames`, made unless it is there, and what was taken.

    Raises InputError if the film cannot be read, or its camera hardly moves.
    """
    make_folder(out)
    folder = out / "frames"
    with film.open("rb") as file:
        digest = hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16))
    key = fingerprint(VERSION, digest.hexdigest(), STEP_SHARE, MOST_FRAMES)
    with exclusive_run(out):
        done = run_stage(out, "frames", key, (folder,), lambda: {"film": asdict(_take(film, folder, progress))})
    return folder, VideoFrames(**done.figures["film"])


@dataclass(frozen=True, kw_only=True, eq=False)
class _FrameStatistics:
    """Frames analysed at: number, sharpness, way of the picture since the first, in longer sides."""

    numbers: IntArray
    sharpness: Array
    way: Array


def _take(film: Path, folder: Path, progress: Progress) -> VideoFrames:
    with opened_film(film) as reader:
        facts = {
            "width": int(reader.get(cv2.CAP_PROP_FRAME_WIDTH)),
            "height": int(reader.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        }
        rate = float(reader.get(cv2.CAP_PROP_FPS))
        rate = rate if np.isfinite(rate) and 0.1 < rate < 1000.0 else 30.0
        expected = max(int(reader.get(cv2.CAP_PROP_FRAME_COUNT)), 1)
        stride = max(1, round(rate / ANALYSED_PER_S))
        analysed, frames = _analyse_frames(reader, stride, expected, progress)
    if len(analysed.numbers) == 0:
        raise InputError(f"{film}: none of its frames can be decoded; convert it, for example to H.264 in MP4")
    step = max(STEP_SHARE, float(analysed.way[-1]) / MOST_FRAMES)
    blurred = _blurred(analysed, rate)
    chosen = choose_frames(analysed.way, analysed.sharpness, step)
    if len(chosen) < LEAST_FRAMES:
        raise InputError(
            f"{film}: the picture moves by {float(analysed.way[-1]):.2f} of its width in {frames} frames, too little "
            f"for {LEAST_FRAMES} photographs {100 * step:.0f} % apart; a model needs a camera that moves"
        )
    numbers = analysed.numbers[chosen]
    with whole_folder(folder) as temporary:
        write_frames(film, temporary, {int(n) for n in numbers}, progress, frames)
    pace = np.gradient(analysed.way, analysed.numbers / rate) if len(analysed.way) > 1 else np.zeros(1)
    motion = float(np.median(pace[chosen])) * max(facts.values())
    return VideoFrames(
        film=film.name,
        **facts,
        frames_per_s=rate,
        frames=frames,
        looked_at=len(analysed.numbers),
        taken=len(chosen),
        blurred=int(blurred.sum()),
        blurred_taken=int(blurred[chosen].sum()),
        moved_widths=float(analysed.way[-1]),
        motion_px_s=motion,
        skew_px=motion * READOUT_S,
        step_share=step,
        numbers=[int(n) for n in numbers],
    )


def choose_frames(way: Array, sharpness: Array, step: float) -> IntArray:
    """Indices of the sharpest frame of each stretch of movement.

    `way`, shape (n,): motion of the picture since the first frame, never falling. `sharpness` has shape (n,). `step`:
    motion from one stretch to the next, in units of `way`; a frame is taken from the first half of each.
    """
    place = (np.asarray(way) - way[0]) / step
    cell = np.floor(place).astype(np.int64)
    inside = place - cell <= 0.5  # half a step is left between, so that neighbours are never next to each other
    out = []
    for number in np.unique(cell):
        whole = np.flatnonzero(cell == number)
        members = whole[inside[whole]]
        # Moved past it between two frames, or all of it blurred.
        if not len(members) or sharpness[members].max() < BLURRED_SHARE * sharpness[whole].max():
            members = whole
        out.append(int(members[np.argmax(sharpness[members])]))
    return np.array(out, dtype=np.int64)


def sharpness_of(grey: Image) -> float:
    """How much finer detail there is than a blurred picture could have, about 0 to 1, whatever is in the picture.

    Mean squared difference of neighbouring pixels over that of the picture at half its size: 1/4 where nothing is finer
    than two pixels, about 1/2 to 1 for sharp pictures of natural things, whose spectra fall as a power (D. J. Field, J.
    Opt. Soc. Am. A 4, 1987, doi 10.1364/JOSAA.4.002379), 4 for noise alone. The quarter is taken off.
    """
    height, width = (size - size % 2 for size in grey.shape)
    whole = grey[:height, :width].astype(np.float32)
    half = whole.reshape(height // 2, 2, width // 2, 2).mean(axis=(1, 3))
    return max(_slopes(whole) / max(_slopes(half), 1e-6) - 0.25, 0.0)


def _slopes(grey: Any) -> float:
    return float((np.diff(grey, axis=1) ** 2).mean() + (np.diff(grey, axis=0) ** 2).mean())


def movement(before: Image, after: Image) -> float | None:
    """Median way of tracked points between two grey pictures, in px; None where too few can be followed."""
    points = cv2.goodFeaturesToTrack(before, _POINTS, 0.01, 7)
    if points is None or len(points) < _LEAST_POINTS:
        return None
    moved, found, _ = cv2.calcOpticalFlowPyrLK(before, after, points, None, winSize=(21, 21), maxLevel=4)
    good = found.ravel() == 1
    if good.sum() < _LEAST_POINTS:
        return None
    return float(np.median(np.linalg.norm((moved - points).reshape(-1, 2)[good], axis=1)))


def _analyse_frames(
    reader: cv2.VideoCapture, stride: int, expected: int, progress: Progress
) -> tuple[_FrameStatistics, int]:
    """Every `stride`th frame, and how many frames there are."""
    numbers, sharp, way = [], [], []
    before: Image | None = None
    total, frame, usual = 0.0, 0, 0.0
    while reader.grab():
        if frame % stride == 0:
            progress(min(frame, expected), 2 * expected, "film")
            ok, image = reader.retrieve()
            if ok and image is not None:
                grey = shrunk(grey_of(image), ANALYSED_PX)
                if before is not None:
                    moved = movement(before, grey)
                    # Where nothing can be followed, as in a turn of murky water, it went on as it did.
                    usual = usual if moved is None else moved / max(grey.shape)
                    total += usual
                numbers.append(frame)
                sharp.append(sharpness_of(grey))
                way.append(total)
                before = grey
        frame += 1
    return _FrameStatistics(
        numbers=np.array(numbers, dtype=np.int64), sharpness=np.array(sharp), way=np.array(way)
    ), frame


def _blurred(analysed: _FrameStatistics, rate: float) -> Any:
    """Which frames are much less sharp than the sharp ones about them."""
    time_s = analysed.numbers / rate
    usual = [np.quantile(analysed.sharpness[np.abs(time_s - t) <= NEAR_S], 0.8) for t in time_s]
    return np.asarray(analysed.sharpness < BLURRED_SHARE * np.array(usual))


def write_frames(film: Path, folder: Path, numbers: set[int], progress: Progress, frames: int) -> None:
    """Write frames of these numbers as JPEG files `frame_NUMBER.jpg`; `frames`: how many the film has, for progress."""
    with opened_film(film) as reader:
        frame = written = 0
        while reader.grab() and written < len(numbers):
            if frame in numbers:
                progress(frames + frame, 2 * frames, "frames")
                ok, image = reader.retrieve()
                if not ok:
                    raise StageError(f"{film}: frame {frame} can no longer be read")
                coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1]
                (folder / f"frame_{frame:06d}.jpg").write_bytes(coded.tobytes())
                written += 1
            frame += 1


@contextmanager
def opened_film(film: Path) -> Iterator[cv2.VideoCapture]:
    """A film to read, quietly.

    Raises InputError if it is none, or in a code that OpenCV's FFmpeg does not read.
    """
    with no_stderr():
        reader = cv2.VideoCapture(str(film), cv2.CAP_FFMPEG)
        try:
            if not reader.isOpened():
                raise InputError(
                    f"{film}: is no film that can be read, or its codec is not known here; convert it, for example to "
                    "H.264 in MP4, or take its frames as JPEG files"
                )
            yield reader
        finally:
            reader.release()
