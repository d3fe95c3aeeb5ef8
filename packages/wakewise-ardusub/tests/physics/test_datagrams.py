"""The bytes of the JSON physics link, both ways."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise_ardusub.physics.datagrams import (
    PhysicsState,
    ServoFrame,
    read_reply,
    read_request,
    write_reply,
    write_request,
)

PULSES = st.one_of(*(st.tuples(*(st.integers(0, 65535),) * n) for n in (16, 32)))
NUMBERS = st.floats(-1e4, 1e4)


def _motion(time_s: float = 1.25, **changed: object) -> PhysicsState:
    given_ = {
        "omega_B_rad_s": (0.1, -0.2, 0.3),
        "force_B_m_s2": (0.0, 0.0, -9.80665),
        "p_WB_m": (1.0, 2.0, 3.0),
        "q_WB": (1.0, 0.0, 0.0, 0.0),
        "v_W_m_s": (0.0, 0.5, 0.0),
    } | changed
    return PhysicsState(time_s=time_s, **{name: np.array(value) for name, value in given_.items()})


@given(PULSES, st.integers(1, 65535), st.integers(0, 2**32 - 1))
def test_a_request_is_read_as_it_was_written(pulses: tuple[int, ...], rate_hz: int, frame: int) -> None:
    """16 and 32 channels, all rates and counts."""
    request = ServoFrame(rate_hz=rate_hz, frame=frame, pulses_us=pulses)
    assert read_request(write_request(request)) == request


@given(st.binary(max_size=120))
def test_any_bytes_are_a_request_or_refused(data: bytes) -> None:
    """Nothing but `InputError` leaves the reader, and what it takes is what it would write."""
    try:
        request = read_request(data)
    except InputError:
        return
    assert write_request(request) == data


def test_the_layout_is_ardupilots() -> None:
    """Magic 18458, rate, count, then pulses, little-endian."""
    data = bytes([0x1A, 0x48, 0x90, 0x01, 7, 0, 0, 0]) + b"\xdc\x05" * 16
    assert read_request(data) == ServoFrame(rate_hz=400, frame=7, pulses_us=(1500,) * 16)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "0 bytes"),
        (bytes(40), "magic number 0"),
        (bytes([0x1A, 0x48, 0x90, 0x01, 7, 0, 0, 0]) + bytes(30), "16 channels need 40"),
        (bytes([0x1A, 0x48, 0, 0, 7, 0, 0, 0]) + bytes(32), "0 Hz"),
    ],
)
def test_what_is_wrong_with_a_request_is_said(data: bytes, words: str) -> None:
    """Each fault in words."""
    with pytest.raises(InputError, match=words):
        read_request(data)


def test_a_request_of_other_channels_or_numbers_is_not_written() -> None:
    """12 channels, or a pulse beyond 65535."""
    with pytest.raises(InputError, match="12 channels"):
        write_request(ServoFrame(rate_hz=400, frame=1, pulses_us=(1500,) * 12))
    with pytest.raises(InputError, match="70000"):
        write_request(ServoFrame(rate_hz=400, frame=1, pulses_us=(70000,) * 16))


def test_a_reply_is_one_compact_line_of_json() -> None:
    """The firmware refuses a space after a colon; it looks for a line between line feeds."""
    line = write_reply(_motion(), own_clock=True)
    assert line.startswith(b"\n{") and line.endswith(b"}\n")
    assert b" " not in line
    said = json.loads(line)
    assert said["imu"]["accel_body"] == [0.0, 0.0, -9.80665]
    assert said["no_time_sync"] == 1
    assert "no_time_sync" not in json.loads(write_reply(_motion()))


@given(st.floats(0.0, 1e6), st.tuples(NUMBERS, NUMBERS, NUMBERS), st.tuples(NUMBERS, NUMBERS, NUMBERS))
def test_a_reply_is_read_as_it_was_written(time_s: float, p: tuple[float, ...], force: tuple[float, ...]) -> None:
    """To the nine decimals that are written."""
    read = read_reply(write_reply(_motion(time_s, p_WB_m=p, force_B_m_s2=force)))
    assert abs(read.time_s - time_s) <= 1e-9 * max(1.0, time_s)
    assert np.allclose(read.p_WB_m, p, rtol=0.0, atol=1e-9)
    assert np.allclose(read.force_B_m_s2, force, rtol=0.0, atol=1e-9)


_JSON = st.recursive(
    st.none() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["imu", "timestamp", "gyro", "position"]), inner, max_size=4)
    ),
    max_leaves=8,
)


@given(st.one_of(st.binary(max_size=80), _JSON.map(lambda said: json.dumps(said).encode())))
def test_any_bytes_are_a_reply_or_refused(data: bytes) -> None:
    """Nothing but `InputError` leaves the reader."""
    try:
        motion = read_reply(data)
    except InputError:
        return
    assert np.isfinite(motion.p_WB_m).all()


def test_a_reply_that_lacks_something_or_has_no_numbers_is_refused() -> None:
    """A missing velocity, a quaternion that is none, a NaN."""
    said = json.loads(write_reply(_motion()))
    for changed in ({"velocity": None}, {"quaternion": [1, 1, 0, 0]}, {"position": [1, 2, float("nan")]}):
        with pytest.raises(InputError):
            read_reply(json.dumps(said | changed).encode())
