"""Just enough of ROS 2 to run a node: messages as Jazzy defines them, checked as strictly, and a Node that listens.

Fields and types come from rosbags, which ships ROS's own definitions; as in rclpy an int where a float64 belongs is
refused, and so is a field that the message does not have.
"""

from __future__ import annotations

import sys
from array import array
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import pytest

KINDS = {"float64": float, "float32": float, "string": str, "bool": bool}


class Clock:
    """A clock that a test sets."""

    def __init__(self, *, clock_type: str = "ROS_TIME") -> None:
        self.clock_type, self.nanoseconds = clock_type, 1_000_000_000

    def now(self) -> Clock:
        return self

    def to_msg(self) -> Any:
        made = sys.modules["builtin_interfaces.msg"].Time()
        made.sec, made.nanosec = divmod(self.nanoseconds, 1_000_000_000)
        return made


class Publisher:
    """Keeps what was sent; refuses another type than its own."""

    def __init__(self, kind: type, topic: str) -> None:
        self.kind, self.topic = kind, topic
        self.sent: list[Any] = []

    def publish(self, message: Any) -> None:
        assert type(message) is self.kind, f"{self.topic}: {type(message)}"
        self.sent.append(message)


class Parameter:
    def __init__(self, name: str, value: Any) -> None:
        self.name, self.value = name, value


class Logger:
    def __init__(self) -> None:
        self.said: list[tuple[str, str]] = []

    def __getattr__(self, level: str) -> Any:
        return lambda text, **_: self.said.append((level, text))


class Node:
    """What a node asks of rclpy: parameters with a type each, topics, timers, a clock and a log."""

    overrides: ClassVar[dict[str, Any]] = {}

    def __init__(self, name: str) -> None:
        self.name, self.clock, self.logger = name, Clock(), Logger()
        self.parameters: dict[str, Any] = {}
        self.described: dict[str, Any] = {}
        self.publishers: dict[str, Publisher] = {}
        self.heard: dict[str, tuple[type, Any]] = {}
        self.timers: list[tuple[float, Any]] = []
        self.timed_by: list[Clock] = []
        self.qos: dict[str, Any] = {}
        self.on_set: Any = None

    def declare_parameter(self, name: str, value: Any, descriptor: Any) -> None:
        self.parameters[name] = Parameter(name, value)
        self.described[name] = descriptor
        if name in self.overrides:
            self._typed(Parameter(name, self.overrides[name]))

    def _typed(self, given: Parameter) -> None:
        """Keep a parameter of its declared type, as rclpy does; of any where typing is dynamic."""
        told = (self.parameters[given.name].value, given.value)
        if not self.described[given.name].dynamic_typing:
            kinds = [type(x[0]) if isinstance(x, list) else type(x) for x in told]
            assert kinds[0] is kinds[1], f"parameter {given.name}: {kinds[1]}, declared {kinds[0]}"
        self.parameters[given.name] = given

    def set_parameter(self, name: str, value: Any) -> Any:
        """What the service of `ros2 param set` does: a wrong type is refused before the node is asked."""
        if name in self.described:
            try:
                self._typed(Parameter(name, value))
            except AssertionError as fault:
                return SimpleNamespace(successful=False, reason=f"Wrong parameter type, {fault}")
        return self.on_set([Parameter(name, value)])

    def get_parameter(self, name: str) -> Parameter:
        return self.parameters[name]

    def create_publisher(self, kind: type, topic: str, qos: Any) -> Publisher:
        return self.publishers.setdefault(topic, Publisher(kind, topic))

    def create_subscription(self, kind: type, topic: str, callback: Any, qos: Any) -> None:
        assert topic not in self.heard
        self.heard[topic] = (kind, callback)
        self.qos[topic] = qos

    def create_timer(self, period_s: float, callback: Any, clock: Clock) -> None:
        self.timers.append((period_s, callback))
        self.timed_by.append(clock)

    def add_on_set_parameters_callback(self, callback: Any) -> None:
        self.on_set = callback

    def get_clock(self) -> Clock:
        return self.clock

    def get_logger(self) -> Logger:
        return self.logger

    def say(self, topic: str, message: Any) -> None:
        """Hand a message to the node."""
        kind, callback = self.heard[topic]
        assert type(message) is kind
        callback(message)


def _message(name: str, fields: list[tuple[str, Any]], make: Any) -> type:
    """A message class of rclpy's manner: keyword arguments, defaults, every assignment checked."""

    def fresh(told: Any) -> Any:
        node, inner = told
        if node.name == "BASE":
            return KINDS.get(inner[0], int)()
        if node.name == "NAME":
            return make(inner)()
        return [0.0] * inner[1] if node.name == "ARRAY" else []

    def fits(told: Any, value: Any) -> bool:
        node, inner = told
        if node.name == "BASE":
            kind = KINDS.get(inner[0], int)
            return isinstance(value, kind) and (kind is not int or not isinstance(value, bool))
        if node.name == "NAME":
            return type(value) is make(inner)
        return isinstance(value, list | tuple | array | bytes) and all(fits(inner[0], item) for item in value[:50])

    told = dict(fields)

    def init(self: Any, **given: Any) -> None:
        for field, kind in told.items():
            object.__setattr__(self, field, fresh(kind))
        for field, value in given.items():
            setattr(self, field, value)

    def assign(self: Any, field: str, value: Any) -> None:
        assert field in told, f"{name} has no {field}"
        assert fits(told[field], value), f"{name}.{field}: {value!r}"
        object.__setattr__(self, field, value)

    return type(name.rpartition("/")[2], (), {"__slots__": tuple(told), "__init__": init, "__setattr__": assign})


def install(patch: pytest.MonkeyPatch) -> None:
    """Put rclpy and the packages of messages into sys.modules."""
    typesys = pytest.importorskip("rosbags.typesys")
    defined = typesys.get_typestore(typesys.Stores.ROS2_JAZZY).fielddefs
    made: dict[str, type] = {}

    def make(name: str) -> type:
        if name not in defined:
            raise AttributeError(name)
        if name not in made:
            made[name] = _message(name, defined[name][1], make)
        return made[name]

    for package in sorted({name.partition("/")[0] for name in defined if "/msg/" in name}):
        patch.setitem(sys.modules, package, ModuleType(package))
        messages: Any = ModuleType(f"{package}.msg")
        messages.__getattr__ = lambda word, package=package: make(f"{package}/msg/{word}")
        patch.setitem(sys.modules, f"{package}.msg", messages)
    modules: list[Any] = [ModuleType(name) for name in ("rclpy", "rclpy.node", "rclpy.qos", "rclpy.clock")]
    _, node, qos, clock = modules
    node.Node, qos.qos_profile_sensor_data = Node, object()
    qos.QoSProfile = SimpleNamespace
    qos.DurabilityPolicy = SimpleNamespace(TRANSIENT_LOCAL="transient local")
    qos.ReliabilityPolicy = SimpleNamespace(RELIABLE="reliable")
    clock.Clock, clock.ClockType = Clock, SimpleNamespace(STEADY_TIME="STEADY_TIME")
    for module in modules:
        patch.setitem(sys.modules, module.__name__, module)
