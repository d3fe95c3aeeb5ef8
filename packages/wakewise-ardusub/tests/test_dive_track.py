"""Logs of every format give the poses that photographs are picked by."""

from __future__ import annotations

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("pymavlink", reason="the extra `links` is not installed")
pytest.importorskip("cv2", reason="the extra `photos` is not installed")

from made_dive import START_S, Dive, dive, write_photos
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import made_logs
from wakewise.core.errors import InputError
from wakewise.core.geometry import euler_from_quat, matrix_from_quat
from wakewise.ui.cli.main import run
from wakewise.vision.photo_selection.dive_track import poses_at, read_track
from wakewise_ardusub.logs import dive_track
from wakewise_ardusub.logs.channels import ChannelSeries
from wakewise_ardusub.logs.dive_track import read_dive_log


@pytest.fixture(scope="module")
def made() -> Dive:
    """A dive of a minute."""
    return dive(21, 60.0)


def _tlog(made: Dive, source: str) -> bytes:
    """The dive as a ground station keeps it: attitude at 10 Hz, position by one source at 5 Hz, rangefinder, depth."""
    track = made.track
    angles = euler_from_quat(track.q_WB)
    R_WB = matrix_from_quat(track.q_WB)
    out = io.BytesIO()
    autopilot, companion = (mavlink.MAVLink(None, srcSystem=1, srcComponent=c) for c in (1, 197))

    def said(sender: Any, time_s: float, message: Any) -> None:
        out.write(struct.pack(">Q", round(1e6 * (START_S + time_s))) + message.pack(sender))
        sender.seq = (sender.seq + 1) % 256

    for k, time_s in enumerate(track.time_s):
        boot = round(1e3 * (50.0 + time_s))
        if k % 10 == 0:
            said(autopilot, time_s, mavlink.MAVLink_heartbeat_message(12, 3, 209, 19, 4, 3))
        said(autopilot, time_s, mavlink.MAVLink_attitude_message(boot, *angles[k], 0, 0, 0))
        north, east, down = track.position_W_m[k]
        said(autopilot, time_s, mavlink.MAVLink_vfr_hud_message(0, 0, 0, 0, -down, 0))
        centimetres = round(100.0 * track.altitude_m[k])
        said(companion, time_s, mavlink.MAVLink_distance_sensor_message(7, 5, 5000, centimetres, 0, 1, 25, 0))
        if k % 2:
            continue
        if source == "position":
            message = mavlink.MAVLink_local_position_ned_message(boot, north, east, down, 0, 0, 0)
            said(autopilot, time_s, message)
        elif source == "odometry":
            still = [0.0] * 21
            message = mavlink.MAVLink_odometry_message(
                0, 1, 8, north, east, down, [1.0, 0, 0, 0], 0, 0, 0, 0, 0, 0, still, still
            )
            said(companion, time_s, message)
        elif source == "dvl" and k >= 2:
            step = R_WB[k].T @ (track.position_W_m[k] - track.position_W_m[k - 2])
            message = mavlink.MAVLink_vision_position_delta_message(0, 200_000, [0.0] * 3, list(step), 100.0)
            said(companion, time_s, message)
        elif source == "global":
            lat, lon = 47.6 + np.degrees(north / 6_371_008.8), -122.3
            lon += np.degrees(east / 6_371_008.8 / np.cos(np.radians(47.6)))
            message = mavlink.MAVLink_global_position_int_message(
                boot, round(1e7 * lat), round(1e7 * lon), 0, 0, 0, 0, 0, 0
            )
            said(autopilot, time_s, message)
    return out.getvalue()


@pytest.mark.parametrize(
    ("time_s", "kept"),
    [
        ([0.0, 1.0, 2.0, 3.0, 4.0, 100.0, 5.0, 6.0, 101.0], [0, 1, 2, 3, 4, 6, 7, 8]),
        ([0.0, 1.0, 2.0, 2.0, 1.5, 1.7, 3.0, 4.0], [0, 1, 4, 5, 6, 7]),
        ([0.0, 1.0, np.nan, 2.0, 3.0, 4.0], [0, 1, 3, 4, 5]),
    ],
)
def test_samples_of_a_channel_have_rising_times(time_s: list[float], kept: list[int]) -> None:
    """Of samples out of order those go that are too late, or those that are too soon, whichever leaves more."""
    times = np.array(time_s)
    found = dive_track._finite(ChannelSeries(time_s=times, values=np.arange(len(times))[:, None].astype(float)))
    assert found is not None
    assert found.values[:, 0].tolist() == kept
    assert (np.diff(found.time_s) > 0.0).all()


@pytest.mark.parametrize(
    ("source", "error_m"), [("position", 0.01), ("odometry", 0.01), ("dvl", 0.15), ("global", 0.1)]
)
def test_positions_of_every_source_are_those_flown(tmp_path: Path, made: Dive, source: str, error_m: float) -> None:
    """Relative to the first place; attitude, altitude and the calendar come with them."""
    (tmp_path / "dive.tlog").write_bytes(_tlog(made, source))
    track = read_track(tmp_path / "dive.tlog")
    at = np.arange(2.0, 58.0, 0.7)
    assert track.started_s == pytest.approx(START_S)
    found, true = poses_at(track, at), poses_at(made.track, at)
    assert found.known.all()
    way = found.position_W_m - found.position_W_m[0] - (true.position_W_m - true.position_W_m[0])
    assert np.abs(way).max() < error_m
    assert np.abs((found.q_WB * true.q_WB).sum(axis=1)).min() > 1.0 - 1e-6
    assert np.abs(found.altitude_m - true.altitude_m).max() < 0.02


