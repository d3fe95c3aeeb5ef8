"""Vehicle state from received MAVLink messages: `LinkState` and the pure function `update_link_state`.

Only messages of the vehicle's autopilot change its state. Sticks count from any sender that addresses this vehicle;
ground stations are identified by system id. A message with invalid fields changes nothing and is counted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import euler_from_quat, quat_from_euler
from wakewise.operation.teleop.input.controls import CONTROL_AXES, apply_dead_zone
from wakewise_ardusub.link import protocol
from wakewise_ardusub.link.pose_messages import SENSED_POSES, finite, sensed_pose
from wakewise_ardusub.logs.channels import MODES

REMEMBERED_S = 1.0
"""How long a rival or a ground station that took over keeps everything still."""
GROUND_STATION_S = 5.0
"""A ground station not heard for this long is gone."""
SUBMARINE, ARDUPILOT = 12, 3
"""MAV_TYPE and MAV_AUTOPILOT of an ArduSub."""
_ARMED = 128
_GROUND_STATION = 6
_NO_AXIS = 32767
_NO_VOLTAGE = 65535
_PITCH_GIVEN = 1
_UNIT = 0.01
"""How far the length of a quaternion may be from 1."""
_TAKING_OVER = {176: "set the mode", 400: "armed or disarmed", 185: "terminated the flight", 300: "started a mission"}
"""Commands of a ground station (MAV_CMD) by which its operator takes the vehicle into their own hands."""
_DONE, _IN_PROGRESS = 0, 5
_ANSWERS = {1: "temporarily rejected", 2: "denied", 3: "unsupported", 4: "failed"}


@dataclass(frozen=True)
class MavlinkMessage:
    """A message: who said it, what it is called and its fields."""

    system: int
    component: int
    name: str
    fields: Mapping[str, Any]

    @classmethod
    def of(cls, message: Any) -> MavlinkMessage:
        """Of a message as pymavlink decodes it."""
        name = message.get_type()
        fields = {key: getattr(message, key) for key in message.get_fieldnames()} if name in WANTED else {}
        return cls(message.get_srcSystem(), message.get_srcComponent(), name, fields)


@dataclass(frozen=True, kw_only=True, eq=False)
class PilotInput:
    """The pilot's sticks: axes as in `wakewise.operation.teleop.input.Controls`, shape (5,), buttons as bits, who moves
    them, when.
    """

    axes: Array
    buttons: int
    system: int
    came_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LinkState:
    """All that was heard, with the time of this computer's clock at which it came.

    Parameters
    ----------
    system : int
        The vehicle's id.
    session : int
        Number that this program's own heartbeats carry: who else speaks as its companion has another, or none.
    attitude : tuple of float
        Roll, pitch and yaw in rad; `rates_rad_s` about the body's axes.
    place_W_m : ndarray, shape (3,), or None
        In NED from the autopilot's origin, and `velocity_W_m_s`.
    depth_m : float
        As the autopilot's altitude above the surface says, positive down.
    servo_us : tuple of int
        Pulses of the channels.
    named : mapping
        NAMED_VALUE_FLOAT of the autopilot: value and time.
    parameters : mapping
        Of the autopilot, as last said.
    ground : mapping
        System ids of ground stations and when each was last heard.
    mount_pitch : tuple of float
        Angle of the camera's mount, rad, up positive, and the time at which it came.
    ranges : mapping
        Distances in m of rangefinders by MAV_SENSOR_ORIENTATION, each with the time at which it came.
    sent_us : tuple of int
        `time_usec` of the thrusts last sent by this program, by which its own echo is told from a rival's.
    photographs : int
        How many a camera said it took, and in `camera` what one said last, in words.
    garbage : int
        Messages that said nonsense, and bytes that were none.
    """

    system: int = protocol.DEFAULT_SYSTEM
    session: int = 0
    heartbeat_s: float = -math.inf
    armed: bool | None = None
    mode: int | None = None
    kind: tuple[int, int] | None = None
    attitude: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    rates_rad_s: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    attitude_s: float = -math.inf
    place_W_m: Array | None = None
    velocity_W_m_s: tuple[float, float, float] = (math.nan, math.nan, math.nan)
    pose_s: float = -math.inf
    pose_from: str = ""
    depth_m: float = math.nan
    depth_s: float = -math.inf
    battery_V: float = math.nan
    servo_us: tuple[int, ...] = ()
    servo_s: float = -math.inf
    sticks: PilotInput | None = None
    named: Mapping[str, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    parameters: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    ground: Mapping[int, float] = field(default_factory=lambda: MappingProxyType({}))
    ranges: Mapping[int, tuple[float, float]] = field(default_factory=lambda: MappingProxyType({}))
    mount_pitch: tuple[float, float] = (math.nan, -math.inf)
    components: frozenset[int] = frozenset()
    sent_us: tuple[int, ...] = ()
    duplicate: str = ""
    duplicate_s: float = -math.inf
    takeover: str = ""
    takeover_s: float = -math.inf
    status: str = ""
    photographs: int = 0
    camera: str = ""
    camera_s: float = -math.inf
    messages: int = 0
    garbage: int = 0
    odd: tuple[str, ...] = field(default=())
    """Names of messages that said nonsense, each once."""

    @property
    def mode_name(self) -> str:
        """The mode in ArduSub's words."""
        return "" if self.mode is None else MODES.get(self.mode, f"mode {self.mode}")

    def named_value(self, name: str, now_s: float) -> tuple[float, float]:
        """A named value and its age; NaN and infinite where it was never heard."""
        value, came_s = self.named.get(name, (math.nan, -math.inf))
        return value, now_s - came_s

    def sent(self, time_us: int) -> LinkState:
        """Thrusts of this time went out."""
        return replace(self, sent_us=(*self.sent_us[-63:], time_us))

    def noise(self, count: int = 1) -> LinkState:
        """Bytes came that are no message."""
        return replace(self, garbage=self.garbage + count)


