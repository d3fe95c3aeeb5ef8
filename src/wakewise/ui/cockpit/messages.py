"""Messages of a page, validated strictly: a message of known type and shape, or one line that describes the fault.

Reading never raises: an invalid message becomes `InvalidMessage`, which the server answers and counts. Axes of the
sticks are the exception: numbers of any size and NaN are limited by
`wakewise.operation.teleop.input.controls.apply_dead_zone`, as for any other device.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from wakewise.core.arrays import Array
from wakewise.operation.teleop.input.controls import ACTIONS, CONTROL_AXES, LEAST_SIDE, apply_dead_zone

_WORD = 64  # characters of a name, a token, an id
_LARGEST = 2**53  # the largest whole number that JavaScript counts to
_FIELDS = 16
CLEAR = "clear"
"""In place of a box: the designated target is forgotten."""
PROPOSAL = ("ask", "accept", "refuse")
"""What the holder may do about a proposed target."""


@dataclass(frozen=True, kw_only=True)
class Hello:
    """The first message of a client; `lease`: that of the controls before its connection was lost."""

    token: str | None
    name: str
    wants: Literal["helm", "watch"]
    lease: str | None = None


@dataclass(frozen=True, kw_only=True)
class ControlRequest:
    """A client requests the controls, or gives them back."""

    want: bool
    force: bool = False


@dataclass(frozen=True, kw_only=True)
class ControlConsent:
    """The holder's answer to client `to`, who requested the controls."""

    to: str
    yes: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class StickMessage:
    """Limited axes, shape (5,), with their number and the time of the client's clock in ms."""

    seq: int
    t_ms: float
    axes: Array
    lease: str


@dataclass(frozen=True, kw_only=True)
class ButtonPress:
    """One of `wakewise.operation.teleop.input.controls.ACTIONS`."""

    what: str
    lease: str


@dataclass(frozen=True, kw_only=True)
class SettingsChange:
    """Changes of the operator's settings, which check the values."""

    changes: dict[str, str | float | bool]
    lease: str


@dataclass(frozen=True, kw_only=True)
class PictureAck:
    """A picture has been shown."""

    frame: int


@dataclass(frozen=True, kw_only=True)
class TargetDesignation:
    """A box of picture `frame` that holds the target; None for the scenario's own target again.

    `box` is (left, top, right, bottom) in shares of the picture, 0 to 1 from its upper left corner.
    """

    box: tuple[float, float, float, float] | None
    frame: int
    lease: str


@dataclass(frozen=True, kw_only=True)
class TargetProposal:
    """One of `PROPOSAL`: a target is to be proposed, or the proposed one is accepted or refused."""

    what: str
    lease: str


@dataclass(frozen=True, kw_only=True)
class InvalidMessage:
    """The fault of a message in one line."""

    why: str


Message = (
    Hello
    | ControlRequest
    | ControlConsent
    | StickMessage
    | ButtonPress
    | SettingsChange
    | PictureAck
    | TargetDesignation
    | TargetProposal
)


class _InvalidError(Exception):
    pass


def read_message(raw: str | bytes) -> Message | InvalidMessage:
    """Read one message; never raises."""
    if isinstance(raw, bytes):
        return InvalidMessage(why="a binary message: only text is read here")
    try:
        told = json.loads(raw)
    except (ValueError, RecursionError):
        return InvalidMessage(why="not JSON")
    if not isinstance(told, dict):
        return InvalidMessage(why="not an object with a type")
    kind = told.get("type")
    reader = _READERS.get(kind) if isinstance(kind, str) else None
    if reader is None:
        return InvalidMessage(why=f"type: {_shown(kind)}, allowed {', '.join(_READERS)}")
    try:
        return reader(told)
    except _InvalidError as fault:
        return InvalidMessage(why=f"{kind}: {fault}")


def _hello(told: dict[str, Any]) -> Hello:
    wants = told.get("wants", "watch")
    if wants not in ("helm", "watch"):
        raise _InvalidError(f"wants {_shown(wants)}, allowed helm, watch")
    token, lease = (None if told.get(field) is None else _word(told, field) for field in ("token", "lease"))
    name = "".join(c for c in _word({"name": "somebody"} | told, "name") if c.isprintable()).strip()
    return Hello(token=token, name=name or "somebody", wants=wants, lease=lease)


def _helm(told: dict[str, Any]) -> ControlRequest:
    return ControlRequest(want=_flag(told, "want"), force=_flag({"force": False} | told, "force"))


