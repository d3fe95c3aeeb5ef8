"""A wrench in, thrusts out: topics and parameters joined to `wakewise_ardusub.ros`, which does the work.

Nothing is computed here: fields of messages are copied into plain numbers and back.
"""

from __future__ import annotations

import math

import numpy as np
import rclpy
from geometry_msgs.msg import Wrench, WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Float64, Float64MultiArray, MultiArrayDimension, String

from wakewise.allocation import Weights
from wakewise.core.defaults import CHANGE_WEIGHT, DISTURBANCE_WEIGHT, EFFORT_WEIGHT
from wakewise.core.errors import WakewiseError
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import wake_model
from wakewise_ardusub.ros import (
    NodeAllocation,
    PointField,
    ProtectedPoints,
    ThrustAllocator,
    body_points,
    cloud_points,
    failed_thrusters,
    pose_of,
    read_frame,
    world_points,
    wrench_for,
    wrench_of,
)

DEFAULTS = {
    "vehicle": "bluerov2-heavy",
    "frame": "flu",
    "stamped": False,
    "wake_model": "jet",
    "w_disturbance": DISTURBANCE_WEIGHT,
    "w_effort": EFFORT_WEIGHT,
    "w_previous": CHANGE_WEIGHT,
    "priority": "",
    "limit_share": 1.0,
    "failed": "",
    "timeout_s": 0.5,
    "pose_timeout_s": 0.5,
    "base_frame": "base_link",
    "target_points": [math.nan],
    "target_on_body": False,
    "target_latched": False,
    "controllers": [""],
}
"""Parameters and what they are unless told; a list of one NaN or one empty name stands for an empty list, whose type
ROS 2 cannot tell."""
ANY_TYPE = ("failed",)
"""Parameters that may be of any type: `ros2 param set /wakewise failed 5` sends a whole number, and "1, 5" a text."""


