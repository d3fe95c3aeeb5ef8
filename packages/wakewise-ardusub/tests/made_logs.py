"""Small logs of a made-up dive, written as the real programs write them: what the readers must give back is known."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega

START_S = 1_700_000_000.0
SECONDS, RATE_HZ = 20, 10
DIRECTIONS = (-1, -1, 1, 1, -1, 1, 1, -1)
"""Of a real BlueROV2 Heavy."""
VOLTAGE_V = 15.4
ASTERN_S = 12


def pulses(step: int) -> list[int]:
    """Pulses of a vectored frame with the directions above: ahead and down from second 5, astern and down from 12."""
    if step < 5 * RATE_HZ:
        return [1500] * 8 + [0] * 8
    turn = 1 if step < ASTERN_S * RATE_HZ else -1
    ahead = (-1, -1, 1, 1, 0, 0, 0, 0)
    down = (0, 0, 0, 0, 1, 1, 1, 1)
    desired = [100 * turn * a + 60 * d for a, d in zip(ahead, down, strict=True)]
    return [1500 + d * w for d, w in zip(DIRECTIONS, desired, strict=True)] + [0] * 8


def _stick(t: float) -> int:
    return 0 if t < 5 else 500 if t < ASTERN_S else -500


def messages(
    *, position: bool = False, vehicle: tuple[int, int] | None = (12, 3), sink_m_s: float = 0.5, told: bool = True
) -> Iterator[tuple[float, int, int, Any]]:
    """Time in seconds, system, component and message of the dive, in order.

    `vehicle` is the heartbeats' MAV_TYPE and MAV_AUTOPILOT, None for no heartbeats; without `told` no parameters.
    """
    mav = ardupilotmega
    named = [("BARO2_GND_PRESS", 101_300.0)] + [(f"MOT_{i}_DIRECTION", d) for i, d in enumerate(DIRECTIONS, 1)]
    for name, value in named if told else []:
        yield 0.0, 1, 1, mav.MAVLink_param_value_message(name.encode(), float(value), 9, 9, 0)
    for i in range(8):
        yield 0.0, 1, 1, mav.MAVLink_param_value_message(f"SERVO{i + 1}_FUNCTION".encode(), 33.0 + i, 9, 9, 0)
    for step in range(SECONDS * RATE_HZ):
        t = step / RATE_HZ
        boot = 100_000 + round(1e3 * t)
        if step % RATE_HZ == 0:
            if vehicle is not None:
                yield t, 1, 1, mav.MAVLink_heartbeat_message(*vehicle, 81 + 128 * (t >= 5), 19 if t < 10 else 2, 4, 3)
            yield t, 255, 190, mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
            yield t, 1, 1, mav.MAVLink_sys_status_message(0, 0, 0, 0, round(1e3 * VOLTAGE_V), 0, -1, 0, 0, 0, 0, 0, 0)
        yield t, 255, 190, mav.MAVLink_manual_control_message(1, _stick(t), 0, 250 if t >= 5 else 500, 0, 0)
        yield t, 1, 1, mav.MAVLink_attitude_message(boot, 0.1, -0.2, 3.1 + 0.01 * t, 0, 0, 0)
        if position:
            yield t, 1, 1, mav.MAVLink_local_position_ned_message(boot, 0.1 * t, -0.2 * t, 0.5 * t, 0.1, -0.2, 0.5)
        yield t, 1, 1, mav.MAVLink_vfr_hud_message(0, 0, 0, 0, -sink_m_s * t, 0)
        yield t, 1, 1, mav.MAVLink_scaled_pressure2_message(boot, 1013.0 + 49.0 * t, 0, 900)
        yield t, 1, 1, mav.MAVLink_servo_output_raw_message(boot * 1000, 0, *pulses(step))


def tlog(jump_at_s: float = 1e9, jump_s: float = 0.0, **how: Any) -> bytes:
    """The dive, as `messages` makes it, as a ground station keeps it; from one time on its clock is off."""
    out = io.BytesIO()
    senders: dict[tuple[int, int], Any] = {}
    for t, system, component, message in messages(**how):
        sender = senders.setdefault(
            (system, component), ardupilotmega.MAVLink(None, srcSystem=system, srcComponent=component)
        )
        stamp_s = START_S + t + (jump_s if t >= jump_at_s else 0.0)
        out.write(struct.pack(">Q", round(1e6 * stamp_s)) + message.pack(sender))
        sender.seq = (sender.seq + 1) % 256
    return out.getvalue()


_BIN = {
    "ATT": (1, "QccC", "TimeUS,Roll,Pitch,Yaw"),
    "RCOU": (2, "QHHHHHHHH", "TimeUS," + ",".join(f"C{i}" for i in range(1, 9))),
    "RCIN": (3, "QHHHHHH", "TimeUS," + ",".join(f"C{i}" for i in range(1, 7))),
    "CTUN": (4, "Qf", "TimeUS,Alt"),
    "BAT": (5, "QBf", "TimeUS,Inst,Volt"),
    "MODE": (6, "QMBB", "TimeUS,Mode,ModeNum,Rsn"),
    "ARM": (7, "QB", "TimeUS,ArmState"),
    "PARM": (8, "QNf", "TimeUS,Name,Value"),
}
_OLD = {
    "ATT": (1, "IccC", "TimeMS,Roll,Pitch,Yaw"),
    "RCOU": (2, "IHHHHHHHH", "TimeMS," + ",".join(f"Ch{i}" for i in range(1, 9))),
    "RCIN": (3, "IHHHHHH", "TimeMS," + ",".join(f"C{i}" for i in range(1, 7))),
    "CTUN": (4, "If", "TimeMS,Alt"),
    "BAT": (5, "IBf", "TimeMS,Inst,Volt"),
    "MODE": (6, "MBB", "Mode,ModeNum,Rsn"),
    "EV": (7, "B", "Id"),
    "PARM": (8, "Nf", "Name,Value"),
    "MSG": (9, "Z", "Message"),
}
"""Before 2015: milliseconds, and none in what is told once."""
_PACKED = {"Z": "64s", "I": "I", "Q": "Q", "c": "h", "C": "H", "H": "H", "f": "f", "B": "B", "M": "B", "N": "16s"}


def dataflash(*, old: bool = False, firmware: str | None = None, told: bool = True, sink_m_s: float = 0.5) -> bytes:
    """The dive as the autopilot keeps it, in the `old` manner if so; without `told` no parameters."""
    out = io.BytesIO()
    kinds = _OLD if old else {**_BIN, "MSG": (9, "QZ", "TimeUS,Message")}

    def described(number: int, name: str, codes: str, labels: str, length: int) -> None:
        head = struct.pack("<BB4s16s64s", number, length, name.encode(), codes.encode(), labels.encode())
        out.write(b"\xa3\x95\x80" + head)

    def said(name: str, t: float, *values: Any) -> None:
        number, codes, labels = kinds[name]
        stamp = {"TimeUS": [round(1e6 * (100.0 + t))], "TimeMS": [round(1e3 * (100.0 + t))]}.get(labels[:6], [])
        packed = struct.pack("<" + "".join(_PACKED[c] for c in codes), *stamp, *values)
        out.write(b"\xa3\x95" + bytes([number]) + packed)

    described(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)
    for name, (number, codes, labels) in kinds.items():
        described(number, name, codes, labels, 3 + struct.calcsize("<" + "".join(_PACKED[c] for c in codes)))
    if firmware is not None:
        said("MSG", 0.0, firmware.encode())
    for i in range(8 if told else 0):
        said("PARM", 0.0, f"SERVO{i + 1}_FUNCTION".encode(), 33.0 + i)
        said("PARM", 0.0, f"MOT_{i + 1}_DIRECTION".encode(), float(DIRECTIONS[i]))
    said("MODE", 0.0, 19, 19, 0)
    arm: dict[bool, tuple[str, int]] = {False: ("ARM", 0), True: ("ARM", 1)}
    if old:
        arm = {False: ("EV", 11), True: ("EV", 10)}
    name, number = arm[False]
    said(name, 0.0, number)
    for step in range(SECONDS * RATE_HZ):
        t = step / RATE_HZ
        if t == 5.0:
            name, number = arm[True]
            said(name, t, number)
        if t == 10.0:
            said("MODE", t, 2, 2, 0)
        if step % RATE_HZ == 0:
            said("BAT", t, 0, VOLTAGE_V)
        said("ATT", t, 573, -1146, round(5729.578 * (3.1 + 0.01 * t)))
        said("CTUN", t, -sink_m_s * t)
        said("RCIN", t, 1500, 1500, 1300 if t >= 5 else 1500, 1500, 1500 + round(0.4 * _stick(t)), 1500)
        said("RCOU", t, *pulses(step)[:8])
    return out.getvalue()


def mcap(chunk_bytes: int = 4096, **how: Any) -> bytes:
    """The dive, as `messages` makes it, as BlueOS records it."""
    from mcap.writer import CompressionType, Writer

    out = io.BytesIO()
    writer = Writer(out, chunk_size=chunk_bytes, compression=CompressionType.ZSTD)
    writer.start()
    schema = writer.register_schema("message", "jsonschema", b'{"type": "object"}')
    channels: dict[str, int] = {}
    for t, system, component, message in messages(**how):
        fields = message.to_dict()
        name = fields.pop("mavpackettype")
        if name == "HEARTBEAT":
            for field, enum in (("type", "MAV_TYPE"), ("autopilot", "MAV_AUTOPILOT")):
                fields[field] = {"type": ardupilotmega.enums[enum][fields[field]].name}
            fields["mavtype"] = fields.pop("type")
            armed = fields["base_mode"] & 128
            fields["base_mode"] = "MAV_MODE_FLAG_CUSTOM_MODE_ENABLED" + (
                " | MAV_MODE_FLAG_SAFETY_ARMED" if armed else ""
            )
        if name == "PARAM_VALUE":
            fields["param_id"] = list(fields["param_id"].ljust(16, "\0"))
        topic = f"mavlink/{system}/{component}/{name}"
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, "json", schema)
        header = {"system_id": system, "component_id": component, "sequence": 0}
        body = json.dumps({"header": header, "message": {"type": name, **fields}}).encode()
        at_ns = round(1e9 * (START_S + t))
        writer.add_message(channels[topic], at_ns, body, at_ns)
    writer.finish()
    return out.getvalue()
