"""What a message does to the stand-in; those of no concern to it do nothing, whoever sends them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from wakewise_ardusub.sitl.mavlink_out import BUILDERS, parameter
from wakewise_ardusub.sitl.modes import demands_of

if TYPE_CHECKING:
    from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot

FORCED = 21196.0
"""Second number of the command to arm that arms or disarms whatever speaks against it."""
_SCRIPTING_RESTART = 3.0
_SCRIPTING = 42701
_REBOOT = 1.0
_ANY_COMPONENT = 0
_MAGIC_2 = 0xFD
_RECORD_PAYLOAD_B, _RECORD_TAIL_B = 264, 15
_NO_INDEX = -1
_LAST = (("param5", "x"), ("param6", "y"))

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
    # COMMAND_INT has whole numbers for the fifth and sixth.
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
    board.send(build(board))
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
    "PARAM_REQUEST_LIST": _param_list,
    "PARAM_REQUEST_READ": _param_read,
    "PARAM_SET": _param_set,
    "REQUEST_DATA_STREAM": _data_stream,
    "FILE_TRANSFER_PROTOCOL": _files,
    "COMMAND_LONG": _command,
    "COMMAND_INT": _command,
}
