"""The rclpy node without ROS: topics and parameters reach the pure functions, and messages are of ROS's own types."""

import ast
import importlib.util
import json
import math
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Callable
from importlib.metadata import packages_distributions
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import yaml
from fake_ros import Node, Parameter, install

from wakewise.experiments.exports import tam_yaml
from wakewise.robot.vehicles import load_vehicle

ROOT = Path(__file__).parents[4]
PACKAGE = ROOT / "packages/wakewise-ardusub/ros2/wakewise_ros"
HEAVY = load_vehicle("bluerov2-heavy")
NEW_IN_NUMPY_2 = (
    "acosh?|asinh?|atan[2h]?|bitwise_count|bitwise_invert|bitwise_left_shift|bitwise_right_shift|bool|concat|isdtype|"
    "cumulative_prod|cumulative_sum|astype|long|matrix_transpose|matvec|permute_dims|pow|trapezoid|ulong|unique_all|"
    "unique_counts|unique_inverse|unique_values|unstack|vecdot|vecmat"
)
NEW_IN_LINALG_2 = "cross|outer|vector_norm|matrix_norm|vecdot|trace"
"""Names that NumPy's notes of 2.0 to 2.2 list as new."""


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
    node._steady.nanoseconds += 300_000_000
    watch()
    assert np.any(_thrusts(node))
    node._steady.nanoseconds += 200_000_000
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
    node._steady.nanoseconds += 600_000_000
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


def _guessed(text: str) -> Any:
    """The value that `ros2 param set` makes of a text: YAML's, a mixed list and all else stay a text.

    As `get_parameter_value` of ros2cli (ros2param/api) and rclpy.parameter have it in Jazzy.
    """
    value = yaml.safe_load(text)
    if isinstance(value, list):
        kinds = {type(item) for item in value}
        return value if len(kinds) <= 1 and kinds <= {bool, int, float, str} else text
    return value if isinstance(value, bool | int | float | str) else text


@pytest.mark.parametrize(
    ("text", "dead"),
    [
        ("5", [4]), ('"5"', [4]), ("[1, 5]", [0, 4]), ("1, 5", [0, 4]), ("5,", [4]), ("", []), ("[]", []),
        ("front right horizontal", [0]), ("front right horizontal, 5", [0, 4]),
        ("[front right horizontal, 5]", [0, 4]), ("['1', '5']", [0, 4]),
    ],
)  # fmt: skip
def test_failed_is_taken_as_ros2_param_set_sends_it(make: Callable[..., Any], text: str, dead: list[int]) -> None:
    """A number, a list, a name or a text with commas, by the command line's own guess, at the start and in flight."""
    wrench = _wrench(10.0, 2.0, 5.0)
    wrench.torque.x, wrench.torque.y, wrench.torque.z = 0.3, 0.2, 0.1
    for node in (make(), make(failed=_guessed(text))):
        assert node.set_parameter("failed", _guessed(text)).successful
        node.say("~/reference", wrench)
        assert np.flatnonzero(_thrusts(node) == 0.0).tolist() == dead


@pytest.mark.parametrize("text", ["9", "0", "-1", "5.0", "true", "[1, 9]", "bow"])
def test_failed_that_names_no_thruster_is_refused_in_a_line(make: Callable[..., Any], text: str) -> None:
    """And what was told before goes on."""
    node = make(failed="2")
    answer = node.set_parameter("failed", _guessed(text))
    assert not answer.successful
    assert "allowed: 1 to 8" in answer.reason
    node.say("~/reference", _wrench(10.0))
    assert _thrusts(node)[1] == 0.0


def test_parameters_that_are_not_the_nodes_own_are_let_through(make: Callable[..., Any]) -> None:
    """ROS sets use_sim_time by the same call; its own are read at the start, and of their type."""
    node = make()
    assert node.set_parameter("use_sim_time", True).successful
    assert not node.set_parameter("frame", "fsd").successful
    assert "Wrong parameter type" in node.set_parameter("timeout_s", 1).reason


def test_a_simulation_that_stops_leaves_no_thrust(make: Callable[..., Any]) -> None:
    """The watch goes by a steady clock: with /clock stopped thrusts still become zero."""
    node = make(timeout_s=0.4)
    (clock,) = node.timed_by
    assert clock.clock_type == "STEADY_TIME"
    node.say("~/reference", _wrench(10.0))
    before = node.get_clock().nanoseconds
    clock.nanoseconds += 500_000_000
    ((_, watch),) = node.timers
    watch()
    assert node.get_clock().nanoseconds == before
    assert not np.any(_thrusts(node))


def test_a_latched_target_is_heard_where_the_parameter_says_so(make: Callable[..., Any]) -> None:
    """Transient local and reliable, which a publisher that is not latched would not match: so not by default."""
    assert not hasattr(make().qos["~/target"], "durability")
    latched = make(target_latched=True).qos["~/target"]
    assert (latched.durability, latched.reliability, latched.depth) == ("transient local", "reliable", 1)


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


def test_what_the_readme_installs_is_what_the_node_imports() -> None:
    """NumPy below 2, as Jazzy has it, and the packages that an allocation loads; it uses no name of NumPy 2 alone."""
    names = "NodeAllocation, PointField, ProtectedPoints, ThrustAllocator, body_points, cloud_points, failed_thrusters"
    code = (
        "import sys, json; import numpy as np\n"
        f"from wakewise_ardusub.ros import {names}, pose_of, read_frame, world_points, wrench_for, wrench_of\n"
        "from wakewise.robot.vehicles import load_vehicle; from wakewise.wake import wake_model\n"
        "made = dict(vehicle=load_vehicle('bluerov2-heavy'), wake=wake_model('jet'))\n"
        "ahead = ProtectedPoints(points_m=np.array([[2.0, 0.0, 0.0]]), weights=np.ones(1), on_body=True)\n"
        "for told in ({}, {'failed': (4,)}, {'priority': 'ZKMN,XY'}):\n"
        "    ThrustAllocator(**made, **told)(np.ones(6), ahead)\n"
        "print(json.dumps({name: module.__file__ for name, module in sys.modules.items() "
        "if getattr(module, '__file__', None)}))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    files: dict[str, str] = json.loads(done.stdout)
    whose = packages_distributions()
    loaded = {package.lower() for name in files for package in whose.get(name.partition(".")[0], [])}
    core = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    readme = (PACKAGE / "README.md").read_text()
    told = set(re.findall(r"'([\w<>=.]+)'", readme.partition("pip install 'numpy<2'")[2].partition("&&")[0]))
    wanted = {line for line in core if re.split("[<>=]", line)[0] in loaded and not line.startswith("numpy")}
    assert told == wanted
    used = re.compile(rf"\bnp\.({NEW_IN_NUMPY_2})\b|\bnp\.linalg\.({NEW_IN_LINALG_2})\b")
    ours = [Path(path) for name, path in files.items() if name.partition(".")[0] == "wakewise"]
    assert len(ours) > 50
    assert {path.name: m[0] for path in ours for m in used.finditer(path.read_text())} == {}


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
    ours = imported - set(sys.stdlib_module_names) - {"wakewise", "wakewise_ardusub", "numpy"}
    assert ours | {"python3-numpy"} == depends
    setup = (PACKAGE / "setup.py").read_text()
    for path in ("launch/allocator.launch.py", "config/bluerov2_heavy.yaml", "package.xml"):
        assert path in setup
        assert (PACKAGE / path).is_file()
    assert 'executable="allocator"' in (PACKAGE / "launch" / "allocator.launch.py").read_text()
    assert "allocator = " in setup
