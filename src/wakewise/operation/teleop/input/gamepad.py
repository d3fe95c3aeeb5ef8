"""A gamepad by SDL: the only module that uses SDL.

SDL runs in its own thread, which polls the gamepad at 100 Hz. So a slow driver, or a gamepad that is plugged in, does
not delay the flight: `read` returns the last state. No window is opened.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.optional_dependencies import need
from wakewise.operation.teleop.input.controls import Controls
from wakewise.operation.teleop.input.pad_mapping import BUTTONS, STICKS, PadMapping, PadState

EVERY_S = 0.01
STALE_S = 0.3
"""A pad of which nothing was heard for so long is not there; as the cockpit's page."""
_FULL = 32767.0
_SDL = {
    "SDL_VIDEODRIVER": "dummy",
    "SDL_AUDIODRIVER": "dummy",
    "SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": "1",
    "SDL_NO_SIGNAL_HANDLERS": "1",
    "PYGAME_HIDE_SUPPORT_PROMPT": "1",
}


class Gamepad:
    """A `ControlSource` that is a gamepad, whichever is plugged in; use it in a `with` statement.

    There are no inputs (None) without a gamepad, and after it is plugged in until its sticks were centred once, so that
    a deflected stick has no effect. Buttons that are held then have no effect until they are pressed again.

    `mapping`: a pad that it is not for is left alone, and that is said.

    Raises MissingExtra without the extra `gamepad`.
    """

    def __init__(self, mapping: PadMapping | None = None) -> None:
        need("a gamepad", "gamepad")
        self._mapping = mapping or PadMapping()
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._first_look = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="gamepad", daemon=True)
        self._pad: _Pad | None = None
        self._refused: dict[int, str] = {}
        self._armed = False
        self._axes = np.zeros(5)
        self._held: frozenset[str] = frozenset()
        self._pressed: deque[str] = deque(maxlen=20)
        self._notes: deque[tuple[str, str]] = deque(maxlen=50)
        self._heard_s = -np.inf

    def __enter__(self) -> Gamepad:
        self._thread.start()
        self._first_look.wait(5.0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join(2.0)

    @property
    def name(self) -> str | None:
        """What the pad calls itself; None while there is none."""
        pad = self._pad
        return None if pad is None else pad.name

    def check(self) -> None:
        """Refuse to begin with a pad that the mapping is not for, where that is all there is.

        Raises InputError, naming pad and mapping.
        """
        if self._pad is None and self._refused:
            raise InputError(next(iter(self._refused.values())))

    def notes(self) -> tuple[tuple[str, str], ...]:
        """What there was to say since the last call: level ("info", "warn") and words."""
        with self._lock:
            found = tuple(self._notes)
            self._notes.clear()
        return found

    def read(self, time_s: float) -> Controls | None:
        """Axes now, and the buttons pressed since the last call; None without an armed gamepad."""
        del time_s  # the device has its own clock
        with self._lock:
            if self._pad is None or not self._armed or time.monotonic() > self._heard_s + STALE_S:
                self._pressed.clear()
                return None
            pressed = tuple(self._pressed)
            self._pressed.clear()
            return Controls(axes=self._axes, pressed=pressed)

    def _watch(self) -> None:
        try:
            with _sdl() as pygame:
                while not self._ended.is_set():
                    self._poll(pygame)
                    self._first_look.set()
                    self._ended.wait(EVERY_S)
        except Exception as fault:  # a fault of a driver means no inputs; the flight continues
            self._say("warn", f"gamepads cannot be read: {type(fault).__name__}: {fault}")
        finally:
            self._pad = None
            self._first_look.set()

    def _poll(self, pygame: Any) -> None:
        """Look once at what is plugged in and at what its sticks say."""
        for event in pygame.event.get():
            if event.type == pygame.JOYDEVICEADDED:
                self._added(event.device_index)
            elif event.type == pygame.JOYDEVICEREMOVED:
                self._removed(event.instance_id)
                for index in range(pygame.joystick.get_count()):  # another one may lie ready
                    self._added(index)
        pad = self._pad
        if pad is None:
            return
        state = pad.state()
        axes, held = self._mapping.sticks(state), self._mapping.held(state)
        with self._lock:
            if not self._armed and not axes.any():
                self._armed = True
                self._say("info", f"gamepad {pad.name}: sticks are centred and have effect")
            self._pressed.extend(self._mapping.buttons[name] for name in sorted(held - self._held))
            self._axes, self._held, self._heard_s = axes, held, time.monotonic()

    def _added(self, index: int) -> None:
        if self._pad is not None:
            return
        try:
            pad = _Pad(index)
        except RuntimeError:  # gone again, or announced twice: pygame.error is one
            return
        try:
            self._mapping.check(pad.state())
        except InputError as fault:
            if pad.number not in self._refused:
                self._refused[pad.number] = str(fault)
                self._say("warn", str(fault))
            return
        with self._lock:
            self._held = self._mapping.held(pad.state())
            self._armed, self._pad = False, pad
        self._say("info", f"gamepad {pad.name}: found; centre its sticks to fly")

    def _removed(self, number: int) -> None:
        self._refused.pop(number, None)
        if self._pad is None or self._pad.number != number:
            return
        name = self._pad.name
        with self._lock:
            self._pad, self._armed = None, False
        self._say("warn", f"gamepad {name}: lost")

    def _say(self, level: str, words: str) -> None:
        self._notes.append((level, words))


class _Pad:
    """One pad that is plugged in; SDL's thread alone may touch it."""

    def __init__(self, index: int) -> None:
        import pygame
        from pygame._sdl2 import controller

        self._known = controller.Controller(index) if controller.is_controller(index) else None
        self._raw = pygame.joystick.Joystick(index)
        self.name, self.number = self._raw.get_name(), self._raw.get_instance_id()

    def state(self) -> PadState:
        raw = self._raw
        values = {f"axis{k}": raw.get_axis(k) for k in range(raw.get_numaxes())}
        values |= {f"button{k}": float(raw.get_button(k)) for k in range(raw.get_numbuttons())}
        for k in range(raw.get_numhats()):
            x, y = raw.get_hat(k)
            for side, on in (("up", y > 0), ("down", y < 0), ("left", x < 0), ("right", x > 0)):
                values[f"hat{k}{side}"] = float(on)
        if self._known is not None:
            values |= {name: self._known.get_axis(k) / _FULL for k, name in enumerate(STICKS)}
            values |= {name: float(self._known.get_button(k)) for k, name in enumerate(BUTTONS)}
        return PadState(name=self.name, values=values)


@contextmanager
def _sdl() -> Iterator[Any]:
    """SDL's events and gamepads without window and sound; ends with the block."""
    before = {name: os.environ.get(name) for name in _SDL}
    os.environ.update(_SDL)
    try:
        import pygame
        from pygame._sdl2 import controller

        pygame.display.init()
        pygame.joystick.init()
        controller.init()
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
    try:
        yield pygame
    finally:
        controller.quit()
        pygame.joystick.quit()
        pygame.display.quit()
