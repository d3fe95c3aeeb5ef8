"""Sensors read live: a serial line that is a pseudo-terminal, a socket, an imitated depth sensor; and the command."""

import ctypes
import json
import os
import socket
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from test_ms5837 import SHEET_30BA, Part, _with_sum

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.ui.cli.main import run
from wakewise_ardusub.sensors import DepthSensor, I2CBus, InertialUnit, LinePoses, SerialPort, UdpSocket
from wakewise_ardusub.sensors.jy901 import composed
from wakewise_ardusub.sensors.ms5837 import ADDRESS
from wakewise_ardusub.sensors.sensor_polling import DepthSource, InertialSource, PoseSource, watch

smbus2 = pytest.importorskip("smbus2.smbus2", reason="the extra `links` is not installed")
pytest.importorskip("serial", reason="the extra `links` is not installed")
Capsys = pytest.CaptureFixture[str]


def test_all_three_say_their_values_and_rates() -> None:
    """Bytes of a line, datagrams and readings come through the real devices' code."""
    master, slave = os.openpty()
    part = Part(_with_sum(SHEET_30BA), 4958179, 6815414)
    with UdpSocket("0") as port:
        unit = SerialPort(os.ttyname(slave), 9600)
        sources = [
            DepthSource(DepthSensor(part, sleep=part.sleep), "bus"),
            InertialSource(InertialUnit(), unit, "line"),
            PoseSource(LinePoses(), port, "port"),
        ]
        os.write(master, b"noise" + composed(0x51, (0, 0, 2048, 0)) + composed(0x52, (0, 0, 0, 0)))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(b"1,2,3,4\nnonsense", ("127.0.0.1", port.port))
        passed: list[object] = []
        part.now = time.monotonic
        *_, told = watch(sources, 0.35, every_s=0.1, passed=passed.append)
        unit.close()
    os.close(master)
    os.close(slave)
    depth, imu, poses = told
    assert depth["samples"] in (3, 4)
    assert depth["last"]["depth_m"] == pytest.approx((depth["last"]["pressure_mbar"] * 100 - 101325) / 9806.65)
    assert imu["samples"] == 1
    assert imu["bad"] == 5
    assert imu["last"]["force_m_s2"] == pytest.approx([0.0, 0.0, -9.80665])
    assert (poses["samples"], poses["bad"]) == (1, 1)
    assert poses["last"]["north_east_down_m"] == [2.0, 3.0, 4.0]
    assert len(passed) == depth["samples"] + 2
    json.dumps(told)


def test_a_sensor_that_falls_silent_is_said_and_asked_again() -> None:
    """A wet connector: counted, its words kept, and the next reading is one again, ten times a second."""
    part = Part(_with_sum(SHEET_30BA), 4958179, 6815414)
    source = DepthSource(DepthSensor(part, sleep=part.sleep), "bus")
    values, part.values = part.values, dict.fromkeys(part.values, 0)
    taken = []
    for tick in range(200):
        now = 0.005 * tick
        part.slept_s = now
        if tick == 100:
            part.values = values
        taken += [(now, measured.time_s) for measured in source.poll(now)]
    assert source.tally.bad == 5
    assert "before it had converted" in str(source.tally.complaint)
    assert len(taken) == 5
    for now, stamp in taken:
        assert stamp == pytest.approx(now - 0.04 + 0.5 * 18.08e-3, abs=0.006)


def test_others_are_read_while_a_depth_sensor_converts() -> None:
    """The stamps of an inertial unit do not wait for it: no poll takes as long as a conversion."""
    part = Part(_with_sum(SHEET_30BA), 4958179, 6815414)
    source = DepthSource(DepthSensor(part, sleep=part.sleep), "bus")
    slept = part.slept_s
    for tick in range(50):
        source.poll(0.005 * tick)
    assert part.slept_s == slept


