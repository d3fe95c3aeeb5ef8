"""The servo outputs: what the motors ask for, unless a script has put something over it for a while.

An override counts loops, not time, and goes on when the vehicle is disarmed, as the firmware's does: a script that
drives motors must itself see to that.
"""

from __future__ import annotations

import math

from wakewise_ardusub.link.protocol import FIRST_FUNCTION, MIDDLE_US
from wakewise_ardusub.sitl.parameters import ParameterTable

OUTPUTS = 16
LATER_FUNCTION = 82
"""SERVOn_FUNCTION of motor 9; motor 1 has `FIRST_FUNCTION`."""
_MOST_LOOPS = 65535
_DISABLED = 0


class ServoOutputs:
    """16 outputs and the overrides on them."""

    def __init__(self, loop_hz: float) -> None:
        self._loop_hz = loop_hz
        self._left = [0] * OUTPUTS
        self._override_us = [0] * OUTPUTS

    @property
    def overridden(self) -> tuple[bool, ...]:
        """On which outputs an override acts now."""
        return tuple(left > 0 for left in self._left)

    def override(self, channel: int, pulse_us: int, timeout_ms: int) -> None:
        """Put a pulse on an output, numbered from 0, for so long; 0 ms ends one that runs. Others are ignored."""
        if 0 <= channel < OUTPUTS:
            loops = math.ceil(max(timeout_ms, 0) * 1e-3 * self._loop_hz)
            self._left[channel] = min(loops, _MOST_LOOPS)
            self._override_us[channel] = max(0, min(65535, pulse_us))

    def step(self, motors_us: list[int] | None, parameters: ParameterTable) -> tuple[int, ...]:
        """Pulses of all outputs in this loop; `motors_us` is of each motor, None while disarmed."""
        pulses = []
        for channel in range(OUTPUTS):
            if self._left[channel] > 0:
                self._left[channel] -= 1
                pulses.append(self._override_us[channel])
                continue
            motor = motor_of(function_of(parameters, channel))
            if motor is None:
                pulses.append(0)
            elif motors_us is None or motor >= len(motors_us):
                pulses.append(MIDDLE_US)
            else:
                pulses.append(motors_us[motor])
        return tuple(pulses)


def function_of(parameters: ParameterTable, channel: int) -> int:
    """SERVOn_FUNCTION of an output, numbered from 0."""
    return round(parameters.value(f"SERVO{channel + 1}_FUNCTION", otherwise=_DISABLED))


def find_channel(parameters: ParameterTable, function: int) -> int | None:
    """First output, numbered from 0, with a function."""
    return next((c for c in range(OUTPUTS) if function_of(parameters, c) == function), None)


def motor_of(function: int) -> int | None:
    """Motor, numbered from 0, of an output's function; None where it is no motor's."""
    if FIRST_FUNCTION <= function < FIRST_FUNCTION + 8:
        return function - FIRST_FUNCTION
    if LATER_FUNCTION <= function < LATER_FUNCTION + 4:
        return function - LATER_FUNCTION + 8
    return None
