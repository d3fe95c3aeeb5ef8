"""Inputs by a script: a list of times with the stick deflections from then on.

As YAML, each entry with `at_s` and any of the axes (those not named are centred), what is `pressed` at that moment, or
`gone: true` for no inputs until the next entry:

    - {at_s: 2, right: 0.6}
    - {at_s: 5, pressed: [capture]}
    - {at_s: 8, gone: true}

Inputs from a file, by its suffix: a script in YAML, or the record of a flight as Parquet or CSV.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import yaml_file
from wakewise.operation.teleop.input.controls import CENTRED, CONTROL_AXES, Controls, ControlSource, TimedControls

LONGEST = 100_000
"""Most entries of a script."""
_KEYS = ("at_s", *CONTROL_AXES, "pressed", "gone")


@dataclass(frozen=True, kw_only=True)
class ScriptEntry:
    """Inputs from `at_s` on, None: no inputs; buttons are pressed once."""

    at_s: float
    controls: Controls | None


class ScriptedInput(TimedControls):
    """A `ControlSource` that reads the entries of a script; before the first the sticks are centred.

    Raises InputError if the times do not increase.
    """

    def __init__(self, moments: tuple[ScriptEntry, ...]) -> None:
        for number, (one, other) in enumerate(pairwise(moments), 2):
            if not one.at_s < other.at_s:
                raise InputError(f"script: entry {number} at {other.at_s:g} s, must be later than {one.at_s:g} s")
        self.moments = moments
        super().__init__([one.at_s for one in moments], [one.controls for one in moments], before=CENTRED)


def script_of(entries: Any, what: str = "script") -> ScriptedInput:
    """Script of entries as in the file (see the top); `what` names them in messages.

    Raises InputError, naming the entry, what was found and what is allowed.
    """
    if not isinstance(entries, list | tuple) or not entries:
        raise InputError(f"{what}: must be a list of entries, such as - {{at_s: 2, right: 0.6}}")
    if len(entries) > LONGEST:
        raise InputError(f"{what}: {len(entries)} entries, at most {LONGEST} are allowed")
    return ScriptedInput(tuple(_moment(entry, f"{what}, entry {k}") for k, entry in enumerate(entries, 1)))


def load_script(path: Path) -> ScriptedInput:
    """Script from a YAML file.

    Raises InputError if it cannot be read, or see `script_of`.
    """
    return script_of(yaml_file(path), str(path))


def _moment(entry: Mapping[str, Any], what: str) -> ScriptEntry:
    if not isinstance(entry, Mapping) or "at_s" not in entry:
        raise InputError(f"{what}: must be a mapping with at_s, such as {{at_s: 2, right: 0.6}}")
    for key in entry:
        if key not in _KEYS:
            raise InputError(f"{what}: {key!r} is unknown, allowed are {', '.join(_KEYS)}")
    at_s = _number(entry["at_s"], f"{what}, at_s")
    if at_s < 0.0:
        raise InputError(f"{what}: at_s {at_s:g}, must be 0 or more")
    gone, pressed = entry.get("gone", False), entry.get("pressed", [])
    if not isinstance(gone, bool):
        raise InputError(f"{what}: gone {gone!r}, must be true or false")
    if not isinstance(pressed, list) or not all(isinstance(name, str) for name in pressed):
        raise InputError(f"{what}: pressed {pressed!r}, must be a list of names")
    axes = [_number(entry.get(name, 0.0), f"{what}, {name}") for name in CONTROL_AXES]
    try:
        controls = Controls(axes=np.array(axes), pressed=tuple(pressed))
    except InputError as fault:
        raise InputError(f"{what}: {fault}") from fault
    return ScriptEntry(at_s=at_s, controls=None if gone else controls)


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f"{what}: {value!r}, must be a finite number")
    return float(value)


def _record(path: Path) -> ControlSource:
    """The record of a flight; polars is imported at first use, because every scenario imports this module."""
    from wakewise.operation.teleop.input.control_log import read_trace

    return read_trace(path)


READERS: dict[str, Callable[[Path], ControlSource]] = {
    ".yaml": load_script,
    ".yml": load_script,
    ".parquet": _record,
    ".csv": _record,
}


def read_input(path: Path) -> ControlSource:
    """Inputs from a file.

    Raises InputError if its ending is none of `READERS`, or it cannot be read.
    """
    if path.suffix not in READERS:
        raise InputError(f"{path}: controls are read from {', '.join(READERS)}")
    return READERS[path.suffix](path)
