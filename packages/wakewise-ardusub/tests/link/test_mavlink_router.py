"""One autopilot's bytes for several programs."""

from __future__ import annotations

import json
import socket
import threading
from contextlib import ExitStack

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise.ui.cli.main import run
from wakewise_ardusub.link.connection import parse_connection
from wakewise_ardusub.link.mavlink_relay import MavlinkRouter


def opened(stack: ExitStack) -> socket.socket:
    made = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
    made.bind(("127.0.0.1", 0))
    made.settimeout(5.0)
    return made


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def heard(one: socket.socket) -> tuple[bytes, tuple[str, int]]:
    data, sender = one.recvfrom(2000)
    return data, sender


def test_what_one_says_goes_to_all_others_as_it_is() -> None:
    """Autopilot to both, each of them to the autopilot and to the other, whatever the bytes; nobody hears himself."""
    port = free_port()
    with ExitStack() as stack:
        autopilot, station, companion = (opened(stack) for _ in range(3))
        outs = [f"udpout:127.0.0.1:{one.getsockname()[1]}" for one in (station, companion)]
        shared = MavlinkRouter([parse_connection(f"udpin:127.0.0.1:{port}"), *map(parse_connection, outs)])
        stack.callback(shared.close)
        autopilot.sendto(b"\xfd first", ("127.0.0.1", port))
        shared.turn()
        (first, at_station), (second, at_companion) = heard(station), heard(companion)
        assert first == second == b"\xfd first"
        station.sendto(b"sticks", at_station)
        shared.turn()
        assert heard(autopilot)[0] == heard(companion)[0] == b"sticks"
        companion.sendto(b"\x00\xff", at_companion)
        shared.turn()
        assert heard(autopilot)[0] == heard(station)[0] == b"\x00\xff"
        for one in (autopilot, station, companion):
            one.setblocking(False)
            with pytest.raises(BlockingIOError):
                one.recv(10)
        assert shared.passed == [1, 1, 1]


def test_a_firmware_that_comes_back_at_another_port_is_answered_there() -> None:
    """From its first heartbeat on; who is not there yet loses nothing for the others."""
    mav = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = bytes(mav.heartbeat_encode(12, 3, 129, 19, 4).pack(mav))
    port = free_port()
    with ExitStack() as stack:
        station = opened(stack)
        outs = [f"udpout:127.0.0.1:{station.getsockname()[1]}", f"udpout:127.0.0.1:{free_port()}"]
        shared = MavlinkRouter([parse_connection(f"udpin:127.0.0.1:{port}"), *map(parse_connection, outs)])
        stack.callback(shared.close)
        for _ in range(2):
            autopilot = opened(stack)
            autopilot.sendto(beat, ("127.0.0.1", port))
            shared.turn()
            data, sender = heard(station)
            assert data == beat
            station.sendto(b"arm", sender)
            for _ in range(5):  # a refused datagram to nobody may wake it
                shared.turn()
            assert heard(autopilot)[0] == b"arm"


def test_only_udp_can_be_shared_and_a_port_that_is_taken_is_said() -> None:
    """In one line each; what was opened is given back."""
    with pytest.raises(InputError, match="only udpin:HOST:PORT and udpout:HOST:PORT can be shared"):
        MavlinkRouter([parse_connection("tcp:127.0.0.1:5760")])
    with ExitStack() as stack:
        taken, port = opened(stack).getsockname()[1], free_port()
        with pytest.raises(EnvironmentFailure, match="another program listens there already"):
            MavlinkRouter([parse_connection(f"udpin:127.0.0.1:{each}") for each in (port, taken)])
        MavlinkRouter([parse_connection(f"udpin:127.0.0.1:{port}")]).close()


def test_the_command_counts_what_went_by(capsys: pytest.CaptureFixture[str]) -> None:
    """As a user starts it; loopback alone, unless another host is named."""
    port = free_port()
    with ExitStack() as stack:
        autopilot, station = opened(stack), opened(stack)
        to = f"udpout:127.0.0.1:{station.getsockname()[1]}"
        over = threading.Event()

        def speak() -> None:
            while not over.wait(0.05):
                autopilot.sendto(b"beat", ("127.0.0.1", port))

        speaking = threading.Thread(target=speak)
        speaking.start()
        asked = ["link", "route", "--connection", f"udpin:127.0.0.1:{port}", "--out", to, "--seconds", "1", "--json"]
        assert run(asked) == 0
        over.set()
        speaking.join()
        assert heard(station)[0] == b"beat"
    told = capsys.readouterr()
    said = json.loads(told.out)
    assert said["datagrams"][f"udpin:127.0.0.1:{port}"] > 0
    assert said["datagrams"][to] == 0
    assert "0.0.0.0" not in told.err
    assert run(["link", "route", "--out", "tcp:127.0.0.1:1"]) == 2
    assert "can be shared" in capsys.readouterr().err
