"""Records of a log, whatever its format: samples by channel, parameters, counts of bad records, clock and identity.

Channels in SI, NED and FRD: `sticks` (forward, right, down, turn in [-1, 1]), `servo` (16 pulses in us), `attitude`
(roll, pitch, yaw in rad), `position` (north, east, down from the autopilot's origin, m), `armed`, `mode` (its number),
`voltage`; `odometry` (position of another estimator), `dvl step` (way since the last one, forward, right, down, m),
`global` (latitude, longitude in deg), `altitude` (rangefinder above the bed, m), `calendar` (s since 1970);
each source of depth separately: `depth VFR_HUD`, `depth AHRS2`, `depth CTUN`, `depth BARO` (m), `pressure 1` to
`pressure 3` (Pa).

`LogClock` makes one clock of a log whose clock may jump, because computers without a battery set theirs by the network.
`VehicleIdentity` is the vehicle's type by its heartbeats, its firmware's name, or parameters that only one firmware
has. ArduSub's tables (modes, channels, motors) are used for an ArduSub only.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array

BACK_S, AHEAD_S = 0.5, 3.0
"""Steps from one record to the next beyond these are questioned."""
LONGEST_PAUSE_S = 3600.0
"""Longest pause that is believed where no second clock tells of it."""
_AGREE_S = 1.0


@dataclass(frozen=True)
class ClockJump:
    """A step of the log's clock that was taken out: when, on the mended clock, and by how much."""

    time_s: float
    step_s: float


class LogClock:
    """Turns the stamps of records, in the order of the file, into seconds from the first one that never run back.

    A step back, or ahead by more than `AHEAD_S`, is a jump or a pause. The vehicle's time since boot tells which: after
    the step the mended clock goes on as that does. Where nothing tells, a step back counts as none and one ahead as a
    pause of at most `LONGEST_PAUSE_S`. A single stamp far from those about it is damage and does not count.
    """

    def __init__(self) -> None:
        self.jumps: list[ClockJump] = []
        self.first_stamp_s: float | None = None
        self._stamp_s = math.nan
        self._now_s = 0.0
        self._boot: tuple[float, float] | None = None
        self._open: tuple[float, float] | None = None
        self._ahead_s = 0.0
        self._stray: tuple[float, int] | None = None

    @property
    def now_s(self) -> float:
        """Mended time of the last record that had a stamp; 0 before the first."""
        return self._now_s

    def at(self, stamp_s: float, boot_s: float | None = None) -> float:
        """Mended time of a record by its stamp, and by the vehicle's own time since boot where it has one."""
        if self.first_stamp_s is None:
            self.first_stamp_s = self._stamp_s = stamp_s
        step = stamp_s - self._stamp_s
        if self._stray is not None:
            before_s, told = self._stray
            self._stray = None
            if -BACK_S <= stamp_s - before_s <= AHEAD_S:
                # The one record between had a damaged stamp.
                step, self._open = stamp_s - before_s, None
                del self.jumps[told:]
        last_s, self._stamp_s = self._stamp_s, stamp_s
        if self._open is not None and not -BACK_S <= step <= AHEAD_S:
            # Several steps with nothing to judge them by between count as one.
            at_s, before = self._open
            step, self._open = before + step, None
            if not -BACK_S <= step <= AHEAD_S:
                self._open = (at_s, step)
        elif not -BACK_S <= step <= AHEAD_S:
            self._open = (self._now_s, step)
            self._stray = (last_s, len(self.jumps))
        if -BACK_S <= step <= AHEAD_S:
            held = min(max(step, 0.0), self._ahead_s)
            self._ahead_s -= held
            self._now_s += max(step, 0.0) - held
        if boot_s is not None:
            if self._open is not None:
                self._settle(boot_s)
            self._boot = (boot_s, self._now_s)
        return self._now_s

    def close(self) -> None:
        """Judge a step that no time since boot came after."""
        self._settle(None)

    def _settle(self, boot_s: float | None) -> None:
        """Say what the open step was, and go on after it."""
        if self._open is None:
            return
        (at_s, step), self._open = self._open, None
        gap = None
        if boot_s is not None and self._boot is not None and boot_s >= self._boot[0]:
            late = (boot_s - self._boot[0]) - (self._now_s - self._boot[1])
            gap = max(late, 0.0)
            # A clock that never runs back stands still where it went too far.
            self._ahead_s = max(-late, 0.0)
        if gap is None or gap > LONGEST_PAUSE_S:
            gap = step if 0.0 < step <= LONGEST_PAUSE_S else 0.0
        self._now_s += gap
        if abs(step - gap) > _AGREE_S:
            self.jumps.append(ClockJump(time_s=at_s, step_s=step - gap))


SUBMARINE, ARDUPILOT = 12, 3
"""MAV_TYPE and MAV_AUTOPILOT of an ArduSub."""
NO_AUTOPILOT = 8
"""MAV_AUTOPILOT of what is no vehicle: ground stations, cameras, companions."""
_ARDUSUB = "ArduSub"
_FIRMWARE = re.compile(
    r"(?:APM:?\s*)?(ArduSub|Sub|ArduCopter|Copter|ArduPlane|Plane|ArduRover|Rover2?|Blimp|Heli|AntennaTracker)\s+V?\d",
    re.IGNORECASE,
)
_ONLY_ARDUSUB = re.compile(r"MOT_\d+_DIRECTION\Z|JS_GAIN_DEFAULT\Z")


