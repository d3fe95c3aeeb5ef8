"""Poses as lines of text over UDP, one pose per line, as JSON or as comma-separated numbers; forwarding as MAVLink.

For optical tracking, a SLAM program, a DVL's dead reckoning, or a person with netcat:

    {"t": 12.5, "p": [1.0, 2.0, 3.0], "q": [1, 0, 0, 0], "std_m": 0.005, "std_rad": 0.01}
    12.5,1.0,2.0,3.0,1,0,0,0,0.005,0.01

`t` is in seconds of the sender's own clock and may be null (in CSV: empty); then the time of arrival counts. `p` is in
metres, north-east-down; with `"frame": "enu"` east-north-up, and the body is forward-left-up. `q` is (w, x, y, z) from
body to world, or `"rpy"` in radians; without either it is a position alone. `std_m` and `std_rad`, one sigma per axis,
may be left out. Lines that begin with # are comments.

`PoseForwarder` sends poses as VISION_POSITION_ESTIMATE to an autopilot, a ground station or `wakewise link ardusub`.
Fields and covariance are those of MAVLink's common set
(https://mavlink.io/en/messages/common.html#VISION_POSITION_ESTIMATE): NED and FRD, the upper triangle of a 6 x 6 matrix
by rows, its first number NaN if it is not known. `wakewise_ardusub.link.telemetry_adapter` reads the message.
"""

from __future__ import annotations

import json
import math
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.core.geometry import Pose, euler_from_quat, quat_from_euler
from wakewise.core.interfaces import Measurement
from wakewise.experiments.exports.records import enu_of, ros_body
from wakewise_ardusub.link.protocol import DEFAULT_SYSTEM
from wakewise_ardusub.link.telemetry_adapter import SenderClock
from wakewise_ardusub.optional_dependencies import need
from wakewise_ardusub.sensors.devices import read_place

