"""MAVLink messages of the simulated autopilot: handlers of received messages, builders and rates of sent ones.

Messages without a handler are ignored. Sent messages come from the true motion: there is no noise, no estimator and no
magnetometer, unless `SeaSensors` gives position and velocity their errors. Only the depth is that of the sensor, whose
zero may have been set under water (`SimulatedAutopilot.depth_m`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.geometry import euler_from_quat
from wakewise_ardusub.sitl.modes import demands_of

if TYPE_CHECKING:
    from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot


SURFACE_HPA = 1013.25
_EARTH_M = 6_378_137.0
_VOLTAGE_V = 16.0
_NO_CELL = 65535
_OFFICIAL = 255

RATES_HZ: dict[int, float] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: 1.0,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 1.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10.0,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 10.0,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 10.0,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 3.0,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 3.0,
    mavlink.MAVLINK_MSG_ID_RAW_IMU: 2.0,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: 2.0,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE2: 2.0,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: 2.0,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: 3.0,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: 3.0,
    mavlink.MAVLINK_MSG_ID_MOUNT_STATUS: 2.0,
}
"""How often each is told before anybody asks for another rate: about as often as by ArduSub's stream parameters."""
FASTEST_HZ = 200.0


def heartbeat(board: SimulatedAutopilot) -> Any:
    """Who it is, mode, armed or not."""
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
    base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if board.armed else 0
    state = mavlink.MAV_STATE_ACTIVE if board.armed else mavlink.MAV_STATE_STANDBY
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_SUBMARINE, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, base, board.mode, state, 3
    )


