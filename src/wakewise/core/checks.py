"""Checks of single values of public functions: a word of a list, a number, a path, an instance of a class."""

from __future__ import annotations

import math
import operator
import os
from collections.abc import Sequence
from difflib import get_close_matches
from numbers import Real
from pathlib import Path
from typing import Any, NoReturn, SupportsIndex, TypeVar, cast

from wakewise.core.errors import InputError

T = TypeVar("T")
_SHOWN = 60
"""Longest value that a message quotes whole."""
_LONGEST_NAME = 255
"""So many bytes file systems let the name of a file or folder have."""
_METHODS: dict[str, tuple[str, ...]] = {
    "pilot": ("goal",),
    "wake": ("unit_velocity",),
    "controller": ("init", "step"),
    "estimator": ("init", "step"),
    "world": ("begin",),
}
"""Methods that a part of a Protocol must have (see `wakewise.core.interfaces`)."""


def quoted(value: object) -> str:
    """A value as a message quotes it: on one line, and cut short where it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # a whole number of more digits than Python writes
        text = f"a number of {int(value).bit_length()} bits" if isinstance(value, int) else type(value).__name__
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def counted(number: int, what: str) -> str:
    """A number of things as a message says it: 1 trial, 2 trials."""
    return f"{number:,} {what}{'' if number == 1 else 's'}"


def one_of(value: T, allowed: Sequence[T], name: str) -> T:
    """The value itself, if it is one of those that are allowed.

    Raises InputError naming the value, what is allowed, and the nearest of it.
    """
    if isinstance(value, str) and value in allowed:
        return value
    near = get_close_matches(value, [str(word) for word in allowed], n=1) if isinstance(value, str) else []
    hint = f", did you mean {near[0]}?" if near else ""
    raise InputError(f"{name}: {quoted(value)} is unknown, allowed: {', '.join(map(str, allowed))}{hint}")


def whole_number(value: object, name: str, lowest: int | None = None, highest: int | None = None) -> int:
    """The value as an int; True and False are no numbers, nor is 1.0.

    Raises InputError if it is no whole number, or out of range.
    """
    try:
        if type(value).__name__ in ("bool", "bool_"):
            raise TypeError
        number = operator.index(cast("SupportsIndex", value))
    except TypeError:
        raise InputError(f"{name}: {quoted(value)}, must be a whole number") from None
    if (lowest is not None and number < lowest) or (highest is not None and number > highest):
        allowed = f"at least {lowest}" if highest is None else f"{lowest} to {highest}"
        raise InputError(f"{name}: {quoted(number)}, allowed {allowed}")
    return number


def finite_number(value: object, name: str, above: float | None = None, least: float | None = None) -> float:
    """The value as a float.

    `above`, `least`: what it must be more than; what it must be at least. Raises InputError if it is no number, not
    finite, or out of range.
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(f"{name}: {quoted(value)}, must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number) or (above is not None and number <= above) or (least is not None and number < least):
        bound = (
            f" and more than {above:g}"
            if above is not None
            else f" and at least {least:g}"
            if least is not None
            else ""
        )
        raise InputError(f"{name}: {number:g}, must be finite{bound}")
    return number


def path_of(value: object, name: str) -> Path:
    """The value as a path, which the operating system takes as one, whether anything is there or not.

    Raises InputError if it is no text or path, or no file or folder can have that name.
    """
    if not isinstance(value, (str, os.PathLike)) or not isinstance(text := os.fspath(value), str):
        raise InputError(f"{name}: {quoted(value)}, must be a path")
    try:
        os.lstat(text)
        reason = None
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        reason = None  # told of, with what was looked for, by whoever opens it
    except OSError as fault:
        reason = fault.strerror or type(fault).__name__
    except ValueError:  # NUL, or half of a character
        return _no_path(text, name, "it holds what no name can hold")
    if any(len(os.fsencode(part)) > _LONGEST_NAME for part in Path(text).parts):
        reason = f"a name has at most {_LONGEST_NAME} bytes"
    return Path(text) if reason is None else _no_path(text, name, reason)


def _no_path(text: str, name: str, reason: str) -> NoReturn:
    raise InputError(f"{name}: {quoted(text)}, must be a path ({reason})")


def boolean(value: object, name: str) -> bool:
    """The value as a bool; neither words nor numbers nor arrays are one.

    Raises InputError if it is neither True nor False.
    """
    if type(value).__name__ not in ("bool", "bool_"):
        raise InputError(f"{name}: {quoted(value)}, must be True or False")
    return bool(value)


def callable_of(value: T, name: str) -> T:
    """The value itself, if it can be called.

    Raises InputError if it cannot.
    """
    if not callable(value):
        raise InputError(f"{name}: {quoted(value)}, must be a function")
    return value


def instance_of(value: Any, kind: type[T], name: str) -> T:
    """The value itself, if it is of that kind.

    Raises InputError naming what it is instead.
    """
    if not isinstance(value, kind):
        raise InputError(f"{name}: {quoted(value)} is a {type(value).__name__}, must be a {kind.__name__}")
    return value


def has_methods(value: T, methods: Sequence[str], name: str, kind: str) -> T:
    """The value itself, if it has the methods of a kind of part (a Protocol of `wakewise.core.interfaces`).

    Raises InputError naming the methods that are missing.
    """
    missing = [method for method in methods if not callable(getattr(value, method, None))]
    if missing or isinstance(value, type):
        lacks = "is a class, not one made of it" if isinstance(value, type) else f"has no {', '.join(missing)}"
        raise InputError(f"{name}: {quoted(value)} {lacks}, must be a {kind} with {', '.join(methods)}")
    return value


def protocol_part(value: T, name: str) -> T:
    """The value itself, if it can be the part of that name, such as controller or world: methods, a name for tables.

    Raises InputError naming what is missing.
    """
    has_methods(value, _METHODS[name], name, name)
    if name in ("controller", "world") and not (isinstance(word := getattr(value, "name", None), str) and word):
        raise InputError(f"{name}: {quoted(value)} has no name for tables, must have a text as its attribute name")
    return value
