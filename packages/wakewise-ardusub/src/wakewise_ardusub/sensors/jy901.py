"""WitMotion's JY901 and WT901 inertial units: frames of 11 bytes on a serial line.

A frame is 0x55, its kind, four signed 16-bit numbers (low byte first) and the sum of the ten bytes before, modulo 256
(WT901 data sheet v20-0702, section 5.1). The factory setting is 9600 baud and 10 Hz.

**Axes.** In the module's data sheet x is right, y forward and z up (section 3.3); in those of units in a case x is
forward and y left. `mounting` gives the direction of each axis on the vehicle.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Measurement

HEAD = 0x55
LENGTH = 11
TIME, ACCELERATION, TURNING, ANGLES, MAGNETIC = 0x50, 0x51, 0x52, 0x53, 0x54
PORTS, PRESSURE, PLACE, SPEED, QUATERNION, ACCURACY = 0x55, 0x56, 0x57, 0x58, 0x59, 0x5A
KINDS = range(TIME, ACCURACY + 1)
FULL = 32768.0
FULL_ACCELERATION_G, FULL_TURNING_DEG_S, FULL_ANGLE_DEG = 16.0, 2000.0, 180.0
BAUD = 9600
AXES = ("right", "forward", "up")
_DIRECTIONS = {
    "forward": (1.0, 0.0, 0.0), "back": (-1.0, 0.0, 0.0), "right": (0.0, 1.0, 0.0), "left": (0.0, -1.0, 0.0),
    "down": (0.0, 0.0, 1.0), "up": (0.0, 0.0, -1.0),
}  # fmt: skip
_PAIRED_S = 0.1
"""Acceleration and turning of one sample come within this; what is further apart is of two."""


@dataclass(frozen=True)
class SerialFrame:
    """Kind and the four numbers of a frame."""

    kind: int
    values: tuple[int, int, int, int]


class FrameReader:
    """Takes bytes as they come and gives whole frames; what is none is skipped and counted."""

    def __init__(self) -> None:
        self._held = bytearray()
        self.frames = 0
        self.bad_bytes = 0

    def feed(self, data: bytes) -> list[SerialFrame]:
        """Frames that are complete now; a frame that was cut short waits for the rest."""
        held, found = self._held, []
        held += data
        at = 0
        while len(held) - at >= LENGTH:
            # A sum that happens to fit is one in 256; the kind makes it one in 6,000 bytes of noise.
            if held[at] == HEAD and held[at + 1] in KINDS and sum(held[at : at + 10]) & 0xFF == held[at + 10]:
                found.append(SerialFrame(held[at + 1], struct.unpack_from("<4h", held, at + 2)))
                at += LENGTH
                continue
            nearest = held.find(HEAD, at + 1)
            step = (len(held) - at if nearest < 0 else nearest - at) or 1
            self.bad_bytes += step
            at += step
        del held[:at]
        self.frames += len(found)
        return found


def mounting(axes: Sequence[str] = AXES) -> Array:
    """R_BS, shape (3, 3), of where the sensor's x, y and z point on the vehicle: forward, back, right, left, down, up.

    Raises
    ------
    InputError
        If a direction is not known, or the three make no right-handed set.
    """
    told = ",".join(axes)
    unknown = [axis for axis in axes if axis not in _DIRECTIONS]
    if len(axes) != 3 or unknown:
        raise InputError(f"axes '{told}': three of {', '.join(_DIRECTIONS)} are needed, separated by commas")
    R_BS = np.array([_DIRECTIONS[axis] for axis in axes]).T
    if round(float(np.linalg.det(R_BS))) != 1:
        raise InputError(f"axes '{told}': make no right-handed set; the default is {','.join(AXES)}")
    return R_BS


@dataclass
class InertialUnit:
    """Makes measurements of frames.

    Parameters
    ----------
    R_BS : ndarray, shape (3, 3)
        See `mounting`.
    """

    R_BS: Array = field(default_factory=mounting)
    reader: FrameReader = field(default_factory=FrameReader)
    angles_rad: Array | None = None
    """Roll, pitch, yaw as the unit itself has them, shape (3,), of its own axes in a world of x east, y north, z up."""
    temperature_C: float | None = None
    _force: tuple[float, Array] | None = None

    def feed(self, data: bytes, time_s: float) -> list[Measurement]:
        """Measurements that are complete with these bytes, stamped with their arrival."""
        found = []
        for frame in self.reader.feed(data):
            numbers = np.array(frame.values[:3]) / FULL
            if frame.kind == ACCELERATION:
                self._force = (time_s, self.R_BS @ (numbers * FULL_ACCELERATION_G * GRAVITY_M_S2))
                self.temperature_C = frame.values[3] / 100.0
            elif frame.kind == TURNING:
                omega = self.R_BS @ np.radians(numbers * FULL_TURNING_DEG_S)
                force = self._force[1] if self._force and time_s - self._force[0] <= _PAIRED_S else None
                self._force = None
                found.append(Measurement(time_s=time_s, omega_B_rad_s=omega, force_B_m_s2=force))
            elif frame.kind == ANGLES:
                self.angles_rad = numbers * math.pi
        return found


def composed(kind: int, values: Sequence[int]) -> bytes:
    """The bytes of a frame: what a unit would send."""
    body = struct.pack("<BB4h", HEAD, kind, *values)
    return body + bytes([sum(body) & 0xFF])