def autopilot_version(board: SimulatedAutopilot) -> Any:
    """Release and what the protocol end can do."""
    can = (
        mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_FTP
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    major, minor, patch = board.firmware
    release = major << 24 | minor << 16 | patch << 8 | _OFFICIAL
    return mavlink.MAVLink_autopilot_version_message(can, release, 0, 0, 0, b"standin\0", bytes(8), bytes(8), 0, 0, 0)


def parameter(board: SimulatedAutopilot, name: str) -> Any:
    """One parameter and its place in the list."""
    table = board.parameters
    return mavlink.MAVLink_param_value_message(
        name.encode("ascii", "replace"),
        table.value(name, otherwise=math.nan),
        mavlink.MAV_PARAM_TYPE_REAL32,
        len(table),
        table.index(name),
    )


def _attitude(board: SimulatedAutopilot) -> Any:
    roll, pitch, yaw = euler_from_quat(board.motion.q_WB)
    return mavlink.MAVLink_attitude_message(board.boot_ms, roll, pitch, yaw, *board.motion.omega_B_rad_s)


def _attitude_quaternion(board: SimulatedAutopilot) -> Any:
    motion = board.motion
    return mavlink.MAVLink_attitude_quaternion_message(board.boot_ms, *motion.q_WB, *motion.omega_B_rad_s)


def _local_position(board: SimulatedAutopilot) -> Any:
    north, east, _ = board.estimated.p_WB_m
    return mavlink.MAVLink_local_position_ned_message(
        board.boot_ms, north, east, board.depth_m, *board.estimated.v_W_m_s
    )


def _ekf_status(board: SimulatedAutopilot) -> Any:
    """Flags alone: attitude and depth always, horizontal position while the Doppler log lasts."""
    flags = mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_VERT_ABS
    flags |= mavlink.EKF_CONST_POS_MODE if board.place_lost else mavlink.EKF_VELOCITY_HORIZ | mavlink.EKF_POS_HORIZ_REL
    return mavlink.MAVLink_ekf_status_report_message(flags, 0.0, 0.0, 0.0, 0.0, 0.0)


def _distance(board: SimulatedAutopilot) -> Any | None:
    """The rangefinder that looks down; nothing without one and in a drop-out."""
    told = None if board.sensors is None else board.sensors.distance_cm(board.motion.time_s)
    if told is None or board.sensors is None:
        return None
    least, most = (round(100.0 * bound) for bound in (board.sensors.errors.least_m, board.sensors.errors.most_m))
    return mavlink.MAVLink_distance_sensor_message(
        board.boot_ms, least, most, max(told, 0), 0, 0, mavlink.MAV_SENSOR_ROTATION_PITCH_270, 255
    )


def _mount_status(board: SimulatedAutopilot) -> Any | None:
    """The camera's mount as its servo is asked to be; nothing without one."""
    if board.parameters.value("MNT1_TYPE", otherwise=0.0) < 1.0:
        return None
    return mavlink.MAVLink_mount_status_message(0, 0, round(100.0 * board.mount_deg), 0, 0)


def _position_target(board: SimulatedAutopilot) -> Any | None:
    """The target that is followed; nothing in modes without one."""
    target = board.target
    if target is None or target.place_W_m is None:
        return None
    north, east, down = target.place_W_m
    return mavlink.MAVLink_position_target_local_ned_message(
        board.boot_ms, mavlink.MAV_FRAME_LOCAL_NED, 0, north, east, down - board.zero_depth_m,
        *target.velocity_W_m_s, *target.acceleration_W_m_s2, target.heading_rad or 0.0, target.turn_rad_s or 0.0,
    )  # fmt: skip


def _global_position(board: SimulatedAutopilot) -> Any:
    north, east, _ = board.motion.p_WB_m
    latitude, longitude = board.home_deg
    turn = math.degrees(1.0 / _EARTH_M)
    heading = math.degrees(euler_from_quat(board.motion.q_WB)[2]) % 360.0
    return mavlink.MAVLink_global_position_int_message(
        board.boot_ms,
        round(1e7 * (latitude + turn * north)),
        round(1e7 * (longitude + turn * east / math.cos(math.radians(latitude)))),
        round(-1e3 * board.depth_m),
        round(-1e3 * board.depth_m),
        *(int(np.clip(round(1e2 * v), -32767, 32767)) for v in board.motion.v_W_m_s),
        round(1e2 * heading) % 36000,
    )


def _vfr_hud(board: SimulatedAutopilot) -> Any:
    velocity = board.motion.v_W_m_s
    heading = math.degrees(euler_from_quat(board.motion.q_WB)[2]) % 360.0
    speed = float(np.hypot(velocity[0], velocity[1]))
    return mavlink.MAVLink_vfr_hud_message(speed, speed, round(heading) % 360, 0, -board.depth_m, -float(velocity[2]))


def _pressure_in_hull(board: SimulatedAutopilot) -> Any:
    return mavlink.MAVLink_scaled_pressure_message(board.boot_ms, SURFACE_HPA, 0.0, 2500)


def _pressure_of_water(board: SimulatedAutopilot) -> Any:
    water_hPa = 1e-2 * TRIM_WATER_KG_M3 * GRAVITY_M_S2 * float(board.motion.p_WB_m[2])
    return mavlink.MAVLink_scaled_pressure2_message(board.boot_ms, SURFACE_HPA + water_hPa, 0.0, 1500)


def _servo_output(board: SimulatedAutopilot) -> Any:
    pulses = board.pulses_us
    micros = round(1e6 * board.now_s) & 0xFFFFFFFF
    return mavlink.MAVLink_servo_output_raw_message(micros, 0, *pulses[:8], *pulses[8:16])


def _raw_imu(board: SimulatedAutopilot) -> Any:
    """Specific force in thousandths of g and rates in mrad/s, whole ones, as ArduPilot fills it."""
    force = [round(1e3 * v / GRAVITY_M_S2) for v in board.motion.force_B_m_s2]
    rates = [round(1e3 * v) for v in board.motion.omega_B_rad_s]
    within = [max(-32767, min(32767, value)) for value in (*force, *rates)]
    return mavlink.MAVLink_raw_imu_message(round(1e6 * board.now_s), *within, 0, 0, 0)


def _sys_status(board: SimulatedAutopilot) -> Any:
    millivolt = round(1e3 * board.parameters.value("SIM_BATT_VOLTAGE", otherwise=_VOLTAGE_V))
    return mavlink.MAVLink_sys_status_message(0, 0, 0, 0, millivolt, -1, -1, 0, 0, 0, 0, 0, 0)


def _battery(board: SimulatedAutopilot) -> Any:
    millivolt = round(1e3 * board.parameters.value("SIM_BATT_VOLTAGE", otherwise=_VOLTAGE_V))
    cells = [millivolt] + [_NO_CELL] * 9
    return mavlink.MAVLink_battery_status_message(0, 0, 0, 32767, cells, -1, -1, -1, -1)


def _system_time(board: SimulatedAutopilot) -> Any:
    return mavlink.MAVLink_system_time_message(0, board.boot_ms)


BUILDERS: dict[int, Callable[[SimulatedAutopilot], Any]] = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: heartbeat,
    mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: autopilot_version,
    mavlink.MAVLINK_MSG_ID_RAW_IMU: _raw_imu,
    mavlink.MAVLINK_MSG_ID_SYS_STATUS: _sys_status,
    mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: _battery,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: _attitude,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _attitude_quaternion,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: _local_position,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _global_position,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _vfr_hud,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: _pressure_in_hull,
    mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE2: _pressure_of_water,
    mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW: _servo_output,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _system_time,
    mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: _ekf_status,
    mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: _distance,
    mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: _position_target,
    mavlink.MAVLINK_MSG_ID_MOUNT_STATUS: _mount_status,
}
"""What can be told, by message id."""


