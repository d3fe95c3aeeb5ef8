"""What the pilot's buttons do, by BTNn_FUNCTION and, while a shift button is held, by BTNn_SFUNCTION.

As ArduSub does it: a button acts as it goes down, and for a tenth of a second after one has acted the others are not
looked at. Arming, disarming, modes and shift are here; mount, lights, gain, trim, relays and servos are not.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from wakewise.links.ardusub.buttons import (
    ARM,
    ARM_TOGGLE,
    BUTTONS,
    DISARM,
    MODE_FUNCTIONS,
    NONE,
    SHIFT,
    parameters_of,
)
from wakewise.links.autopilot.parameters import ParameterTable

if TYPE_CHECKING:
    from wakewise.links.autopilot.stand_in import StandIn

DEBOUNCE_S = 0.1


class Joystick:
    """Remembers which buttons are down."""

    def __init__(self) -> None:
        self._before, self._acted_s = 0, -math.inf

    def take(self, board: StandIn, buttons: int) -> None:
        """Buttons as bits, as the last sticks have them."""
        if board.now_s - self._acted_s <= DEBOUNCE_S:
            return
        down = [button for button in range(BUTTONS) if buttons & 1 << button]
        shifted = any(_function(board.parameters, button, shifted=False) == SHIFT for button in down)
        for button in down:
            self._acted_s = board.now_s
            if not self._before & 1 << button:
                _act(board, _function(board.parameters, button, shifted=shifted))
        self._before = buttons


def can_disarm(parameters: ParameterTable) -> bool:
    """Whether some button disarms: without one ArduSub refuses to arm, whatever ARMING_CHECK says."""
    functions = {
        _function(parameters, button, shifted=shifted) for button in range(BUTTONS) for shifted in (False, True)
    }
    return bool(functions & {ARM_TOGGLE, DISARM})


def _function(parameters: ParameterTable, button: int, *, shifted: bool) -> int:
    return round(parameters.value(parameters_of(button)[shifted], otherwise=NONE))


def _act(board: StandIn, function: int) -> None:
    if function == ARM or (function == ARM_TOGGLE and not board.armed):
        board.arm()
    elif function in (DISARM, ARM_TOGGLE):
        board.disarm("button")
    elif function in MODE_FUNCTIONS:
        board.set_mode(MODE_FUNCTIONS[function])