class AllocatorNode(Node):
    """Node `wakewise`: see the package's README for topics and parameters."""

    def __init__(self) -> None:
        super().__init__("wakewise")
        for name, value in DEFAULTS.items():
            self.declare_parameter(name, value, ParameterDescriptor(dynamic_typing=name in ANY_TYPE))
        told = {name: self.get_parameter(name).value for name in DEFAULTS}
        self._frame = read_frame(told["frame"])
        vehicle = load_vehicle(told["vehicle"])
        self._names = tuple(thruster.name for thruster in vehicle.thrusters)
        self._base = told["base_frame"]
        self._timeout_s, self._pose_timeout_s = float(told["timeout_s"]), float(told["pose_timeout_s"])
        self._make = {
            "vehicle": vehicle,
            "wake": wake_model(told["wake_model"]),
            "weights": Weights(disturbance=told["w_disturbance"], effort=told["w_effort"], previous=told["w_previous"]),
            "priority": told["priority"] or None,
            "share": float(told["limit_share"]),
        }
        self._allocate = ThrustAllocator(**self._make, failed=failed_thrusters(told["failed"], self._names))
        self._target = self._target_of(told["target_points"], bool(told["target_on_body"]))
        self._target_frame = ""  # of a target of the parameter: the odometry's, whichever that is
        self._wrench_B = np.zeros(6)
        self._thrusts_N = np.zeros(len(self._names))
        self._heard_ns: int | None = None
        self._pose: Pose | None = None
        self._pose_frame = ""
        self._pose_ns = 0
        self._way = ""
        # How long ago a message came is asked of a clock that no simulation stops: thrusts must not outlive it.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        # Compiled before a vehicle waits for it.
        self._allocate(
            np.ones(6), ProtectedPoints(points_m=np.array([[2.0, 0.0, 0.0]]), weights=np.ones(1), on_body=True)
        )
        self._wire(told["controllers"], bool(told["stamped"]), bool(told["target_latched"]))

    def _wire(self, controllers: list[str], stamped: bool, latched: bool) -> None:
        names = [name for name in controllers if name]
        if not names:
            names = [f"thruster_{k + 1}_controller" for k in range(len(self._names))]
        if len(names) != len(self._names):
            raise ValueError(f"controllers: {len(names)} names, the vehicle has {len(self._names)} thrusters")
        self._each = [self.create_publisher(Float64, f"/{name.strip('/')}/reference", 10) for name in names]
        self._all = self.create_publisher(Float64MultiArray, "~/thrusts", 10)
        self._made = self.create_publisher(WrenchStamped, "~/wrench", 10)
        self._spared = self.create_publisher(Float64MultiArray, "~/disturbance", 10)
        self.create_subscription(WrenchStamped if stamped else Wrench, "~/reference", self._on_reference, 10)
        self.create_subscription(String, "~/failed", self._on_failed, 10)
        self.create_subscription(Odometry, "~/odometry", self._on_odometry, qos_profile_sensor_data)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
        self.create_subscription(PointCloud2, "~/target", self._on_target, kept if latched else qos_profile_sensor_data)
        self.add_on_set_parameters_callback(self._on_parameters)
        self.create_timer(0.25 * self._timeout_s, self._watch, clock=self._steady)

    def _now_ns(self) -> int:
        return self._steady.now().nanoseconds

    def _on_reference(self, message: Wrench | WrenchStamped) -> None:
        wrench = message.wrench if hasattr(message, "wrench") else message
        force, torque = wrench.force, wrench.torque
        try:
            told = (force.x, force.y, force.z, torque.x, torque.y, torque.z)
            self._wrench_B = wrench_of(told, self._frame, self._wrench_B)
            answer = self._allocate(self._wrench_B, self._target, self._usable_pose(), self._thrusts_N)
        except WakewiseError as fault:
            self.get_logger().error(str(fault))
            return
        self._heard_ns = self._now_ns()
        self._send(answer)

    def _usable_pose(self) -> Pose | None:
        """The vehicle's pose if it is fresh and in the frame that the target is in."""
        fresh = self._now_ns() - self._pose_ns <= self._pose_timeout_s * 1e9
        return self._pose if fresh and self._target_frame in ("", self._pose_frame) else None

    def _send(self, answer: NodeAllocation) -> None:
        self._thrusts_N = answer.thrusts_N
        if answer.way != self._way:
            self._way = answer.way
            self.get_logger().info(answer.way)
        self._publish_thrusts()
        made = WrenchStamped()
        made.header.stamp = self.get_clock().now().to_msg()
        made.header.frame_id = self._base
        values = [float(value) for value in wrench_for(answer.wrench_B, self._frame)]
        made.wrench.force.x, made.wrench.force.y, made.wrench.force.z = values[:3]
        made.wrench.torque.x, made.wrench.torque.y, made.wrench.torque.z = values[3:]
        self._made.publish(made)
        if answer.disturbance is not None:
            saved = math.nan if answer.saved_pct is None else answer.saved_pct
            figures = [answer.disturbance, answer.least_disturbance, saved]
            self._spared.publish(_array("D,D of least thrusts,saved %", figures))

    def _publish_thrusts(self) -> None:
        self._all.publish(_array(",".join(self._names), self._thrusts_N))
        for publisher, thrust in zip(self._each, self._thrusts_N, strict=True):
            publisher.publish(Float64(data=float(thrust)))

    def _watch(self) -> None:
        """Zero thrusts, again and again, once nobody has asked for `timeout_s`; nothing before somebody has asked."""
        if self._heard_ns is None or self._now_ns() - self._heard_ns <= self._timeout_s * 1e9:
            return
        if np.any(self._thrusts_N):
            self.get_logger().warning(f"no reference for {self._timeout_s:g} s: thrusts are zero")
        self._wrench_B = np.zeros(6)
        self._thrusts_N = np.zeros(len(self._names))
        self._publish_thrusts()

    def _on_odometry(self, message: Odometry) -> None:
        p, q = message.pose.pose.position, message.pose.pose.orientation
        if message.child_frame_id not in ("", self._base):
            self.get_logger().error(
                f"odometry: of '{message.child_frame_id}', base_frame is '{self._base}': not used",
                throttle_duration_sec=5.0,
            )
            return
        try:
            self._pose = pose_of((p.x, p.y, p.z), (q.x, q.y, q.z, q.w), self._frame)
        except WakewiseError as fault:
            self.get_logger().error(str(fault))
            return
        self._pose_frame, self._pose_ns = message.header.frame_id, self._now_ns()

    def _on_target(self, message: PointCloud2) -> None:
        frame = message.header.frame_id
        on_body = frame == self._base
        if not on_body and self._pose_frame and frame != self._pose_frame:
            self.get_logger().error(
                f"target: in frame '{frame}', must be '{self._base}' or '{self._pose_frame}', the odometry's"
            )
            return
        try:
            fields = [PointField(name=f.name, offset=f.offset, datatype=f.datatype) for f in message.fields]
            sizes = (message.point_step, message.row_step, message.width, message.height, message.is_bigendian)
            xyz, weights = cloud_points(fields, *sizes, bytes(message.data))
            self._target, self._target_frame = self._placed(xyz, weights, on_body), frame
        except WakewiseError as fault:
            self.get_logger().error(str(fault))

    def _on_failed(self, message: String) -> None:
        try:
            self._fail(message.data)
        except WakewiseError as fault:
            self.get_logger().error(str(fault))

    def _fail(self, told: object) -> None:
        self._allocate = ThrustAllocator(**self._make, failed=failed_thrusters(told, self._names))

    def _on_parameters(self, parameters: list) -> SetParametersResult:
        """`failed` may change in flight, and so may what is not the node's own, such as use_sim_time."""
        for parameter in parameters:
            if parameter.name not in DEFAULTS:
                continue
            if parameter.name != "failed":
                return SetParametersResult(successful=False, reason=f"{parameter.name}: is read at the start only")
            try:
                self._fail(parameter.value)
            except WakewiseError as fault:
                return SetParametersResult(successful=False, reason=str(fault))
        return SetParametersResult(successful=True)

    def _target_of(self, flat: list[float], on_body: bool) -> ProtectedPoints:
        """Target of the parameter: x, y, z, x, y, z, ... in the node's frame."""
        numbers = np.array([x for x in flat if not math.isnan(x)], dtype=np.float64)
        if len(numbers) % 3:
            raise ValueError(f"target_points: {len(numbers)} numbers, must be x, y, z of each point")
        return self._placed(numbers.reshape(-1, 3), np.ones(len(numbers) // 3), on_body)

    def _placed(self, xyz: np.ndarray, weights: np.ndarray, on_body: bool) -> ProtectedPoints:
        turn = body_points if on_body else world_points
        return ProtectedPoints(points_m=turn(xyz, self._frame), weights=weights, on_body=on_body)


def _array(label: str, values) -> Float64MultiArray:
    """Numbers whose one dimension says what they are."""
    message = Float64MultiArray()
    message.layout.dim = [MultiArrayDimension(label=label, size=len(values), stride=len(values))]
    message.data = [float(value) for value in values]
    return message


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    rclpy.init(args=args)
    node = AllocatorNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
