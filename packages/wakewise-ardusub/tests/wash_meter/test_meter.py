"""The meter beside a vehicle says what the log's reader says afterwards, and only where it knows."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("mcap", reason="the extra `links` is not installed")

import made_logs
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.logs import mavlink
from wakewise_ardusub.logs.channels import LogClock
from wakewise_ardusub.logs.read import read_log
from wakewise_ardusub.logs.replay_allocation import ReplayedAllocation, bow_points, replay_log
from wakewise_ardusub.logs.table import LogTable, tabulate
from wakewise_ardusub.vehicle_summary import VehicleSummary
from wakewise_ardusub.wash_meter.meter import MINUTE_S, MeterReading, WashMeter
from wakewise_ardusub.wash_meter.vehicle_listener import VehicleListener
from wakewise_ardusub.wash_savings import SHARES, bow_ball

REAL = Path(os.environ.get("WAKEWISE_DATA", "../shared/data")) / "ardusub" / "2023-04-18.tlog"
Message = tuple[float, int, int, str, dict[str, Any]]


@pytest.fixture(scope="module")
def craft() -> VehicleSummary:
    return VehicleSummary.of(load_vehicle("bluerov2-heavy"), wake_model("jet"))


def meter_of(craft: VehicleSummary, parameters: dict[str, float] | None = None) -> WashMeter:
    points = bow_ball(craft.bow_m, craft.camera_z_m, 0.4)
    return WashMeter(craft, VehicleListener(parameters=parameters), points, np.ones(len(points)))


def tape(file: Path, monkeypatch: pytest.MonkeyPatch) -> list[Message]:
    """Messages of a telemetry log in their order, on its mended clock."""
    found: list[Message] = []
    clock, record_message = LogClock(), mavlink.record_message

    def keep(collector: Any, stamp_s: float, system: int, component: int, name: str, fields: dict[str, Any]) -> None:
        boot = fields.get("time_boot_ms") if component == mavlink.AUTOPILOT and name in mavlink.WANTED else None
        found.append((clock.at(stamp_s, None if boot is None else 1e-3 * boot), system, component, name, fields))
        record_message(collector, stamp_s, system, component, name, fields)

    monkeypatch.setattr(mavlink, "record_message", keep)
    read_log(file)
    monkeypatch.undo()
    return found


def replayed(meter: WashMeter, messages: list[Message], ticks_s: np.ndarray) -> Iterator[MeterReading]:
    """Readings at ticks while messages come in."""
    at = 0
    for tick_s in ticks_s:
        while at < len(messages) and messages[at][0] <= tick_s + 1e-9:
            meter.listener.hear(*messages[at])
            at += 1
        yield meter.read(float(tick_s))


def judged(file: Path) -> tuple[LogTable, ReplayedAllocation]:
    """The same log as the log's reader judges it."""
    vehicle = load_vehicle("bluerov2-heavy")
    log = read_log(file)
    table = tabulate(log)
    return table, replay_log(table.rows, log.parameters, vehicle, bow_points(vehicle, 0.4), wake_model("jet"))


