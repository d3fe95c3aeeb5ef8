"""Wash meter: servo pulses and pose to a reading of the wash, with totals over the last minute and the dive.

`WashHistory` keeps one mean per second of the last minutes, for pages that are opened late. `DiveRecord` writes one CSV
row for each reading while thrusters run, and a JSON summary at the end. `reading_as_json` is the reading as the page
gets it.
"""

from __future__ import annotations

import csv
import math
from collections import deque
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import IO, Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import write_json
from wakewise.core.geometry import Pose
from wakewise.wake.disturbance import split_roots
from wakewise.wake.influence import InfluenceModel
from wakewise_ardusub.logs.channels import SERVOS
from wakewise_ardusub.motors import directions_of_motors, motor_channels
from wakewise_ardusub.vehicle_summary import VehicleSummary
from wakewise_ardusub.wash_meter.vehicle_listener import VehicleListener
from wakewise_ardusub.wash_savings import SHARES, Shares, WashSavings, WashSavingsCalculator, influence_model, saved_pct

MINUTE_S = 60.0
"""Over how long the one number is taken: long enough to be calm, short enough to answer what a pilot tries."""
_HERE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


@dataclass(frozen=True, kw_only=True, eq=False)
class MeterReading:
    """One instant of m thrusters.

    Parameters
    ----------
    time_s : float
    why_not : str or None
        Why there is no judgement at this instant, None where there is one.
    savings : WashSavings or None
    peak_m_s, rms_m_s : dict of float
        Highest speed at the points and root mean square over them, as flown, with least thrusts and with gentle ones.
    shares : ndarray, shape (m,)
        Of D as flown that each thruster's jet brings, in per cent; they add up to 100, and one whose jet takes speed
        out of another's is negative. Zeros without D.
    in_world : bool
        Whether the points stand in the world (a marked target), or go with the vehicle.
    """

    time_s: float
    why_not: str | None = None
    savings: WashSavings | None = None
    peak_m_s: dict[Shares, float] = field(default_factory=dict)
    rms_m_s: dict[Shares, float] = field(default_factory=dict)
    shares: Array = field(default_factory=lambda: np.zeros(0))
    in_world: bool = False

    @property
    def running(self) -> bool:
        """Whether a thruster runs."""
        return self.savings is not None and bool(np.any(self.savings.thrusts_N["flown"]))


@dataclass
class WashTotals:
    """D added up over instants in which thrusters ran."""

    instants: int = 0
    flown: float = 0.0
    gentle: float = 0.0

    def add(self, flown: float, gentle: float, instants: int = 1) -> None:
        """Add an instant, or take one away."""
        self.instants += instants
        self.flown += flown
        self.gentle += gentle

    def saved_pct(self, weight: float) -> float | None:
        """Of D as flown that gentle thrusts would have spared; None where there was next to none."""
        return saved_pct(self.flown, self.gentle, self.instants * weight) if self.instants else None


