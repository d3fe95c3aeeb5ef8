"""Hands from a file, by its ending: a script in YAML, or the record of a flight as Parquet or CSV."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.operation.teleop.input.controls import ControlSource
from wakewise.operation.teleop.input.script import load_script


def _record(path: Path) -> ControlSource:
    """The record of a flight; tables are imported where one is read, since every scenario knows of this file."""
    from wakewise.operation.teleop.input.control_log import read_trace

    return read_trace(path)


READERS: dict[str, Callable[[Path], ControlSource]] = {
    ".yaml": load_script,
    ".yml": load_script,
    ".parquet": _record,
    ".csv": _record,
}


def read_input(path: Path) -> ControlSource:
    """Hands that a file tells of.

    Raises
    ------
    InputError
        If its ending is none of `READERS`, or it cannot be read.
    """
    if path.suffix not in READERS:
        raise InputError(f"{path}: hands are read from {', '.join(READERS)}")
    return READERS[path.suffix](path)
