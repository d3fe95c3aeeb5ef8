"""Protocol between the companion and the script on the autopilot: ids, names, times and bounds, stated only here.

The companion sends thrusts as SET_ACTUATOR_CONTROL_TARGET: `controls[i]` is motor i + 1, a value v in [-1, 1] that the
script converts into a pulse of 1500 + 400 v us on the channel whose SERVOn_FUNCTION is that motor. An override bypasses
the mixer, so MOT_n_DIRECTION has no effect on it; the companion applies it (`motor_interface.py`).
`script/wakewise.lua` states the same numbers; a test compares them.

`interval_requests` are the message rates that the companion requests, since default rates are a few per second.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

SCRIPT_VERSION: Final = 2
"""Of wire and script together: the script says it as `VERSION_NAME`, and the companion drives only its own."""

# Who speaks.
DEFAULT_SYSTEM: Final = 1
"""System id of a vehicle (SYSID_THISMAV, from 4.7 MAV_SYSID), which its companion shares."""
AUTOPILOT_COMPONENT: Final = 1
COMPANION_COMPONENT: Final = 191
"""MAV_COMP_ID_ONBOARD_COMPUTER. A companion is never a ground station: its heartbeats would hide the pilot's loss.
Their custom_mode is the number of its session, so that two companions know each other apart. It is no flight mode: a
ground station that logs modes of all components writes it down as one of component 191."""
HEARTBEAT_PERIOD_S: Final = 1.0

# Thrusts, companion to script.
THRUST_MESSAGE: Final = 139
"""SET_ACTUATOR_CONTROL_TARGET of MAVLink's common set."""
THRUST_BYTES: Final = 43
"""Its payload: uint64 time_usec, float controls[8], uint8 group_mlx, target_system, target_component."""
THRUST_GROUP: Final = 0
"""group_mlx of thrusts."""
RELEASE_GROUP: Final = 1
"""group_mlx of the message that lets go: the script ends its override at once, whatever the controls hold."""
SLOTS: Final = 8
"""Motors that one message holds; a slot without a motor holds NaN."""
MIDDLE_US: Final = 1500
FULL_US: Final = 400
FIRST_FUNCTION: Final = 33
"""SERVOn_FUNCTION of motor 1; motor i has 32 + i up to 8."""
SEND_PERIOD_S: Final = 0.05
"""Longest time between two messages while engaged: five may be lost before the override ends."""

# Times.
HOLD_MS: Final = 250
"""How long one message acts; after that the outputs are the autopilot's, and so the pilot's."""
BACKSTOP_MS: Final = 290
"""When an override ends by itself, should the script have stopped: `HOLD_MS` and two loops."""
PAUSE_MS: Final = 500
"""For how long nothing may be sent after the mode changed under thrusts, before any act again."""
LOOP_MS: Final = 20
"""Period of the script."""
NEUTRAL_WITHIN_S: Final = 0.3
"""What must hold after any loss: `HOLD_MS` and two loops."""
MOST_AHEAD_US: Final = 5_000_000
"""A message further ahead of the last than this is of another sender: both are refused."""
MOST_BEHIND_US: Final = 250_000
"""A message behind the last by more than this, likewise; one that is less behind was overtaken and is left out."""
SESSION_STEP_US: Final = 2**15
"""A companion's times begin at this for each of its session's number, which is drawn below 2^31. Two on one clock are
so further apart than `MOST_AHEAD_US`, but for one pair in seven million, and stay below the 2^48 that the script reads.
"""
RIVAL_MS: Final = 1000
"""How long nobody acts after two senders were heard."""

# What the script says.
ENGAGED_NAME: Final = "WKW_ENG"
"""NAMED_VALUE_FLOAT: 1 while thrusts act on the motors, else 0."""
VERSION_NAME: Final = "WKW_VER"
REASON_NAME: Final = "WKW_WHY"
"""NAMED_VALUE_FLOAT: key of `REASONS`."""
STATE_PERIOD_S: Final = 0.5
STATE_FRESH_S: Final = 1.5
"""A script not heard for this long is not there."""
STATUS_PREFIX: Final = "Wakewise: "
"""The script's STATUSTEXT begin so."""
REASONS: Final[dict[int, str]] = {
    0: "acting",
    1: "not enabled",
    2: "disarmed",
    3: "mode not allowed",
    4: "no thrusts arrive",
    5: "thrusts refused: not a number or out of range",
    6: "thrusts refused: their slots are not the motors",
    7: "two senders",
    8: "thrusts refused: not from the companion",
    9: "mode changed, waits for a pause",
}
"""Why the script acts or does not, the first that holds: the words of its STATUSTEXT at a change."""

# Parameters that the script adds.
ENABLE_PARAMETER: Final = "WKW_ENABLE"
"""1 lets the companion drive the motors. The script writes 0 when it starts, so a reboot switches it off."""
MODES_PARAMETER: Final = "WKW_MODES"
"""Sum of 2^mode over the modes in which thrusts act."""
PARAMETER_TABLE: Final = 87
"""Key of the script's parameter table on the autopilot (0 to 200), one script's own."""

