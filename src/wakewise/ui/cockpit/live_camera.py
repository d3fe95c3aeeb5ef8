"""The live picture: what the camera sees now, small, by the renderer of the photographs, in a process of its own.

It includes scene, light, water, silt, exposure and noise, with one ray per pixel. Motion blur, flakes and the bending
of a soft target are left out. Rendering holds the interpreter's lock for longer than a control step may wait, so it
runs in another process with lower priority.
"""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import IO, TYPE_CHECKING, Any

from wakewise.core.errors import StageError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid
from wakewise.core.subprocesses import (
    end_process,
    ignore_interrupt,
    private_stdout,
    read_message,
    start_python,
    write_message,
)

if TYPE_CHECKING:
    from wakewise.operation import Scenario
    from wakewise.scene.targets import Target
    from wakewise.vision.imaging import ImagingSettings

WIDTHS_PX = (480, 400, 320, 256)
"""Widths of a picture, widest first: under load pictures become smaller, and not less frequent."""
DRAWN_WITHIN_S = 0.07
"""Largest rendering time, so that ten pictures a second can be sent and shown."""
_SMOOTHED = 0.3
QUALITY = 75
NICER = 5
"""Niceness of the process after its scene is ready."""
_METERED = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraState:
    """Where the camera truly is, and the silt before it; None leaves that as it was. `width_px`: of the picture."""

    X_WC: Pose
    silt: ScalarGrid | None = None
    width_px: int | None = None


class PictureWidth:
    """Width of the next picture by the times of the last ones.

    The time is proportional to the number of pixels, that is, to the square of the width. The width is one step smaller
    if the mean time is above `within_s`, and one step larger if the time there is a fifth below it.
    """

    def __init__(self, widths_px: tuple[int, ...] = WIDTHS_PX, within_s: float = DRAWN_WITHIN_S) -> None:
        self._widths_px, self._within_s = widths_px, within_s
        self._at = 0
        self._mean_s: float | None = None

    @property
    def px(self) -> int:
        """Of the next picture."""
        return self._widths_px[self._at]

    def took(self, took_s: float) -> None:
        """Take in the time of the last picture."""
        before_s = self._mean_s
        mean_s = took_s if before_s is None else before_s + _SMOOTHED * (took_s - before_s)
        self._mean_s = mean_s
        if mean_s > self._within_s:
            self._step(1)
        elif self._at > 0 and 1.2 * mean_s * self._growth(-1) < self._within_s:
            self._step(-1)

    def _growth(self, by: int) -> float:
        """Pixels of a width `by` steps on, over this one's."""
        return (self._widths_px[self._at + by] / self.px) ** 2

    def _step(self, by: int) -> None:
        if 0 <= self._at + by < len(self._widths_px) and self._mean_s is not None:
            self._mean_s *= self._growth(by)
            self._at += by


class LiveCamera:
    """Renders views on request, one at a time.

    `scenario`: its target, camera, light and water. `target`: in place of the scenario's own. `widths_px`: of its
    pictures, widest first; the height follows from the scenario's.
    """

    def __init__(
        self, scenario: Scenario, target: Target | None = None, widths_px: tuple[int, ...] = WIDTHS_PX
    ) -> None:
        self._begin = (scenario, target, widths_px[0])
        self._width = PictureWidth(widths_px)
        self._process: subprocess.Popen[bytes] | None = None
        self._answers: queue.Queue[bytes | None] = queue.Queue()
        self._waited_for, self._last = 0, b""
        self._lock = threading.Lock()

    def start(self) -> None:
        """Start the process, which takes a few seconds to build its scene."""
        self._process = start_python("-m", "wakewise.ui.cockpit.live_camera", variables={"NUMBA_NUM_THREADS": "1"})
        threading.Thread(target=self._listen, args=(self._process.stdout,), name="pictures", daemon=True).start()
        self._send(pickle.dumps(self._begin))
        self._waited_for = 1  # the message that the scene is ready

    def draw(self, view: CameraState, timeout_s: float = 2.0) -> bytes | None:
        """Draw a view as a JPEG; None while the scene is not ready, or where a picture does not come in time.

        Raises StageError if the process has ended.
        """
        with self._lock:
            if self._process is None:
                return None
            if not self._caught_up(0.0 if self._waited_for else timeout_s):
                return None
            began_s = time.monotonic()
            self._send(pickle.dumps(replace(view, width_px=self._width.px)))
            self._waited_for += 1
            in_time = self._caught_up(timeout_s)
            self._width.took(time.monotonic() - began_s)
            return self._last if in_time else None

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            end_process(process)

    def _caught_up(self, timeout_s: float) -> bool:
        """Whether all requests were answered within a time."""
        while self._waited_for:
            try:
                answer = self._answers.get(timeout=timeout_s) if timeout_s else self._answers.get_nowait()
            except queue.Empty:
                return False
            if answer is None:
                raise StageError("live picture: the process that draws it has ended")
            self._last, self._waited_for = answer, self._waited_for - 1
        return True

    def _send(self, message: bytes) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        with suppress(OSError):  # then it has ended, which `_listen` reports
            write_message(self._process.stdin, message)

    def _listen(self, pipe: IO[bytes]) -> None:
        with suppress(OSError, ValueError):
            while (answer := read_message(pipe)) is not None:
                self._answers.put(answer)
        self._answers.put(None)


