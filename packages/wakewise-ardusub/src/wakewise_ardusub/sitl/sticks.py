"""The pilot's sticks, as MANUAL_CONTROL says them, to demands.

A stick's way becomes a pulse of 1500 us plus up to 400 times the gain (JS_GAIN_DEFAULT), so a demand is the stick times
the gain. The last sticks go on until the failsafe of the pilot's input says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

STICK_FULL = 1000.0
THROTTLE_MIDDLE = 500.0
_EXTENSIONS_PITCH, _EXTENSIONS_ROLL = 1, 2


@dataclass(frozen=True, kw_only=True)
class PilotDemands:
    """What is asked of the mixer, each in [-1, 1]; forward, right and up are positive."""

    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    throttle: float = 0.0
    forward: float = 0.0
    lateral: float = 0.0


def demands_of(
    x: int, y: int, z: int, r: int, *, pitch: int = 0, roll: int = 0, extensions: int = 0, gain: float, throttle: float
) -> PilotDemands:
    """Demands of MANUAL_CONTROL's numbers at a gain, and at one of the throttle on top; numbers out of range count as
    the end of their range.
    """
    return PilotDemands(
        roll=_share(roll) * gain if extensions & _EXTENSIONS_ROLL else 0.0,
        pitch=_share(pitch) * gain if extensions & _EXTENSIONS_PITCH else 0.0,
        yaw=_share(r) * gain,
        throttle=max(-1.0, min(1.0, (max(0, min(1000, z)) - THROTTLE_MIDDLE) / THROTTLE_MIDDLE)) * gain * throttle,
        forward=_share(x) * gain,
        lateral=_share(y) * gain,
    )


def _share(value: int) -> float:
    return max(-1.0, min(1.0, value / STICK_FULL))