class MessageSchedule:
    """When each message is due."""

    def __init__(self) -> None:
        self._every_s = {message: 1.0 / rate for message, rate in RATES_HZ.items()}
        self._next_s = dict.fromkeys(self._every_s, 0.0)

    def ask(self, message: int, every_us: float) -> bool:
        """Set how often: microseconds between two, -1 for never, 0 for what it was at first; False where unknown."""
        if message not in BUILDERS or not math.isfinite(every_us):
            return False
        if every_us < 0.0:
            self._every_s.pop(message, None)
        else:
            usual = RATES_HZ.get(message, 1.0)
            self._every_s[message] = max(1e-6 * every_us, 1.0 / FASTEST_HZ) if every_us else 1.0 / usual
        return True

    def due(self, now_s: float) -> list[int]:
        """Messages whose time has come; one that fell behind is told once."""
        due = []
        for message, every_s in self._every_s.items():
            if now_s >= self._next_s.get(message, 0.0) - 1e-9:
                due.append(message)
                self._next_s[message] = max(self._next_s.get(message, 0.0) + every_s, now_s)
        return due


FORCED = 21196.0
"""Second number of the command to arm that arms or disarms whatever speaks against it."""
_SCRIPTING_RESTART = 3.0
_SCRIPTING = 42701
_REBOOT = 1.0
_ANY_COMPONENT = 0
_MAGIC_2 = 0xFD
_RECORD_PAYLOAD_B, _RECORD_TAIL_B = 264, 15
_NO_INDEX = -1
_LAST = (("param5", "x"), ("param6", "y"), ("param7", "z"))

ACCEPTED, DENIED, UNSUPPORTED, FAILED = (
    mavlink.MAV_RESULT_ACCEPTED,
    mavlink.MAV_RESULT_DENIED,
    mavlink.MAV_RESULT_UNSUPPORTED,
    mavlink.MAV_RESULT_FAILED,
)


def handle_message(board: SimulatedAutopilot, message: Any) -> None:
    """Do what a message asks for, if it is for this vehicle's autopilot."""
    own, component = board.system, board.component
    if message.get_srcSystem() == own and message.get_srcComponent() == component:
        return
    if getattr(message, "target_system", 0) not in (0, own):
        return
    if getattr(message, "target_component", _ANY_COMPONENT) not in (_ANY_COMPONENT, component):
        return
    board.to_scripts(raw_record(message), message.get_msgId())
    does = _DOES.get(message.get_type())
    if does is not None:
        does(board, message)


