"""Poses by lines of text."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.geometry import quat_from_euler
from wakewise.experiments.exports.records import ros_body
from wakewise_ardusub.sensors import LinePoses, read_line

Q = quat_from_euler(0.1, -0.2, 2.0)
FAR = st.floats(-1e4, 1e4)


def test_json_and_csv_say_the_same() -> None:
    """Stamp, place, attitude and sigmas of either; roll, pitch and yaw are another way to say a quaternion."""
    q = [float(x) for x in Q]
    lines = (
        json.dumps({"t": 12.5, "p": [1, 2.0, 3], "q": q, "std_m": 0.01, "std_rad": 0.02}),
        "12.5, 1, 2, 3, " + ",".join(map(repr, q)) + ",0.01,0.02",
        json.dumps({"t": 12.5, "p": [1, 2, 3], "rpy": [0.1, -0.2, 2.0], "std_m": 0.01, "std_rad": 0.02}),
    )
    for line in lines:
        stamp, sample = read_line(line)
        pose = sample.measurement.X_WB
        assert stamp == 12.5
        np.testing.assert_allclose(pose.p_m, [1.0, 2.0, 3.0])
        np.testing.assert_allclose(pose.q, Q)
        np.testing.assert_allclose(sample.covariance, np.diag([1e-4] * 3 + [4e-4] * 3))
        assert sample.position_std_m == pytest.approx(0.01)


def test_a_position_alone_is_what_tracking_knows() -> None:
    """Four numbers are a stamp and a place; no stamp is the time of arrival."""
    (sample,) = LinePoses().feed(b"# x is north\n\n,1,2,3\n", 7.0)
    assert sample.measurement.X_WB is None
    assert sample.covariance is None
    np.testing.assert_array_equal(sample.measurement.p_WB_m, [1.0, 2.0, 3.0])
    assert sample.measurement.time_s == 7.0


@given(FAR, FAR, FAR, st.floats(-3, 3), st.floats(-1.5, 1.5))
def test_enu_is_ned_turned(x: float, y: float, z: float, yaw: float, pitch: float) -> None:
    """A pose of ROS, said in its own frame, is the pose that was turned into it."""
    q = quat_from_euler(0.3, pitch, yaw)
    p_enu, q_enu = ros_body([x, y, z], q)
    line = json.dumps({"p": p_enu.tolist(), "q": q_enu.tolist(), "frame": "enu"})
    told = read_line(line)
    assert told is not None
    pose = told[1].measurement.X_WB
    np.testing.assert_allclose(pose.p_m, [x, y, z], atol=1e-9)
    assert abs(float(pose.q @ q)) == pytest.approx(1.0, abs=1e-12)
    alone = read_line(json.dumps({"p": p_enu.tolist(), "frame": "enu"}))
    np.testing.assert_allclose(alone[1].measurement.p_WB_m, [x, y, z], atol=1e-9)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("hello", "1 numbers, must be 4"),
        ("1,2,x,4", "not numbers"),
        ("1,2,,4", "p: None"),
        ("{", "begins as JSON"),
        ('{"q": [1,0,0,0]}', "no p"),
        ('{"p": [1,2,3], "w": 1}', "unknown w"),
        ('{"p": [1,2]}', "p: must be 3"),
        ('{"p": [1,2,true]}', "finite number"),
        ('{"p": [1,2,NaN]}', "finite number"),
        ('{"p": [1,2,1e9]}', "at most 100000 m"),
        ('{"p": [1,2,3], "q": [1,1,0,0]}', "length must be 1"),
        ('{"p": [1,2,3], "q": [1,0,0,0], "rpy": [0,0,0]}', "one of them"),
        ('{"p": [1,2,3], "frame": "flu"}', "ned, enu"),
        ('{"p": [1,2,3], "std_m": 0}', "more than 0"),
        ('{"p": [1,2,3], "t": "noon"}', "t: noon"),
    ],
)
def test_a_line_that_is_no_pose_is_refused_in_words(line: str, said: str) -> None:
    """And counted by the reader, which goes on with the next line."""
    with pytest.raises(InputError, match=said):
        read_line(line)
    poses = LinePoses()
    assert len(poses.feed(f"{line}\n1,2,3,4\n".encode(), 0.0)) == 1
    assert (poses.taken, poses.refused) == (1, 1)
    assert said in str(poses.complaint)


def only_what_can_be(data: bytes) -> None:
    """Every pose that is read of these bytes is somewhere, and is counted."""
    poses = LinePoses()
    samples = poses.feed(data, 1.0)
    for sample in samples:
        said = sample.measurement
        assert np.isfinite(said.X_WB.p_m if said.p_WB_m is None else said.p_WB_m).all()
    assert len(samples) <= poses.taken


@given(st.binary(max_size=300))
def test_any_datagram_is_borne(data: bytes) -> None:
    """Bytes of any kind give poses that can be, or nothing."""
    only_what_can_be(data)


@given(st.text(alphabet='{}[]":,.0123456789eE+-pqtrynstd_mfaceu \n', max_size=200))
def test_text_that_is_nearly_a_pose_is_borne(text: str) -> None:
    """The same of letters that poses are made of."""
    only_what_can_be(text.encode())


def test_a_senders_clock_is_brought_onto_ours() -> None:
    """Stamps of another epoch keep their distances; one that jumps is left out and said, until it goes on evenly."""
    poses, times = LinePoses(), []
    for k in range(5):
        delay = 0.002 if k == 0 else 0.05
        (sample,) = poses.feed(f"{1e6 + 0.1 * k},1,2,3".encode(), 50.0 + 0.1 * k + delay)
        times.append(sample.measurement.time_s)
    np.testing.assert_allclose(np.diff(times), 0.1, atol=1e-6)
    assert poses.feed(b"7,1,2,3", 51.0) == []
    assert "clock jumped" in str(poses.complaint)
    taken = [len(poses.feed(f"{7 + 0.1 * k},1,2,3".encode(), 51.0 + 0.1 * k)) for k in range(1, 21)]
    assert taken[0] == 0
    assert taken[-1] == 1
    assert poses.refused + poses.taken == 26
