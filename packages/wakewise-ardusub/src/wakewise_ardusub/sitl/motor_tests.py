"""MAV_CMD_DO_MOTOR_TEST as ArduSub has it: one motor's pulse, past the mixer, for as long as it is asked for again.

By what its motors.cpp does: armed only; motors are counted from 0 and keep their pulse until they get another; half a
second without a command ends the test and disarms; none begins within ten seconds of that, nor within two of a refusal.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from wakewise_ardusub.link.protocol import MIDDLE_US

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
