"""Poses by the plainest protocol: a datagram of text, a pose a line, as JSON or as numbers parted by commas.

For optical tracking, a SLAM program, a DVL's dead reckoning, or a person with netcat:

    {"t": 12.5, "p": [1.0, 2.0, 3.0], "q": [1, 0, 0, 0], "std_m": 0.005, "std_rad": 0.01}
    12.5,1.0,2.0,3.0,1,0,0,0,0.005,0.01

`t` is in seconds of the sender's own clock and may be null (in CSV: empty): the time of arrival counts then. `p` is in
metres, north-east-down unless `"frame": "enu"` says otherwise, which makes the body forward-left-up. `q` is (w, x, y,
z) from body to world; `"rpy"` in radians may stand in its place; without either it is a position alone, as optical
tracking has it. `std_m` and `std_rad`, one sigma per axis, may be left out. Lines that begin with # are none.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_from_euler
from wakewise.core.interfaces import Measurement
from wakewise.experiments.exports.frames import enu_of, ros_body
from wakewise_ardusub.link.telemetry_adapter import SenderClock
from wakewise_ardusub.sensors.samples import PoseSample, checked_place, checked_pose, checked_turn

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
        raise InputError(f"'{text[:60]}': not numbers parted by commas") from None
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
