"""What happens when the ground station or the pilot falls silent while the vehicle is armed."""

from __future__ import annotations

from typing import Literal

from wakewise_ardusub.sitl.parameters import ParameterTable

Action = Literal["none", "warn", "disarm", "hold depth", "surface"]

_GCS: dict[int, Action] = {0: "none", 1: "warn", 2: "disarm", 3: "hold depth", 4: "surface"}
_PILOT: dict[int, Action] = {0: "none", 1: "warn", 2: "disarm"}


def ground_station(parameters: ParameterTable, heard_s: float | None, now_s: float) -> Action:
    """What FS_GCS_ENABLE asks for: nothing while a heartbeat is fresh, or if there was never one."""
    if heard_s is None or now_s - heard_s <= parameters.value("FS_GCS_TIMEOUT", otherwise=3.0):
        return "none"
    return _GCS.get(round(parameters.value("FS_GCS_ENABLE", otherwise=2.0)), "disarm")


def pilot_input(parameters: ParameterTable, heard_s: float | None, now_s: float) -> Action:
    """What FS_PILOT_INPUT asks for: nothing while sticks are fresh. Sticks that never came are silent ones."""
    if heard_s is not None and now_s - heard_s <= parameters.value("FS_PILOT_TIMEOUT", otherwise=3.0):
        return "none"
    return _PILOT.get(round(parameters.value("FS_PILOT_INPUT", otherwise=2.0)), "disarm")
