"""Whole files or none: everything is written to a temporary name beside its place and renamed."""

from __future__ import annotations

import csv
import errno
import hashlib
import io
import json
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from wakewise.core.checks import quoted
from wakewise.core.errors import FULL, FileFailure, InputError, WakewiseError, environment_failure
from wakewise.core.run_lock import temporary_prefix

_LEAST_BYTES = 65_536
_LONGEST_NAME = 200


@contextmanager
def whole_file(path: Path, lasting: bool = False) -> Iterator[Path]:
    """Give a temporary path beside `path`, same suffix; rename it into place if the block ends well, else remove it.

    What is `lasting` is there, whole, after a power cut too: file and folder are on the disk when the block is left.
    Every file of a result is written so, or in a `whole_folder`; tests/core/test_files.py knows the exceptions.

    Raises FileFailure if the operating system does not let it be written, whichever library met that; an OSError too.
    """
    began = temporary_prefix(path.stem)
    with _failures_told(path, began):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=began, suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        with _failures_told(path, began):
            yield temporary
            temporary.chmod(0o644)
            if lasting:
                fsync_path(temporary)
            temporary.replace(path)
            if lasting:
                fsync_path(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def _failures_told(path: Path, began: str) -> Iterator[None]:
    """Tell of what the operating system does not allow with the name of what was to be written.

    `began` is how the names of its temporary files begin.
    """
    try:
        yield
    except Exception as fault:  # what is not of the computer is raised again below
        failure = environment_failure(fault, path)
        told = isinstance(fault, WakewiseError) or getattr(failure, "errno", None)
        if not told and not _has_room(path.parent):
            failure = FileFailure(errno.ENOSPC, FULL, str(path))  # some libraries say only that they failed
        if failure is None or failure is fault:
            raise
        if isinstance(failure, FileFailure) and str(failure.filename).startswith(str(path.parent / began)):
            failure.filename = str(path)
        raise failure from fault


def _has_room(folder: Path) -> bool:
    """Whether anything can still be written to a folder's disk."""
    try:
        return shutil.disk_usage(folder).free >= _LEAST_BYTES
    except OSError:
        return True


def fsync_path(path: Path) -> None:
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
    """Give a temporary folder beside `path`; rename it into place if the block ends well, else remove it.

    Raises FileFailure as `whole_file`.
    """
    began = temporary_prefix(path.name)
    with _failures_told(path, began):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=began, dir=path.parent))
    try:
        with _failures_told(path, began):
            yield temporary
            if path.exists():
                shutil.rmtree(path)
            temporary.chmod(0o755)
            temporary.replace(path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def sha256_of(path: Path) -> str:
    """Check sum of a file, as 64 hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_bytes(path: Path, data: bytes, lasting: bool = False) -> None:
    """Write bytes whole or not at all; `lasting` as in `whole_file`."""
    with whole_file(path, lasting) as temporary:
        temporary.write_bytes(data)


def write_text(path: Path, text: str, lasting: bool = False) -> None:
    """Write `text` whole or not at all; `lasting` as in `whole_file`."""
    with whole_file(path, lasting) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any, lasting: bool = False) -> None:
    """Write JSON whole or not at all; NaN and infinity are refused, since JSON has none. `lasting` as above."""
    write_text(path, json.dumps(value, indent=2, allow_nan=False) + "\n", lasting)


def write_rows(path: Path, rows: Iterable[Iterable[object]]) -> None:
    """Write rows as CSV, whole or not at all."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write_text(path, text.getvalue())


def name_fault(name: str) -> str | None:
    """What is wrong with a name that a file or folder is to have in its place; None if nothing is."""
    if not name or name.strip() != name or name.startswith(".") or not name.isprintable() or set(name) & set("/\\"):
        return "no slash, no dot first, no space around it and nothing unprintable"
    return None if len(name.encode()) <= _LONGEST_NAME else f"at most {_LONGEST_NAME} bytes"


def child_path(folder: Path, name: str, what: str) -> Path:
    """The place in a folder that a name stands for, and no place elsewhere.

    Raises InputError if it cannot be a name; `what` has it, for the message.
    """
    fault = name_fault(name)
    if fault is not None:
        raise InputError(f"{what}: {quoted(name)} names a folder, so {fault}")
    return folder / name