@dataclass(frozen=True, kw_only=True)
class VehicleIdentity:
    """MAV_TYPE and MAV_AUTOPILOT of the heartbeats, or the firmware's name; None where nothing says it."""

    mav_type: int | None = None
    autopilot: int | None = None
    firmware: str | None = None

    @property
    def is_known(self) -> bool:
        """Whether anything said what the vehicle is."""
        return self.mav_type is not None or self.firmware is not None

    @property
    def is_ardusub(self) -> bool:
        """Whether it is a submarine that ArduPilot steers."""
        if self.mav_type is not None:
            return (self.mav_type, self.autopilot) == (SUBMARINE, ARDUPILOT)
        return self.firmware == _ARDUSUB

    @property
    def is_other(self) -> bool:
        """Whether it is known to be another vehicle."""
        return self.is_known and not self.is_ardusub

    @property
    def words(self) -> str:
        """For people, such as "ArduSub" or "octorotor of ArduPilot (heartbeat type 14)"."""
        if self.is_ardusub:
            return _ARDUSUB
        if self.mav_type is None:
            return self.firmware or "not said"
        maker = "ArduPilot" if self.autopilot == ARDUPILOT else _name("MAV_AUTOPILOT", self.autopilot)
        return f"{_name('MAV_TYPE', self.mav_type)} of {maker} (heartbeat type {self.mav_type})"


def firmware_of(text: str) -> str | None:
    """Name of the ArduPilot firmware that a message of the autopilot begins with, such as "ArduSub V4.1.0 (f2af)"."""
    found = _FIRMWARE.match(text.strip())
    if found is None:
        return None
    name = found[1]
    return _ARDUSUB if name.lower() in ("ardusub", "sub") else name


def firmware_of_parameters(names: Iterable[str]) -> str | None:
    """ArduSub if a parameter is there that no other firmware has."""
    return _ARDUSUB if any(_ONLY_ARDUSUB.match(name) for name in names) else None


def enumerated(enum: str, value: Any) -> int:
    """Number of an enumeration's value, which BlueOS's JSON has in words or as an object with `type`.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is none.
    """
    if isinstance(value, Mapping):
        value = value["type"]
    if isinstance(value, str):
        from pymavlink.dialects.v20 import ardupilotmega

        numbers: dict[str, int] = {entry.name: number for number, entry in ardupilotmega.enums[enum].items()}
        return numbers[value]
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError
    return value


def _name(enum: str, number: int | None) -> str:
    """An enumeration's value in small letters."""
    from pymavlink.dialects.v20 import ardupilotmega

    entry = ardupilotmega.enums[enum].get(number)
    if entry is None:
        return f"type {number}" if enum == "MAV_TYPE" else f"autopilot {number}"
    return str(entry.name.removeprefix(f"{enum}_").lower().replace("_", " "))


SERVOS = 16
WIDTHS = {"sticks": 4, "servo": SERVOS, "attitude": 3, "position": 3}
HELD_S = {"sticks": 1.0, "servo": 1.5, "attitude": 1.0, "position": 1.0, "armed": 5.0, "mode": 5.0, "voltage": 10.0}
"""How long the last sample of a channel stands where one is needed at an instant; then none is known."""
# Beyond these a value is damage, not a measurement.
_ALLOWED = {
    "sticks": (-1.0, 1.0),
    "servo": (500.0, 2500.0),
    "attitude": (-2.0 * math.pi, 2.0 * math.pi),
    "position": (-1e5, 1e5),
    "odometry": (-1e5, 1e5),
    "dvl": (-100.0, 100.0),
    "global": (-180.0, 180.0),
    "altitude": (0.01, 500.0),
    "calendar": (1e9, 4e9),
    "armed": (0.0, 1.0),
    "mode": (0.0, 255.0),
    "voltage": (0.5, 100.0),
    "depth": (-100.0, 12_000.0),
    "pressure": (1e4, 1.3e8),
}
MODES = {
    0: "STABILIZE", 1: "ACRO", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 7: "CIRCLE", 9: "SURFACE", 16: "POSHOLD",
    19: "MANUAL", 20: "MOTOR_DETECT", 21: "SURFTRAK",
}  # fmt: skip
"""ArduSub's flight modes by number (ArduPilot, ArduSub/mode.h)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelSeries:
    """Samples of one channel: times, shape (n,), on the mended clock, and values, shape (n, k), NaN where damaged."""

    time_s: Array
    values: Array

    def __post_init__(self) -> None:
        self.time_s.setflags(write=False)
        self.values.setflags(write=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class VehicleLog:
    """What one log holds of one vehicle.

    Parameters
    ----------
    path : Path
    kind : str
        "tlog", "dataflash" or "mcap".
    system : int or None
        MAVLink system id of the vehicle; None where the format has none. `others` are systems that were left aside.
    records : int
        Whole records.
    bad : dict
        How many records were bad, by reason; a stretch of bytes that is no record counts as one.
    bad_bytes : int
        Bytes in them.
    unread : dict
        How many whole records of a wanted kind had other fields than are known, by kind.
    cut_short : bool
        Whether the file ends within a record.
    series : dict of ChannelSeries
        By channel; see the module.
    parameters : dict
        The vehicle's, as last said.
    jumps : tuple of ClockJump
    started_s : float or None
        Stamp of the first record in seconds: since 1970 for tlog and mcap, since boot for dataflash.
    identity : VehicleIdentity
        What the vehicle says it is.
    """

    path: Path
    kind: str
    records: int
    bad: dict[str, int]
    bad_bytes: int
    cut_short: bool
    series: dict[str, ChannelSeries]
    parameters: dict[str, float]
    jumps: tuple[ClockJump, ...] = ()
    started_s: float | None = None
    system: int | None = None
    others: tuple[int, ...] = ()
    identity: VehicleIdentity = field(default_factory=VehicleIdentity)
    unread: dict[str, int] = field(default_factory=dict)

    @property
    def bad_records(self) -> int:
        """All bad records."""
        return sum(self.bad.values())

    @property
    def duration_s(self) -> float:
        """Time of the last sample."""
        return max((float(s.time_s[-1]) for s in self.series.values()), default=0.0)


def valid_or_nan(channel: str, values: Iterable[float]) -> tuple[float, ...]:
    """Values of a channel's sample; one out of its range, or none, becomes NaN."""
    low, high = _ALLOWED[channel.partition(" ")[0]]
    return tuple(float(v) if low <= v <= high else math.nan for v in values)