# Flight modes of ArduSub (ArduPilot, ArduSub/mode.h).
STABILIZE: Final = 0
ALT_HOLD: Final = 2
GUIDED: Final = 4
POSHOLD: Final = 16
MANUAL: Final = 19
ALLOWED_MODES: Final = frozenset({STABILIZE, ALT_HOLD, MANUAL})
"""Those in which nothing jumps when the override ends. ALT_HOLD's controllers go on beneath it, so the script has the
autopilot enter that mode anew at hand-back; POSHOLD would need its place taken anew as well."""
DEFAULT_MODES: Final = sum(1 << mode for mode in sorted(ALLOWED_MODES))

# What is asked of the autopilot by COMMAND_LONG (common.xml).
SET_MODE: Final = 176
REQUEST_MESSAGE: Final = 512
AUTOPILOT_VERSION: Final = 148
IMAGE_START_CAPTURE: Final = 2000
DIGICAM_CONTROL: Final = 203

# The pilot.
STICKS_MESSAGE: Final = 69
"""MANUAL_CONTROL."""
STICKS_FULL: Final = 1000
STICKS_MIDDLE: Final = (0, 0, 500, 0)
"""x, y, z, r of sticks let go: the throttle z goes from 0 (down) by 500 (none) to 1000 (up)."""

# What the companion tells every ground station, as NAMED_VALUE_FLOAT.
DISTURBANCE_NAME: Final = "WW_D"
SAVED_NAME: Final = "WW_SAVED"
COVERAGE_NAME: Final = "WW_COVER"
FIGURES_PERIOD_S: Final = 0.5

# What it runs on.
LEAST_FIRMWARE: Final = (4, 5, 0)
"""Oldest ArduSub whose Lua has every binding that the script calls."""
TRIED_FIRMWARE: Final = ((4, 6), (4, 7))
"""ArduSub that the script was tried on: development versions of May 2024 and July 2025, in simulation."""


SET_MESSAGE_INTERVAL = 511
DO_MOUNT_CONTROL = 205
MOUNT_BY_MAVLINK, MOUNT_BY_STICKS = 2, 3
"""MAV_MOUNT_MODE: the angles of this command, and the pilot's."""
RATES_HZ: dict[int, tuple[str, float]] = {
    30: ("ATTITUDE", 50.0),
    32: ("LOCAL_POSITION_NED", 20.0),
    27: ("RAW_IMU", 50.0),
    36: ("SERVO_OUTPUT_RAW", 20.0),
    74: ("VFR_HUD", 10.0),
    1: ("SYS_STATUS", 2.0),
    158: ("MOUNT_STATUS", 5.0),
    285: ("GIMBAL_DEVICE_ATTITUDE_STATUS", 5.0),
}
"""Message ids with their names and rates: attitude for the estimator, positions four to an age limit, and the rest for
limits and the meter."""
AGAIN_S = 3.0
"""How soon it is asked again while what is needed does not come."""

PARAMETERS_S, MOST_PARAMETERS = 0.5, 12
"""How soon parameters that are not known are asked for again, and how many at once."""


def parameter_request(system: int, name: str) -> Mapping[str, Any]:
    """Fields of PARAM_REQUEST_READ for one parameter."""
    return {
        "target_system": system,
        "target_component": AUTOPILOT_COMPONENT,
        "param_id": name.encode("ascii"),
        "param_index": -1,
    }


def heartbeat(session: int = 0) -> dict[str, int]:
    """Fields of the companion's HEARTBEAT: an onboard controller without an autopilot of its own, active."""
    return {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": session, "system_status": 4}


def photograph_command(number: int, digicam: bool) -> tuple[int, tuple[float, ...]]:
    """Command and parameters of one photograph by all cameras: MAV_CMD_IMAGE_START_CAPTURE, or DO_DIGICAM_CONTROL."""
    if digicam:
        return DIGICAM_CONTROL, (0.0, 0.0, 0.0, 0.0, 1.0, float(number), 0.0)  # the fifth is: shoot
    return IMAGE_START_CAPTURE, (0.0, 0.0, 1.0, float(number), 0.0, 0.0, 0.0)  # no interval, one image, its number


def mount_command(system: int, pitch_rad: float, mode: int) -> Mapping[str, Any]:
    """Fields of MAV_CMD_DO_MOUNT_CONTROL: the camera's pitch, up positive, and who steers the mount."""
    target = {"target_system": system, "target_component": AUTOPILOT_COMPONENT, "confirmation": 0}
    zero = {f"param{i}": 0.0 for i in range(2, 7)}
    return {"command": DO_MOUNT_CONTROL, **target, "param1": math.degrees(pitch_rad), **zero, "param7": float(mode)}


def interval_requests(system: int) -> list[tuple[str, Mapping[str, Any]]]:
    """MAV_CMD_SET_MESSAGE_INTERVAL for each of `RATES_HZ`."""
    return [
        (
            "command_long",
            {
                "target_system": system,
                "target_component": AUTOPILOT_COMPONENT,
                "command": SET_MESSAGE_INTERVAL,
                "confirmation": 0,
                "param1": float(number),
                "param2": 1e6 / rate_hz,
                **{f"param{i}": 0.0 for i in range(3, 8)},
            },
        )
        for number, (_, rate_hz) in RATES_HZ.items()
    ]
