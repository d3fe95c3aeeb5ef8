"""ROS 2 bags, read back by rosbags."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.core.geometry import matrix_from_quat
from wakewise.experiments.exports import Photographs, ThrustRecord, Trajectory
from wakewise.experiments.exports.records import enu_of, ros_body

pytest.importorskip("rosbags")
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

from wakewise.experiments.exports import write_bag

RNG = np.random.default_rng(4)
TELEMETRY = ThrustRecord(
    times_s=np.arange(3) * 0.1, thrusts_N=RNG.normal(size=(3, 8)), wrenches_B=np.tile(np.arange(1.0, 7.0), (3, 1))
)


def _read(folder: Path) -> dict[str, list[tuple[int, Any]]]:
    """Messages of each topic, by the definitions of the latest ROS 2."""
    store = get_typestore(Stores.LATEST)
    found: dict[str, list[tuple[int, Any]]] = {}
    with Reader(folder) as reader:
        for connection, at_ns, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((at_ns, message))
    return found


def _pose(position: Any, turn: Any) -> tuple[np.ndarray, np.ndarray]:
    return np.array([position.x, position.y, position.z]), np.array([turn.w, turn.x, turn.y, turn.z])


def test_poses_come_back_to_ned_and_frd(track: Trajectory, tmp_path: Path) -> None:
    """What rosbags reads, turned back, is what was flown to 1e-9: poses and transforms, times to the nanosecond."""
    assert write_bag(tmp_path / "bag", {"true": track, "estimated": track}) == 16
    found = _read(tmp_path / "bag")
    for topic in ("/true/pose", "/estimated/pose"):
        for k, (at_ns, message) in enumerate(found[topic]):
            p, q = ros_body(*_pose(message.pose.position, message.pose.orientation))
            np.testing.assert_allclose(p, track.p_W_m[k], atol=1e-9)
            np.testing.assert_allclose(matrix_from_quat(q), matrix_from_quat(track.q[k]), atol=1e-9)
            assert at_ns == round(track.times_s[k] * 1e9)
            assert at_ns == message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
            assert message.header.frame_id == "map"
    children = [message.transforms[0].child_frame_id for _, message in found["/tf"]]
    assert sorted(children) == ["base_link"] * 4 + ["base_link_true"] * 4
    for at_ns, message in found["/tf"]:
        (k,) = np.flatnonzero(np.round(track.times_s * 1e9).astype(int) == at_ns)
        moved = message.transforms[0].transform
        p, _ = _pose(moved.translation, moved.rotation)
        np.testing.assert_allclose(p, enu_of(track.p_W_m[k]), atol=1e-9)


def test_a_wrench_is_flu_and_thrusts_stay(track: Trajectory, tmp_path: Path) -> None:
    """X, Y, Z, K, M, N of FRD become X, -Y, -Z, K, -M, -N; thrusts are the thrusters' own, exactly."""
    write_bag(tmp_path / "bag", {"estimated": track}, TELEMETRY)
    found = _read(tmp_path / "bag")
    _, message = found["/wrench"][1]
    force, torque = message.wrench.force, message.wrench.torque
    assert [force.x, force.y, force.z, torque.x, torque.y, torque.z] == [1.0, -2.0, -3.0, 4.0, -5.0, -6.0]
    assert message.header.frame_id == "base_link"
    for k, (_, thrusts) in enumerate(found["/thrusts"]):
        np.testing.assert_array_equal(thrusts.data, TELEMETRY.thrusts_N[k])
        assert (thrusts.layout.dim[0].label, thrusts.layout.dim[0].size) == ("thruster", 8)


def test_a_point_projects_to_the_pixel_that_ours_gives(photographs: Photographs, tmp_path: Path) -> None:
    """The file's bytes are in the image; its camera, by ROS's pixel centres, sees half a pixel lower than ours counts.

    The camera's transform leads a point of the world into optical axes as our pose does.
    """
    write_bag(tmp_path / "bag", {}, None, {"estimated": photographs.track}, photographs)
    found = _read(tmp_path / "bag")
    for k, (_, image) in enumerate(found["/camera/image/compressed"]):
        assert image.data.tobytes() == photographs.files[k].read_bytes()
        assert image.format == "jpeg"
        assert image.header.frame_id == "camera_optical"
    _, info = found["/camera/camera_info"][0]
    fx, fy, cx, cy, *bend = photographs.params
    np.testing.assert_allclose(info.k.reshape(3, 3), [[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]], atol=1e-9)
    np.testing.assert_allclose(info.d, [*bend, 0.0], atol=1e-12)
    point_C = np.array([0.1, 0.2, 0.9])
    for k, (_, message) in enumerate(found["/tf"]):
        moved = message.transforms[0].transform
        p, q = _pose(moved.translation, moved.rotation)
        there = enu_of(photographs.track.p_W_m[k] + matrix_from_quat(photographs.track.q[k]) @ point_C)
        np.testing.assert_allclose(p + matrix_from_quat(q) @ point_C, there, atol=1e-9)


def test_times_run_forward_through_all_topics(track: Trajectory, tmp_path: Path) -> None:
    """Messages lie in the file in the order of time, as they were recorded by a vehicle."""
    write_bag(tmp_path / "bag", {"true": track}, TELEMETRY)
    with Reader(tmp_path / "bag") as reader:
        times = [at_ns for _, at_ns, _ in reader.messages()]
    assert times == sorted(times)


def test_foxgloves_reader_opens_it(track: Trajectory, tmp_path: Path) -> None:
    """The `mcap` library, which knows nothing of rosbags, finds all messages, their types and definitions."""
    reader = pytest.importorskip("mcap.reader")
    written = write_bag(tmp_path / "bag", {"true": track}, TELEMETRY)
    with (tmp_path / "bag" / "bag.mcap").open("rb") as file:
        rows = list(reader.make_reader(file, validate_crcs=True).iter_messages())
    assert len(rows) == written
    kinds = {channel.topic: (schema.name, schema.encoding, channel.message_encoding) for schema, channel, _ in rows}
    assert kinds["/true/pose"] == ("geometry_msgs/msg/PoseStamped", "ros2msg", "cdr")
    assert kinds["/thrusts"] == ("std_msgs/msg/Float64MultiArray", "ros2msg", "cdr")


def test_a_time_below_zero_is_refused(tmp_path: Path) -> None:
    """ROS's time holds none."""
    early = Trajectory(times_s=np.array([-1.0]), p_W_m=np.zeros((1, 3)), q=np.array([[1.0, 0, 0, 0]]))
    with pytest.raises(InputError, match="below 0"):
        write_bag(tmp_path / "bag", {"true": early})
