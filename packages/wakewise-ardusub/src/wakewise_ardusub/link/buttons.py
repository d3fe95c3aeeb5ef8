"""What ArduSub itself does at a button of the pilot's sticks: BTNn_FUNCTION, and BTNn_SFUNCTION while shift is held.

A button that means something to the companion must mean nothing to the autopilot: both hear the same MANUAL_CONTROL.
Numbers and names as ArduSub's parameter documentation has them, the table of a fresh autopilot as its `joystick.cpp`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

BUTTONS = 16
"""Buttons of MANUAL_CONTROL's first field, counted from 0."""
NONE, SHIFT, ARM_TOGGLE, ARM, DISARM = 0, 1, 2, 3, 4
MODE_FUNCTIONS: dict[int, int] = {5: 19, 6: 0, 7: 2, 8: 16, 9: 3, 10: 7, 11: 4, 12: 1, 13: 21}
"""Functions that set a mode, and ArduSub's number of the mode."""
CAMERA_TRIGGER = 24
FUNCTIONS: dict[int, str] = {
    NONE: "none", SHIFT: "shift", ARM_TOGGLE: "arm or disarm", ARM: "arm", DISARM: "disarm", 5: "mode MANUAL",
    6: "mode STABILIZE", 7: "mode ALT_HOLD", 8: "mode POSHOLD", 9: "mode AUTO", 10: "mode CIRCLE", 11: "mode GUIDED",
    12: "mode ACRO", 13: "mode SURFTRAK", 21: "mount to the centre", 22: "mount up", 23: "mount down",
    CAMERA_TRIGGER: "camera trigger", 25: "camera source", 26: "mount right", 27: "mount left", 31: "lights 1",
    32: "lights 1 brighter", 33: "lights 1 dimmer", 34: "lights 2", 35: "lights 2 brighter", 36: "lights 2 dimmer",
    41: "gain", 42: "more gain", 43: "less gain", 44: "roll trim up", 45: "roll trim down", 46: "pitch trim up",
    47: "pitch trim down", 48: "input hold", 49: "roll and pitch by the sticks",
}  # fmt: skip
_IDLE = frozenset({NONE, *range(91, 97)})
"""Functions at which ArduSub does nothing: none, and those for a firmware of one's own."""
DEFAULT: tuple[tuple[int, int], ...] = (
    (0, 0), (5, 0), (7, 0), (6, 0), (DISARM, 0), (SHIFT, 0), (ARM, 0), (21, 0),
    (48, 0), (23, 27), (22, 26), (42, 47), (43, 46), (33, 45), (32, 44), (0, 0),
)  # fmt: skip
"""BTNn_FUNCTION and BTNn_SFUNCTION of each button on an autopilot on which nobody has changed them."""


def parameters_of(button: int) -> tuple[str, str]:
    """Names of a button's two parameters."""
    return f"BTN{button}_FUNCTION", f"BTN{button}_SFUNCTION"


BUTTON_PARAMETERS = tuple(name for button in range(BUTTONS) for name in parameters_of(button))


def conflict(button: int, what: str, parameters: Mapping[str, float]) -> str:
    """What the autopilot does at a button that is to mean `what` here, in words; empty where it does nothing.

    A parameter that is not known counts as no function. A photograph may trigger the autopilot's camera, too.
    """
    harmless = _IDLE | {CAMERA_TRIGGER} if what == "capture" else _IDLE
    for name in parameters_of(button):
        function = round(parameters.get(name, NONE))
        if function not in harmless:
            return f"{name} is {function} ({FUNCTIONS.get(function, 'a function of the autopilot')})"
    return ""


def free_buttons(parameters: Mapping[str, float]) -> list[int]:
    """Buttons at which the autopilot is known to do nothing."""
    return [
        button
        for button in range(BUTTONS)
        if all(name in parameters for name in parameters_of(button)) and not conflict(button, "", parameters)
    ]


def button_faults(buttons: Mapping[str, int], parameters: Mapping[str, float]) -> str:
    """The first of the companion's buttons at which the autopilot acts as well, in words; empty where there is none."""
    for what, button in buttons.items():
        words = conflict(button, what, parameters)
        if words:
            return f"--buttons {what}={button}: {words} on this autopilot; {free_words(parameters, buttons)}"
    return ""


def free_words(parameters: Mapping[str, float], buttons: Mapping[str, int] | None = None) -> str:
    """Which buttons are free and not yet given, in words."""
    free = [button for button in free_buttons(parameters) if button not in (buttons or {}).values()]
    if not free:
        return (
            "none is free: set BTNn_FUNCTION and BTNn_SFUNCTION of one that you do not need to 0, not those of disarm"
        )
    return f"free {'is' if len(free) == 1 else 'are'} {_listed(free)}"


def _listed(numbers: Iterable[int]) -> str:
    words = [str(number) for number in numbers]
    return ", ".join(words) if len(words) < 2 else f"{', '.join(words[:-1])} and {words[-1]}"
