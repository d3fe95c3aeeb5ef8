"""What comes in on the wire, whatever it is, and what is kept of it."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")

from hypothesis import given, settings
from hypothesis import strategies as st

from loopback_vehicle import Vehicle, free_ends
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.vehicle_summary import VehicleSummary
from wakewise_ardusub.wash_meter.meter import KEPT_S, DiveRecord, MeterReading, WashHistory
from wakewise_ardusub.wash_meter.run import MeterLoop, MeterSettings
from wakewise_ardusub.wash_meter.vehicle_listener import MavlinkSocket, TimedMessage, VehicleListener
from wakewise_ardusub.wash_savings import Shares, WashSavings


def heard_within(wire: MavlinkSocket, seconds: float, enough: int) -> list[TimedMessage]:
    found: list[TimedMessage] = []
    end_s = time.monotonic() + seconds
    while len(found) < enough and time.monotonic() < end_s:
        wire.wait(0.05)
        found += wire.heard()
    return found


def test_messages_come_through_a_hundred_thousand_bytes_of_rubbish() -> None:
    """Rubbish of one sender is counted and costs another's messages nothing; one's own comes back after it."""
    wire = MavlinkSocket(MeterSettings(connection=free_ends()).ends)
    rng = np.random.default_rng(5)
    with Vehicle(wire.port) as vehicle, Vehicle(wire.port, system=9) as other:
        found: list[TimedMessage] = []
        for turn in range(100):
            other.send_bytes(rng.bytes(1000))
            if turn % 10 == 0:
                vehicle.say(*[1500 + turn] * 8)
            found += wire.heard()
        found += heard_within(wire, 2.0, 50 - len(found))
        assert sum(one.name == "SERVO_OUTPUT_RAW" and one.system == 1 for one in found) == 10
        assert wire.bad > 0
        for _ in range(40):
            other.say(*[1500] * 8)
        assert any(one.system == 9 for one in heard_within(wire, 2.0, 20))
    wire.close()


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(
        ["SERVO_OUTPUT_RAW", "ATTITUDE", "HEARTBEAT", "PARAM_VALUE", "LOCAL_POSITION_NED", "MANUAL_CONTROL"]
    ),
    st.dictionaries(
        st.sampled_from(["servo1_raw", "roll", "pitch", "yaw", "x", "y", "z", "base_mode", "param_id", "param_value"]),
        st.one_of(st.floats(), st.integers(), st.text(max_size=5), st.none(), st.lists(st.text(max_size=2))),
    ),
)
def test_no_fields_stop_the_hearing(name: str, fields: dict[str, object]) -> None:
    """Missing, of another kind, or no numbers: passed over, and what is told stays finite or unknown."""
    listener = VehicleListener(system=1)
    listener.hear(0.0, 1, 1, name, fields)
    pose = listener.pose(0.1)
    assert pose is None or np.isfinite(pose.p_m).all()
    volts = listener.number("voltage", 0.1)
    assert volts is None or math.isfinite(volts)
    assert listener.mode(0.1) is None or isinstance(listener.mode(0.1), str)


def test_the_first_vehicle_with_outputs_is_the_one() -> None:
    """Others are told apart; companions and ground stations are no vehicles; a system that was named is waited for."""
    outputs = {"port": 0} | {f"servo{i}_raw": 1500 for i in range(1, 17)}
    listener, named = VehicleListener(), VehicleListener(system=3)
    for one in (listener, named):
        one.hear(0.0, 255, 190, "HEARTBEAT", {"base_mode": 0, "custom_mode": 0})
        one.hear(0.0, 2, 191, "SERVO_OUTPUT_RAW", outputs)
        one.hear(0.0, 2, 1, "SERVO_OUTPUT_RAW", outputs)
        one.hear(0.0, 3, 1, "SERVO_OUTPUT_RAW", outputs)
    assert (listener.system, listener.others) == (2, (3,))
    assert (named.system, named.others) == (3, (2,))
    assert listener.age_s("servo", 1.0) == 1.0
    assert listener.age_s("position", 1.0) == math.inf


def reading(time_s: float, flown: float, gentle: float) -> MeterReading:
    craft_thrusts = np.array([1.0, -2.0])
    savings = WashSavings(
        thrusts_N=dict.fromkeys(("flown", "least", "gentle"), craft_thrusts),
        disturbance={"flown": flown, "least": flown, "gentle": gentle},
    )
    speeds: dict[Shares, float] = {"flown": 0.2, "least": 0.2, "gentle": 0.1}
    return MeterReading(time_s=time_s, savings=savings, peak_m_s=speeds, rms_m_s=speeds)


def test_the_past_is_a_mean_of_each_second_with_gaps() -> None:
    """D is averaged, its root is told; silence is a gap; no more is kept than is shown."""
    history = WashHistory(weight=1.0)
    for k in range(10):
        history.add(reading(5.0 + 0.1 * k, 1e-6 * (1 + (k % 2)), 0.0))
    history.add(MeterReading(time_s=6.5, why_not="silence"))
    history.add(reading(7.5, 4e-6, 1e-6))
    history.add(MeterReading(time_s=8.5, why_not="silence"))
    told = history.told()
    assert told["flown_mm_s"] == [pytest.approx(math.sqrt(1.5), abs=1e-3), None, pytest.approx(2.0)]
    assert told["gentle_mm_s"] == [0.0, None, pytest.approx(1.0)]
    assert (told["until_s"], history.last[0]) == (8, 7)
    history.add(reading(1e6, 1e-6, 0.0))
    assert len(history.told()["flown_mm_s"]) == KEPT_S


def test_a_record_is_closed_however_the_meter_ends(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault of a reading ends the meter; its summary is written all the same."""
    craft = VehicleSummary.of(load_vehicle("bluerov2-heavy"), wake_model("jet"))
    settings = MeterSettings(connection=free_ends(), port=0, out=tmp_path / "dive")
    meter = MeterLoop(settings, craft, np.array([[1.0, 0.0, 0.0]]), np.ones(1), "of a point", {}, lambda line: None)

    def fails(now_s: float) -> MeterReading:
        raise ValueError("no reading")

    monkeypatch.setattr(meter.meter, "read", fails)
    with pytest.raises(ValueError, match="no reading"):
        meter.run()
    assert json.loads((tmp_path / "dive" / "meter.json").read_text())["messages"] == 0


