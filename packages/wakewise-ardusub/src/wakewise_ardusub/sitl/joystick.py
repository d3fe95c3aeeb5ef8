"""What the pilot's buttons do, by BTNn_FUNCTION and, while a shift button is held, by BTNn_SFUNCTION.

Arming, disarming, modes and shift are here; mount, lights, gain, trim, input hold, relays and servos are not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from wakewise_ardusub.link.buttons import (
    ARM,
    ARM_TOGGLE,
    BUTTONS,
    DISARM,
    MODE_FUNCTIONS,
    NONE,
    SHIFT,
    parameters_of,
)
from wakewise_ardusub.sitl.parameters import ParameterTable

if TYPE_CHECKING:
    from wakewise_ardusub.sitl.simulated_autopilot import SimulatedAutopilot


class ButtonHandler:
    """Remembers which buttons are down: one acts as it goes down."""

    def __init__(self) -> None:
        self._before = 0

    def take(self, board: SimulatedAutopilot, buttons: int) -> None:
        """Buttons as bits, as the last sticks have them."""
        pressed, self._before = buttons & ~self._before, buttons
        if not pressed:
            return
        shifted = any(buttons & 1 << b and _function(board.parameters, b) == SHIFT for b in range(BUTTONS))
        for button in range(BUTTONS):
            if pressed & 1 << button:
                _act(board, _function(board.parameters, button, shifted=shifted))


def can_disarm(parameters: ParameterTable) -> bool:
    """Whether some button disarms: without one ArduSub refuses to arm, whatever ARMING_CHECK says."""
    plain = {_function(parameters, button) for button in range(BUTTONS)}
    shifted = {_function(parameters, button, shifted=True) for button in range(BUTTONS)} if SHIFT in plain else set()
    return bool((plain | shifted) & {ARM_TOGGLE, DISARM})


def _function(parameters: ParameterTable, button: int, *, shifted: bool = False) -> int:
    return round(parameters.value(parameters_of(button)[shifted], otherwise=NONE))


def _act(board: SimulatedAutopilot, function: int) -> None:
    if function == ARM or (function == ARM_TOGGLE and not board.armed):
        board.arm()
    elif function in (DISARM, ARM_TOGGLE):
        board.disarm("button")
    elif function in MODE_FUNCTIONS:
        board.set_mode(MODE_FUNCTIONS[function])
