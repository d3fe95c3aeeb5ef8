"""Connections: what their words may be, and that bytes go through them as the companion's."""

from __future__ import annotations

import errno
import gc
import os
import socket
import sys
from pathlib import Path

import pytest

from wakewise.core.errors import EnvironmentFailure, InputError, MissingExtra
from wakewise_ardusub.link.connection import Connection, cannot_open, dialect, parse_connection


@pytest.mark.parametrize(
    "words",
    ["udpin:0.0.0.0:14550", "udpout:192.168.2.2:14550", "tcp:blueos.local:5777", "serial:/dev/ttyACM0:115200"],
)
def test_words_that_mean_a_connection(words: str) -> None:
    """Read and said again they are the same."""
    assert parse_connection(words).words == words


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("upd:0.0.0.0:14550", "'upd' is not one of udpin"),
        ("192.168.2.2", "must begin with udpin"),
        ("udpin:", "nothing after the colon"),
        ("udpin:14550", "a port is missing"),
        ("udpin:0.0.0.0:14550x", "'14550x' is not a number"),
        ("udpin:0.0.0.0:145500", "port 145500 is not between"),
        ("udpin:0.0.0.0:0", "port 0 is not between"),
        ("udpin:a b:14550", "'a b' is no host"),
        ("tcp:-x:1", "'-x' is no host"),
        ("serial:/dev/ttyACM0", "a speed is missing"),
        ("serial:/dev/ttyACM0:115201", "speed 115201"),
        ("serial:ttyACM0:115200", "'ttyACM0' is no serial device"),
        ("file:/not/there.tlog", "there is no file /not/there.tlog"),
        ("", "must begin with udpin"),
    ],
)
def test_a_typo_is_one_line_with_what_is_right(words: str, said: str) -> None:
    """What was found, where, and what would be right."""
    with pytest.raises(InputError) as fault:
        parse_connection(words)
    assert said in str(fault.value)
    assert "\n" not in str(fault.value)
    assert ("right is udpin:" in str(fault.value)) == (not words.startswith("file"))


def test_a_companion_speaks_mavlink_2_from_component_191() -> None:
    """Over UDP on this computer: what is sent carries the vehicle's id, and what comes back is heard."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.settimeout(5.0)
        words = f"udpout:127.0.0.1:{vehicle.getsockname()[1]}"
        with Connection(parse_connection(words), system=7) as link:
            link.send("heartbeat", type=18, autopilot=8, base_mode=0, custom_mode=0, system_status=4)
            data, back = vehicle.recvfrom(4096)
            assert (data[0], data[5], data[6]) == (0xFD, 7, 191)
            voice = dialect().MAVLink(None, srcSystem=7, srcComponent=1)
            ack = voice.command_ack_encode(command=512, result=0).pack(voice)
            vehicle.sendto(b"\x00garbage" + b"\xff" * 30, back)
            vehicle.sendto(ack, back)
            assert link.hear({"COMMAND_ACK"}, 5.0).command == 512
            assert link.hear({"HEARTBEAT"}, 0.05) is None


def test_a_conversation_over_a_serial_line() -> None:
    """As over UDP, at a pseudo-terminal: MAVLink 2 from component 191 out, the autopilot's answer in."""
    master, slave = os.openpty()
    with Connection(parse_connection(f"serial:{os.ttyname(slave)}:115200"), system=7) as link:
        assert link.live
        link.send("heartbeat", type=18, autopilot=8, base_mode=0, custom_mode=0, system_status=4)
        data = os.read(master, 300)
        assert (data[0], data[5], data[6]) == (0xFD, 7, 191)
        voice = dialect().MAVLink(None, srcSystem=7, srcComponent=1)
        os.write(master, b"\x00garbage" + bytes(voice.command_ack_encode(command=512, result=0).pack(voice)))
        assert link.hear({"COMMAND_ACK"}, 5.0).command == 512
        assert link.hear({"HEARTBEAT"}, 0.05) is None
    os.close(master)
    os.close(slave)


def test_a_device_that_is_not_there_and_one_that_is_none(tmp_path: Path) -> None:
    """Each in one line that says what would be one."""
    with pytest.raises(InputError, match="/dev/ttyNONE: no such device; give a serial port"):
        Connection(parse_connection("serial:/dev/ttyNONE:115200"))
    with pytest.raises(InputError, match="/dev/null: is not a serial port"):
        Connection(parse_connection("serial:/dev/null:115200"))
    with pytest.raises(InputError, match="COM3: no such device; give a serial port"):
        Connection(parse_connection("serial:COM3:115200"))


# pymavlink leaves a socket that it could not bind or connect to the garbage collector.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_port_that_is_taken_and_a_host_that_is_not_there() -> None:
    """Each in one line; neither is a fault of the program."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        words = f"udpin:127.0.0.1:{other.getsockname()[1]}"
        with pytest.raises(EnvironmentFailure, match="another program listens there already"):
            Connection(parse_connection(words))
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        with pytest.raises(EnvironmentFailure, match="refused"):
            Connection(parse_connection(f"tcp:127.0.0.1:{nobody.getsockname()[1]}"))
    gc.collect()


def test_the_ground_stations_port_is_said_to_be_taken_by_it() -> None:
    """Of 14550 the line names QGroundControl and a port that is free of it; of other ports it does not."""
    taken = OSError(errno.EADDRINUSE, "Address already in use")
    said = str(cannot_open(parse_connection("udpin:0.0.0.0:14550"), taken))
    assert "QGroundControl" in said and "14560" in said
    assert "QGroundControl" not in str(cannot_open(parse_connection("udpin:0.0.0.0:14560"), taken))


def test_a_file_is_heard_to_its_end(tmp_path: Path) -> None:
    """A log is a connection on which nobody answers."""
    voice = dialect().MAVLink(None, srcSystem=1, srcComponent=1)
    packet = voice.heartbeat_encode(12, 3, 0, 19, 4).pack(voice)
    path = tmp_path / "a.tlog"
    path.write_bytes(b"".join(bytes(7) + bytes([i]) + packet for i in range(3)))
    with Connection(parse_connection(f"file:{path}")) as link:
        assert not link.live
        assert sum(link.hear({"HEARTBEAT"}, 0.0) is not None for _ in range(5)) == 3


def test_without_pymavlink_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """The extra by name."""
    dialect.cache_clear()
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    with pytest.raises(MissingExtra, match=r"\[links\]"):
        dialect()