WANTED = frozenset({
    "HEARTBEAT", "ATTITUDE", "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "VISION_POSITION_ESTIMATE", "ODOMETRY",
    "VFR_HUD", "SYS_STATUS", "SERVO_OUTPUT_RAW", "MANUAL_CONTROL", "RC_CHANNELS_OVERRIDE", "NAMED_VALUE_FLOAT",
    "SET_ACTUATOR_CONTROL_TARGET", "SET_MODE", "COMMAND_LONG", "STATUSTEXT", "RAW_IMU", "PARAM_VALUE",
    "COMMAND_ACK", "CAMERA_IMAGE_CAPTURED", "DISTANCE_SENSOR", "EKF_STATUS_REPORT", "AUTOPILOT_VERSION",
    "GLOBAL_POSITION_INT", "MOUNT_STATUS", "GIMBAL_DEVICE_ATTITUDE_STATUS",
})  # fmt: skip
"""Messages that are looked into, here, in `telemetry_adapter` or by a survey."""


def update_link_state(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    """What is known after a message."""
    known = replace(known, messages=known.messages + 1)
    if said.name not in WANTED:
        return known
    try:
        return _taken(known, said, now_s)
    except (KeyError, TypeError, ValueError, ArithmeticError):
        odd = known.odd if said.name in known.odd else (*known.odd, said.name)
        return replace(known, garbage=known.garbage + 1, odd=odd)


def _taken(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    ours = said.system == known.system
    if ours and said.name in ("COMMAND_ACK", "CAMERA_IMAGE_CAPTURED"):
        return _photographed(known, said, now_s)
    if ours and said.name == "DISTANCE_SENSOR":
        return _ranged(known, said, now_s)
    if ours and said.component == protocol.COMPANION_COMPONENT:
        return _from_companion(known, said, now_s)
    if ours and said.component == protocol.AUTOPILOT_COMPONENT:
        return _from_autopilot(known, said, now_s)
    if ours:
        known = replace(known, components=known.components | {said.component})
    if said.name == "HEARTBEAT":
        if said.fields["type"] == _GROUND_STATION:
            return replace(known, ground=MappingProxyType({**known.ground, said.system: now_s}))
        return known
    if said.name in SENSED_POSES:  # one of another vehicle says nothing of this one
        return _placed(known, said, now_s) if ours else known
    return _from_ground(known, said, now_s)


def _photographed(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    """What a camera, or the autopilot for one, answers to a request for a photograph, or tells of one."""
    get, who = said.fields, f"component {said.component}"
    if said.name == "CAMERA_IMAGE_CAPTURED":
        took, where = int(get["capture_result"]) == 1, _words(get["file_url"])
        words = f"{who} took image {int(get['image_index'])}" + (f", {where}" if where else "")
        if not took:
            words = f"{who} could not take image {int(get['image_index'])}"
        return replace(known, photographs=known.photographs + took, camera=words, camera_s=now_s)
    meant = int(get.get("target_component", 0)) in (0, protocol.COMPANION_COMPONENT)
    if int(get["command"]) not in (protocol.IMAGE_START_CAPTURE, protocol.DIGICAM_CONTROL) or not meant:
        return known
    result = int(get["result"])
    agreed = result in (_DONE, _IN_PROGRESS)
    words = f"{who} takes photographs" if agreed else f"{who} takes none: {_ANSWERS.get(result, f'result {result}')}"
    return replace(known, camera=words, camera_s=now_s)


def _ranged(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    """A distance of a rangefinder, which says it in cm; one outside what it can measure is none."""
    least, most, distance, turn = (
        int(said.fields[name]) for name in ("min_distance", "max_distance", "current_distance", "orientation")
    )
    if not max(least, 1) <= distance <= most:
        return known
    return replace(known, ranges=MappingProxyType({**known.ranges, turn: (0.01 * distance, now_s)}))


def _from_companion(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    """A message under this program's own ids: its echo, or a rival."""
    if said.name == "SET_ACTUATOR_CONTROL_TARGET":
        rival = int(said.fields["time_usec"]) not in known.sent_us
        words = "another program sends thrusts as this vehicle's companion"
    elif said.name == "HEARTBEAT":
        rival = int(said.fields["custom_mode"]) != known.session
        words = f"another program speaks as component {protocol.COMPANION_COMPONENT} of this vehicle"
    elif said.name in SENSED_POSES:
        return _placed(known, said, now_s)
    else:
        return known
    return replace(known, duplicate=words, duplicate_s=now_s) if rival else known


def _from_autopilot(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    name, get = said.name, said.fields
    if name == "HEARTBEAT":
        armed = bool(int(get["base_mode"]) & _ARMED)
        kind = (int(get["type"]), int(get["autopilot"]))
        return replace(known, heartbeat_s=now_s, armed=armed, mode=int(get["custom_mode"]), kind=kind)
    if name == "ATTITUDE":
        angles, rates = _floats(get, "roll", "pitch", "yaw"), _floats(get, "rollspeed", "pitchspeed", "yawspeed")
        if max(map(abs, angles)) > 2.0 * math.pi:
            raise ValueError
        return replace(known, attitude=angles, rates_rad_s=rates, attitude_s=now_s)
    if name == "VFR_HUD":
        (altitude,) = _floats(get, "alt")
        return replace(known, depth_m=-altitude, depth_s=now_s)
    if name == "LOCAL_POSITION_NED" or name in SENSED_POSES:
        return _placed(known, said, now_s)
    if name == "MOUNT_STATUS":
        return replace(known, mount_pitch=(math.radians(0.01 * int(get["pointing_a"])), now_s))
    if name == "GIMBAL_DEVICE_ATTITUDE_STATUS":  # of a mount with servos: the angles that are asked of them
        q = np.array([float(part) for part in get["q"]])
        if q.shape != (4,) or not abs(float(np.linalg.norm(q)) - 1.0) < _UNIT:
            raise ValueError
        return replace(known, mount_pitch=(float(euler_from_quat(q)[1]), now_s))
    if name == "SYS_STATUS":
        millivolts = int(get["voltage_battery"])
        return known if millivolts == _NO_VOLTAGE else replace(known, battery_V=1e-3 * millivolts)
    if name == "SERVO_OUTPUT_RAW":
        if get.get("port"):
            return known
        pulses = tuple(int(get.get(f"servo{i}_raw", 0)) for i in range(1, 17))
        return replace(known, servo_us=pulses, servo_s=now_s)
    if name == "NAMED_VALUE_FLOAT":
        (value,) = _floats(get, "value")
        kept = {**known.named, _words(get["name"]): (value, now_s)}
        if len(kept) > 64:
            raise ValueError
        return replace(known, named=MappingProxyType(kept))
    if name == "PARAM_VALUE":
        (value,) = _floats(get, "param_value")
        what = _words(get["param_id"])
        if not what.isidentifier() or len(known.parameters) > 4000:
            raise ValueError
        if known.parameters.get(what) == value:
            return known
        return replace(known, parameters=MappingProxyType({**known.parameters, what: value}))
    if name == "STATUSTEXT":
        return replace(known, status=_words(get["text"]))
    return known


def _from_ground(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    """Sticks and orders of whoever stands ashore."""
    name, get = said.name, said.fields
    if name == "MANUAL_CONTROL" and int(get["target"]) == known.system:
        before = known.sticks
        sticks = PilotInput(axes=stick_axes(get), buttons=int(get["buttons"]), system=said.system, came_s=now_s)
        known = replace(known, sticks=sticks)
        if before is not None and before.system != said.system and now_s - before.came_s < REMEMBERED_S:
            return _overtaken(known, f"sticks from two ground stations, {before.system} and {said.system}", now_s)
        return known
    if name == "RC_CHANNELS_OVERRIDE" and int(get["target_system"]) == known.system:
        if any(int(get[f"chan{i}_raw"]) not in (0, 65535) for i in range(1, 7)):
            return _overtaken(known, f"system {said.system} overrides the pilot's channels", now_s)
        return known
    if name == "SET_MODE" and int(get["target_system"]) == known.system:
        return _overtaken(known, f"system {said.system} set the mode", now_s)
    if name == "COMMAND_LONG" and int(get["target_system"]) == known.system:
        what = _TAKING_OVER.get(int(get["command"]))
        if what is not None:
            return _overtaken(known, f"system {said.system} {what}", now_s)
    return known


def _overtaken(known: LinkState, words: str, now_s: float) -> LinkState:
    return replace(known, takeover=words, takeover_s=now_s)


def _placed(known: LinkState, said: MavlinkMessage, now_s: float) -> LinkState:
    """A position: of the autopilot's own estimate, or of a sensor that others feed it with."""
    if said.name in SENSED_POSES:
        # What the estimator refuses is no position here either, so that it cannot pass for a fresh one.
        place = sensed_pose(said.name, said.fields).p_m
        return replace(known, place_W_m=place, pose_s=now_s, pose_from=said.name)
    place = finite(said.fields, "x", "y", "z")
    known = replace(known, velocity_W_m_s=_floats(said.fields, "vx", "vy", "vz"))
    if known.pose_from not in ("", said.name) and now_s - known.pose_s < REMEMBERED_S:
        return known  # a sensor's own place is better than what the autopilot made of it
    return replace(known, place_W_m=place, pose_s=now_s, pose_from=said.name)


def stick_axes(fields: Mapping[str, Any]) -> Array:
    """Axes of MANUAL_CONTROL, shape (5,), in the order of `CONTROL_AXES`, dead zone taken out.

    ArduSub's throttle z goes from 0 (down) by 500 (none) to 1000 (up). The tilt of the camera is the extension s, the
    pitch axis, where it is enabled; an axis that says that it is none is centred.
    """
    x, y, z, r = (int(fields[key]) for key in ("x", "y", "z", "r"))
    s = int(fields.get("s", 0)) if int(fields.get("enabled_extensions", 0)) & _PITCH_GIVEN else 0
    axes = [math.nan if v == _NO_AXIS else v / 1000.0 for v in (x, y)]
    axes.append(math.nan if z == _NO_AXIS else (500 - z) / 500.0)
    axes += [math.nan if v == _NO_AXIS else v / 1000.0 for v in (r, s)]
    if any(abs(v) > 1.0 + 1e-9 for v in axes if math.isfinite(v)) or len(axes) != len(CONTROL_AXES):
        raise ValueError
    return apply_dead_zone(axes)


def tilt_of(known: LinkState) -> float:
    """Angle between the body's down and the world's, NaN where no attitude was heard."""
    roll, pitch, _ = known.attitude
    return math.acos(min(max(math.cos(roll) * math.cos(pitch), -1.0), 1.0)) if math.isfinite(roll + pitch) else math.nan


def attitude_of(known: LinkState) -> Array:
    """The attitude as a quaternion w, x, y, z of body in world, shape (4,)."""
    return quat_from_euler(*known.attitude)


def _floats(fields: Mapping[str, Any], *names: str) -> Any:
    values = tuple(float(fields[name]) for name in names)
    if not all(map(math.isfinite, values)):
        raise ValueError
    return values


def _words(value: Any) -> str:
    if isinstance(value, bytes):
        value = value.decode("ascii", "replace")
    if not isinstance(value, str):
        raise TypeError
    return value.partition("\0")[0].strip()
