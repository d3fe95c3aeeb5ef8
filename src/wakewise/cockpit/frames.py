"""The live picture: what the camera sees now, small, by the renderer of the photographs, in a process of its own.

Of a photograph's chain it has scene, light, water, silt, exposure and noise; left out are motion blur, flakes, and how
a soft target bends. One ray a pixel. Rendering takes the interpreter's lock for longer than a control step may wait, so
it is done in another process, which yields to the loop where both want a core.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Any

from wakewise.errors import StageError
from wakewise.geometry import Pose
from wakewise.interfaces import ScalarGrid

if TYPE_CHECKING:
    from wakewise.imaging import ImagingSettings
    from wakewise.operation import Scenario
    from wakewise.targets import Target

WIDTH_PX = 480
QUALITY = 75
NICER = 5
"""How much the process yields to others (nice), once its scene is ready."""
_METERED = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """Where the camera truly is, and the silt before it; None leaves that as it was."""

    X_WC: Pose
    silt: ScalarGrid | None = None


class LiveCamera:
    """Draws views on request, one at a time.

    Parameters
    ----------
    scenario : Scenario
        Its target, camera, light and water.
    target : Target, optional
        In place of the scenario's own.
    width_px : int
        The height follows from the scenario's.
    """

    def __init__(self, scenario: Scenario, target: Target | None = None, width_px: int = WIDTH_PX) -> None:
        self._begin = (scenario, target, width_px)
        self._process: subprocess.Popen[bytes] | None = None
        self._answers: queue.Queue[bytes | None] = queue.Queue()
        self._waited_for, self._last = 0, b""
        self._lock = threading.Lock()

    def start(self) -> None:
        """Start the process, which takes a few seconds to light its scene."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "wakewise.cockpit.frames"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ
            | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path), "NUMBA_NUM_THREADS": "1"},
        )
        threading.Thread(target=self._listen, args=(self._process.stdout,), name="pictures", daemon=True).start()
        self._send(pickle.dumps(self._begin))
        self._waited_for = 1  # its word that the scene is ready

    def draw(self, view: View, timeout_s: float = 2.0) -> bytes | None:
        """Draw a view as a JPEG; None while the scene is not ready, or where a picture does not come in time.

        Raises
        ------
        StageError
            If the process has ended.
        """
        with self._lock:
            if self._process is None:
                return None
            if not self._caught_up(0.0 if self._waited_for else timeout_s):
                return None
            self._send(pickle.dumps(view))
            self._waited_for += 1
            return self._last if self._caught_up(timeout_s) else None

    def close(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with suppress(OSError):
                        pipe.close()

    def _caught_up(self, timeout_s: float) -> bool:
        """Whether all that was asked for has been answered, within a time."""
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
        with suppress(OSError):  # then it has ended, which the answers tell
            _write(self._process.stdin, message)

    def _listen(self, pipe: IO[bytes]) -> None:
        with suppress(OSError, ValueError):
            while (answer := _read(pipe)) is not None:
                self._answers.put(answer)
        self._answers.put(None)


def _write(pipe: IO[bytes], message: bytes) -> None:
    pipe.write(len(message).to_bytes(8, "little") + message)
    pipe.flush()


def _read(pipe: IO[bytes]) -> bytes | None:
    """The next message; None at the end."""
    head = pipe.read(8)
    if len(head) < 8:
        return None
    size = int.from_bytes(head, "little")
    message = pipe.read(size)
    return message if len(message) == size else None


class Easel:
    """Draws small pictures of one scene, one after the other."""

    def __init__(self, scenario: Scenario, target: Target | None, width_px: int) -> None:
        import numpy as np

        from wakewise.imaging import SiltOptics

        parts = scenario.parts() if target is None else scenario.parts().replace(target=target)
        given = parts.scenario.imaging
        height = max(16, round(width_px * given.height / given.width))
        self.settings: ImagingSettings = given.model_copy(update={"width": width_px, "height": height})
        self._camera, self._scene = self.settings.camera(), parts.scene
        silt = parts.scenario.tank.silt
        self._grains = SiltOptics(diameter_m=silt.grain_m, density_kg_m3=silt.grain_density_kg_m3)
        self._silt: ScalarGrid | None = None
        self._seen: deque[float] = deque(maxlen=_METERED)
        self._rng = np.random.default_rng(parts.scenario.seed)

    def draw(self, view: View) -> Any:
        """The picture, RGB, shape (h, w, 3), uint8."""
        from wakewise.imaging.metering import brightness, divided, settled
        from wakewise.imaging.optics import haze_between, through_water
        from wakewise.imaging.photograph import white_balance
        from wakewise.imaging.renderer import render
        from wakewise.imaging.sensor import expose
        from wakewise.imaging.settings import ELECTRONS_PER_S, READ_NOISE_E

        if view.silt is not None:
            self._silt = view.silt if view.silt.largest > 0.0 else None
        settings, X_WC = self.settings, view.X_WC
        lights, water, balance = settings.lights(), settings.water(), white_balance(settings)
        gain, amplification = settings.gain, 1.0
        if settings.auto_exposure:
            self._seen.append(brightness(self._scene, X_WC, self._silt, settings, self._grains, balance))
            chosen = divided(settled(self._seen), settings)
            gain, amplification = chosen.gain, chosen.amplification
        seen = render(self._scene, self._camera, X_WC, lights, 1)
        haze = haze_between(self._camera, X_WC, water, self._grains, self._silt, lights)
        radiance, _ = through_water(seen, self._camera, haze, water, lights.from_above, self._grains)
        well_e = ELECTRONS_PER_S * settings.exposure_s / amplification
        return expose(radiance, gain * balance, well_e, READ_NOISE_E, self._rng)


def serve(pipe: IO[bytes], answers: IO[bytes]) -> None:
    """Draw what is asked for until nobody asks any more: the other process."""
    import cv2

    first = _read(pipe)
    if first is None:
        return
    easel = Easel(*pickle.loads(first))
    _write(answers, b"ready")
    with suppress(OSError):
        os.nice(NICER)
    while (message := _read(pipe)) is not None:
        image = easel.draw(pickle.loads(message))
        _write(answers, cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes())


if __name__ == "__main__":
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started this ends it
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # whatever else is printed is no answer
    serve(sys.stdin.buffer, answers)
