"""The logs in all three formats say the same dive; damage is counted, and never stops a reader."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("mcap", reason="the extra `links` is not installed")

import made_logs
from wakewise.core.errors import InputError
from wakewise_ardusub.logs.channels import LogCollector, VehicleLog
from wakewise_ardusub.logs.dataflash import read_dataflash
from wakewise_ardusub.logs.mavlink import packet_at, read_mcap, read_tlog
from wakewise_ardusub.logs.read import read_log
from wakewise_ardusub.logs.table import RATE_HZ, tabulate

MADE = {"dive.tlog": made_logs.tlog, "dive.BIN": made_logs.dataflash, "dive.mcap": made_logs.mcap}
READERS = {"dive.tlog": read_tlog, "dive.BIN": read_dataflash, "dive.mcap": read_mcap}
WHOLE = {name: make() for name, make in MADE.items()}
QUICK = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True)


def _read(folder: Path, name: str, data: bytes | None = None) -> VehicleLog:
    path = folder / name
    path.write_bytes(WHOLE[name] if data is None else data)
    return read_log(path)


def _row(log: VehicleLog, time_s: float) -> dict[str, object]:
    return tabulate(log).rows.filter((pl.col("time_s") - time_s).abs() < 1e-6).row(0, named=True)


@pytest.mark.parametrize("name", MADE)
def test_every_format_gives_the_dive_back(tmp_path: Path, name: str) -> None:
    """Sticks, pulses, depth, attitude, arming, mode, voltage and parameters are what was written."""
    log = _read(tmp_path, name)
    assert (log.bad_records, log.cut_short, log.jumps) == (0, False, ())
    before, after = _row(log, 3.0), _row(log, 15.0)
    assert (before["armed"], after["armed"]) == (False, True)
    assert (before["mode"], after["mode"]) == ("MANUAL", "ALT_HOLD")
    assert [after[f"stick_{axis}"] for axis in ("forward", "right", "down", "turn")] == [-0.5, 0.0, 0.5, 0.0]
    assert [after[f"servo_{i}_us"] for i in range(1, 9)] == made_logs.pulses(150)[:8]
    assert after["depth_m"] == pytest.approx(7.5, abs=1e-3)
    assert after["roll_rad"] == pytest.approx(0.1, abs=1e-4)
    assert after["pitch_rad"] == pytest.approx(-0.2, abs=1e-4)
    assert after["heading_rad"] == pytest.approx(3.25, abs=1e-4)
    assert after["voltage_V"] == pytest.approx(made_logs.VOLTAGE_V, abs=1e-3)
    assert [log.parameters[f"MOT_{i}_DIRECTION"] for i in range(1, 9)] == list(made_logs.DIRECTIONS)
    table = tabulate(log)
    assert len(table.rows) == made_logs.SECONDS * RATE_HZ
    assert table.rows["time_s"].diff().drop_nulls().to_numpy() == pytest.approx(1.0 / RATE_HZ)


def test_records_without_a_time_are_records(tmp_path: Path) -> None:
    """Old logs tell parameters, events, modes and messages without one: each is of the time of the last that had one.

    As many are whole as pymavlink reads.
    """
    from pymavlink.DFReader import DFReader_binary

    path = tmp_path / "old.BIN"
    path.write_bytes(made_logs.dataflash(old=True, firmware="ArduSub V3.4 (d1f6a2)"))
    log = read_log(path)
    theirs = DFReader_binary(str(path))
    count = 0
    while theirs.recv_msg() is not None:
        count += 1
    theirs.close()
    assert (log.bad_records, log.records, log.unread) == (0, count, {})
    assert [log.parameters[f"MOT_{i}_DIRECTION"] for i in range(1, 9)] == list(made_logs.DIRECTIONS)
    before, after = _row(log, 3.0), _row(log, 15.0)
    assert (before["armed"], after["armed"]) == (False, True)
    assert (before["mode"], after["mode"]) == ("MANUAL", "ALT_HOLD")
    assert [after[f"servo_{i}_us"] for i in range(1, 9)] == made_logs.pulses(150)[:8]


def test_records_of_other_fields_are_counted_by_name(tmp_path: Path) -> None:
    """A kind of record whose fields have other names is whole, is not read, and that is said."""
    data = WHOLE["dive.BIN"].replace(b"TimeUS,Alt", b"TimeUS,Foo")
    log = _read(tmp_path, "dive.BIN", data)
    assert log.unread == {"CTUN": made_logs.SECONDS * RATE_HZ}
    assert log.bad_records == 0
    assert "depth CTUN" not in log.series


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("a.db3", b"SQLite format 3\0" + bytes(100), "as a ROS 2 bag's .db3 is"),
        ("a.bag", b"#ROSBAG V2.0\n" + bytes(100), "a ROS 1 bag"),
        ("a.ulg", b"ULog\x01\x12\x35" + bytes(100), "PX4"),
        ("a.tlog.gz", b"\x1f\x8b" + bytes(100), "unpack it first"),
        ("a.csv", b"Timestamp,roll,pitch,heading,rollRate\n2022-08-15 10:16:17.386,1,2,3,4\n", "no motor outputs"),
    ],
)
def test_what_people_have_beside_logs_is_named(tmp_path: Path, name: str, data: bytes, said: str) -> None:
    """By its first bytes, in one line that says what is read instead."""
    path = tmp_path / name
    path.write_bytes(data)
    with pytest.raises(InputError, match=said) as fault:
        read_log(path)
    assert ".tlog" in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_ros_bag_is_no_recording_of_blueos(tmp_path: Path) -> None:
    """As a folder and as its MCAP file; a folder that holds a log names it."""
    from mcap.writer import Writer

    bag = tmp_path / "bag"
    bag.mkdir()
    with (bag / "bag_0.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="libmcap")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/chat", "cdr", schema)
        writer.add_message(channel, 0, bytes(8), 0)
        writer.finish()
    with pytest.raises(InputError, match=r"a ROS bag .MCAP., not a recording of BlueOS"):
        read_log(bag / "bag_0.mcap")
    with pytest.raises(InputError, match="give one of its files, such as bag_0"):
        read_log(bag)
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    with pytest.raises(InputError, match="a ROS 2 bag folder"):
        read_log(bag)


@pytest.mark.parametrize("name", MADE)
def test_half_a_log_is_half_a_dive(tmp_path: Path, name: str) -> None:
    """What is before the cut is read as in the whole log."""
    log = _read(tmp_path, name, WHOLE[name][: len(WHOLE[name]) // 2 + 3])
    assert log.cut_short
    assert log.bad_records <= 1
    assert 6.0 < log.duration_s < 14.0
    assert _row(log, 6.0)["stick_forward"] == 0.5


@pytest.mark.parametrize("jump_s", [1e6, -1e6, 40.0, -40.0])
def test_a_jump_of_the_clock_is_taken_out_and_told(tmp_path: Path, jump_s: float) -> None:
    """The vehicle's time since boot says that no time went by."""
    log = _read(tmp_path, "dive.tlog", made_logs.tlog(8.0, jump_s))
    assert [round(jump.time_s) for jump in log.jumps] == [8]
    assert log.jumps[0].step_s == pytest.approx(jump_s, abs=0.2)
    assert log.duration_s == pytest.approx(19.9, abs=0.11)
    assert _row(log, 15.0)["depth_m"] == pytest.approx(7.5, abs=0.06)