def test_a_record_goes_on_and_keeps_another_crafts_rows(tmp_path: Path) -> None:
    """Rows are added to the same columns; a file of other columns is put aside, not mixed nor lost."""
    heavy, six = (VehicleSummary.of(load_vehicle(name), wake_model("jet")) for name in ("bluerov2-heavy", "bluerov2"))
    for _ in range(2):
        record = DiveRecord(tmp_path / "dive", heavy)
        record.add(1.5, MeterReading(time_s=0.0, why_not="silence"))
        record.add(1.5, reading(0.0, 1e-6, 0.0))
        record.close({"a": 1})
    rows = (tmp_path / "dive" / "meter.csv").read_text().splitlines()
    assert len(rows) == 3
    assert rows[1].startswith("1.500,1e-06,1e-06,0,0.2,0.1,1,-2")
    DiveRecord(tmp_path / "dive", six).close({})
    (aside,) = (tmp_path / "dive").glob("meter-*.csv")
    assert len(aside.read_text().splitlines()) == 3
    DiveRecord(tmp_path / "dive", six).close({"messages": 7})
    DiveRecord(tmp_path / "dive", six).close({})
    summaries = [path.read_text() for path in sorted((tmp_path / "dive").glob("meter-*.json"))]
    assert any('"messages": 7' in text for text in summaries)
    assert (tmp_path / "dive" / "meter.csv").read_text().startswith("time_s,")
