"""Writes moving pictures with what comes in the wheels: no codec of the operating system is asked for.

`.mp4` is H.264 where the extra `film` (PyAV) is installed, which every player knows; else VP9 by OpenCV's own FFmpeg,
which browsers, VLC and current players of Windows and Android know. `.webm` is VP9. `.webp` is an animated picture that
needs only an image viewer or a browser.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures

from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_file
from wakewise.core.optional_dependencies import how_to_install

Frame = NDArray[np.uint8]
SUFFIXES = (".mp4", ".webm", ".webp")
WEBP_QUALITY = 72
H264_CRF = "20"


class FrameSink(Protocol):
    """Takes frames one after the other."""

    def add(self, frame: Frame) -> None:
        """Append an RGB frame, shape (h, w, 3)."""
        ...

    def close(self, whole: bool) -> None:
        """Finish the file, or only let go of it where the film is not whole."""
        ...


def check_film_name(path: Path) -> None:
    """Refuse a name whose ending says nothing that can be written.

    Raises InputError.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"--out {path}: ends in '{path.suffix}', allowed are {', '.join(SUFFIXES)}")
    if path.is_dir():
        raise InputError(f"--out {path}: is a folder, must be a file")


def has_h264() -> bool:
    """Whether H.264 can be written."""
    return find_spec("av") is not None


@contextmanager
def film_writer(path: Path, fps: float, size_px: tuple[int, int]) -> Iterator[FrameSink]:
    """Give what takes RGB frames of `size_px` (width, height); the film appears under its name only when it is whole.

    Raises InputError if the name's ending is none of `SUFFIXES`, or a side of the picture is odd or too small;
    StageError if the encoder refuses.
    """
    check_film_name(path)
    if any(side < 16 or side % 2 for side in size_px):
        raise InputError(f"film: {size_px[0]} x {size_px[1]} px, both sides must be even and at least 16")
    with whole_file(path) as temporary:
        sink: FrameSink
        if path.suffix.lower() == ".webp":
            sink = _WebP(temporary, fps)
        elif path.suffix.lower() == ".mp4" and has_h264():
            sink = _H264(temporary, fps, size_px)
        else:
            sink = _VP9(temporary, fps, size_px)
        whole = False
        try:
            yield sink
            whole = True
        finally:
            sink.close(whole)


class _VP9:
    """VP9 by the FFmpeg inside OpenCV's wheel (libvpx, BSD)."""

    def __init__(self, path: Path, fps: float, size_px: tuple[int, int]) -> None:
        code = cv2.VideoWriter.fourcc(*("vp09" if path.suffix.lower() == ".mp4" else "VP90"))
        self._path, self._frames = path, 0
        self._writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, fps, size_px)
        if not self._writer.isOpened():
            raise StageError(f"film: OpenCV here cannot write VP9; use --out film.webp, or {how_to_install('film')}")

    def add(self, frame: Frame) -> None:
        self._writer.write(np.ascontiguousarray(frame[..., ::-1]))
        self._frames += 1

    def close(self, whole: bool) -> None:
        self._writer.release()
        if whole and (there := _frames_in(self._path)) != self._frames:  # OpenCV says nothing of what it cannot write
            raise OSError(f"{there} of {self._frames} frames are in the file that was written")


def _frames_in(path: Path) -> int:
    """How many frames of a film can be read."""
    film, count = cv2.VideoCapture(str(path)), 0
    try:
        while film.grab():
            count += 1
    finally:
        film.release()
    return count


class _H264:
    """H.264 by PyAV, whose wheel brings libx264 (GPL): an extra that nothing else needs."""

    def __init__(self, path: Path, fps: float, size_px: tuple[int, int]) -> None:
        av: Any = import_module("av")
        self._av = av
        self._file = av.open(str(path), "w", options={"movflags": "faststart"})
        stream: Any = self._file.add_stream("libx264", rate=round(fps))
        stream.width, stream.height = size_px
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": H264_CRF, "preset": "medium"}
        self._stream = stream

    def add(self, frame: Frame) -> None:
        picture = self._av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
        for packet in self._stream.encode(picture):
            self._file.mux(packet)

    def close(self, whole: bool) -> None:
        if whole:
            for packet in self._stream.encode():
                self._file.mux(packet)
        self._file.close()


class _WebP:
    """Animated WebP by Pillow; frames wait in memory, already as JPEG, since Pillow wants them all at once."""

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps = path, fps
        self._frames: list[bytes] = []

    def add(self, frame: Frame) -> None:
        jpeg = cv2.imencode(".jpg", np.ascontiguousarray(frame[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
        self._frames.append(jpeg.tobytes())

    def close(self, whole: bool) -> None:
        if not (whole and self._frames):
            return
        first, *rest = (self._picture(jpeg) for jpeg in self._frames)
        # Whole milliseconds between frames, without drifting from the clock.
        edges = np.round(1e3 / self._fps * np.arange(len(self._frames) + 1)).astype(int)
        first.save(
            self._path, format="WEBP", save_all=True, append_images=rest, duration=np.diff(edges).tolist(), loop=0,
            quality=WEBP_QUALITY, method=3,
        )  # fmt: skip

    @staticmethod
    def _picture(jpeg: bytes) -> Pictures.Image:
        bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
        if bgr is None:
            raise StageError("film: a frame could not be read back")
        return Pictures.fromarray(np.ascontiguousarray(bgr[..., ::-1]))
