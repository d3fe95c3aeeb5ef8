"""Hands from a file, by its ending: a script in YAML, or the record of a flight as Parquet or CSV."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wakewise.errors import InputError
from wakewise.pilot.controls import ControlSource
from wakewise.pilot.script import load_script
from wakewise.pilot.trace import read_trace

READERS: dict[str, Callable[[Path], ControlSource]] = {
    ".yaml": load_script,
    ".yml": load_script,
    ".parquet": read_trace,
    ".csv": read_trace,
}


def hands_from(path: Path) -> ControlSource:
    """Hands that a file tells of.

    Raises
    ------
    InputError
        If its ending is none of `READERS`, or it cannot be read.
    """
    if path.suffix not in READERS:
        raise InputError(f"{path}: hands are read from {', '.join(READERS)}")
    return READERS[path.suffix](path)