def raw_record(message: Any) -> str:
    """A message as scripts get it: the firmware's own record of it, one character a byte.

    Checksum, magic number, length, two flags, sequence, system, component, three bytes of id, then the payload as it
    came and zeros.
    """
    frame = bytes(message.get_msgbuf())
    length, crc = frame[1], frame[-2:]
    if frame[0] == _MAGIC_2:
        head, payload = frame[:10], frame[10 : 10 + length]
        crc = frame[10 + length : 12 + length]
    else:
        head, payload = bytes([*frame[:2], 0, 0, *frame[2:5], frame[5], 0, 0]), frame[6 : 6 + length]
    record = crc + head + payload.ljust(_RECORD_PAYLOAD_B, b"\0") + bytes(_RECORD_TAIL_B)
    return record.decode("latin-1")


def _heartbeat(board: SimulatedAutopilot, message: Any) -> None:
    if message.get_srcSystem() == board.ground_station and message.type == mavlink.MAV_TYPE_GCS:
        board.note_ground_station()


def _manual_control(board: SimulatedAutopilot, message: Any) -> None:
    if message.get_srcSystem() != board.ground_station or message.target != board.system:
        return
    gain = board.parameters.value("JS_GAIN_DEFAULT", otherwise=0.5)
    board.take_sticks(
        demands_of(
            message.x,
            message.y,
            message.z,
            message.r,
            pitch=getattr(message, "s", 0),
            roll=getattr(message, "t", 0),
            extensions=getattr(message, "enabled_extensions", 0),
            gain=gain,
            throttle=board.parameters.value("JS_THR_GAIN", otherwise=1.0),
        )
    )
    board.joystick.take(board, message.buttons)


def _guided_target(board: SimulatedAutopilot, message: Any) -> None:
    board.take_target(message)


def _set_mode(board: SimulatedAutopilot, message: Any) -> None:
    board.set_mode(message.custom_mode)


def _param_list(board: SimulatedAutopilot, _message: Any) -> None:
    board.list_parameters()


def _param_read(board: SimulatedAutopilot, message: Any) -> None:
    name = board.parameters.at(message.param_index) if message.param_index != _NO_INDEX else _name(message.param_id)
    if name is not None and board.parameters.get(name) is not None:
        board.send(parameter(board, name))


def _param_set(board: SimulatedAutopilot, message: Any) -> None:
    name = _name(message.param_id)
    if board.parameters.get(name) is not None:
        # A value that is refused is answered with the one that stays.
        board.set_parameter(name, float(message.param_value))
        board.send(parameter(board, name))


def _name(given: Any) -> str:
    text = given.decode("latin-1") if isinstance(given, bytes | bytearray) else str(given)
    return text.partition("\0")[0]


def _data_stream(board: SimulatedAutopilot, message: Any) -> None:
    every_us = 1e6 / message.req_message_rate if message.start_stop and message.req_message_rate else -1.0
    for identity in BUILDERS:
        if identity not in (mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION):
            board.timetable.ask(identity, every_us)


def _files(board: SimulatedAutopilot, message: Any) -> None:
    answer = board.files.answer(bytes(message.payload))
    board.send(
        mavlink.MAVLink_file_transfer_protocol_message(
            0, message.get_srcSystem(), message.get_srcComponent(), list(answer)
        )
    )


def _command(board: SimulatedAutopilot, message: Any) -> None:
    numbers = [float(getattr(message, f"param{i}")) for i in range(1, 5)]
    # COMMAND_INT has whole numbers for the fifth and sixth, and names of its own for the last three.
    numbers += [float(getattr(message, name, getattr(message, other, 0.0))) for name, other in _LAST]
    does = _COMMANDS.get(message.command)
    result = UNSUPPORTED if does is None else does(board, numbers)
    board.send(
        mavlink.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
    )


