"""What a name of a scenario stands for: one of ours, one that an installed package offers, or `package.module:name`.

Packages offer parts through entry points, a group for each kind (see `GROUPS`), so that a controller, wake model or
world from outside is named in a scenario as ours are. `package.module:name` is imported from where Python finds it,
the working folder included, and needs no installed package.
"""

from __future__ import annotations

import difflib
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from wakewise.core.errors import InputError, WakewiseError

T = TypeVar("T")

GROUPS = {
    "method": "wakewise.controllers",
    "wake model": "wakewise.wake_models",
    "vehicle format": "wakewise.vehicle_formats",
    "target": "wakewise.targets",
    "pilot": "wakewise.pilots",
    "world": "wakewise.worlds",
    "current": "wakewise.currents",
    "detector": "wakewise.detectors",
    "dive log": "wakewise.dive_logs",
}
"""Entry point group of each kind of part."""

_LONGEST_REASON = 300
"""So many characters of a foreign error are quoted."""


class ResolvedPlugin(NamedTuple, Generic[T]):
    """A part's maker and where it comes from: "" for our own, else such as "package 1.2" or "my.module:make"."""

    maker: T
    origin: str


def find(kind: str, name: str, own: Mapping[str, T]) -> ResolvedPlugin[T]:
    """What `name` stands for.

    `kind`: a key of `GROUPS`. `name`: one of `own`, of an entry point of this kind, or ``package.module:name``. `own`:
    our own parts of this kind. Raises InputError if there is nothing of that name, or it cannot be imported; the reason
    is named.
    """
    if name in own:
        return ResolvedPlugin(own[name], "")
    offered = _offered(GROUPS[kind])
    if name in offered:
        point = offered[name]
        package = f"{point.dist.name} {point.dist.version}" if point.dist is not None else point.value
        return ResolvedPlugin(load(kind, name, point.value), package)
    if ":" in name:
        return ResolvedPlugin(load(kind, name, name), name)
    known = names(kind, own)
    close = difflib.get_close_matches(name, known, 1)
    hint = f"did you mean {close[0]}? " if close else ""
    raise InputError(f"{kind} '{name}': unknown, {hint}allowed: {', '.join(known)}, or package.module:name")


def make(
    kind: str, name: str, own: Mapping[str, Callable[..., T]], *given: Any, checked: Callable[[T], T] | None = None
) -> T:
    """What the maker of this name makes of what it is given; from outside, what `checked` gives for that.

    Raises InputError as `find` does, and where a maker from outside or `checked` raises anything; the reason is named.
    """
    maker, origin = find(kind, name, own)
    try:
        made = maker(*given)
        return checked(made) if origin and checked is not None else made
    except Exception as fault:  # whatever a foreign maker raises is named; memory that ran out is no fault of its
        refused = isinstance(fault, InputError)
        if not origin or (isinstance(fault, WakewiseError | MemoryError) and not refused):
            raise
        source = "" if origin == name else f" (from {origin})"
        words = fault if refused else f"cannot be made, {reason_of(fault)}"
        raise InputError(f"{kind} '{name}'{source}: {words}") from fault


def reason_of(fault: Exception) -> str:
    """Type and message of a foreign error on one line, cut short where it is long."""
    text = " ".join(str(fault).split())
    return f"{type(fault).__name__}: {text[:_LONGEST_REASON]}" if text else type(fault).__name__


def names(kind: str, own: Mapping[str, Any]) -> list[str]:
    """Names of this kind, ours first, then those that installed packages offer."""
    return [*own, *(name for name in sorted(_offered(GROUPS[kind])) if name not in own)]


def offered(kind: str) -> list[str]:
    """Names of this kind that installed packages offer."""
    return sorted(_offered(GROUPS[kind]))


@cache
def _offered(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=group)}


def load(kind: str, name: str, target: str) -> Any:
    """What `target`, as ``package.module:name``, is; the working folder is looked through, too.

    Raises InputError if it cannot be imported; `kind` and `name` say what it was to be.
    """
    module, _, attribute = target.partition(":")
    if not module or not attribute:
        raise InputError(f"{kind} '{name}': must be package.module:name")
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.append(here)
    try:
        found: Any = import_module(module)
        for part in attribute.split("."):
            found = getattr(found, part)
    except InputError:
        raise
    except Exception as fault:  # whatever a foreign module raises while it is imported is the user's to see
        raise InputError(f"{kind} '{name}': cannot be loaded, {reason_of(fault)}") from fault
    return found
