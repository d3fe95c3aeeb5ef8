"""A vehicle behind a firmware, without a socket."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.physics import FreeWater, PhysicsServer, PulseTable, ServoFrame, read_reply, write_request

HEAVY = load_vehicle("bluerov2-heavy")
TABLE = PulseTable.of(HEAVY)
REST = (1500,) * 16
AHEAD = (1300, 1300, 1700, 1700, *(1500,) * 12)
SENDER = ("127.0.0.1", 40000)


def _link(**more: object) -> PhysicsServer:
    return PhysicsServer(lambda: FreeWater(HEAVY), TABLE.thrusts, **more)


def _frame(count: int, pulses: tuple[int, ...] = REST, rate_hz: int = 400) -> bytes:
    return write_request(ServoFrame(rate_hz=rate_hz, frame=count, pulses_us=pulses))


def test_each_new_frame_is_one_step_of_the_rate_asked_for() -> None:
    """Time goes on by 1/rate, and the rate may change."""
    link = _link()
    for count in range(1, 5):
        link.answer(_frame(count), SENDER, 0.0)
    reply = link.answer(_frame(5, rate_hz=100), SENDER, 0.0)
    assert reply is not None
    assert read_reply(reply).time_s == pytest.approx(4 / 400 + 1 / 100)


def test_a_repeat_gets_the_same_bytes_and_moves_nothing() -> None:
    """As ArduPilot asks when an answer was lost."""
    link = _link()
    first = link.answer(_frame(1, AHEAD), SENDER, 0.0)
    assert link.answer(_frame(1, AHEAD), SENDER, 0.01) == first
    assert link.figures().frames == 1


def test_at_rest_the_accelerometer_feels_gravity_upwards() -> None:
    """Specific force, not acceleration: -g on z, but for the little that weight and buoyancy differ by."""
    link = _link()
    reply = link.answer(_frame(1), SENDER, 0.0)
    assert reply is not None
    assert read_reply(reply).force_B_m_s2 == pytest.approx([0.0, 0.0, -GRAVITY_M_S2], abs=0.05)


def test_pulses_move_the_vehicle_the_way_the_frame_means() -> None:
    """ArduSub's own pulses for ahead drive it north when it heads north."""
    link = _link()
    for count in range(1, 400):
        link.answer(_frame(count, AHEAD), SENDER, 0.0)
    motion = link.motion
    assert motion is not None
    assert motion.v_W_m_s[0] > 0.1
    assert abs(motion.v_W_m_s[1]) < 0.01


def test_a_firmware_that_starts_anew_finds_the_vehicle_at_its_start() -> None:
    """So does its estimator, which knows nothing of the flight before."""
    link = _link()
    for count in range(1, 200):
        link.answer(_frame(count, AHEAD), SENDER, 0.0)
    moved = link.motion
    reply = link.answer(_frame(1), SENDER, 0.1)
    assert moved is not None
    assert reply is not None
    assert moved.p_WB_m[0] > 0.01
    assert read_reply(reply).time_s == pytest.approx(1 / 400)
    assert link.figures().starts == 2


def test_a_rate_of_ones_own_stands_above_the_firmwares() -> None:
    """And one that no step can be made of is refused."""
    link = _link(rate_hz=50)
    reply = link.answer(_frame(1), SENDER, 0.0)
    assert reply is not None
    assert read_reply(reply).time_s == pytest.approx(0.02)
    with pytest.raises(InputError, match="--rate 5"):
        _link(rate_hz=5)


_ALMOST = st.binary(min_size=38, max_size=38).map(lambda rest: b"\x1a\x48" + rest)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.one_of(st.binary(max_size=90), _ALMOST, st.integers(0, 3).map(_frame)), max_size=12))
def test_garbage_is_counted_and_never_answered(datagrams: list[bytes]) -> None:
    """Whatever comes, the vehicle stays where numbers are finite, and the count adds up."""
    link = _link()
    for datagram in datagrams:
        link.answer(datagram, SENDER, 0.0)
    figures = link.figures()
    assert figures.frames + figures.repeats + figures.late + figures.refused == len(datagrams)
    assert link.motion is None or np.isfinite(link.motion.p_WB_m).all()


def test_what_was_refused_is_said() -> None:
    """The last fault in words, for the status line."""
    link = _link()
    assert link.answer(b"hello", SENDER, 0.0) is None
    assert "5 bytes" in link.why_refused
