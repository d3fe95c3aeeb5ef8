"""WitMotion's frames: composed by hand from the sheet, in pieces, in noise, and onto the vehicle's axes."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise_ardusub.sensors import FrameReader, InertialUnit, mounting
from wakewise_ardusub.sensors.jy901 import SerialFrame, composed

AT_REST = bytes.fromhex("5551 0000 0000 0008 c409 7b".replace(" ", ""))
"""0, 0, 1 g (2048 of 32768 in 16 g), 25.00 deg C: 55+51+08+c4+09 = 17b."""
TURNING = bytes.fromhex("5552 cd0c 0000 0000 c409 4d".replace(" ", ""))
"""3277 of 32768 in 2000 deg/s, 200 deg/s about x: 55+52+cd+0c+c4+09 = 24d."""
ANGLES = bytes.fromhex("5553 0020 00e0 0040 0000 e8".replace(" ", ""))
"""45, -45 and 90 deg: 55+53+20+e0+40 = 1e8."""


def test_frames_written_by_hand_say_what_the_sheet_says() -> None:
    """1 g up at rest is -g along z in FRD; x to the right is y of the vehicle; angles are the unit's own."""
    unit = InertialUnit()
    (measured,) = unit.feed(AT_REST + TURNING + ANGLES, 3.0)
    assert measured.time_s == 3.0
    assert measured.force_B_m_s2 == pytest.approx([0.0, 0.0, -9.80665])
    assert np.degrees(measured.omega_B_rad_s) == pytest.approx([0.0, 3277 / 32768 * 2000, 0.0])
    assert unit.temperature_C == 25.0
    assert np.degrees(unit.angles_rad) == pytest.approx([45.0, -45.0, 90.0])


def test_a_sensor_with_x_forward_is_a_mounting_away() -> None:
    """Forward, left, up is FLU: turning about x stays, y and z change sign."""
    unit = InertialUnit(mounting(["forward", "left", "up"]))
    (measured,) = unit.feed(composed(0x51, (2048, 2048, 0, 0)) + composed(0x52, (100, 200, 300, 0)), 0.0)
    assert measured.force_B_m_s2 == pytest.approx([9.80665, -9.80665, 0.0])
    assert np.degrees(measured.omega_B_rad_s) == pytest.approx(np.array([100, -200, -300]) / 32768 * 2000)
    for bad, said in ((["up", "up", "up"], "right-handed"), (["x", "y", "z"], "forward, back")):
        with pytest.raises(InputError, match=said):
            mounting(bad)
    with pytest.raises(InputError, match="right-handed"):
        mounting(["forward", "right", "up"])


def test_an_old_acceleration_is_not_paired_with_a_new_turning() -> None:
    """What was lost on the wire is missing, not taken from the sample before."""
    unit = InertialUnit()
    unit.feed(AT_REST, 0.0)
    (measured,) = unit.feed(TURNING, 0.5)
    assert measured.force_B_m_s2 is None
    assert measured.omega_B_rad_s is not None


SHORT = st.tuples(*[st.integers(-32768, 32767)] * 4)


@given(
    st.lists(st.tuples(st.integers(0x50, 0x5A), SHORT), max_size=8),
    st.lists(st.integers(1, 30), min_size=1, max_size=30),
)
def test_frames_come_through_however_they_are_cut(frames: list[tuple[int, tuple[int, ...]]], cuts: list[int]) -> None:
    """Any frames, in pieces of any size, are the same frames, and no byte is bad."""
    data = b"".join(composed(kind, values) for kind, values in frames)
    reader, found, at, k = FrameReader(), [], 0, 0
    while at < len(data):
        step = cuts[k % len(cuts)]
        found += reader.feed(data[at : at + step])
        at, k = at + step, k + 1
    assert found == [SerialFrame(kind, values) for kind, values in frames]
    assert reader.bad_bytes == 0


@given(st.binary(max_size=60).filter(lambda noise: 0x55 not in noise), SHORT)
def test_noise_before_a_frame_is_skipped_and_counted(noise: bytes, values: tuple[int, ...]) -> None:
    """Bytes without a head are all bad; the frame after them is found."""
    reader = FrameReader()
    assert reader.feed(noise + composed(0x59, values)) == [SerialFrame(0x59, values)]
    assert reader.bad_bytes == len(noise)


@given(st.binary(max_size=400))
def test_any_bytes_are_borne(data: bytes) -> None:
    """Nothing is held beyond a frame, and every byte is in a frame, bad, or held."""
    reader = FrameReader()
    frames = reader.feed(data)
    assert 11 * len(frames) + reader.bad_bytes + len(reader._held) == len(data)
    assert len(reader._held) < 11


def test_a_head_within_a_broken_frame_begins_the_next() -> None:
    """A frame cut off in the middle costs itself only."""
    reader = FrameReader()
    whole = composed(0x52, (1, 2, 3, 4))
    assert reader.feed(AT_REST[:6] + whole + whole) == [SerialFrame(0x52, (1, 2, 3, 4))] * 2
    assert reader.bad_bytes == 6
    assert struct.unpack("<h", AT_REST[6:8])[0] == 2048
