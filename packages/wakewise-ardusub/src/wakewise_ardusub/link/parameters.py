"""Parameters of an autopilot: read until complete, set and read back, or parsed from a file; functions of the buttons.

BTNn_FUNCTION, and BTNn_SFUNCTION while shift is held, are what ArduSub does at a button of MANUAL_CONTROL. A button of
the companion must have no function there, because autopilot and companion receive the same message. Numbers and names
are those of ArduSub's parameter documentation; defaults are those of its `joystick.cpp`.
"""

from __future__ import annotations

import math
import re
import struct
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from wakewise.core.errors import EnvironmentFailure, InputError
from wakewise_ardusub.link.connection import MavlinkSession
from wakewise_ardusub.link.protocol import AUTOPILOT_COMPONENT

BUTTONS = 16
"""Buttons of MANUAL_CONTROL's first field, counted from 0."""
NONE, SHIFT, ARM_TOGGLE, ARM, DISARM = 0, 1, 2, 3, 4
MODE_FUNCTIONS: dict[int, int] = {5: 19, 6: 0, 7: 2, 8: 16, 9: 3, 10: 7, 11: 4, 12: 1, 13: 21}
"""Functions that set a mode, and ArduSub's number of the mode."""
CAMERA_TRIGGER = 24
FUNCTIONS: dict[int, str] = {
    NONE: "none", SHIFT: "shift", ARM_TOGGLE: "arm or disarm", ARM: "arm", DISARM: "disarm", 5: "mode MANUAL",
    6: "mode STABILIZE", 7: "mode ALT_HOLD", 8: "mode POSHOLD", 9: "mode AUTO", 10: "mode CIRCLE", 11: "mode GUIDED",
    12: "mode ACRO", 13: "mode SURFTRAK", 21: "mount to the centre", 22: "mount up", 23: "mount down",
    CAMERA_TRIGGER: "camera trigger", 25: "camera source", 26: "mount right", 27: "mount left", 31: "lights 1",
    32: "lights 1 brighter", 33: "lights 1 dimmer", 34: "lights 2", 35: "lights 2 brighter", 36: "lights 2 dimmer",
    41: "gain", 42: "more gain", 43: "less gain", 44: "roll trim up", 45: "roll trim down", 46: "pitch trim up",
    47: "pitch trim down", 48: "input hold", 49: "roll and pitch by the sticks",
}  # fmt: skip
_IDLE = frozenset({NONE, *range(91, 97)})
"""Functions at which ArduSub does nothing: none, and those for a firmware of one's own."""
DEFAULT: tuple[tuple[int, int], ...] = (
    (0, 0), (5, 0), (7, 0), (6, 0), (DISARM, 0), (SHIFT, 0), (ARM, 0), (21, 0),
    (48, 0), (23, 27), (22, 26), (42, 47), (43, 46), (33, 45), (32, 44), (0, 0),
)  # fmt: skip
"""BTNn_FUNCTION and BTNn_SFUNCTION of each button on an autopilot on which nobody has changed them."""


def parameters_of(button: int) -> tuple[str, str]:
    """Names of a button's two parameters."""
    return f"BTN{button}_FUNCTION", f"BTN{button}_SFUNCTION"


BUTTON_PARAMETERS = tuple(name for button in range(BUTTONS) for name in parameters_of(button))


def conflict(button: int, what: str, parameters: Mapping[str, float]) -> str:
    """What the autopilot does at a button that is to mean `what` here, in words; empty where it does nothing.

    A parameter that is not known counts as no function. A photograph may trigger the autopilot's camera, too.
    """
    harmless = _IDLE | {CAMERA_TRIGGER} if what == "capture" else _IDLE
    for name in parameters_of(button):
        function = round(parameters.get(name, NONE))
        if function not in harmless:
            return f"{name} is {function} ({FUNCTIONS.get(function, 'a function of the autopilot')})"
    return ""


def free_buttons(parameters: Mapping[str, float]) -> list[int]:
    """Buttons at which the autopilot is known to do nothing."""
    return [
        button
        for button in range(BUTTONS)
        if all(name in parameters for name in parameters_of(button)) and not conflict(button, "", parameters)
    ]


