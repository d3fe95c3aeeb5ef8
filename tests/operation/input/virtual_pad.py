"""A gamepad that SDL believes in, moved by tests: its virtual joystick, through the library that pygame-ce brings."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from pathlib import Path

import pytest

FULL = 32767


def sdl() -> ctypes.CDLL:
    """SDL itself; skips where pygame-ce, or its own copy of it, is not there."""
    pygame = pytest.importorskip("pygame", reason="needs the extra gamepad (pygame-ce)")
    found = sorted((Path(pygame.__file__).parents[1] / "pygame_ce.libs").glob("libSDL2-2*"))
    if not found:
        pytest.skip("this pygame-ce does not bring its SDL as a file")
    library = ctypes.CDLL(str(found[0]))
    library.SDL_JoystickOpen.restype = ctypes.c_void_p
    library.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
    library.SDL_JoystickSetVirtualAxis.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int16]
    library.SDL_JoystickSetVirtualButton.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_uint8]
    library.SDL_JoystickGetDeviceInstanceID.restype = ctypes.c_int32
    return library


class VirtualPad:
    """Plugged in when made, of a kind that SDL knows (6 axes, 16 buttons) or not, with axes held over or none."""

    def __init__(self, known: bool = True, axes: int = 6, buttons: int = 16, held: dict[int, float] | None = None):
        self._sdl = sdl()
        self._sdl.SDL_LockJoysticks()  # so that whoever looks for pads finds it as it is held
        try:
            index = self._sdl.SDL_JoystickAttachVirtual(1 if known else 0, axes, buttons, 1)
            assert index >= 0, "SDL made no virtual joystick"
            self._number = self._sdl.SDL_JoystickGetDeviceInstanceID(index)
            if held:
                assert self._sdl.SDL_JoystickOpen(index)
                for number, share in held.items():
                    self.axis(number, share)
        finally:
            self._sdl.SDL_UnlockJoysticks()

    def axis(self, number: int, share: float) -> None:
        """Move an axis, -1 to 1."""
        self._sdl.SDL_JoystickSetVirtualAxis(self._stick(), number, int(share * FULL))

    def button(self, number: int, down: bool) -> None:
        """Press a button, or let it go."""
        self._sdl.SDL_JoystickSetVirtualButton(self._stick(), number, int(down))

    def unplug(self) -> None:
        """Pull it out."""
        for index in range(self._sdl.SDL_NumJoysticks()):
            if self._sdl.SDL_JoystickGetDeviceInstanceID(index) == self._number:
                assert self._sdl.SDL_JoystickDetachVirtual(index) == 0
                return
        raise AssertionError("not plugged in")

    def _stick(self) -> ctypes.c_void_p:
        stick = self._sdl.SDL_JoystickFromInstanceID(self._number)
        assert stick, "nobody has opened it"
        return ctypes.c_void_p(stick)


def until(true: Callable[[], bool], patience_s: float = 5.0) -> None:
    """Wait until it is true."""
    end_s = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < end_s, "did not come about"
        time.sleep(0.005)