def test_a_pause_that_the_vehicle_confirms_stays(tmp_path: Path) -> None:
    """Where its time since boot went on as the log's clock did, the link was lost and the gap is in the table."""
    data, gap_s = WHOLE["dive.tlog"], (6.0, 18.0)
    kept = bytearray()
    at = 0
    while (packet := packet_at(data, at)) is not None:
        t = packet.stamp_s - made_logs.START_S
        if not gap_s[0] < t < gap_s[1]:
            kept += data[at : packet.end]
        at = packet.end
    log = _read(tmp_path, "dive.tlog", bytes(kept))
    assert log.jumps == ()
    assert log.duration_s == pytest.approx(19.9, abs=0.01)
    assert _row(log, 12.0)["depth_m"] is None
    assert _row(log, 12.0)["stick_forward"] is None


@pytest.mark.parametrize("off_s", [-1e6, -30.0, 30.0, 1e6])
def test_one_damaged_stamp_moves_nothing(tmp_path: Path, off_s: float) -> None:
    """The record comes a moment early or late; the clock goes on as if its stamp were right."""
    data = bytearray(WHOLE["dive.tlog"])
    at = 0
    for _ in range(500):
        packet = packet_at(data, at)
        assert packet is not None
        at = packet.end
    packet = packet_at(data, at)
    assert packet is not None
    data[at : at + 8] = round(1e6 * (packet.stamp_s + off_s)).to_bytes(8, "big")
    log = _read(tmp_path, "dive.tlog", bytes(data))
    assert log.jumps == ()
    assert log.duration_s == pytest.approx(19.9, abs=1e-3)