def _consent(told: dict[str, Any]) -> ControlConsent:
    return ControlConsent(to=_word(told, "to"), yes=_flag(told, "yes"))


def _sticks(told: dict[str, Any]) -> StickMessage:
    axes = told.get("axes")
    if not isinstance(axes, list) or len(axes) != len(CONTROL_AXES):
        raise _InvalidError(f"axes must be {len(CONTROL_AXES)} numbers")
    t_ms = _number(told.get("t"), "t")
    if not abs(t_ms) <= _LARGEST:  # what is no number, too
        raise _InvalidError("t must be a time in ms")
    values = [_number(value, "axes") for value in axes]
    return StickMessage(seq=_whole(told, "seq"), t_ms=t_ms, axes=apply_dead_zone(values), lease=_word(told, "lease"))


def _press(told: dict[str, Any]) -> ButtonPress:
    what = told.get("what")
    if what not in ACTIONS:
        raise _InvalidError(f"what {_shown(what)}, allowed {', '.join(ACTIONS)}")
    return ButtonPress(what=what, lease=_word(told, "lease"))


def _settings(told: dict[str, Any]) -> SettingsChange:
    changes = told.get("set")
    if not isinstance(changes, dict) or not 0 < len(changes) <= _FIELDS:
        raise _InvalidError("set must be an object of fields and values")
    for name, value in changes.items():
        if not isinstance(value, str | int | float) or (isinstance(value, str) and len(value) > _WORD):
            raise _InvalidError(f"set.{_shown(name)} must be a number, a word or true or false")
        if not isinstance(value, str | bool):
            changes[name] = _number(value, "set")
    return SettingsChange(changes=changes, lease=_word(told, "lease"))


def _seen(told: dict[str, Any]) -> PictureAck:
    return PictureAck(frame=_whole(told, "frame"))


def _designate(told: dict[str, Any]) -> TargetDesignation:
    lease = _word(told, "lease")
    if told.get("box") == CLEAR:
        return TargetDesignation(box=None, frame=0, lease=lease)
    edges = told.get("box")
    if not isinstance(edges, list) or len(edges) != 4:
        raise _InvalidError(f"box must be left, top, right and bottom, or {CLEAR!r}, not {_shown(edges)}")
    left, top, right, bottom = (_number(edge, "box") for edge in edges)
    if not (0.0 <= left < right <= 1.0 and 0.0 <= top < bottom <= 1.0):  # what is no number, too
        raise _InvalidError("box must lie within 0 to 1, left before right and top before bottom")
    if min(right - left, bottom - top) < LEAST_SIDE:
        raise _InvalidError(f"box must have sides of {LEAST_SIDE:g} at least")
    return TargetDesignation(box=(left, top, right, bottom), frame=_whole(told, "frame"), lease=lease)


def _proposal(told: dict[str, Any]) -> TargetProposal:
    what = told.get("what")
    if what not in PROPOSAL:
        raise _InvalidError(f"what {_shown(what)}, allowed {', '.join(PROPOSAL)}")
    return TargetProposal(what=what, lease=_word(told, "lease"))


_READERS: dict[str, Callable[[dict[str, Any]], Message]] = {
    "hello": _hello,
    "helm": _helm,
    "consent": _consent,
    "sticks": _sticks,
    "press": _press,
    "settings": _settings,
    "seen": _seen,
    "designate": _designate,
    "proposal": _proposal,
}


def _number(value: Any, field: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise _InvalidError(f"{field} must be a number, not {_shown(value)}")
    try:
        return float(value)
    except OverflowError:  # a whole number of more than 308 digits
        return float("inf") if value > 0 else float("-inf")


def _whole(told: dict[str, Any], field: str) -> int:
    value = told.get(field)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _LARGEST:
        raise _InvalidError(f"{field} must be a whole number from 0, not {_shown(value)}")
    return value


def _word(told: dict[str, Any], field: str) -> str:
    value = told.get(field)
    if not isinstance(value, str) or len(value) > _WORD:
        raise _InvalidError(f"{field} must be a text of at most {_WORD} characters, not {_shown(value)}")
    return value


def _flag(told: dict[str, Any], field: str) -> bool:
    value = told.get(field)
    if not isinstance(value, bool):
        raise _InvalidError(f"{field} must be true or false, not {_shown(value)}")
    return value


def _shown(value: Any) -> str:
    """A value as text for an answer: short and on one line."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > _LARGEST:
        return "a huge number"
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else "a list"
    words = ascii(value) if not isinstance(value, str) else ascii(value[:24])
    return words[:40]