class WashMeter:
    """Judges what a `VehicleListener` holds, whenever it is asked.

    Parameters
    ----------
    craft : VehicleSummary
    listener : VehicleListener
    points_B_m, weights : ndarray, shape (n, 3) and (n,)
        What is to be spared, in the vehicle's frame.

    Raises
    ------
    InputError
        If the autopilot's parameters as known beforehand do not fit the craft, or this computer cannot judge it.
    """

    def __init__(self, craft: VehicleSummary, listener: VehicleListener, points_B_m: Array, weights: Array) -> None:
        self.craft, self.listener = craft, listener
        self.weight = float(np.sum(weights))
        self.dive = WashTotals()
        self._points_B_m, self._weights = points_B_m, weights
        self._carried = _TargetView.at(influence_model(craft, points_B_m, weights), _HERE)
        self._mark: InfluenceModel | None = None
        self._minute: deque[tuple[float, float, float]] = deque()
        self._known: dict[str, float] | None = None
        self._misfit: str | None = None
        self._calculator = WashSavingsCalculator(craft, directions_of_motors({}, craft.count))
        self._channels = motor_channels(craft, {})
        self._fit()
        if self._misfit is not None:
            raise InputError(self._misfit)
        # Kernels that are compiled or read are so now, not when thrusters first run.
        self._calculator.judge(np.full(craft.count, 1600.0), self._calculator.supply_V(None), self._carried.gram)

    @property
    def directions_known(self) -> bool:
        """Whether the autopilot has said which motors run the other way."""
        known = self.listener.parameters
        return all(f"MOT_{i + 1}_DIRECTION" in known for i in range(self.craft.count))

    @property
    def marked(self) -> bool:
        """Whether the target stands in the world."""
        return self._mark is not None

    def mark(self, now_s: float) -> str | None:
        """Let the points stay where they are now while the vehicle moves; why not, where its place is not known."""
        pose = self.listener.pose(now_s)
        if pose is None:
            return "the autopilot does not say where the vehicle is (LOCAL_POSITION_NED and ATTITUDE)"
        self._mark = influence_model(self.craft, pose.apply(self._points_B_m), self._weights)
        return None

    def unmark(self) -> None:
        """Let the points go with the vehicle again."""
        self._mark = None

    def saved_pct(self) -> float | None:
        """Spared over the last minute; None where there was nothing to spare."""
        last = WashTotals(len(self._minute), sum(d for _, d, _ in self._minute), sum(g for _, _, g in self._minute))
        return last.saved_pct(self.weight)

    def read(self, now_s: float) -> MeterReading:
        """The reading at a time, which must not run back."""
        self._fit()
        while self._minute and self._minute[0][0] < now_s - MINUTE_S:
            self._minute.popleft()
        pulses = self.listener.last("servo", now_s)
        if self.listener.identity.is_other:
            return MeterReading(time_s=now_s, why_not=f"the vehicle is no ArduSub: {self.listener.identity.words}")
        if self._misfit is not None:
            return MeterReading(time_s=now_s, why_not=self._misfit)
        if pulses is None:
            return MeterReading(time_s=now_s, why_not="no servo outputs are heard")
        own = pulses[[channel - 1 for channel in self._channels]]
        if not np.isfinite(own).all():
            return MeterReading(time_s=now_s, why_not="a motor's servo output says nothing")
        seen = self._carried
        if self._mark is not None:
            pose = self.listener.pose(now_s)
            if pose is None:
                return MeterReading(time_s=now_s, why_not="the vehicle's place is not known, so the mark's is not")
            seen = _TargetView.at(self._mark, pose)
        supply_V = self._calculator.supply_V(self.listener.number("voltage", now_s))
        savings = self._calculator.judge(own, supply_V, seen.gram)
        reading = MeterReading(
            time_s=now_s,
            savings=savings,
            peak_m_s={share: seen.peak_m_s(savings.thrusts_N[share]) for share in SHARES},
            rms_m_s={share: float(np.sqrt(savings.disturbance[share] / self.weight)) for share in SHARES},
            shares=seen.shares_pct(savings.thrusts_N["flown"]),
            in_world=self._mark is not None,
        )
        if reading.running:
            flown, gentle = savings.disturbance["flown"], savings.disturbance["gentle"]
            self._minute.append((now_s, flown, gentle))
            self.dive.add(flown, gentle)
        return reading

    def _fit(self) -> None:
        """Take the autopilot's parameters when they changed."""
        known = self.listener.parameters
        if known == self._known:
            return
        self._known = known
        self._misfit = None
        try:
            self._channels = motor_channels(self.craft, known)
        except InputError as fault:
            # They come one by one; until all are there, the motors are taken in their order.
            self._channels = motor_channels(self.craft, {})
            self._misfit = str(fault) if all(f"SERVO{i + 1}_FUNCTION" in known for i in range(SERVOS)) else None
        directions = directions_of_motors(known, self.craft.count)
        if not np.array_equal(directions, self._calculator.directions):
            self._calculator = WashSavingsCalculator(self.craft, directions)


@dataclass(frozen=True, eq=False)
class _TargetView:
    """Points before the jets at one pose: D's matrix, shape (2 m, 2 m), and velocities, shape (2 m, n, 3)."""

    gram: Array
    velocity: Array

    @classmethod
    def at(cls, view: InfluenceModel, pose: Pose) -> _TargetView:
        """What a pose makes of a view."""
        R = pose.R
        origins, axes = pose.apply(view.positions_B_m), view.axes_B @ R.T
        jets = (np.concatenate([origins, origins]), np.concatenate([-axes, axes]), np.tile(view.areas_m2, 2))
        return cls(gram=view.gram(pose), velocity=view.wake.unit_velocity(view.points_W_m, *jets))

    def peak_m_s(self, thrusts_N: Array) -> float:
        """Highest speed at a point."""
        velocity = np.einsum("i,inx->nx", split_roots(thrusts_N), self.velocity)
        return float(np.max(np.linalg.norm(velocity, axis=1)))

    def shares_pct(self, thrusts_N: Array) -> Array:
        """Of D that each thruster brings, shape (m,): s_i (G s)_i over s' G s."""
        roots = split_roots(thrusts_N)
        part = roots * (self.gram @ roots)
        total = float(np.sum(part))
        m = len(thrusts_N)
        return 100.0 * (part[:m] + part[m:]) / total if total > 0.0 else np.zeros(m)


KEPT_S = 600


