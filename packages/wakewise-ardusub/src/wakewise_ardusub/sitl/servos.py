"""Servo outputs of the simulated autopilot: motor pulses, overrides by a script, and the motor test.

An override is counted in loops and persists when the vehicle is disarmed, as in the firmware: a script that drives
motors must check arming itself.

MAV_CMD_DO_MOTOR_TEST as in ArduSub's motors.cpp: armed only; motors are counted from 0 and keep their pulse, past the
mixer, until they get another; half a second without a command ends the test and disarms; none begins within ten seconds
of that, nor within two of a refusal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from wakewise_ardusub.link.protocol import FIRST_FUNCTION, MIDDLE_US
from wakewise_ardusub.sitl.own_parameters import ParameterTable

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


SILENT_S, COOL_S, AGAIN_S = 0.5, 10.0, 2.0
_PERCENT, _PULSE = 0, 1
_BOARD_ORDER = 2
_LEAST_US, _MOST_US = 1100.0, 1900.0
_CRITICAL, _WARNING = 2, 4
Say = Callable[[int, str], None]


class MotorTest:
    """Which pulses a test asks for now, if one runs.

    Parameters
    ----------
    motors : int
        How many there are.
    """

    def __init__(self, motors: int) -> None:
        self.pulses_us: list[int] | None = None
        """Of each motor while a test runs."""
        self._motors = motors
        self._asked_s = 0.0
        self._ended_s: float | None = None
        self._refused_s: float | None = None

    def ask(self, numbers: Sequence[float], now_s: float, armed: bool, say: Say) -> bool:
        """A command with its first six numbers; whether a motor was given a pulse."""
        self._asked_s = now_s
        if self.pulses_us is None and not self._begun(now_s, armed, say):
            return False
        if not all(map(math.isfinite, numbers)):
            return False
        motor, by, throttle, order = int(numbers[0]), numbers[1], numbers[2], numbers[5]
        if order != _BOARD_ORDER:
            say(_WARNING, f"bad test type {order:.2f}")
            return False
        if by == _PERCENT:
            throttle = _LEAST_US + 1e-2 * min(max(throttle, 0.0), 100.0) * (_MOST_US - _LEAST_US)
        elif by != _PULSE:
            say(_WARNING, f"bad throttle type {by:.2f}")
            return False
        if self.pulses_us is None or not 0 <= motor < self._motors:
            return False
        self.pulses_us[motor] = round(min(max(throttle, 0.0), 65535.0))
        return True

    def over(self, now_s: float) -> bool:
        """Whether a test that ran has just ended, because nobody asked for it any more."""
        if self.pulses_us is None or now_s <= self._asked_s + SILENT_S:
            return False
        self.pulses_us, self._ended_s = None, now_s
        return True

    def _begun(self, now_s: float, armed: bool, say: Say) -> bool:
        if self._refused_s is not None and now_s <= self._refused_s + AGAIN_S:
            return False
        if self._ended_s is not None and now_s < self._ended_s + COOL_S:
            say(_CRITICAL, "10 second cooldown required after motor test")
        elif not armed:
            say(_WARNING, "Arm motors before testing motors.")
        else:
            self.pulses_us = [MIDDLE_US] * self._motors
            return True
        say(_WARNING, "motor test initialization failed!")
        self._refused_s = now_s
        return False
