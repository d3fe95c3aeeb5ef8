"""Whole files or none: everything is written to a temporary name beside its place and renamed."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from wakewise.processes import half_done

_MOST_HEAD_LINES, _LONGEST_LINE = 1000, 10_000


@contextmanager
def whole_file(path: Path, lasting: bool = False) -> Iterator[Path]:
    """Give a temporary path beside `path`, same suffix; rename it into place if the block ends well, else remove it.

    What is `lasting` is there, whole, after a power cut too: file and folder are on the disk when the block is left.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=half_done(path.stem), suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        if lasting:
            settle(temporary)
        temporary.replace(path)
        if lasting:
            settle(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def settle(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk (fsync)."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except PermissionError:  # Windows opens no folders
        if path.is_dir():
            return
        raise
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Give a temporary folder beside `path`; rename it into place if the block ends well, else remove it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = Path(tempfile.mkdtemp(prefix=half_done(path.name), dir=path.parent))
    try:
        yield temporary
        if path.exists():
            shutil.rmtree(path)
        temporary.chmod(0o755)
        temporary.replace(path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def write_text(path: Path, text: str, lasting: bool = False) -> None:
    """Write `text` whole or not at all; `lasting` as in `whole_file`."""
    with whole_file(path, lasting) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any, lasting: bool = False) -> None:
    """Write JSON whole or not at all; NaN and infinity are refused, since JSON has none. `lasting` as above."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n", lasting)


def broken_promise(path: Path) -> str | None:
    """What an ASCII PLY file holds less of than its head promises, in words; None for a whole one or another format.

    Readers take what is there, so a file that was cut short passes for a small one.
    """
    with path.open("rb") as file:
        promised = 0
        for _ in range(_MOST_HEAD_LINES):
            words = file.readline(_LONGEST_LINE).split()
            if words[:1] == [b"format"] and words[1:2] != [b"ascii"]:
                return None
            if words[:1] == [b"element"] and len(words) == 3 and words[2].isdigit():
                promised += int(words[2])
            if words == [b"end_header"]:
                held = sum(1 for line in file if line.strip())
                return None if held >= promised else f"promises {promised} vertices and faces, holds {held}"
    return None
