"""What readers find in a log, whatever its format: samples by channel, parameters, and a count of what was no record.

Channels, all in SI, NED and FRD: `sticks` (forward, right, down, turn in [-1, 1]), `servo` (16 pulses in us),
`attitude` (roll, pitch, yaw in rad), `position` (north, east, down of the autopilot's origin, m), `armed`, `mode` (its
number), `voltage`; of depth, each source by itself: `depth VFR_HUD`, `depth AHRS2`, `depth CTUN`, `depth BARO` (m),
`pressure 1` to `pressure 3` (Pa).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array
from wakewise_ardusub.logs.clock import ClockJump, LogClock
from wakewise_ardusub.logs.identity import VehicleIdentity, firmware_of_parameters

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
        self.vessels: dict[int | None, SystemRecords] = {}

    def vessel(self, system: int | None = None) -> SystemRecords:
        """Where samples of a system go."""
        return self.vessels.setdefault(system, SystemRecords())

    def spoiled(self, reason: str, size: int) -> None:
        """Count a bad record of some bytes."""
        self.bad[reason] += 1
        self.bad_bytes += size

    def done(self, path: Path, kind: str) -> VehicleLog:
        """The log of the ArduSub, or where none is of the system, that most is known of."""
        self.clock.close()
        held = {s: (vessel.identity.is_ardusub, vessel.samples) for s, vessel in self.vessels.items() if vessel.samples}
        system = max(held, key=lambda s: held[s], default=None)
        vessel = self.vessels.get(system, SystemRecords())
        series = {}
        for channel, rows in vessel.rows.items():
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
            parameters=vessel.parameters,
            jumps=tuple(self.clock.jumps),
            started_s=self.clock.first_stamp_s,
            system=system,
            identity=vessel.identity,
            unread=dict(self.unread),
            others=tuple(sorted(s for s, v in self.vessels.items() if s is not None and s != system and v.samples)),
        )
