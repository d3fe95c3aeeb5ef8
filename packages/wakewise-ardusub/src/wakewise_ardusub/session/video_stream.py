"""The stream of the vehicle's camera: where it is, and a thread that reads it.

OpenCV reads the stream and is imported when one is opened: it is an extra.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from wakewise.core.errors import InputError

Picture = NDArray[np.uint8]
MOST_DELAY_S = 1.5
RETRY_S = 2.0
OPENS_MS, READS_MS = 5000, 3000
"""A stream that does not answer, or stops, is given up after this, and opened anew."""
SCHEMES = ("rtsp", "rtsps", "http", "https", "udp", "tcp")
STREAM_FORMS = f"an address ({', '.join(SCHEMES)}), an .sdp file, or a number for a camera at this computer"


@dataclass(frozen=True, kw_only=True)
class VideoSource:
    """Where a stream is, and how old its pictures are when they arrive.

    Raises
    ------
    InputError
        If `place` is no stream, or `delay_s` is not within 0 and `MOST_DELAY_S`.
    """

    place: str
    delay_s: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.delay_s <= MOST_DELAY_S:
            raise InputError(f"--video-delay {self.delay_s:g}: must be 0 to {MOST_DELAY_S:g} s")
        if self.place.isdigit() or urlsplit(self.place).scheme.lower() in SCHEMES:
            return
        if Path(self.place).suffix.lower() != ".sdp":
            raise InputError(f"--video {self.place!r}: must be {STREAM_FORMS}")
        if not Path(self.place).is_file():
            raise InputError(f"--video {self.place}: no such file")


class VideoCapture(Protocol):
    """An open stream, as `cv2.VideoCapture`."""

    def grab(self) -> bool:
        """Go to the next picture; false if there is none."""
        ...

    def retrieve(self) -> tuple[bool, Any]:
        """Whether there is one, and the present picture, BGR, shape (h, w, 3)."""
        ...

    def release(self) -> None:
        """Close it."""
        ...


def open_video(place: str) -> VideoCapture | None:
    """Open a stream with OpenCV; None if it cannot be opened."""
    import cv2

    # OpenCV takes options of the stream from the environment only; what the user has set stays.
    os.environ.setdefault(
        "OPENCV_FFMPEG_CAPTURE_OPTIONS",
        "protocol_whitelist;file,rtp,udp,tcp,tls,http,https,rtsp,rtsps|rtsp_flags;prefer_tcp|fflags;nobuffer|flags;low_delay",
    )
    # A broken picture, or a stream that is not there, is no line at the terminal.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
    if place.isdigit():
        capture = cv2.VideoCapture(int(place))
    else:
        times = [cv2.CAP_PROP_OPEN_TIMEOUT_MSEC, OPENS_MS, cv2.CAP_PROP_READ_TIMEOUT_MSEC, READS_MS]
        capture = cv2.VideoCapture(place, cv2.CAP_FFMPEG, times)
    return capture if capture.isOpened() else None


class VideoReader:
    """Reads a stream in a thread of its own, and hands pictures on as they are due; opens it anew when it ends.

    Every picture is taken from the stream, so that none waits in a buffer; only those that are due are converted.

    Parameters
    ----------
    source : VideoSource
    clock : callable
        The time now, s.
    take : callable
        Called in the thread with a picture, BGR, shape (h, w, 3), and the time at which it was taken.
    rate_hz : float
    opened : callable
        Opens the stream; `open_video` if not given.
    """

    def __init__(
        self,
        source: VideoSource,
        clock: Callable[[], float],
        take: Callable[[Picture, float], None],
        rate_hz: float,
        opened: Callable[[str], VideoCapture | None] | None = None,
    ) -> None:
        self._source, self._clock, self._take, self._opened = source, clock, take, opened or open_video
        self._period_s, self._due_s = 1.0 / rate_hz, -math.inf
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="video", daemon=True)
        self.trouble = "not opened yet"

    def start(self) -> None:
        """Start reading."""
        self._thread.start()

    def close(self) -> None:
        """Stop reading, after the picture that is waited for, which may take `READS_MS`."""
        self._over.set()
        if self._thread.is_alive():
            self._thread.join(1e-3 * max(OPENS_MS, READS_MS))

    def _run(self) -> None:
        while not self._over.is_set():
            try:
                capture = self._opened(self._source.place)
                if capture is None:
                    self.trouble = "cannot be opened"
                else:
                    self._read(capture)
                    self.trouble = "ended"
            except Exception as fault:  # the flight goes on without pictures
                self.trouble = f"{type(fault).__name__}: {' '.join(str(fault).split())}"[:120]
            self._over.wait(RETRY_S)

    def _read(self, capture: VideoCapture) -> None:
        try:
            while not self._over.is_set() and capture.grab():
                now_s = self._clock()
                if now_s < self._due_s:
                    continue
                there, picture = capture.retrieve()
                if not there:
                    continue
                self._due_s = max(self._due_s + self._period_s, now_s)
                self.trouble = ""
                self._take(np.asarray(picture, dtype=np.uint8), now_s - self._source.delay_s)
        finally:
            capture.release()