def test_photographs_are_picked_by_a_telemetry_log(
    tmp_path: Path, made: Dive, capsys: pytest.CaptureFixture[str]
) -> None:
    """`wakewise photos pick --log dive.tlog`: the offset is found within 0.1 s from a DVL's steps."""
    (tmp_path / "dive.tlog").write_bytes(_tlog(made, "dvl"))
    write_photos(tmp_path / "photos", made, -3598.6)
    words = [str(tmp_path / "photos"), "--log", str(tmp_path / "dive.tlog"), "--out", str(tmp_path / "out"), "--json"]
    assert run(["photos", "pick", *words]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["offset"]["offset_s"] == pytest.approx(-3598.6, abs=0.1)
    assert told["positions_from"] == "steps of a DVL, summed"


@pytest.mark.parametrize("name", ["dive.tlog", "dive.mcap"])
def test_the_autopilots_estimate_comes_from_mavlink_logs(tmp_path: Path, name: str) -> None:
    """The made dive goes 0.1 m/s north, 0.2 m/s west, 0.5 m/s down."""
    pytest.importorskip("mcap", reason="the extra `links` is not installed")
    make = made_logs.tlog if name.endswith("tlog") else made_logs.mcap
    (tmp_path / name).write_bytes(make(position=True))
    track = read_dive_log(tmp_path / name)
    poses = poses_at(track, np.array([4.0, 14.0]))
    assert poses.position_W_m[1] - poses.position_W_m[0] == pytest.approx([1.0, -2.0, 5.0], abs=0.05)


def test_an_autopilots_own_log_gives_dvl_rangefinder_and_calendar(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """VISO's steps are turned by the attitude and summed, RFND is altitude, GPS is the calendar; no record is lost."""
    kinds = {
        "VISO": (10, "Qffff", "TimeUS,dt,PosDX,PosDY,PosDZ"),
        "RFND": (11, "QBCBB", "TimeUS,Instance,Dist,Stat,Orient"),
        "GPS": (12, "QBIHLL", "TimeUS,I,GMS,GWk,Lat,Lng"),
    }
    monkeypatch.setitem(made_logs._PACKED, "L", "i")
    data = bytearray(made_logs.dataflash())
    for name, (number, codes, labels) in kinds.items():
        length = 3 + struct.calcsize("<" + "".join(made_logs._PACKED[c] for c in codes))
        head = struct.pack("<BB4s16s64s", number, length, name.encode(), codes.encode(), labels.encode())
        data += b"\xa3\x95\x80" + head
    for k in range(100):
        stamp = round(1e6 * (120.0 - 0.01 + k * 1e-4))
        for name, values in {
            "VISO": (0.1, 0.02, 0.0, 0.0),
            "RFND": (0, 130, 4, 25),
            "GPS": (0, 43_200_000 + round(k * 0.1), 2222, 0, 0),
        }.items():
            number, codes, _ = kinds[name]
            data += b"\xa3\x95" + bytes([number])
            data += struct.pack("<" + "".join(made_logs._PACKED[c] for c in codes), stamp, *values)
    path = tmp_path / "dive.BIN"
    path.write_bytes(bytes(data))
    from wakewise_ardusub.logs.read import read_log

    log = read_log(path)
    assert log.bad_records == 0 and not log.unread
    assert log.series["altitude"].values[0, 0] == pytest.approx(1.3)
    assert len(log.series["dvl step"].time_s) == 100
    # Week 2222 of GPS time began on 2022-08-07.
    assert log.series["calendar"].values[0, 0] == pytest.approx(1_659_830_400.0 + 43_200.0 - 18.0)


def test_a_clock_that_was_set_during_the_dive_counts_as_it_was_afterwards(tmp_path: Path) -> None:
    """A ground station whose clock jumped by 900 s after 8 s began 900 s later than it said."""
    (tmp_path / "dive.tlog").write_bytes(made_logs.tlog(8.0, 900.0, position=True))
    assert read_dive_log(tmp_path / "dive.tlog").started_s == pytest.approx(made_logs.START_S + 900.0, abs=0.2)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (made_logs.tlog, "holds no positions"),
        (made_logs.dataflash, "holds no positions"),
    ],
)
def test_a_log_without_positions_is_told_in_one_line(tmp_path: Path, make: Any, told: str) -> None:
    """The line names the messages that would hold them."""
    (tmp_path / "dive.log").write_bytes(make())
    with pytest.raises(InputError, match=told) as fault:
        read_dive_log(tmp_path / "dive.log")
    assert "LOCAL_POSITION_NED" in str(fault.value) and "\n" not in str(fault.value)


def test_link_log_says_what_a_ground_stations_table_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and one line that names the .tlog and the .BIN; nothing is written."""
    monkeypatch.chdir(tmp_path)
    header = "Timestamp,roll,pitch,heading,rollRate,pitchRate,yawRate,groundSpeed,altitudeRelative"
    Path("2022-08-15 10-16-17 vehicle1.csv").write_text(f"{header}\n2022-08-15 10:16:17.386,1,2,3,0,0,0,0,-2\n")
    assert run(["link", "log", "2022-08-15 10-16-17 vehicle1.csv"]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("✓")]
    assert len(lines) == 1
    assert all(word in lines[0] for word in ("no motor outputs", ".tlog", "Telemetry", ".BIN"))
    assert not Path("runs").exists()
