"""Polling of all sensors: latest values, sample rates and errors of each source."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from typing import Any, Protocol

import numpy as np

from wakewise.core.errors import EnvironmentFailure
from wakewise.core.geometry import euler_from_quat
from wakewise.core.interfaces import Measurement
from wakewise_ardusub.sensors.devices import SerialPort, UdpSocket
from wakewise_ardusub.sensors.jy901 import InertialUnit
from wakewise_ardusub.sensors.line_poses import LinePoses, PoseSample
from wakewise_ardusub.sensors.ms5837 import DepthSensor, PressureReading

DEPTH_PERIOD_S = 0.1
"""A pressure sensor is asked this often; its two conversions take 36 ms of it."""
_RATE_OVER_S = 3.0
_POLL_S = 0.01


class PolledSensor(Protocol):
    """A sensor that is read."""

    @property
    def tally(self) -> RateCounter:
        """How many samples came, and what went wrong."""
        ...

    def poll(self, now_s: float) -> Sequence[Measurement | PoseSample]:
        """What has come since."""
        ...

    def last(self) -> dict[str, Any]:
        """The latest values, by name with unit."""
        ...


class RateCounter:
    """Counts samples of one source and says at what rate they come."""

    def __init__(self, name: str, device: str) -> None:
        self.name, self.device = name, device
        self.samples = 0
        self.bad = 0
        self.complaint: str | None = None
        self._times: deque[float] = deque()

    def add(self, count: int, now_s: float) -> None:
        """Note samples that came now."""
        self.samples += count
        self._times.extend([now_s] * count)

    def rate_hz(self, now_s: float) -> float:
        """Samples per second over the last while, 0 once they stop."""
        while self._times and now_s - self._times[0] > _RATE_OVER_S:
            self._times.popleft()
        span = now_s - self._times[0] if self._times else 0.0
        return (len(self._times) - 1) / span if span > 0.0 and len(self._times) > 1 else 0.0


class DepthSource:
    """A pressure sensor; others are read while it converts.

    When it does not answer that is counted, and it is asked again.
    """

    def __init__(self, sensor: DepthSensor, device: str) -> None:
        self.tally = RateCounter("depth", device)
        self._sensor = sensor
        self._steps: Generator[float, None, PressureReading] | None = None
        self._began_s = self._due_s = self._next_s = -math.inf
        self._last: dict[str, Any] = {}

    def poll(self, now_s: float) -> list[Measurement]:
        """Go on with a reading, or begin one if it is time for it; the measurement, if one is complete."""
        if now_s < self._next_s:
            return []
        if self._steps is None:
            self._steps, self._began_s = self._sensor.reading(), now_s
            # On a grid, so that being a little late each time does not slow it down.
            on_time = now_s - self._due_s < DEPTH_PERIOD_S
            self._due_s = (self._due_s if on_time else now_s) + DEPTH_PERIOD_S
        try:
            self._next_s = now_s + next(self._steps)
            return []
        except StopIteration as done:
            reading: PressureReading = done.value
        except EnvironmentFailure as fault:
            self.tally.bad += 1
            self.tally.complaint = str(fault)
            self._rest(now_s)
            return []
        # Pressure is converted first.
        measured = self._sensor.measured(reading, self._began_s + 0.5 * self._sensor.conversion_s)
        self._rest(now_s)
        self.tally.add(1, now_s)
        self._last = {
            "depth_m": measured.depth_m,
            "pressure_mbar": reading.pressure_Pa / 100.0,
            "temperature_C": reading.temperature_C,
        }
        return [measured]

    def _rest(self, now_s: float) -> None:
        """Until the next reading is due."""
        self._steps, self._next_s = None, max(self._due_s, now_s)

    def last(self) -> dict[str, Any]:
        """Depth, pressure and temperature."""
        return self._last


class InertialSource:
    """An inertial unit on a serial line."""

    def __init__(self, unit: InertialUnit, port: SerialPort, device: str) -> None:
        self.tally = RateCounter("imu", device)
        self._unit, self._port = unit, port
        self._last: dict[str, Any] = {}

    def poll(self, now_s: float) -> list[Measurement]:
        """Samples that have come since."""
        found = self._unit.feed(self._port.read(), now_s)
        self.tally.add(len(found), now_s)
        self.tally.bad = self._unit.reader.bad_bytes
        if not found and self._unit.reader.frames == 0 and self.tally.bad > 200:
            self.tally.complaint = f"{self.tally.bad} bytes and no frame in them: another baud rate, or another device"
        for measured in found:
            self.tally.complaint = None
            if measured.omega_B_rad_s is not None:
                self._last["turning_deg_s"] = [float(x) for x in np.degrees(measured.omega_B_rad_s)]
            if measured.force_B_m_s2 is not None:
                self._last["force_m_s2"] = [float(x) for x in measured.force_B_m_s2]
        if self._unit.angles_rad is not None:
            self._last["angles_of_unit_deg"] = [float(x) for x in np.degrees(self._unit.angles_rad)]
        return found

    def last(self) -> dict[str, Any]:
        """Turning and specific force in FRD; angles as the unit itself has them."""
        return self._last


class PoseSource:
    """Poses by lines of text on a socket."""

    def __init__(self, poses: LinePoses, port: UdpSocket, device: str) -> None:
        self.tally = RateCounter("poses", device)
        self._poses, self._port = poses, port
        self._last: dict[str, Any] = {}

    def poll(self, now_s: float) -> list[PoseSample]:
        """Poses that have come since."""
        found = [sample for data in self._port.read() for sample in self._poses.feed(data, now_s)]
        self.tally.add(len(found), now_s)
        self.tally.bad, self.tally.complaint = self._poses.refused, self._poses.complaint
        if found:
            sample = found[-1]
            said = sample.measurement
            p = said.p_WB_m if said.X_WB is None else said.X_WB.p_m
            self._last = {"north_east_down_m": None if p is None else [float(x) for x in p]}
            if said.X_WB is not None:
                self._last["roll_pitch_yaw_deg"] = [float(x) for x in np.degrees(euler_from_quat(said.X_WB.q))]
            if sample.position_std_m is not None:
                self._last["std_m"] = sample.position_std_m
        return found

    def last(self) -> dict[str, Any]:
        """Place in NED, attitude and one sigma, as far as the sender says."""
        return self._last


def facts(source: PolledSensor, now_s: float) -> dict[str, Any]:
    """A source in figures."""
    tally = source.tally
    return {
        "sensor": tally.name,
        "device": tally.device,
        "samples": tally.samples,
        "rate_hz": round(tally.rate_hz(now_s), 2),
        "bad": tally.bad,
        "complaint": tally.complaint,
        "last": source.last(),
    }


def watch(
    sources: Sequence[PolledSensor],
    seconds: float,
    every_s: float,
    passed: Callable[[Measurement | PoseSample], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Iterator[list[dict[str, Any]]]:
    """Read for `seconds` and give the figures of all sources every `every_s`, and at the end.

    `passed` is called with every sample as it comes.
    """
    began = clock()
    told = began
    while True:
        now = clock()
        for source in sources:
            for sample in source.poll(now):
                if passed is not None:
                    passed(sample)
        now = clock()
        if now - began >= seconds:
            yield [facts(source, now) for source in sources]
            return
        if now - told >= every_s:
            told = now
            yield [facts(source, now) for source in sources]
        sleep(_POLL_S)
