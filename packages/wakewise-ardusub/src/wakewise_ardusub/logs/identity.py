"""What a vehicle is by its own words: the type in its heartbeats, the name of its firmware, parameters of one alone.

Tables of ArduSub (its modes, its channels, its motors) are used for nothing else than an ArduSub.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

SUBMARINE, ARDUPILOT = 12, 3
"""MAV_TYPE and MAV_AUTOPILOT of an ArduSub."""
NO_AUTOPILOT = 8
"""MAV_AUTOPILOT of what is no vehicle: ground stations, cameras, companions."""
_ARDUSUB = "ArduSub"
_FIRMWARE = re.compile(
    r"(?:APM:?\s*)?(ArduSub|Sub|ArduCopter|Copter|ArduPlane|Plane|ArduRover|Rover2?|Blimp|Heli|AntennaTracker)\s+V?\d",
    re.IGNORECASE,
)
_ONLY_ARDUSUB = re.compile(r"MOT_\d+_DIRECTION\Z|JS_GAIN_DEFAULT\Z")


@dataclass(frozen=True, kw_only=True)
class VehicleIdentity:
    """MAV_TYPE and MAV_AUTOPILOT of the heartbeats, or the firmware's name; None where nothing says it."""

    mav_type: int | None = None
    autopilot: int | None = None
    firmware: str | None = None

    @property
    def is_known(self) -> bool:
        """Whether anything said what the vehicle is."""
        return self.mav_type is not None or self.firmware is not None

    @property
    def is_ardusub(self) -> bool:
        """Whether it is a submarine that ArduPilot steers."""
        if self.mav_type is not None:
            return (self.mav_type, self.autopilot) == (SUBMARINE, ARDUPILOT)
        return self.firmware == _ARDUSUB

    @property
    def is_other(self) -> bool:
        """Whether it is known to be another vehicle."""
        return self.is_known and not self.is_ardusub

    @property
    def words(self) -> str:
        """For people, such as "ArduSub" or "octorotor of ArduPilot (heartbeat type 14)"."""
        if self.is_ardusub:
            return _ARDUSUB
        if self.mav_type is None:
            return self.firmware or "not said"
        maker = "ArduPilot" if self.autopilot == ARDUPILOT else _name("MAV_AUTOPILOT", self.autopilot)
        return f"{_name('MAV_TYPE', self.mav_type)} of {maker} (heartbeat type {self.mav_type})"


def firmware_of(text: str) -> str | None:
    """Name of the ArduPilot firmware that a message of the autopilot begins with, such as "ArduSub V4.1.0 (f2af)"."""
    found = _FIRMWARE.match(text.strip())
    if found is None:
        return None
    name = found[1]
    return _ARDUSUB if name.lower() in ("ardusub", "sub") else name


def firmware_of_parameters(names: Iterable[str]) -> str | None:
    """ArduSub if a parameter is there that no other firmware has."""
    return _ARDUSUB if any(_ONLY_ARDUSUB.match(name) for name in names) else None


def enumerated(enum: str, value: Any) -> int:
    """Number of an enumeration's value, which BlueOS's JSON has in words or as an object with `type`.

    Raises
    ------
    KeyError, TypeError, ValueError
        If it is none.
    """
    if isinstance(value, Mapping):
        value = value["type"]
    if isinstance(value, str):
        from pymavlink.dialects.v20 import ardupilotmega

        numbers: dict[str, int] = {entry.name: number for number, entry in ardupilotmega.enums[enum].items()}
        return numbers[value]
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError
    return value


def _name(enum: str, number: int | None) -> str:
    """An enumeration's value in small letters."""
    from pymavlink.dialects.v20 import ardupilotmega

    entry = ardupilotmega.enums[enum].get(number)
    if entry is None:
        return f"type {number}" if enum == "MAV_TYPE" else f"autopilot {number}"
    return str(entry.name.removeprefix(f"{enum}_").lower().replace("_", " "))