def test_a_line_of_another_rate_is_said() -> None:
    """Bytes without a frame in them are no unit's."""
    master, slave = os.openpty()
    port = SerialPort(os.ttyname(slave), 115200)
    source = InertialSource(InertialUnit(), port, "line")
    os.write(master, b"\x80" * 400)
    for _ in range(50):
        source.poll(0.0)
        if source.tally.bad > 200:
            break
        time.sleep(0.01)
    assert "another baud rate" in str(source.tally.complaint)
    port.close()
    os.close(master)
    os.close(slave)


def test_the_command_shows_poses_that_are_sent_to_it(capsys: Capsys) -> None:
    """JSON alone on standard output; the port is chosen by the system beforehand."""
    with UdpSocket("0") as free:
        port = free.port

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for _ in range(60):
                sender.sendto(b'{"p": [1, 2, 3], "q": [1, 0, 0, 0]}', ("127.0.0.1", port))
                time.sleep(0.01)

    sender = threading.Thread(target=send)
    sender.start()
    assert run(["link", "sensors", "--poses", str(port), "--seconds", "0.5", "--json"]) == 0
    sender.join()
    (told,) = json.loads(capsys.readouterr().out)["sensors"]
    assert told["samples"] > 3
    assert told["last"]["north_east_down_m"] == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "--depth, --imu or --poses"),
        (["--depth", "/dev/i2c-none"], "no such device"),
        (["--imu", "/dev/null"], "is not a serial port"),
        (["--imu", "/dev/null", "--baud", "9601"], "9600"),
        (["--imu", "/dev/null", "--imu-axes", "up,up,up"], "right-handed"),
        (["--poses", "here"], "such as 127.0.0.1:14660"),
        (["--poses", "99999"], "such as 127.0.0.1:14660"),
        (["--poses", "::1:5"], "such as 127.0.0.1:14660"),
        (["--forward", "127.0.0.1:5"], "--forward: goes with --poses"),
        (["--poses", "0", "--forward", "there"], "such as 127.0.0.1:14660"),
        (["--poses", "0", "--zero"], "--zero: goes with --depth"),
        (["--poses", "0", "--json"], "give --seconds"),
    ],
)
def test_bad_words_are_one_line(words: list[str], said: str, capsys: Capsys) -> None:
    """Exit code 2, what and what would be right."""
    assert run(["link", "sensors", *words]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert said in told.err
    assert len(told.err.strip().splitlines()) == 1


def test_the_bus_carries_bytes_both_ways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """smbus2's messages reach the part, and its answers come back; a part that is silent is an OSError."""
    part = Part(_with_sum(SHEET_30BA), 4958179, 6815414)

    def ioctl(_: int, request: int, data: Any) -> None:
        if request != smbus2.I2C_RDWR:
            return
        for message in data.msgs[: data.nmsgs]:
            if message.addr != ADDRESS:
                raise OSError(121, "Remote I/O error")
            if message.flags & smbus2.I2C_M_RD:
                ctypes.memmove(message.buf, part.read(message.addr, message.len), message.len)
            else:
                part.write(message.addr, ctypes.string_at(message.buf, message.len))

    monkeypatch.setattr("smbus2.smbus2.ioctl", ioctl)
    (tmp_path / "i2c-1").write_bytes(b"")
    bus = I2CBus(tmp_path / "i2c-1")
    twin = Part(_with_sum(SHEET_30BA), 4958179, 6815414)
    assert DepthSensor(bus, sleep=part.sleep).read() == DepthSensor(twin, sleep=twin.sleep).read()
    with pytest.raises(EnvironmentFailure, match="0x77: does not answer, Remote I/O error"):
        DepthSensor(bus, address=0x77, sleep=part.sleep)
    bus.close()


def test_devices_that_cannot_be_had_are_refused(tmp_path: Path) -> None:
    """A file that is no bus, a port that is taken."""
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(InputError, match="file: is not an I2C bus, such as /dev/i2c-1"):
        I2CBus(tmp_path / "file")
    with UdpSocket("0") as port, pytest.raises(EnvironmentFailure, match="cannot listen"):
        UdpSocket(f"127.0.0.1:{port.port}")
    with pytest.raises(InputError, match="no such device"):
        SerialPort(tmp_path / "none", 9600)
