"""Bytes over sockets on this computer."""

from __future__ import annotations

import os
import socket
import threading
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.link.connection import Endpoint, parse_connection
from wakewise_ardusub.link.transports import MavlinkCodec, StreamTransport, UdpTransport, open_transport


def test_a_host_without_an_address_is_said():
    """Its name, and that it has none."""
    with pytest.raises(InputError, match=r"no-such-host\.invalid has no address"):
        open_transport(parse_connection("udpout:no-such-host.invalid:14550"))


def test_a_port_that_is_taken_is_said():
    """Another program listens there."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        with pytest.raises(EnvironmentFailure, match="another program listens there already"):
            open_transport(Endpoint(way="udpin", host="127.0.0.1", port=other.getsockname()[1]))


def test_who_waits_answers_whoever_spoke():
    """Nothing is sent before somebody spoke; then it goes to them."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as vehicle:
        vehicle.bind(("127.0.0.1", 0))
        vehicle.settimeout(2.0)
        waiting = UdpTransport(Endpoint(way="udpin", host="127.0.0.1"))
        waiting.send(b"to nobody")
        vehicle.sendto(b"hello", waiting.socket.getsockname())
        assert waiting.receive(2.0) == b"hello"
        waiting.send(b"answer")
        assert vehicle.recv(100) == b"answer"
        assert waiting.receive(0.0) == b""
        waiting.close()
        speaking = UdpTransport(Endpoint(way="udpout", host="127.0.0.1", port=vehicle.getsockname()[1]))
        speaking.send(b"first")
        assert vehicle.recv(100) == b"first"
        speaking.close()


def test_who_only_sends_poses_is_not_answered():
    """Of two that speak to one port the one with heartbeats is answered, before and after the other's poses."""
    heart = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = heart.heartbeat_encode(12, 3, 129, 19, 4).pack(heart)
    pose = heart.vision_position_estimate_encode(1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0).pack(heart)
    waiting = UdpTransport(Endpoint(way="udpin", host="127.0.0.1"))
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    try:
        for one in sockets:
            one.bind(("127.0.0.1", 0))
            one.settimeout(2.0)
        router, sender = sockets
        for who, data in ((sender, pose), (router, beat), (sender, pose)):
            who.sendto(data, waiting.socket.getsockname())
            assert waiting.receive(2.0) == bytes(data)
        waiting.send(b"thrusts")
        assert router.recv(100) == b"thrusts"
    finally:
        for one in (*sockets, waiting):
            one.close()


def test_a_record_cannot_be_flown(tmp_path):
    """A file is refused, and what reads it is named."""
    (tmp_path / "flight.tlog").write_bytes(b"")
    with pytest.raises(InputError, match="a record cannot be flown; wakewise link log reads it"):
        open_transport(parse_connection(f"file:{tmp_path / 'flight.tlog'}"))


def test_nobody_at_the_other_end_of_tcp_is_said():
    """A refused connection is told of in one line."""
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    with pytest.raises(EnvironmentFailure, match=f"tcp:127.0.0.1:{port}: Connection refused"):
        open_transport(parse_connection(f"tcp:127.0.0.1:{port}"))


def test_a_stream_over_tcp_carries_both_ways():
    """Messages come in and thrusts go out; a side that hung up is silence."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        taken: list[socket.socket] = []
        waits = threading.Thread(target=lambda: taken.append(server.accept()[0]))
        waits.start()
        transport = open_transport(parse_connection(f"tcp:127.0.0.1:{server.getsockname()[1]}"))
        waits.join()
        with taken[0] as vehicle:
            mav = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
            packet = bytes(mav.attitude_encode(1, 0.5, 0, 0, 0, 0, 0.5).pack(mav))
            vehicle.sendall(packet[:20])
            assert transport.receive(1.0) == b""
            vehicle.sendall(packet[20:])
            assert transport.receive(1.0) == packet
            transport.send(b"out")
            assert vehicle.recv(10) == b"out"
        assert transport.receive(0.2) == b""
        transport.close()


def test_a_serial_line_carries_both_ways():
    """A pseudo-terminal as the cable: packets come in whole, bytes go out as they are; pulled out, it is silence."""
    master, slave = os.openpty()
    transport = open_transport(parse_connection(f"serial:{os.ttyname(slave)}:115200"))
    mav = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    packet = bytes(mav.attitude_encode(1, 0.5, 0, 0, 0, 0, 0.5).pack(mav))
    os.write(master, packet[:20])
    assert transport.receive(1.0) == b""
    os.write(master, packet[20:])
    assert transport.receive(1.0) == packet
    transport.send(bytes(range(256)))
    assert os.read(master, 300) == bytes(range(256))
    os.close(slave)
    os.close(master)
    began_s = time.monotonic()
    assert [transport.receive(0.1) for _ in range(3)] == [b""] * 3
    assert time.monotonic() - began_s > 0.15  # it waits, and does not spin
    with pytest.raises(OSError, match="Input/output"):
        transport.send(b"more")
    transport.close()


@given(cuts=st.lists(st.integers(1, 60), max_size=30), noise=st.binary(max_size=20))
@settings(max_examples=100, deadline=None)
def test_packets_of_a_stream_are_whole_however_it_was_cut(cuts, noise):
    """Ten messages with noise before them, handed over in pieces of any size: all but what may be begun are read."""
    mav = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    data = noise + b"".join(bytes(mav.attitude_encode(k, 0, 0, 0, 0, 0, 0).pack(mav)) for k in range(1, 20))
    pieces, at = [], 0
    for cut in [*cuts, len(data)]:
        pieces.append(data[at : at + cut])
        at += cut
    ours, theirs = socket.socketpair()
    waiting = iter([piece for piece in pieces if piece])
    stream = StreamTransport(ours, lambda _: next(waiting), theirs.send, ours.close)
    theirs.send(b"ready")
    post = MavlinkCodec(stream, 1)
    times = [said.fields["time_boot_ms"] for piece in pieces if piece for said in post.receive(0.0)[0]]
    ours.close()
    theirs.close()
    assert times == sorted(times)
    assert len(times) >= 12 or len(noise) > 0
    if not noise:
        assert times == list(range(1, 20))
