"""Cameras of a session: MAVLink commands, or a program that is run for each photograph.

The session triggers the photographs (buttons or mission) and records their poses. Three kinds:

- `mavlink`: MAV_CMD_IMAGE_START_CAPTURE, one image, to every component of the vehicle (MAVLink's camera protocol; an
  autopilot of 4.4 or later with a camera set up accepts it as well);
- `digicam`: MAV_CMD_DO_DIGICAM_CONTROL, the older command, which every ArduPilot with a camera set up accepts;
- `run:PROGRAM ...`: a program for each photograph, for cameras without MAVLink, as the stock one of a BlueROV2.

None of them blocks the control thread.
"""

from __future__ import annotations

import shlex
import shutil
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.link.protocol import photograph_command
from wakewise_ardusub.link.session_log import SessionLog

PHOTOGRAPHS = "photographs"
CAMERAS_FILE = "cameras.csv"
PATIENCE_S = 30.0
"""A program that takes longer over a photograph is ended."""
_COLUMNS = "name,x_m,y_m,z_m,qw,qx,qy,qz,flight_s,utc_s"
_ALL_COMPONENTS = 0
CAMERA_FORMS = "mavlink, digicam, or run:PROGRAM with {file} where the photograph goes"


class CameraDriver(Protocol):
    """Takes photographs."""

    def take(self, number: int) -> None:
        """Have photograph `number`, from 1, taken; does not wait for it."""
        ...

    def close(self) -> None:
        """Finish what is under way."""
        ...


MakeCamera = Callable[[OutputGate, Path, SessionLog], CameraDriver]
"""Makes the camera of a session: its output gate, its folder and its journal."""


def photo_name(number: int) -> str:
    """What photograph `number`, from 1, is called in the record."""
    return f"{number:04d}.jpg"


def parse_camera(words: str) -> MakeCamera:
    """Read what `--camera` says.

    Raises
    ------
    InputError
        If it is none of the ways, or the program is not there.
    """
    if words in ("mavlink", "digicam"):
        return lambda gate, _folder, _journal: MavlinkCamera(gate, digicam=words == "digicam")
    way, _, line = words.partition(":")
    if way != "run":
        raise InputError(f"--camera {words!r}: right is {CAMERA_FORMS}")
    try:
        program = shlex.split(line)
    except ValueError as fault:
        raise InputError(f"--camera {words!r}: {fault}; right is {CAMERA_FORMS}") from None
    if not program:
        raise InputError(f"--camera {words!r}: nothing to run; right is {CAMERA_FORMS}")
    if shutil.which(program[0]) is None:
        raise InputError(f"--camera {words!r}: there is no program {program[0]}")
    return lambda _gate, folder, journal: ProgramCamera(program, folder / PHOTOGRAPHS, journal)


@dataclass(eq=False)
class MavlinkCamera:
    """A camera of the vehicle that takes MAVLink's commands; what it answers is the output gate's to hear."""

    gate: OutputGate
    digicam: bool = False

    def take(self, number: int) -> None:
        """Ask for one image now."""
        command, numbers = photograph_command(number, self.digicam)
        fields = {f"param{i}": value for i, value in enumerate(numbers, start=1)}
        target = {"target_system": self.gate.known.system, "target_component": _ALL_COMPONENTS}
        self.gate.send("command_long", {**target, "command": command, "confirmation": 0, **fields})

    def close(self) -> None:
        """Nothing is held."""


class ProgramCamera:
    """A program for each photograph, one after the other, in a thread of its own.

    Parameters
    ----------
    program : list of str
        Its words; {file} becomes the photograph's path and {number} its number.
    folder : Path
        Where photographs go; made with the first.
    journal : SessionLog
        Is told how each went.
    """

    def __init__(self, program: list[str], folder: Path, journal: SessionLog) -> None:
        self._program, self._folder, self._journal = program, folder, journal
        self._beside = ThreadPoolExecutor(1, thread_name_prefix="camera")
        self._asked: dict[int, Future[None]] = {}

    def take(self, number: int) -> None:
        """Start it, or have it wait for the one before."""
        self._asked[number] = self._beside.submit(self._run, number)

    def close(self) -> None:
        """Wait for the photograph under way; those that wait for it are not taken."""
        self._beside.shutdown(cancel_futures=True)
        for number in (number for number, asked in self._asked.items() if asked.cancelled()):
            self._told(number, 0.0, "not taken: the session ended")

    def _run(self, number: int) -> None:
        file = self._folder / photo_name(number)
        words = [word.replace("{file}", str(file)).replace("{number}", str(number)) for word in self._program]
        began_s = time.monotonic()
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE_S, check=False)
            said = done.stderr.decode("utf-8", "replace").strip().splitlines()
            amiss = "" if done.returncode == 0 else f"ended with {done.returncode}: {said[-1] if said else ''}"
        except subprocess.TimeoutExpired:
            amiss = f"took longer than {PATIENCE_S:g} s"
        except OSError as fault:
            amiss = fault.strerror or str(fault)
        self._told(number, round(time.monotonic() - began_s, 3), amiss)

    def _told(self, number: int, took_s: float, amiss: str) -> None:
        file = self._folder / photo_name(number)
        self._journal.write("camera", number=number, file=str(file), there=file.exists(), took_s=took_s, amiss=amiss)


def note_view(folder: Path, number: int, X_WC: Pose, flight_s: float) -> None:
    """Add the camera's centre and attitude at a photograph to a table that `wakewise reconstruct` takes."""
    path = folder / CAMERAS_FILE
    figures = (*X_WC.p_m, *X_WC.q)
    row = ",".join(
        (photo_name(number), *(f"{value:.6f}" for value in figures), f"{flight_s:.3f}", f"{time.time():.3f}")
    )
    with path.open("a", encoding="utf-8") as file:
        file.write(f"{row}\n" if path.stat().st_size else f"{_COLUMNS}\n{row}\n")
