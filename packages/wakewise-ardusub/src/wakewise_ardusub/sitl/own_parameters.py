"""Parameters of the simulated autopilot: default values, .params files, and tables that a script adds.

Names and values are those of ArduSub's parameter documentation; gains of the attitude are those of its frame parameters
of the BlueROV2 Heavy. A .params file replaces single values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from wakewise.core.errors import InputError
from wakewise_ardusub.link.parameters import DEFAULT, parameters_of

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
        "PSC_POSXY_P": 1.0,
        "PSC_VELXY_P": 1.0,
        "PSC_VELXY_I": 0.5,
        "PSC_VELXY_IMAX": 1000,
        "WPNAV_SPEED": 50,
        "PSC_POSZ_P": 3.0,
        "PSC_VELZ_P": 8.0,
        "PSC_ACCZ_P": 0.5,
        "PSC_ACCZ_I": 0.1,
        "PSC_ACCZ_IMAX": 100,
        "BATT_CAPACITY": 18000,
        "MNT1_TYPE": 1,
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


LONGEST_NAME = 16
MOST = 4000
"""More than the firmware has; a script that adds without end is stopped here."""


class ParameterTable:
    """Values by name, in the order of the names, as 32-bit floats like the firmware's.

    Names that release 4.7 changed (SYSID_THISMAV to MAV_SYSID) are whatever the values given say.
    """

    def __init__(self, values: Mapping[str, float]) -> None:
        self._values: dict[str, float] = {}
        for name, value in values.items():
            self._values[name] = _single(value)
        self._tables: dict[int, tuple[str, int]] = {}
        self._sort()

    def __len__(self) -> int:
        """How many there are."""
        return len(self._values)

    def __iter__(self) -> Iterator[str]:
        """Names, in their order."""
        return iter(self._names)

    def get(self, name: str) -> float | None:
        """A value, or None where there is no such parameter."""
        return self._values.get(name)

    def value(self, *names: str, otherwise: float) -> float:
        """The value of the first of these names that there is."""
        return next((self._values[name] for name in names if name in self._values), otherwise)

    def set(self, name: str, value: float) -> bool:
        """Set one; False where there is no such parameter or the value is no number."""
        if name not in self._values or not math.isfinite(value):
            return False
        self._values[name] = _single(value)
        return True

    def at(self, index: int) -> str | None:
        """Name at a place of the list."""
        return self._names[index] if 0 <= index < len(self._names) else None

    def index(self, name: str) -> int:
        """Place in the list."""
        return self._places[name]

    def add_table(self, key: int, prefix: str, count: int) -> bool:
        """Reserve a table for a script; False where its key is another prefix's, or the numbers make no sense."""
        if not (0 <= key <= 200 and 0 < count <= 63 and 0 < len(prefix) < LONGEST_NAME):
            return False
        if self._tables.get(key, (prefix, 0))[0] != prefix:
            return False
        self._tables[key] = (prefix, count)
        return True

    def add_param(self, key: int, index: int, name: str, value: float) -> bool:
        """Add one to a table; one that is there keeps its value."""
        if key not in self._tables or not 1 <= index <= self._tables[key][1] or len(self._values) >= MOST:
            return False
        full = self._tables[key][0] + name
        if len(full) > LONGEST_NAME or not math.isfinite(value):
            return False
        self._values.setdefault(full, _single(value))
        self._sort()
        return True

    def forget_tables(self) -> None:
        """What a start does: tables are reserved anew; values stay."""
        self._tables.clear()

    def _sort(self) -> None:
        self._names = sorted(self._values)
        self._places = {name: place for place, name in enumerate(self._names)}


def _single(value: float) -> float:
    return float(np.float32(value))
