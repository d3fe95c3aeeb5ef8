"""Levers of `wake-aware` that the bench switches, one by one.

Each is held against the method without it, all others on (left out), and against the method without any (alone).
"""

from __future__ import annotations

from typing import Any

from wakewise.core.errors import InputError

Settings = dict[str, Any]

MECHANISMS: dict[str, Settings] = {
    "drift": {"levers.drift": False},
    "jets that meet": {"levers.meet": False},
    "floor": {"wake.floor": False},
    "doubt": {"levers.doubt": False},
    "posture": {"levers.posture": False},
    "thrift": {"levers.thrift": False},
}
"""Fields of `ControlSettings` that take a lever away, by its name. Sharing out (`levers.spare`) is no lever of its own:
the others need it."""

NONE = "wake-aware, no levers"
LEVER_SEEDS = 3
"""Levers fly the first seeds only, which have all trims and all sides once."""


def selected_mechanisms(wished: tuple[str, ...] | None) -> tuple[str, ...]:
    """Names of the levers to switch; none if not given, `all` for all.

    Raises
    ------
    InputError
        If one is not known.
    """
    names = () if wished is None or wished == ("none",) else wished
    for name in names:
        if name not in (*MECHANISMS, "all"):
            raise InputError(f"levers: '{name}' is not known, allowed: none, all, {', '.join(MECHANISMS)}")
    return tuple(MECHANISMS) if "all" in names else tuple(name for name in MECHANISMS if name in names)


def without(*names: str) -> Settings:
    """Fields that take these levers away."""
    merged: Settings = {}
    for name in names:
        merged |= MECHANISMS[name]
    return merged


def lever_settings(names: tuple[str, ...]) -> dict[str, Settings]:
    """Settings of the flights that judge some levers, by what the flight is called."""
    if not names:
        return {}
    table = {NONE: without(*MECHANISMS)}
    for name in names:
        table[without_name(name)] = without(name)
        table[only_name(name)] = without(*(other for other in MECHANISMS if other != name))
    return table


def without_name(name: str) -> str:
    """What the flight without a lever is called."""
    return f"wake-aware without {name}"


def only_name(name: str) -> str:
    """What the flight with a lever alone is called."""
    return f"wake-aware, {name} alone"