@dataclass
class WashHistory:
    """Mean D of each second, as flown and with gentle thrusts; a second without readings is a gap."""

    weight: float
    _seconds: deque[tuple[int, float | None, float | None]] = field(default_factory=lambda: deque(maxlen=KEPT_S))
    _now: int | None = None
    _flown: list[float] = field(default_factory=list)
    _gentle: list[float] = field(default_factory=list)

    def add(self, reading: MeterReading) -> None:
        """Take in a reading."""
        second = math.floor(reading.time_s)
        if self._now is None:
            self._now = second
        while self._now < second:
            self._seconds.append((self._now, self._mean(self._flown), self._mean(self._gentle)))
            self._flown, self._gentle = [], []
            # After a pause of any length only what is kept is gone through.
            self._now = max(self._now + 1, second - KEPT_S)
        if reading.savings is not None:
            self._flown.append(reading.savings.disturbance["flown"])
            self._gentle.append(reading.savings.disturbance["gentle"])

    def told(self) -> dict[str, Any]:
        """Root mean square speeds in mm/s, oldest first; the last ended `until_s`."""
        return {
            "until_s": self._now,
            "flown_mm_s": [self._speed(d) for _, d, _ in self._seconds],
            "gentle_mm_s": [self._speed(d) for _, _, d in self._seconds],
        }

    @property
    def last(self) -> tuple[int | None, float | None, float | None]:
        """The last whole second, and its speeds in mm/s."""
        if not self._seconds:
            return None, None, None
        second, flown, gentle = self._seconds[-1]
        return second, self._speed(flown), self._speed(gentle)

    def _speed(self, disturbance: float | None) -> float | None:
        return None if disturbance is None else round(1e3 * math.sqrt(disturbance / self.weight), 3)

    @staticmethod
    def _mean(values: list[float]) -> float | None:
        return sum(values) / len(values) if values else None


ROWS, SUMMARY = "meter.csv", "meter.json"


class DiveRecord:
    """Writes one dive into a folder; a row is whole or not there.

    Parameters
    ----------
    folder : Path
        Made where it is not there; rows in it are gone on with where their columns are the same, else put aside, as an
        earlier summary is.
    craft : VehicleSummary
    """

    def __init__(self, folder: Path, craft: VehicleSummary) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        names = ["time_s", *(f"disturbance_{share}" for share in SHARES), "peak_flown_m_s", "peak_gentle_m_s"]
        names += [f"{share}_{i + 1}_N" for share in ("flown", "gentle") for i in range(craft.count)]
        path = folder / ROWS
        before = path.read_text(encoding="utf-8").partition("\n")[0] if path.is_file() else ""
        taken = {one.stem for one in folder.glob("meter-*.*")}
        number = next(n for n in count(1) if f"meter-{n}" not in taken)
        if before not in ("", ",".join(names)):
            path.rename(folder / f"meter-{number}.csv")
            before = ""
        if (folder / SUMMARY).is_file():
            (folder / SUMMARY).rename(folder / f"meter-{number}.json")
        self._file: IO[str] = path.open("a", encoding="utf-8", newline="", buffering=1)
        self._rows = csv.writer(self._file, lineterminator="\n")
        if not before:
            self._rows.writerow(names)

    def add(self, unix_s: float, reading: MeterReading) -> None:
        """Write a reading under the time of day, if thrusters ran."""
        if reading.savings is None or not reading.running:
            return
        savings = reading.savings
        row = [f"{unix_s:.3f}", *(f"{savings.disturbance[share]:.9g}" for share in SHARES)]
        row += [f"{reading.peak_m_s['flown']:.6g}", f"{reading.peak_m_s['gentle']:.6g}"]
        row += [f"{thrust:.5g}" for share in ("flown", "gentle") for thrust in savings.thrusts_N[share]]
        self._rows.writerow(row)

    def close(self, summary: dict[str, Any]) -> None:
        """End with how it came out."""
        self._file.close()
        write_json(self._folder / SUMMARY, summary)


def reading_as_json(meter: WashMeter, reading: MeterReading, history: WashHistory, points: str) -> dict[str, Any]:
    """How it stands; no number is NaN, what is not known is null."""
    craft, listener, now_s = meter.craft, meter.listener, reading.time_s
    armed = listener.number("armed", now_s)
    second, flown, gentle = history.last
    state: dict[str, Any] = {
        "time_s": now_s,
        "vehicle": craft.name,
        "wake_model": craft.wake.name,
        "points": "of a mark in the world" if meter.marked else points,
        "marked": meter.marked,
        "can_mark": listener.pose(now_s) is not None,
        "system": listener.system,
        "armed": None if armed is None else armed > 0.5,
        "mode": listener.mode(now_s),
        "voltage_V": listener.number("voltage", now_s),
        "directions_known": meter.directions_known,
        "others": list(listener.others),
        "why_not": reading.why_not,
        "running": reading.running,
        "saved_pct": meter.saved_pct(),
        "saved_dive_pct": meter.dive.saved_pct(meter.weight),
        "running_instants": meter.dive.instants,
        "second": second,
        "second_mm_s": [flown, gentle],
        "thrusters": list(craft.thrusters),
    }
    if reading.savings is not None:
        state |= {
            "disturbance": dict(reading.savings.disturbance),
            "rms_mm_s": {share: 1e3 * reading.rms_m_s[share] for share in SHARES},
            "peak_mm_s": {share: 1e3 * reading.peak_m_s[share] for share in SHARES},
            "thrusts_N": {share: reading.savings.thrusts_N[share].tolist() for share in SHARES},
            "shares_pct": reading.shares.tolist(),
        }
    return state