LARGEST_M = 1e5
"""A place further from the origin than this is no place of a dive."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseSample:
    """A pose or a position in NED/FRD on our clock.

    `measurement` has `X_WB`, or `p_WB_m` where the source knows no attitude. `covariance`, shape (6, 6), is that of
    position in W (m) and of attitude (rad, roll, pitch, yaw as MAVLink has it, a rotation vector for small errors);
    None where the source does not say.
    """

    measurement: Measurement
    covariance: Array | None = None

    def __post_init__(self) -> None:
        if self.covariance is not None:
            freeze(self, covariance=(6, 6))

    @property
    def position_std_m(self) -> float | None:
        """One sigma of the position per axis, the root of the mean variance; None where nothing is known."""
        if self.covariance is None:
            return None
        return math.sqrt(float(np.trace(self.covariance[:3, :3])) / 3.0)


def checked_pose(p_m: Array, q: Array) -> Pose:
    """A pose, or what is wrong with it.

    Raises
    ------
    InputError
        If it is not finite, further away than a dive goes, or its quaternion is none.
    """
    return Pose(checked_place(p_m), checked_turn(q))


def checked_place(p_m: Array) -> Array:
    """A place in m, shape (3,), or what is wrong with it."""
    if p_m.shape != (3,) or not np.isfinite(p_m).all() or np.abs(p_m).max() > LARGEST_M:
        told = " ".join(f"{x:g}" for x in p_m.ravel())
        raise InputError(f"position {told}: must be three numbers of at most {LARGEST_M:g} m")
    return p_m


def checked_turn(q: Array) -> Array:
    """A unit quaternion (w, x, y, z), or what is wrong with it; 1 % of length is taken for rounding."""
    if q.shape != (4,) or not abs(float(np.linalg.norm(q)) - 1.0) <= 0.01:
        raise InputError(f"quaternion {' '.join(f'{x:g}' for x in q.ravel())}: its length must be 1")
    return np.asarray(q / np.linalg.norm(q))


LONGEST_LINE = 2000
_CSV = ("t", "x", "y", "z", "qw", "qx", "qy", "qz", "std_m", "std_rad")
_KEYS = frozenset({"t", "p", "q", "rpy", "std_m", "std_rad", "frame"})


def read_line(line: str) -> tuple[float | None, PoseSample] | None:
    """Stamp and pose of a line, the measurement stamped 0; None for a comment or an empty one.

    Raises
    ------
    InputError
        If the line is neither JSON nor numbers of the right count, or a number cannot be.
    """
    text = line.strip()
    if not text or text.startswith("#"):
        return None
    if len(text) > LONGEST_LINE:
        raise InputError(f"line of {len(text)} characters: {LONGEST_LINE} are allowed")
    told = _json(text) if text.startswith("{") else _csv(text)
    unknown = sorted(set(told) - _KEYS)
    if unknown or "p" not in told:
        raise InputError(
            f"pose: {'unknown ' + unknown[0] if unknown else 'no p'}; known are {', '.join(sorted(_KEYS))}"
        )
    if "q" in told and "rpy" in told:
        raise InputError("pose: has q and rpy, one of them is wanted")
    stamp = None if told.get("t") is None else _number("t", told["t"])
    frame = told.get("frame", "ned")
    if frame not in ("ned", "enu"):
        raise InputError(f"frame '{frame}': allowed are ned, enu")
    return stamp, _sample(told, frame == "enu")


class LinePoses:
    """Poses of datagrams; lines that are none are counted, and the last complaint is kept.

    A sender's clock that jumps is told, and its poses are refused until it has gone on evenly (see `SenderClock`).
    """

    def __init__(self) -> None:
        self._clock = SenderClock()
        self.taken = 0
        self.refused = 0
        self.complaint: str | None = None

    def feed(self, data: bytes, arrival_s: float) -> list[PoseSample]:
        """Poses of a datagram that arrived at `arrival_s` of our clock."""
        found = []
        for line in data.decode("utf-8", errors="replace").splitlines():
            try:
                told = read_line(line)
                if told is not None:
                    stamp, sample = told
                    found.append(stamped(sample, arrival_s if stamp is None else self._made_s(stamp, arrival_s)))
            except InputError as fault:
                self.refused += 1
                self.complaint = str(fault)
        self.taken += len(found)
        return found

    def _made_s(self, stamp_s: float, arrival_s: float) -> float:
        """When it was made, by our clock."""
        self._clock, made_s, jump_s = self._clock.at(stamp_s, arrival_s)
        if made_s is None:
            told = f"jumped by {jump_s:+.2f} s" if jump_s else "has not gone on evenly for long enough since it jumped"
            raise InputError(f"the sender's clock {told}; its pose is left out")
        return made_s


def stamped(sample: PoseSample, time_s: float) -> PoseSample:
    """The same at another time."""
    said = sample.measurement
    measured = Measurement(time_s=time_s, X_WB=said.X_WB, p_WB_m=said.p_WB_m)
    return PoseSample(measurement=measured, covariance=sample.covariance)


def _sample(told: Mapping[str, Any], enu: bool) -> PoseSample:
    p = _numbers("p", told["p"], 3)
    q: Array | None = None
    if "q" in told:
        q = checked_turn(_numbers("q", told["q"], 4))
    elif "rpy" in told:
        q = quat_from_euler(*_numbers("rpy", told["rpy"], 3))
    checked_place(p)
    if enu:
        p, q = (enu_of(p), None) if q is None else ros_body(p, q)
    measured = Measurement(time_s=0.0, p_WB_m=p) if q is None else Measurement(time_s=0.0, X_WB=checked_pose(p, q))
    return PoseSample(measurement=measured, covariance=_covariance(told))


def _covariance(told: Mapping[str, Any]) -> Array | None:
    stds = {}
    for name in ("std_m", "std_rad"):
        if told.get(name) is not None:
            stds[name] = _number(name, told[name])
            if not 0.0 < stds[name] < 1e3:
                raise InputError(f"{name}: {stds[name]:g}, must be more than 0")
    if "std_m" not in stds:
        return None
    return np.diag([stds["std_m"] ** 2] * 3 + [stds.get("std_rad", math.pi) ** 2] * 3)


def _json(text: str) -> Mapping[str, Any]:
    try:
        told = json.loads(text)
    except (ValueError, RecursionError):
        raise InputError(f"'{text[:60]}': begins as JSON and is none") from None
    if not isinstance(told, dict):
        raise InputError(f"'{text[:60]}': must be an object")
    return told


def _csv(text: str) -> Mapping[str, Any]:
    cells = [cell.strip() for cell in text.split(",")]
    if len(cells) not in (4, 8, 10):
        raise InputError(
            f"'{text[:60]}': {len(cells)} numbers, must be 4 ({', '.join(_CSV[:4])}), 8 (and "
            f"{', '.join(_CSV[4:8])}) or 10 (and {', '.join(_CSV[8:])})"
        )
    try:
        values = [float(cell) if cell else None for cell in cells]
    except ValueError:
        raise InputError(f"'{text[:60]}': not numbers separated by commas") from None
    told: dict[str, Any] = {"t": values[0], "p": values[1:4]}
    if len(values) > 4:
        told["q"] = values[4:8]
    if len(values) > 8:
        told |= {"std_m": values[8], "std_rad": values[9]}
    return told


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e15:
        raise InputError(f"{name}: {str(value)[:40]}, must be a finite number")
    return float(value)


def _numbers(name: str, values: Any, count: int) -> Array:
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"{name}: must be {count} numbers")
    return np.array([_number(name, value) for value in values])


COMPONENT = 197
"""MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY: a part of the vehicle beside its companion, which is 191."""
_UPPER = np.triu_indices(6)


def vision_position_estimate(sample: PoseSample) -> dict[str, Any] | None:
    """Fields of the message that says a pose; None for a position alone, which the message cannot say."""
    pose = sample.measurement.X_WB
    if pose is None:
        return None
    roll, pitch, yaw = (float(angle) for angle in euler_from_quat(pose.q))
    covariance = [math.nan] + [0.0] * 20
    if sample.covariance is not None:
        covariance = [float(x) for x in sample.covariance[_UPPER]]
    x, y, z = (float(c) for c in pose.p_m)
    return {
        "usec": max(round(1e6 * sample.measurement.time_s), 0),
        **{"x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw},
        "covariance": covariance,
        "reset_counter": 0,
    }


class PoseForwarder:
    """Sends poses to a place, `HOST:PORT`, over UDP, as a part of the vehicle of id `system`.

    Raises
    ------
    InputError, EnvironmentFailure
        If the place is none, or its name leads nowhere.
    MissingExtra
        If pymavlink is not installed.
    """

    def __init__(self, place: str, system: int = DEFAULT_SYSTEM) -> None:
        need("wakewise link sensors --forward", "links", only=("pymavlink",))
        from pymavlink.dialects.v20 import common

        host, port = read_place(place, "--forward")
        try:
            self._to = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0][4]
        except OSError as fault:
            raise EnvironmentFailure(f"--forward {place}: {fault.strerror or fault}") from None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._link = common.MAVLink(None, srcSystem=system, srcComponent=COMPONENT)
        self._message = common.MAVLink_vision_position_estimate_message
        self.sent = 0
        self.lost = 0
        """Poses that did not leave this computer, and positions alone."""

    def __call__(self, sample: Measurement | PoseSample) -> None:
        """Send a pose; what is none is let be."""
        if not isinstance(sample, PoseSample):
            return
        fields = vision_position_estimate(sample)
        try:
            if fields is None:
                raise OSError
            message = self._message(**fields).pack(self._link)
            self._link.seq = (self._link.seq + 1) % 256
            self._socket.sendto(message, self._to)
        except OSError:
            self.lost += 1
            return
        self.sent += 1

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()