def is_parameter(name: str, value: float) -> bool:
    """Whether a name and a value can be a parameter's."""
    return name.isidentifier() and math.isfinite(value)


@dataclass
class SystemRecords:
    """Samples and parameters of one system while a log is read."""

    rows: dict[str, list[tuple[float, ...]]] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)
    beats: Counter[tuple[int, int]] = field(default_factory=Counter)
    firmware: str | None = None

    def put(self, channel: str, time_s: float, values: Iterable[float]) -> None:
        """Keep one sample; a value out of its range, or none, becomes NaN."""
        kept = valid_or_nan(channel, values)
        self.rows.setdefault(channel, []).append((time_s, *kept))

    def parameter(self, name: str, value: float) -> None:
        """Keep a parameter under a name that can be one."""
        if is_parameter(name, value):
            self.parameters[name] = value

    def beat(self, mav_type: int, autopilot: int) -> None:
        """Count what a heartbeat says the vehicle is."""
        self.beats[mav_type, autopilot] += 1

    @property
    def identity(self) -> VehicleIdentity:
        """By most heartbeats; without any by the firmware's name, or by parameters that only one firmware has."""
        if self.beats:
            ((mav_type, autopilot), _) = self.beats.most_common(1)[0]
            return VehicleIdentity(mav_type=mav_type, autopilot=autopilot, firmware=self.firmware)
        return VehicleIdentity(firmware=self.firmware or firmware_of_parameters(self.parameters))

    @property
    def samples(self) -> int:
        """How much is known of it."""
        return sum(map(len, self.rows.values()))


class LogCollector:
    """Collects what a reader finds; `done` makes the record of it."""

    def __init__(self) -> None:
        self.clock = LogClock()
        self.records = 0
        self.bad: Counter[str] = Counter()
        self.bad_bytes = 0
        self.unread: Counter[str] = Counter()
        self.cut_short = False
        self.systems: dict[int | None, SystemRecords] = {}

    def records_of(self, system: int | None = None) -> SystemRecords:
        """Where samples of a system go."""
        return self.systems.setdefault(system, SystemRecords())

    def count_bad(self, reason: str, size: int) -> None:
        """Count a bad record of some bytes."""
        self.bad[reason] += 1
        self.bad_bytes += size

    def done(self, path: Path, kind: str) -> VehicleLog:
        """The log of the ArduSub, or where none is of the system, that most is known of."""
        self.clock.close()
        held = {
            s: (system_records.identity.is_ardusub, system_records.samples)
            for s, system_records in self.systems.items()
            if system_records.samples
        }
        system = max(held, key=lambda s: held[s], default=None)
        system_records = self.systems.get(system, SystemRecords())
        series = {}
        for channel, rows in system_records.rows.items():
            table = np.array(rows, dtype=np.float64)
            series[channel] = ChannelSeries(time_s=table[:, 0].copy(), values=table[:, 1:].copy())
        return VehicleLog(
            path=path,
            kind=kind,
            records=self.records,
            bad=dict(self.bad),
            bad_bytes=self.bad_bytes,
            cut_short=self.cut_short,
            series=series,
            parameters=system_records.parameters,
            jumps=tuple(self.clock.jumps),
            started_s=self.clock.first_stamp_s,
            system=system,
            identity=system_records.identity,
            unread=dict(self.unread),
            others=tuple(sorted(s for s, v in self.systems.items() if s is not None and s != system and v.samples)),
        )
