"""What MAVLink messages say, by name and fields, whether they come as packets or as BlueOS writes them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from wakewise_ardusub.logs.channels import SERVOS
from wakewise_ardusub.logs.identity import NO_AUTOPILOT, enumerated

WANTED = frozenset({
    "MANUAL_CONTROL", "SERVO_OUTPUT_RAW", "ATTITUDE", "VFR_HUD", "AHRS2", "SCALED_PRESSURE", "SCALED_PRESSURE2",
    "SCALED_PRESSURE3", "HEARTBEAT", "SYS_STATUS", "PARAM_VALUE", "LOCAL_POSITION_NED",
})  # fmt: skip
AUTOPILOT = 1
"""Component id of a vehicle's autopilot; cameras, sonars and companions have others."""
_ARMED = 128
_NO_PILOT = 32767
_NO_VOLTAGE = 65535
_PASCAL_PER_MBAR = 100.0


class ClockModel(Protocol):
    """What makes one clock of stamps."""

    def at(self, stamp_s: float, boot_s: float | None = None) -> float:
        """Time of a stamp on that clock."""
        ...


class SampleSink(Protocol):
    """Where the samples and parameters of one system go."""

    def put(self, channel: str, time_s: float, values: Iterable[float]) -> None:
        """Keep one sample of a channel (`wakewise_ardusub.logs.channels`)."""
        ...

    def parameter(self, name: str, value: float) -> None:
        """Keep a parameter."""
        ...

    def beat(self, mav_type: int, autopilot: int) -> None:
        """Keep what a heartbeat says the vehicle is."""
        ...


class MessageListener(Protocol):
    """Who keeps what messages say: a log's reader, or the meter beside a vehicle."""

    @property
    def clock(self) -> ClockModel:
        """Its clock."""
        ...

    def vessel(self, system: int) -> SampleSink:
        """Where a system's go."""
        ...


def record_message(
    gather: MessageListener, stamp_s: float, system: int, component: int, name: str, fields: Mapping[str, Any]
) -> None:
    """Keep what a message says; those that are not `WANTED` only set the clock.

    Raises
    ------
    KeyError, TypeError, ValueError
        If fields are missing or no numbers.
    """
    if name == "MANUAL_CONTROL":
        sticks = [_number(fields[k]) for k in ("x", "y", "z", "r")]
        x, y, z, r = (math.nan if v == _NO_PILOT else v for v in sticks)
        # The throttle goes from 0 (down) by 500 (none) to 1000 (up).
        time_s = gather.clock.at(stamp_s)
        gather.vessel(int(fields["target"])).put("sticks", time_s, (x / 1e3, y / 1e3, (500.0 - z) / 500.0, r / 1e3))
        return
    if component != AUTOPILOT or name not in WANTED:
        gather.clock.at(stamp_s)
        return
    boot = fields.get("time_boot_ms")
    time_s = gather.clock.at(stamp_s, None if boot is None else 1e-3 * _number(boot))
    vessel = gather.vessel(system)
    if name == "SERVO_OUTPUT_RAW":
        if not fields.get("port"):
            vessel.put("servo", time_s, (_number(fields.get(f"servo{i}_raw", 0)) for i in range(1, SERVOS + 1)))
    elif name == "ATTITUDE":
        vessel.put("attitude", time_s, (_number(fields[k]) for k in ("roll", "pitch", "yaw")))
    elif name == "LOCAL_POSITION_NED":
        vessel.put("position", time_s, (_number(fields[k]) for k in ("x", "y", "z")))
    elif name == "VFR_HUD":
        vessel.put("depth VFR_HUD", time_s, (-_number(fields["alt"]),))
    elif name == "AHRS2":
        vessel.put("depth AHRS2", time_s, (-_number(fields["altitude"]),))
    elif name.startswith("SCALED_PRESSURE"):
        number = name.removeprefix("SCALED_PRESSURE") or "1"
        vessel.put(f"pressure {number}", time_s, (_PASCAL_PER_MBAR * _number(fields["press_abs"]),))
    elif name == "SYS_STATUS":
        voltage = _number(fields["voltage_battery"])
        vessel.put("voltage", time_s, (math.nan if voltage == _NO_VOLTAGE else 1e-3 * voltage,))
    elif name == "HEARTBEAT":
        vessel.put("armed", time_s, (float(_is_armed(fields["base_mode"])),))
        vessel.put("mode", time_s, (_number(fields["custom_mode"]),))
        # BlueOS's JSON has the message's own name under `type`, and the vehicle's type beside it.
        kind = fields.get("mavtype", fields.get("type", name))
        if kind != name and (autopilot := enumerated("MAV_AUTOPILOT", fields["autopilot"])) != NO_AUTOPILOT:
            vessel.beat(enumerated("MAV_TYPE", kind), autopilot)
    elif name == "PARAM_VALUE":
        vessel.parameter(_text(fields["param_id"]), _number(fields["param_value"]))


def _is_armed(base_mode: Any) -> bool:
    """Whether the flag is set, in a number or in the words of BlueOS's JSON."""
    if isinstance(base_mode, Mapping):
        base_mode = base_mode.get("bits", 0)
    if isinstance(base_mode, str):
        return "SAFETY_ARMED" in base_mode
    return bool(int(base_mode) & _ARMED)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    return float(value)


def _text(value: Any) -> str:
    """A name, which BlueOS's older JSON has as a list of letters."""
    if isinstance(value, list):
        value = "".join(letter for letter in value if isinstance(letter, str))
    if not isinstance(value, str):
        raise TypeError
    return value.partition("\0")[0]