@pytest.mark.parametrize(
    "name", ["made", pytest.param("real", marks=pytest.mark.skipif(not REAL.is_file(), reason=f"{REAL} is not here"))]
)
def test_a_replayed_log_gives_hindsights_figures(
    name: str, craft: VehicleSummary, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Thrusts and D of every tick, as flown and otherwise, and the dive's saved per cent."""
    file = REAL
    if name == "made":
        file = tmp_path / "dive.tlog"
        file.write_bytes(made_logs.tlog())
    table, found = judged(file)
    ticks_s = table.rows["time_s"].to_numpy()
    # A log knows its parameters from its begin; a meter from when they are said.
    meter = meter_of(craft, read_log(file).parameters)
    known = 0
    for row, reading in enumerate(replayed(meter, tape(file, monkeypatch), ticks_s)):
        if reading.savings is None:
            assert np.isnan(found.disturbance["flown"][row])
            continue
        known += 1
        for share in SHARES:
            assert reading.savings.disturbance[share] == pytest.approx(found.disturbance[share][row], rel=1e-12)
            assert reading.savings.thrusts_N[share] == pytest.approx(found.thrusts_N[share][row], abs=1e-12)
    assert known == int(np.isfinite(found.disturbance["flown"]).sum()) > 0.9 * len(ticks_s)
    assert meter.dive.saved_pct(meter.weight) == pytest.approx(found.saved_pct())
    assert meter.dive.instants == int(found.running.sum())


def test_shares_peak_and_root_mean_square_belong_together(craft: VehicleSummary) -> None:
    """Shares add up to all of D; the peak lies above the root mean square, which is D's."""
    meter = meter_of(craft)
    meter.listener.hear(0.0, 1, 1, "SERVO_OUTPUT_RAW", pulses(1620, 1610, 1450, 1440, 1530, 1540, 1460, 1470))
    reading = meter.read(0.1)
    assert reading.savings is not None
    assert reading.running
    assert reading.shares.sum() == pytest.approx(100.0)
    for share in SHARES:
        assert reading.rms_m_s[share] ** 2 * meter.weight == pytest.approx(reading.savings.disturbance[share])
        assert reading.peak_m_s[share] >= reading.rms_m_s[share]


def test_what_is_not_known_is_said_and_not_judged(craft: VehicleSummary) -> None:
    """Silence, old pulses, an output that says nothing, a vehicle with other motors."""
    meter = meter_of(craft)
    assert meter.read(0.0).why_not == "no servo outputs are heard"
    meter.listener.hear(0.0, 1, 1, "SERVO_OUTPUT_RAW", pulses(1600, 1600))
    assert meter.read(0.1).why_not == "a motor's servo output says nothing"
    meter.listener.hear(0.2, 1, 1, "SERVO_OUTPUT_RAW", pulses(*[1500] * 8))
    assert meter.read(1.6).why_not is None
    assert not meter.read(1.6).running
    assert meter.read(1.8).why_not == "no servo outputs are heard"
    six = {f"SERVO{i}_FUNCTION": 32.0 + i if i <= 6 else 0.0 for i in range(1, 17)}
    with pytest.raises(InputError, match="8 thrusters, SERVOn_FUNCTION drives motors 1, 2, 3, 4, 5, 6"):
        meter_of(craft, six)
    for name, value in six.items():
        meter.listener.records_of(1).parameter(name, value)
    assert "drives motors 1, 2, 3, 4, 5, 6" in (meter.read(1.8).why_not or "")


def test_directions_that_come_late_count_from_then_on(craft: VehicleSummary) -> None:
    """Thrusts change their sign when the autopilot says that a motor runs the other way."""
    meter = meter_of(craft)
    meter.listener.hear(0.0, 1, 1, "SERVO_OUTPUT_RAW", pulses(*[1600] * 8))
    before = meter.read(0.1).savings
    assert not meter.directions_known
    for i, direction in enumerate(made_logs.DIRECTIONS, 1):
        fields = {"param_id": f"MOT_{i}_DIRECTION", "param_value": float(direction)}
        meter.listener.hear(0.2, 1, 1, "PARAM_VALUE", fields)
    after = meter.read(0.3).savings
    assert meter.directions_known
    assert before is not None
    assert after is not None
    assert after.thrusts_N["flown"] == pytest.approx(np.array(made_logs.DIRECTIONS) * before.thrusts_N["flown"])


def test_the_minute_forgets_and_the_dive_does_not(craft: VehicleSummary) -> None:
    """A minute of rest after thrusts leaves nothing to spare in the minute, all of it in the dive."""
    meter = meter_of(craft)
    astern = pulses(1650, 1650, 1350, 1350, 1500, 1500, 1500, 1500)
    for step in range(20):
        meter.listener.hear(0.1 * step, 1, 1, "SERVO_OUTPUT_RAW", astern)
        meter.read(0.1 * step)
    saved = meter.saved_pct()
    assert saved == pytest.approx(meter.dive.saved_pct(meter.weight))
    assert saved is not None
    assert saved > 10.0
    meter.listener.hear(2.0, 1, 1, "SERVO_OUTPUT_RAW", pulses(*[1500] * 8))
    meter.read(2.0 + MINUTE_S)
    assert meter.saved_pct() is None
    assert meter.dive.saved_pct(meter.weight) == pytest.approx(saved)


def test_a_marked_target_stays_where_it_is(craft: VehicleSummary) -> None:
    """The jets astern lose it as the vehicle backs off, and find it again there; without a place there is no mark."""
    meter = meter_of(craft)
    astern = pulses(1650, 1650, 1350, 1350, 1500, 1500, 1500, 1500)

    def at(time_s: float, north_m: float) -> MeterReading:
        listener = meter.listener
        listener.hear(time_s, 1, 1, "SERVO_OUTPUT_RAW", astern)
        listener.hear(time_s, 1, 1, "ATTITUDE", {"roll": 0.0, "pitch": 0.0, "yaw": 0.5 * np.pi, "time_boot_ms": 0})
        place = {"x": 0.0, "y": north_m, "z": 3.0, "time_boot_ms": 0}
        listener.hear(time_s, 1, 1, "LOCAL_POSITION_NED", place)
        return meter.read(time_s)

    assert meter.mark(0.0) is not None
    assert not meter.marked
    carried = at(0.0, 5.0)
    assert meter.mark(0.0) is None
    here, away, back = at(0.1, 5.0), at(0.2, 3.0), at(0.3, 5.0)
    assert here.in_world
    assert carried.savings is not None
    assert here.savings is not None
    assert away.savings is not None
    assert back.savings is not None
    flown = carried.savings.disturbance["flown"]
    assert here.savings.disturbance["flown"] == pytest.approx(flown, rel=1e-9)
    assert back.savings.disturbance["flown"] == pytest.approx(flown, rel=1e-9)
    assert away.savings.disturbance["flown"] < 0.9 * flown
    meter.listener.hear(2.0, 1, 1, "SERVO_OUTPUT_RAW", astern)
    assert "place is not known" in (meter.read(2.0).why_not or "")
    meter.unmark()
    assert meter.read(2.0).why_not is None


def pulses(*values: int) -> dict[str, Any]:
    """Fields of SERVO_OUTPUT_RAW."""
    return {"port": 0} | {f"servo{i}_raw": values[i - 1] if i <= len(values) else 0 for i in range(1, 17)}
