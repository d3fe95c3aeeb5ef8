"""The rclpy node without ROS: topics and parameters reach the pure functions, and messages are of ROS's own types."""

import ast
import importlib.util
import math
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml
from fake_ros import Node, Parameter, install

from wakewise.links.exports import tam_yaml
from wakewise.vehicles import load_vehicle

PACKAGE = Path(__file__).parents[3] / "ros2" / "wakewise_ros"
HEAVY = load_vehicle("bluerov2-heavy")


@pytest.fixture
def node_module(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """node.py, imported with ROS's packages replaced."""
    install(monkeypatch)
    spec = importlib.util.spec_from_file_location("wakewise_ros_node", PACKAGE / "wakewise_ros" / "node.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def make(node_module: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """A node with some parameters told."""

    def made(**told: Any) -> Any:
        monkeypatch.setattr(Node, "overrides", told)
        return node_module.AllocatorNode()

    return made


def _message(package: str, kind: str, /, **fields: Any) -> Any:
    return getattr(sys.modules[f"{package}.msg"], kind)(**fields)


def _wrench(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Any:
    message = _message("geometry_msgs", "Wrench")
    message.force.x, message.force.y, message.force.z = x, y, z
    return message


def _odometry(frame: str = "odom", child: str = "base_link") -> Any:
    message = _message("nav_msgs", "Odometry", child_frame_id=child)
    message.header.frame_id = frame
    message.pose.pose.orientation.w = 1.0
    return message


def _cloud(points: np.ndarray, frame: str) -> Any:
    fields = [
        _message("sensor_msgs", "PointField", name=name, offset=4 * k, datatype=7, count=1)
        for k, name in enumerate("xyz")
    ]
    data = list(points.astype("<f4").tobytes())
    message = _message("sensor_msgs", "PointCloud2", fields=fields, data=data, height=1, width=len(points))
    message.point_step, message.row_step, message.header.frame_id = 12, 12 * len(points), frame
    return message


def _thrusts(node: Any) -> np.ndarray:
    """What was last sent, the same on both ways."""
    each = [node.publishers[f"/thruster_{k + 1}_controller/reference"].sent[-1].data for k in range(8)]
    np.testing.assert_array_equal(each, node.publishers["~/thrusts"].sent[-1].data)
    return np.array(each)


@pytest.mark.parametrize("frame", ["flu", "fsd"])
def test_thrusts_make_the_wrench_in_its_own_axes(make: Callable[..., Any], frame: str) -> None:
    """By the matrix that `wakewise export --to auv_controllers` writes for the same frame, thrusts are the wrench."""
    node = make(frame=frame)
    node.say("~/reference", _wrench(10.0, 4.0, 6.0))
    text = tam_yaml("heavy", [t.name for t in HEAVY.thrusters], HEAVY.allocation_matrix, frame=frame)
    tam = yaml.safe_load(text)["thruster_allocation_matrix_controller"]["ros__parameters"]["tam"]
    matrix = np.array([tam[row] for row in ("x", "y", "z", "rx", "ry", "rz")])
    np.testing.assert_allclose(matrix @ _thrusts(node), [10.0, 4.0, 6.0, 0.0, 0.0, 0.0], atol=1e-9)
    made = node.publishers["~/wrench"].sent[-1]
    assert (made.wrench.force.x, made.wrench.force.z) == pytest.approx((10.0, 6.0))
    assert made.header.frame_id == "base_link"


def test_silence_means_zero_thrusts_and_nothing_comes_before_the_first_word(make: Callable[..., Any]) -> None:
    """The watch runs four times in the time-out; after it thrusts are zero, and so is what NaN axes hold."""
    node = make(timeout_s=0.4)
    ((period_s, watch),) = node.timers
    assert period_s == pytest.approx(0.1)
    watch()
    assert not node.publishers["~/thrusts"].sent
    node.say("~/reference", _wrench(10.0))
    node.clock.nanoseconds += 300_000_000
    watch()
    assert np.any(_thrusts(node))
    node.clock.nanoseconds += 200_000_000
    watch()
    assert not np.any(_thrusts(node))
    assert any("no reference for 0.4 s" in text for _, text in node.logger.said)
    node.say("~/reference", _wrench(math.nan, 5.0))
    assert node.publishers["~/wrench"].sent[-1].wrench.force.x == pytest.approx(0.0, abs=1e-9)


def test_a_target_and_a_fresh_pose_make_it_gentle(make: Callable[..., Any]) -> None:
    """Points ahead in the odometry's frame: spared, until the pose grows old."""
    node = make()
    ahead = np.array([[0.6, -0.33, -0.1], [0.6, 0.33, -0.1], [0.65, 0.35, -0.12]])
    node.say("~/odometry", _odometry())
    node.say("~/target", _cloud(ahead, "odom"))
    node.say("~/reference", _wrench(-20.0))
    d, least, saved = node.publishers["~/disturbance"].sent[-1].data
    assert saved == pytest.approx(100.0 * (1.0 - d / least))
    assert saved > 5.0
    node.clock.nanoseconds += 600_000_000
    node.say("~/reference", _wrench(-20.0))
    assert len(node.publishers["~/disturbance"].sent) == 1
    assert "no fresh pose" in node.logger.said[-1][1]
    node.say("~/target", _cloud(ahead, "base_link"))
    node.say("~/reference", _wrench(-20.0))
    assert node.publishers["~/disturbance"].sent[-1].data == pytest.approx([d, least, saved], rel=1e-6)


def test_points_of_the_parameter_are_spared_as_those_of_a_cloud(make: Callable[..., Any]) -> None:
    """A flat list of x, y, z, fixed to the body."""
    node = make(target_points=[0.6, -0.33, -0.1, 0.6, 0.33, -0.1], target_on_body=True, frame="flu")
    node.say("~/reference", _wrench(-20.0))
    assert node.publishers["~/disturbance"].sent[-1].data[2] > 5.0


def test_failed_thrusters_are_taken_out_in_flight(make: Callable[..., Any]) -> None:
    """By topic and by parameter; a wrong name changes nothing, and the rest is read at the start only."""
    node = make(failed="2")
    node.say("~/reference", _wrench(10.0))
    assert _thrusts(node)[1] == 0.0
    node.say("~/failed", _message("std_msgs", "String", data="front right horizontal"))
    node.say("~/reference", _wrench(10.0))
    assert _thrusts(node)[0] == 0.0
    assert _thrusts(node)[1] != 0.0
    assert node.on_set([Parameter("failed", "3")]).successful
    node.say("~/reference", _wrench(10.0))
    assert _thrusts(node)[2] == 0.0
    refused = node.on_set([Parameter("failed", "9")])
    assert not refused.successful
    assert "1 to 8" in refused.reason
    assert not node.on_set([Parameter("frame", "fsd")]).successful
    node.say("~/reference", _wrench(10.0))
    assert _thrusts(node)[2] == 0.0


def test_what_cannot_be_taken_is_said_and_changes_nothing(make: Callable[..., Any]) -> None:
    """Infinite forces, odometry of another body, a target in a third frame, a cloud cut short: each one line."""
    node = make()
    node.say("~/reference", _wrench(10.0))
    before = _thrusts(node)
    node.say("~/odometry", _odometry())
    ahead = np.array([[1.0, 0.0, 0.0]])
    cut = _cloud(ahead, "odom")
    cut.data = cut.data[:-1]
    words = [
        ("~/reference", _wrench(math.inf), "six finite"),
        ("~/odometry", _odometry(child="base_link_fsd"), "base_frame is 'base_link'"),
        ("~/odometry", _message("nav_msgs", "Odometry"), "quaternion"),
        ("~/target", _cloud(ahead, "camera"), "must be 'base_link' or 'odom'"),
        ("~/target", cut, "11 bytes"),
        ("~/failed", _message("std_msgs", "String", data="bow"), "no thruster 'bow'"),
    ]
    for topic, message, said in words:
        if topic == "~/odometry" and said == "quaternion":
            message.pose.pose.orientation.w = 0.0
        node.say(topic, message)
        level, text = node.logger.said[-1]
        assert level == "error"
        assert said in text
        assert "\n" not in text
    np.testing.assert_array_equal(_thrusts(node), before)


def test_a_stamped_reference_is_one_parameter_away(make: Callable[..., Any]) -> None:
    """stamped: true takes a WrenchStamped, names of controllers are as told."""
    node = make(stamped=True, controllers=[f"left_{k}" for k in range(8)])
    stamped = _message("geometry_msgs", "WrenchStamped")
    stamped.wrench.force.x = 5.0
    node.say("~/reference", stamped)
    assert len(node.publishers["/left_7/reference"].sent) == 1
    with pytest.raises(ValueError, match="8 thrusters"):
        make(controllers=["one"])


def test_the_shipped_file_tells_every_parameter_its_default(node_module: ModuleType) -> None:
    """config/*.yaml, package.xml, setup.py and the launch file name what node.py has, no more and no less."""
    told = yaml.safe_load((PACKAGE / "config" / "bluerov2_heavy.yaml").read_text())["wakewise"]["ros__parameters"]
    assert set(told) == set(node_module.DEFAULTS)
    for name, value in node_module.DEFAULTS.items():
        assert str(told[name]) == str(value), name
        assert type(told[name]) is type(value), name
    imported = set()
    for path in ("wakewise_ros/node.py", "launch/allocator.launch.py"):
        for line in ast.walk(ast.parse((PACKAGE / path).read_text())):
            if isinstance(line, ast.ImportFrom) and line.module:
                imported.add(line.module.partition(".")[0])
            elif isinstance(line, ast.Import):
                imported |= {alias.name.partition(".")[0] for alias in line.names}
    tree = ET.parse(PACKAGE / "package.xml")
    depends = {element.text for element in tree.iter("exec_depend")}
    ours = imported - set(sys.stdlib_module_names) - {"wakewise", "numpy"}
    assert ours | {"python3-numpy"} == depends
    setup = (PACKAGE / "setup.py").read_text()
    for path in ("launch/allocator.launch.py", "config/bluerov2_heavy.yaml", "package.xml"):
        assert path in setup
        assert (PACKAGE / path).is_file()
    assert 'executable="allocator"' in (PACKAGE / "launch" / "allocator.launch.py").read_text()
    assert "allocator = " in setup
