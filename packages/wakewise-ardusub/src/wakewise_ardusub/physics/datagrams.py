"""Wire format of ArduPilot's JSON interface for external physics: pulses in, motion out; both ends, without a socket.

A request is `<HHI`: a magic number that gives the number of channels, the rate in Hz, a frame count; then one uint16
per channel, the pulse in us. A reply is one line of JSON between two line feeds, without spaces: the firmware's parser
searches the keys and refuses a space after a colon. Layout and names as in ArduPilot's
libraries/SITL/examples/JSON/readme.md and SIM_JSON (facts; no code of it is here).
"""

from __future__ import annotations

import json
import math
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError

CHANNELS = {18458: 16, 29569: 32}
"""Magic number of a request and how many channels it carries."""
PORT = 9002
"""Where physics listens for a first vehicle."""
LARGEST_B = 4096
"""Longer datagrams belong to something else."""
DECIMALS = 9
_HEAD = struct.Struct("<HHI")
_QUATERNION_TOLERANCE = 1e-3


@dataclass(frozen=True, kw_only=True)
class ServoFrame:
    """One frame of the firmware: the rate in Hz at which it wants to be answered, its count, pulses per channel."""

    rate_hz: int
    frame: int
    pulses_us: tuple[int, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class PhysicsState:
    """What physics tells the firmware: truth at one instant.

    Parameters
    ----------
    time_s : float
        Since the start.
    omega_B_rad_s : ndarray, shape (3,)
        What a perfect gyro reads.
    force_B_m_s2 : ndarray, shape (3,)
        Specific force: (0, 0, -9.81) at rest.
    p_WB_m, v_W_m_s : ndarray, shape (3,)
        NED; z is the depth.
    q_WB : ndarray, shape (4,)
        w, x, y, z.
    """

    time_s: float
    omega_B_rad_s: Array
    force_B_m_s2: Array
    p_WB_m: Array
    q_WB: Array
    v_W_m_s: Array

    def __post_init__(self) -> None:
        freeze(self, omega_B_rad_s=(3,), force_B_m_s2=(3,), p_WB_m=(3,), q_WB=(4,), v_W_m_s=(3,))


def write_request(request: ServoFrame) -> bytes:
    """The datagram of a frame; 16 or 32 channels.

    Raises
    ------
    InputError
        If there are as many channels as no request has, or a number does not fit its field.
    """
    magic = next((key for key, count in CHANNELS.items() if count == len(request.pulses_us)), None)
    if magic is None:
        raise InputError(f"physics link: {len(request.pulses_us)} channels, a request has 16 or 32")
    try:
        head = _HEAD.pack(magic, request.rate_hz, request.frame)
        return head + struct.pack(f"<{len(request.pulses_us)}H", *request.pulses_us)
    except struct.error as fault:
        raise InputError(f"physics link: {request}: {fault}") from None


def read_request(datagram: bytes) -> ServoFrame:
    """The frame in a datagram.

    Raises
    ------
    InputError
        If it is none: too short or long for its magic number, an unknown one, a rate of 0.
    """
    if len(datagram) < _HEAD.size:
        raise InputError(f"physics link: a datagram of {len(datagram)} bytes is no request")
    magic, rate_hz, frame = _HEAD.unpack_from(datagram)
    if magic not in CHANNELS:
        raise InputError(f"physics link: magic number {magic}, known are {', '.join(map(str, CHANNELS))}")
    count = CHANNELS[magic]
    if len(datagram) != _HEAD.size + 2 * count:
        raise InputError(f"physics link: {len(datagram)} bytes, {count} channels need {_HEAD.size + 2 * count}")
    if rate_hz == 0:
        raise InputError("physics link: a rate of 0 Hz, must be at least 1")
    return ServoFrame(rate_hz=rate_hz, frame=frame, pulses_us=struct.unpack_from(f"<{count}H", datagram, _HEAD.size))


def write_reply(motion: PhysicsState, *, own_clock: bool = False) -> bytes:
    """The line that answers a frame.

    `own_clock` asks the firmware not to hold itself to the clock on the wall, so that it runs as fast as both can.
    """
    said: dict[str, Any] = {
        "timestamp": round(motion.time_s, DECIMALS),
        "imu": {"gyro": _numbers(motion.omega_B_rad_s), "accel_body": _numbers(motion.force_B_m_s2)},
        "position": _numbers(motion.p_WB_m),
        "quaternion": _numbers(motion.q_WB),
        "velocity": _numbers(motion.v_W_m_s),
    }
    if own_clock:
        said["no_time_sync"] = 1
    return f"\n{json.dumps(said, separators=(',', ':'), allow_nan=False)}\n".encode()


def read_reply(datagram: bytes) -> PhysicsState:
    """The motion in a reply.

    Raises
    ------
    InputError
        If it is no such line, a value is missing, not finite or of another shape, or the quaternion is none.
    """
    try:
        said = json.loads(datagram.decode("ascii"))
        motion = PhysicsState(
            time_s=float(said["timestamp"]),
            omega_B_rad_s=_array(said["imu"]["gyro"], 3),
            force_B_m_s2=_array(said["imu"]["accel_body"], 3),
            p_WB_m=_array(said["position"], 3),
            q_WB=_array(said["quaternion"], 4),
            v_W_m_s=_array(said["velocity"], 3),
        )
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as fault:
        raise InputError(f"physics link: no reply of the JSON link ({type(fault).__name__})") from None
    if not math.isfinite(motion.time_s) or abs(float(np.linalg.norm(motion.q_WB)) - 1.0) > _QUATERNION_TOLERANCE:
        raise InputError("physics link: a reply whose time or quaternion is none")
    return motion


def _numbers(values: Array) -> list[float]:
    return [round(value, DECIMALS) for value in values.tolist()]


def _array(value: Any, count: int) -> Array:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (count,) or not np.all(np.isfinite(array)):
        raise ValueError
    return array