class PictureRenderer:
    """Draws small pictures of one scene, one after the other."""

    def __init__(self, scenario: Scenario, target: Target | None, width_px: int) -> None:
        import numpy as np

        parts = scenario.parts() if target is None else scenario.parts().replace(target=target)
        self._given, self._width_px, self._scene = parts.scenario.imaging, width_px, parts.scene
        self._grains = parts.grains
        self._silt: ScalarGrid | None = None
        self._seen: deque[float] = deque(maxlen=_METERED)
        self._rng = np.random.default_rng(parts.scenario.seed)
        self._first = CameraState(X_WC=parts.start.X_WB @ parts.vehicle.X_BC)

    def warm(self) -> None:
        """Render a first picture, which loads the kernels."""
        self.draw(self._first)
        self._seen.clear()

    def settings(self, width_px: int) -> ImagingSettings:
        """Settings of a picture of this width."""
        height = max(16, round(width_px * self._given.height / self._given.width))
        return self._given.model_copy(update={"width": width_px, "height": height})

    def draw(self, view: CameraState) -> Any:
        """The picture, RGB, shape (h, w, 3), uint8."""
        from wakewise.vision.imaging.optics import attenuate, haze_between
        from wakewise.vision.imaging.photograph import brightness, converged_gain, split_gain, white_balance
        from wakewise.vision.imaging.renderer import render
        from wakewise.vision.imaging.sensor import expose
        from wakewise.vision.imaging.settings import ELECTRONS_PER_S, READ_NOISE_E

        if view.silt is not None:
            self._silt = view.silt if view.silt.largest > 0.0 else None
        settings, X_WC = self.settings(view.width_px or self._width_px), view.X_WC
        camera = settings.camera()
        lights, water, balance = settings.lights(), settings.water(), white_balance(settings)
        gain, amplification = settings.gain, 1.0
        if settings.auto_exposure:
            self._seen.append(brightness(self._scene, X_WC, self._silt, settings, self._grains, balance))
            chosen = split_gain(converged_gain(self._seen), settings)
            gain, amplification = chosen.gain, chosen.amplification
        seen = render(self._scene, camera, X_WC, lights, 1)
        haze = haze_between(camera, X_WC, water, self._grains, self._silt, lights)
        radiance, _ = attenuate(seen, camera, haze, water, lights.from_above, self._grains)
        well_e = ELECTRONS_PER_S * settings.exposure_s / amplification
        return expose(radiance, gain * balance, well_e, READ_NOISE_E, self._rng)


def serve(pipe: IO[bytes], answers: IO[bytes]) -> None:
    """Render the requested views until the pipe ends: the other process."""
    import cv2

    first = read_message(pipe)
    if first is None:
        return
    renderer = PictureRenderer(*pickle.loads(first))
    renderer.warm()
    write_message(answers, b"ready")
    with suppress(OSError):
        os.nice(NICER)
    while (message := read_message(pipe)) is not None:
        image = renderer.draw(pickle.loads(message))
        write_message(answers, cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes())


if __name__ == "__main__":
    ignore_interrupt()
    serve(sys.stdin.buffer, private_stdout())
