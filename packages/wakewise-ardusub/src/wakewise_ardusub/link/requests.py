"""What the companion asks the autopilot to send, and how often: ground stations set rates of a few a second."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from wakewise_ardusub.link.protocol import AUTOPILOT_COMPONENT

SET_MESSAGE_INTERVAL = 511
RATES_HZ: dict[int, tuple[str, float]] = {
    30: ("ATTITUDE", 50.0),
    32: ("LOCAL_POSITION_NED", 20.0),
    27: ("RAW_IMU", 50.0),
    36: ("SERVO_OUTPUT_RAW", 20.0),
    74: ("VFR_HUD", 10.0),
    1: ("SYS_STATUS", 2.0),
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