def button_faults(buttons: Mapping[str, int], parameters: Mapping[str, float]) -> str:
    """The first of the companion's buttons at which the autopilot acts as well, in words; empty where there is none."""
    for what, button in buttons.items():
        words = conflict(button, what, parameters)
        if words:
            return f"--buttons {what}={button}: {words} on this autopilot; {free_words(parameters, buttons)}"
    return ""


def free_words(parameters: Mapping[str, float], buttons: Mapping[str, int] | None = None) -> str:
    """Which buttons are free and not yet given, in words."""
    free = [button for button in free_buttons(parameters) if button not in (buttons or {}).values()]
    if not free:
        return (
            "none is free: set BTNn_FUNCTION and BTNn_SFUNCTION of one that you do not need to 0, not those of disarm"
        )
    return f"free {'is' if len(free) == 1 else 'are'} {_listed(free)}"


def _listed(numbers: Iterable[int]) -> str:
    words = [str(number) for number in numbers]
    return ", ".join(words) if len(words) < 2 else f"{', '.join(words[:-1])} and {words[-1]}"


SYSTEM_NAMES = ("MAV_SYSID", "SYSID_THISMAV")
"""The vehicle's system id, by its names in newer and older firmware; likewise the pilot's ground station:"""
GROUND_NAMES = ("MAV_GCS_SYSID", "SYSID_MYGCS")
WANTED = (
    *SYSTEM_NAMES,
    *GROUND_NAMES,
    "FRAME_CONFIG", "SCR_ENABLE", "WKW_ENABLE", "WKW_MODES", "FS_GCS_ENABLE", "FS_PILOT_INPUT",
    "FS_PILOT_TIMEOUT", "ARMING_CHECK", "ARMING_SKIPCHK", "MOT_PWM_TYPE",
    *(f"MOT_{i}_DIRECTION" for i in range(1, 13)),
    *(f"SERVO{i}_FUNCTION" for i in range(1, 17)),
    *BUTTON_PARAMETERS,
)  # fmt: skip
"""Those that `checks.py` looks at; which of them there are depends on the firmware."""
ROUNDS = 6
QUIET_S = 0.6
"""How long nothing may come before what is missing is asked for again."""
_AT_ONCE = 16
_IDLE_ROUNDS = 2
_REAL32 = 9
_NAME = re.compile(r"[A-Z][A-Z0-9_]{0,15}\Z")
Progress = Callable[[float, float], None]


def first_of(parameters: Mapping[str, float], names: Iterable[str]) -> tuple[str, float] | None:
    """Name and value of the first of these that there is."""
    return next(((name, parameters[name]) for name in names if name in parameters), None)


def read_parameters(
    link: MavlinkSession, names: Iterable[str] = WANTED, *, progress: Progress | None = None, quiet_s: float = QUIET_S
) -> dict[str, float]:
    """Ask for parameters by name; those that the firmware does not know are left out.

    A request or an answer may be lost, so what is missing is asked for again, up to `ROUNDS` times in all; two rounds
    that bring nothing are believed.

    Raises
    ------
    EnvironmentFailure
        If the autopilot answers nothing at all.
    """
    wanted = list(dict.fromkeys(names))
    found: dict[str, float] = {}
    idle = 0
    for _ in range(ROUNDS):
        missing, before = [name for name in wanted if name not in found], len(found)
        for start in range(0, len(missing), _AT_ONCE):
            asked = missing[start : start + _AT_ONCE]
            for name in asked:
                _ask(link, name)
            _collect(link, found, quiet_s, asked)
            if progress is not None:
                progress(len(found), len(wanted))
        idle = idle + 1 if len(found) == before else 0
        if idle == _IDLE_ROUNDS or len(found) == len(wanted):
            break
    if not found:
        raise EnvironmentFailure("the autopilot says no parameter: is it the right system id, and does it hear us?")
    return {name: found[name] for name in wanted if name in found}


