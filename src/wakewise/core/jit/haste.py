"""What makes Numba compile sooner, without a change in what it compiles.

Numba asks flags of compilation for all their values whenever it compares two, looks for variables in what has none, and
tells its timers of each call of LLVM: a tenth of the time. Each remedy here replaces one such function of Numba's; what
comes out is the same. They are for processes that compile and do nothing else.
"""

from __future__ import annotations

from typing import Any

from numba.core import event, ir, targetconfig

__all__ = ["hasten"]

_PLAIN = frozenset({str, int, float, bool, type(None)})


def hasten() -> None:
    """Make this process compile sooner."""
    _compare_flags_sooner()
    _list_variables_sooner()
    _tell_no_locks()


def _compare_flags_sooner() -> None:
    """Flags are compared by what is set in them first; Numba's hash is one for all flags of a kind, so is this."""
    config: Any = targetconfig.TargetConfig
    defaults: dict[type, dict[str, Any]] = {}

    def whole(flags: Any) -> dict[str, Any]:
        kind = type(flags)
        if kind not in defaults:
            defaults[kind] = {name: option.default for name, option in kind.options.items()}
        return {**defaults[kind], **flags._values}

    def same(self: Any, other: Any) -> Any:
        if not isinstance(other, config):
            return NotImplemented
        return self is other or self._values == other._values or whole(self) == whole(other)

    config.__eq__ = same
    config.__hash__ = lambda self: len(self.options)


def _list_variables_sooner() -> None:
    """Most of what Numba looks through for variables is one, or a name or a number."""
    instruction: Any = ir.Inst
    listed = instruction._rec_list_vars

    def list_variables(self: Any, value: Any) -> list[Any]:
        kind = type(value)
        if kind is ir.Var:
            return [value]
        if kind in _PLAIN:
            return []
        found: list[Any] = listed(self, value)
        return found

    instruction._rec_list_vars = list_variables


def _tell_no_locks() -> None:
    """Numba tells its timers of each call of LLVM, for figures that nobody reads here."""
    lock = "numba:llvm_lock"
    told: Any = event
    start, end = told.start_event, told.end_event
    told.start_event = lambda kind, data=None: None if kind == lock else start(kind, data)
    told.end_event = lambda kind, data=None, exc_details=None: None if kind == lock else end(kind, data, exc_details)