def test_a_wrong_checksum_is_one_bad_record(tmp_path: Path) -> None:
    """The packet after it is read."""
    data = bytearray(WHOLE["dive.tlog"])
    packet = packet_at(data, 0)
    assert packet is not None
    data[packet.start + 12] ^= 0xFF
    log = _read(tmp_path, "dive.tlog", bytes(data))
    assert log.bad == {"checksum": 1}
    assert log.bad_bytes == packet.end
    assert log.records == _read(tmp_path, "dive.tlog").records - 1


@pytest.mark.parametrize("name", ["dive.tlog", "dive.BIN"])
def test_garbage_between_records_is_one_bad_record(tmp_path: Path, name: str) -> None:
    """Nothing else is lost; its bytes are counted."""
    data = WHOLE[name]
    if name == "dive.tlog":
        packet = packet_at(data, 0)
        assert packet is not None
        at = packet.end
    else:
        at = 89
    junk = bytes(range(1, 140))
    log = _read(tmp_path, name, data[:at] + junk + data[at:])
    assert log.bad == {"no record": 1}
    assert log.bad_bytes == len(junk)
    assert log.records == _read(tmp_path, name).records


def test_a_spoiled_chunk_costs_its_own_messages(tmp_path: Path) -> None:
    """The rest of BlueOS's recording is read."""
    data = bytearray(WHOLE["dive.mcap"])
    middle = len(data) // 2
    data[middle : middle + 40] = bytes(40)
    log = _read(tmp_path, "dive.mcap", bytes(data))
    assert log.bad == {"chunk": 1}
    assert log.duration_s == pytest.approx(19.9, abs=0.01)


@pytest.mark.parametrize("name", MADE)
@given(data=st.data())
@QUICK
def test_mutated_bytes_never_stop_a_reader(name: str, data: st.DataObject) -> None:
    """Any bytes changed, cut out or put in: every sample that comes back is finite in time, in order, and in range."""
    count_bad = bytearray(WHOLE[name])
    for _ in range(data.draw(st.integers(1, 12))):
        at = data.draw(st.integers(0, len(count_bad) - 1))
        what = data.draw(st.sampled_from(["change", "remove", "insert"]))
        if what == "change":
            count_bad[at] = data.draw(st.integers(0, 255))
        elif what == "remove":
            del count_bad[at : at + data.draw(st.integers(1, 400))]
        else:
            count_bad[at:at] = data.draw(st.binary(max_size=300))
    _is_sound(READERS[name](bytes(count_bad)), name)


@pytest.mark.parametrize("name", MADE)
@given(noise=st.binary(max_size=3000))
@QUICK
def test_noise_never_stops_a_reader(name: str, noise: bytes) -> None:
    """Bytes of no format at all."""
    _is_sound(READERS[name](noise), name)


def _is_sound(collector: LogCollector, name: str) -> None:
    log = collector.done(Path(name), "dataflash" if name.endswith("BIN") else name.rpartition(".")[2])
    for channel, series in log.series.items():
        assert np.isfinite(series.time_s).all()
        assert (np.diff(series.time_s) >= 0.0).all()
        if channel == "attitude":
            assert np.nanmax(np.abs(series.values), initial=0.0) <= 2.0 * math.pi
    rows = tabulate(log).rows
    assert len(rows) <= 500_001


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"", "empty"),
        (b"hello" * 100, "not one record found"),
        (b"\x89MCAP0\r\n", "none of which says"),
        (b"\xa3\x95\x80" + bytes(86), "none of which says"),
    ],
)
def test_what_is_no_log_is_one_line(tmp_path: Path, data: bytes, said: str) -> None:
    """The message names the file and what would be right."""
    path = tmp_path / "x.dat"
    path.write_bytes(data)
    with pytest.raises(InputError, match=said) as fault:
        read_log(path)
    assert "\n" not in str(fault.value)
    assert "x.dat" in str(fault.value)


def test_blueos_keys_without_quotes_are_read() -> None:
    """Its JSON may be JSON5."""
    from wakewise_ardusub.logs import mavlink

    collector = LogCollector()
    body = b'{header: {system_id: 1}, message: {type: "VFR_HUD", alt: -2.5}}'
    head = mavlink._MESSAGE_HEAD.pack(7, 0, 10**9, 10**9)
    assert mavlink._message(collector, head + body, {7: (1, 1, "VFR_HUD")})
    assert collector.records_of(1).rows["depth VFR_HUD"] == [(0.0, 2.5)]
