"""Bytes to messages and back."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega

from wakewise_ardusub.link.protocol import RATES_HZ, interval_requests, parameter_request
from wakewise_ardusub.link.transports import MavlinkCodec, RelayTransport


class Line:
    """A carrier whose two ends are lists."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []
        self.sent: list[bytes] = []

    def receive(self, timeout_s: float) -> bytes:
        return self.waiting.pop(0) if self.waiting else b""

    def send(self, data: bytes) -> None:
        self.sent.append(data)


def test_it_speaks_as_the_vehicles_companion():
    """MAVLink 2 under the vehicle's system id and component 191, in sequence."""
    line = Line()
    post = MavlinkCodec(line, 7)
    for _ in range(3):
        post.send("heartbeat", {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 5, "system_status": 4})
    found = ardupilotmega.MAVLink(None).parse_buffer(b"".join(line.sent))
    assert [(m.get_srcSystem(), m.get_srcComponent(), m.get_seq()) for m in found] == [(7, 191, k) for k in range(3)]
    assert {packet[0] for packet in line.sent} == {0xFD}


def test_what_is_asked_for_are_messages_that_can_be_sent():
    """Requests for rates and parameters are packed and read back as they were."""
    line = Line()
    post = MavlinkCodec(line, 1)
    for name, fields in interval_requests(1):
        post.send(name, fields)
    post.send("param_request_read", parameter_request(1, "MOT_1_DIRECTION"))
    found = ardupilotmega.MAVLink(None).parse_buffer(b"".join(line.sent))
    asked = {round(m.param1): 1e6 / m.param2 for m in found[:-1]}
    assert asked == {number: rate_hz for number, (_, rate_hz) in RATES_HZ.items()}
    assert {ardupilotmega.mavlink_map[number].msgname for number in asked} == {name for name, _ in RATES_HZ.values()}
    assert (found[-1].param_id, found[-1].param_index) == ("MOT_1_DIRECTION", -1)


@given(noise=st.binary(min_size=1, max_size=600))
@settings(max_examples=200, deadline=None)
def test_noise_is_counted_and_nothing_is_raised(noise):
    """Any bytes: messages or noise, and after them a message is understood again within a packet's length."""
    line = Line()
    post = MavlinkCodec(line, 1)
    line.waiting.append(noise)
    post.receive(0.0)
    mav = ardupilotmega.MAVLink(None, srcSystem=1, srcComponent=1)
    line.waiting += [bytes(mav.attitude_encode(k, 0, 0, 0, 0, 0, 0).pack(mav)) for k in range(20)]
    said = [one for _ in range(20) for one in post.receive(0.0)[0]]
    assert any(one.name == "ATTITUDE" for one in said)


def test_a_tap_gives_what_went_by():
    """All datagrams since the last look, in order; nothing after a wait, where nothing went by."""
    tap = RelayTransport()
    tap.put(b"a")
    tap.put(b"b")
    assert tap.receive(0.0) == b"ab"
    assert tap.receive(0.01) == b""
    tap.send(b"nobody is there yet")
    sent: list[bytes] = []
    tap.out = sent.append
    tap.send(b"c")
    assert sent == [b"c"]