def read_all_parameters(
    link: MavlinkSession, *, progress: Progress | None = None, quiet_s: float = 2.0 * QUIET_S
) -> dict[str, float]:
    """All parameters of the autopilot: its list, then those that were lost on the way by their index.

    Raises
    ------
    EnvironmentFailure
        If there is no answer, or some are still missing after `ROUNDS` rounds.
    """
    found: dict[str, float] = {}
    indices: set[int] = set()
    count = 0
    link.send("param_request_list", target_system=link.system, target_component=AUTOPILOT_COMPONENT)
    for _ in range(ROUNDS + 1):
        while (answer := link.hear({"PARAM_VALUE"}, quiet_s)) is not None:
            count = max(count, int(answer.param_count))
            # An answer to somebody's request by name carries no index.
            if answer.param_index < count:
                indices.add(int(answer.param_index))
            _keep(found, answer)
            if progress is not None:
                progress(len(indices), count)
            if count and len(indices) >= count:
                return dict(sorted(found.items()))
        for index in [i for i in range(count) if i not in indices][:200]:
            link.send(
                "param_request_read",
                target_system=link.system,
                target_component=AUTOPILOT_COMPONENT,
                param_id=b"",
                param_index=index,
            )
    if not found:
        raise EnvironmentFailure("the autopilot says no parameter: is it the right system id, and does it hear us?")
    raise EnvironmentFailure(f"{count - len(indices)} of {count} parameters never came: the link loses too much")


def set_parameter(link: MavlinkSession, name: str, value: float, *, quiet_s: float = QUIET_S) -> None:
    """Set a parameter and read it back: nothing else says that it was taken.

    Raises
    ------
    InputError
        If the name or value cannot be a parameter's.
    EnvironmentFailure
        If the autopilot does not know it, or holds another value afterwards.
    """
    if not _NAME.match(name) or not math.isfinite(value):
        raise InputError(f"parameter {name} = {value:g}: a name has up to 16 capital letters, a value is finite")
    held: float | None = None
    for _ in range(ROUNDS):
        link.send(
            "param_set",
            target_system=link.system,
            target_component=AUTOPILOT_COMPONENT,
            param_id=name.encode("ascii"),
            param_value=value,
            param_type=_REAL32,
        )
        # The echo of the setting may come before it holds: what counts is the answer to a question put after it.
        _collect(link, {}, 0.1, [name, ""])
        found: dict[str, float] = {}
        _ask(link, name)
        _collect(link, found, quiet_s, [name])
        held = found.get(name, held)
        if held is not None and held == _float32(value):
            return
    if held is None:
        raise EnvironmentFailure(f"{name}: the autopilot does not know it, or does not answer")
    raise EnvironmentFailure(f"{name}: set to {value:g}, and the autopilot still says {held:g}")


def read_parameter_file(path: Path) -> dict[str, float]:
    """Parameters of a file: QGroundControl's, Mission Planner's, MAVProxy's or that of `wakewise link log`.

    Raises
    ------
    InputError
        If there is no such file, a line is none of theirs, or it names no parameter.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as fault:
        raise InputError(f"{path}: {fault.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: no text; a parameter file has lines such as SCR_ENABLE,1") from None
    found: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words or words == ["name", "value"]:
            continue
        # QGroundControl: vehicle id, component id, name, value, type.
        name, value = words[2:4] if len(words) == 5 else (words if len(words) == 2 else ("", ""))
        if not _NAME.match(name) or not _is_number(value):
            raise InputError(f"{path}, line {number}: {line.strip()[:60]!r} is no parameter; right is SCR_ENABLE,1")
        found[name] = float(value)
    if not found:
        raise InputError(f"{path}: names no parameter; a line is such as SCR_ENABLE,1")
    return found


def _ask(link: MavlinkSession, name: str) -> None:
    link.send(
        "param_request_read",
        target_system=link.system,
        target_component=AUTOPILOT_COMPONENT,
        param_id=name.encode("ascii"),
        param_index=-1,
    )


def _collect(link: MavlinkSession, found: dict[str, float], quiet_s: float, wanted: list[str]) -> None:
    """Take answers until all are there or none comes for a while; never for longer than ten such whiles."""
    until = time.monotonic() + 10.0 * quiet_s
    while time.monotonic() < until and not all(name in found for name in wanted):
        answer = link.hear({"PARAM_VALUE"}, quiet_s)
        if answer is None:
            return
        _keep(found, answer)


def _keep(found: dict[str, float], answer: Any) -> None:
    name = answer.param_id.decode("ascii", "replace") if isinstance(answer.param_id, bytes) else str(answer.param_id)
    name = name.partition("\0")[0]
    if _NAME.match(name) and math.isfinite(answer.param_value):
        found[name] = float(answer.param_value)


def _float32(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def _is_number(value: str) -> bool:
    try:
        return math.isfinite(float(value))
    except ValueError:
        return False