def _arm(board: SimulatedAutopilot, numbers: list[float]) -> int:
    if numbers[0] not in (0.0, 1.0):
        return int(UNSUPPORTED)
    fine = board.arm() if numbers[0] == 1.0 else board.disarm("command")
    return int(ACCEPTED if fine or numbers[1] == FORCED else FAILED)


def _photograph(board: SimulatedAutopilot, _numbers: list[float]) -> int:
    board.photographs += 1
    return int(ACCEPTED)


def _mount(board: SimulatedAutopilot, numbers: list[float]) -> int:
    if board.parameters.value("MNT1_TYPE", otherwise=0.0) < 1.0:
        return int(UNSUPPORTED)
    if not math.isfinite(numbers[0] + numbers[6]):
        return int(DENIED)
    by_mavlink = round(numbers[6]) == mavlink.MAV_MOUNT_MODE_MAVLINK_TARGETING
    board.mount_target_deg = numbers[0] if by_mavlink else None
    return int(ACCEPTED)


def _mode(board: SimulatedAutopilot, numbers: list[float]) -> int:
    if not math.isfinite(numbers[1]):
        return int(DENIED)
    return int(ACCEPTED if board.set_mode(round(numbers[1])) else FAILED)


def _interval(board: SimulatedAutopilot, numbers: list[float]) -> int:
    if not math.isfinite(numbers[0]):
        return int(DENIED)
    return int(ACCEPTED if board.timetable.ask(round(numbers[0]), numbers[1]) else FAILED)


def _request(board: SimulatedAutopilot, numbers: list[float]) -> int:
    build = BUILDERS.get(round(numbers[0])) if math.isfinite(numbers[0]) else None
    if build is None:
        return int(FAILED)
    told = build(board)
    if told is None:
        return int(FAILED)
    board.send(told)
    return int(ACCEPTED)


def _motor_test(board: SimulatedAutopilot, numbers: list[float]) -> int:
    turned = board.motor_test.ask(numbers, board.now_s, board.armed, board.send_text)
    return int(ACCEPTED if turned else FAILED)


def _capabilities(board: SimulatedAutopilot, _numbers: list[float]) -> int:
    return _request(board, [float(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)])


def _reboot(board: SimulatedAutopilot, numbers: list[float]) -> int:
    if board.armed or numbers[0] != _REBOOT:
        return int(DENIED)
    board.reboot()
    return int(ACCEPTED)


def _scripting(board: SimulatedAutopilot, numbers: list[float]) -> int:
    if numbers[0] != _SCRIPTING_RESTART:
        return int(UNSUPPORTED)
    board.start_scripts()
    return int(ACCEPTED)


_COMMANDS: dict[int, Callable[[SimulatedAutopilot, list[float]], int]] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm,
    mavlink.MAV_CMD_DO_SET_MODE: _mode,
    mavlink.MAV_CMD_DO_DIGICAM_CONTROL: _photograph,
    mavlink.MAV_CMD_DO_MOUNT_CONTROL: _mount,
    mavlink.MAV_CMD_IMAGE_START_CAPTURE: _photograph,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _interval,
    mavlink.MAV_CMD_REQUEST_MESSAGE: _request,
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _capabilities,
    mavlink.MAV_CMD_DO_MOTOR_TEST: _motor_test,
    mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN: _reboot,
    _SCRIPTING: _scripting,
}

_DOES: dict[str, Callable[[SimulatedAutopilot, Any], None]] = {
    "HEARTBEAT": _heartbeat,
    "MANUAL_CONTROL": _manual_control,
    "SET_MODE": _set_mode,
    "SET_POSITION_TARGET_LOCAL_NED": _guided_target,
    "PARAM_REQUEST_LIST": _param_list,
    "PARAM_REQUEST_READ": _param_read,
    "PARAM_SET": _param_set,
    "REQUEST_DATA_STREAM": _data_stream,
    "FILE_TRANSFER_PROTOCOL": _files,
    "COMMAND_LONG": _command,
    "COMMAND_INT": _command,
}
