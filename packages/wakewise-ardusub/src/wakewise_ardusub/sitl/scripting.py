"""Lua scripting of the simulated autopilot: scheduled calls with limits of instructions and memory.

Lua is the firmware's version, 5.3, by `lupa`, with the bindings of `bindings.lua`. Two differences: numbers have 64
bits here and 32 there, and no other scripts run. A script that fails is stopped, reported to the ground station, and
not started again before the next boot.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from importlib import resources
from typing import Any, Protocol

from wakewise_ardusub.optional_dependencies import need
from wakewise_ardusub.sitl.own_parameters import ParameterTable

LONGEST_WAIT_MS = 600_000
MOST_QUEUED = 255
MEMORY_B = 8_000_000
"""What a script may take; a pointer has twice the firmware's size here and the engine its own share."""
BUDGET = 200_000
"""Instructions of a turn if SCR_VM_I_COUNT does not say."""
_LETTERS = 200
_ERROR, _INFO = 3, 6


class ScriptHost(Protocol):
    """What a script may see and do."""

    parameters: ParameterTable

    @property
    def armed(self) -> bool:
        """Whether the motors are armed."""
        ...

    @property
    def mode(self) -> int:
        """Flight mode."""
        ...

    @property
    def now_s(self) -> float:
        """Time since the start."""
        ...

    def set_mode(self, mode: int) -> bool:
        """Change the mode; False where that is refused."""
        ...

    def find_channel(self, function: int) -> int | None:
        """First output, numbered from 0, with a function."""
        ...

    def output_us(self, function: int) -> int | None:
        """Pulse on that output now."""
        ...

    def override(self, channel: int, pulse_us: int, timeout_ms: int) -> None:
        """Put a pulse on an output for so long."""
        ...

    def send_text(self, severity: int, words: str) -> None:
        """STATUSTEXT."""
        ...

    def send_named_float(self, name: str, value: float) -> None:
        """NAMED_VALUE_FLOAT."""
        ...


class LuaScript:
    """One script on a board.

    Parameters
    ----------
    text : str
    name : str
        For messages.
    board : ScriptHost

    Raises
    ------
    MissingExtra
        If there is no Lua.
    """

    def __init__(self, text: str, name: str, board: ScriptHost) -> None:
        need("the stand-in autopilot's scripting", "links", only=("lupa",))
        from lupa import lua53

        self._name, self._board = name, board
        self._next_s = board.now_s
        self._wanted: set[int] = set()
        self._most_ids = 0
        self._queue: deque[tuple[str, int, int]] = deque(maxlen=0)
        self.fault: str | None = None
        """Why it was stopped, None while it runs."""
        self._call: Callable[[], Any] | None = None
        self._lua = lua53.LuaRuntime(
            encoding="latin-1",
            unpack_returned_tuples=True,
            register_eval=False,
            register_builtins=False,
            max_memory=MEMORY_B,
        )
        prelude = resources.files("wakewise_ardusub.sitl").joinpath("bindings.lua").read_text("ascii")
        self._within = self._lua.execute(prelude, self._lua.table_from(self._host()))
        try:
            chunk = self._lua.compile(text)
        except Exception as fault:
            self._stop(fault)
        else:
            self._call = chunk

    def hear(self, raw: str, message: int, at_ms: int, link: int = 0) -> None:
        """Queue a message's raw record, one character a byte, if the script wants its kind; a full queue drops it."""
        if message in self._wanted and len(self._queue) < (self._queue.maxlen or 0):
            self._queue.append((raw, link, at_ms))

    def step(self) -> None:
        """Give the script its turn if it is due."""
        if self._call is None or self._board.now_s < self._next_s:
            return
        budget = max(1000, round(self._board.parameters.value("SCR_VM_I_COUNT", otherwise=BUDGET)))
        try:
            answer = self._within(budget, self._call)
        except Exception as fault:  # memory at its end reaches us as an exception of lupa's own
            self._stop(fault)
            return
        fine, *given = answer if isinstance(answer, tuple) else (answer,)
        then, wait_ms = (*given, None, None)[:2]
        if fine is not True:
            self._stop(then)
        elif not given:
            self._call = None  # it is done, as one without a loop is
        elif not callable(then) or not isinstance(wait_ms, int | float) or not 0 <= wait_ms <= LONGEST_WAIT_MS:
            self._stop("did not return a function and a delay")
        else:
            self._call, self._next_s = then, self._board.now_s + 1e-3 * wait_ms

    def _stop(self, fault: object) -> None:
        self.fault, self._call = str(fault), None
        self._board.send_text(_ERROR, f"Lua: {self._name}: {self.fault}"[:_LETTERS])

    def _host(self) -> dict[str, Callable[..., Any]]:
        board = self._board

        def mavlink_init(queue: int, ids: int) -> None:
            self._queue = deque(maxlen=min(queue, MOST_QUEUED))
            self._most_ids = ids

        def register(message: int) -> bool:
            if len(self._wanted) >= self._most_ids:
                return False
            self._wanted.add(message)
            return True

        def receive() -> Any:
            return self._queue.popleft() if self._queue else (None, None, None)

        return {
            "mavlink_init": mavlink_init,
            "register": register,
            "receive": receive,
            "is_armed": lambda: board.armed,
            "get_mode": lambda: board.mode,
            "set_mode": board.set_mode,
            "find_channel": board.find_channel,
            "get_output": board.output_us,
            "override": board.override,
            "get_param": board.parameters.get,
            "set_param": board.parameters.set,
            "add_table": board.parameters.add_table,
            "add_param": board.parameters.add_param,
            "send_text": board.send_text,
            "send_float": lambda name, value: board.send_named_float(name[:10], value),
            "millis": lambda: round(1e3 * board.now_s),
            "micros": lambda: round(1e6 * board.now_s),
        }
