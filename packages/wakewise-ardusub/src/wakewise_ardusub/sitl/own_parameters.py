"""The stand-in's own parameters: those of a vehicle as it leaves the box, as far as anything here reads them.

Names and values as ArduSub's parameter documentation has them, gains of the attitude as in its frame parameters of the
BlueROV2 Heavy. Other sets are read from `.params` files, which replace these value by value.
"""

from __future__ import annotations

import math
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise_ardusub.link.buttons import DEFAULT, parameters_of

FRAME_VECTORED, FRAME_VECTORED_6DOF = 1, 2
"""FRAME_CONFIG of six and of eight motors."""
_LONGEST_NAME = 16


def own_parameters(motors: int = 8) -> dict[str, float]:
    """Values by name for six or eight motors.

    Raises
    ------
    InputError
        If ArduSub has no vectored frame of so many.
    """
    frames = {6: FRAME_VECTORED, 8: FRAME_VECTORED_6DOF}
    if motors not in frames:
        raise InputError(f"stand-in: {motors} thrusters, ArduSub's vectored frames have 6 or 8")
    values: dict[str, float] = {
        "SYSID_THISMAV": 1,
        "SYSID_MYGCS": 255,
        "FRAME_CONFIG": frames[motors],
        "ARMING_CHECK": 1,
        "ANGLE_MAX": 4500,
        "ACRO_YAW_P": 3.375,
        "PILOT_SPEED_UP": 50,
        "THR_DZ": 100,
        "JS_GAIN_DEFAULT": 0.5,
        "JS_THR_GAIN": 1.0,
        "FS_GCS_ENABLE": 2,
        "FS_GCS_TIMEOUT": 3.0,
        "FS_PILOT_INPUT": 2,
        "FS_PILOT_TIMEOUT": 3.0,
        "ATC_ANG_RLL_P": 6.0,
        "ATC_ANG_PIT_P": 6.0,
        "ATC_ANG_YAW_P": 6.0,
        "ATC_RAT_RLL_P": 0.135,
        "ATC_RAT_RLL_I": 0.09,
        "ATC_RAT_RLL_D": 0.0036,
        "ATC_RAT_RLL_IMAX": 0.444,
        "ATC_RAT_PIT_P": 0.135,
        "ATC_RAT_PIT_I": 0.09,
        "ATC_RAT_PIT_D": 0.0036,
        "ATC_RAT_PIT_IMAX": 0.444,
        "ATC_RAT_YAW_P": 0.18,
        "ATC_RAT_YAW_I": 0.018,
        "ATC_RAT_YAW_D": 0.0,
        "ATC_RAT_YAW_IMAX": 0.222,
        "PSC_POSZ_P": 3.0,
        "PSC_VELZ_P": 8.0,
        "PSC_ACCZ_P": 0.5,
        "PSC_ACCZ_I": 0.1,
        "PSC_ACCZ_IMAX": 100,
        "BATT_CAPACITY": 18000,
        "SCHED_LOOP_RATE": 400,
        "SCR_ENABLE": 1,
        "SCR_HEAP_SIZE": 204800,
        "SCR_VM_I_COUNT": 10000,
    }
    for i in range(1, motors + 1):
        values[f"MOT_{i}_DIRECTION"] = 1
    for button, functions in enumerate(DEFAULT):
        values |= dict(zip(parameters_of(button), functions, strict=True))
    for i in range(1, 17):
        values[f"SERVO{i}_FUNCTION"] = 32 + i if i <= motors else 0
        values |= {f"SERVO{i}_MIN": 1100, f"SERVO{i}_MAX": 1900, f"SERVO{i}_TRIM": 1500, f"SERVO{i}_REVERSED": 0}
    return values


def read_params(path: Path) -> dict[str, float]:
    """Values by name of a `.params` or `.parm` file: a name and a number on each line, comma or space between.

    Raises
    ------
    InputError
        If the file cannot be read or a line is something else; the line is named.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as fault:
        raise InputError(f"{path}: {getattr(fault, 'strerror', None) or 'is no text'}") from None
    found: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        # QGroundControl's files have system, component, name, value, type.
        name, value = (words[2], words[3]) if len(words) == 5 else (words[0], words[1] if len(words) == 2 else "")
        try:
            found[name] = float(value)
        except ValueError:
            raise InputError(f"{path}, line {number}: {line.strip()!r}, must be a name and a number") from None
        if len(name) > _LONGEST_NAME or not math.isfinite(found[name]):
            raise InputError(f"{path}, line {number}: {line.strip()!r}, names have up to 16 letters, values are finite")
    if not found:
        raise InputError(f"{path}: holds no parameter")
    return found
