"""COLMAP's blocking calls, quiet, watched and stoppable."""

from __future__ import annotations

import os
import sqlite3
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TypeVar

import pycolmap

from wakewise.errors import StageError

T = TypeVar("T")


def be_quiet() -> None:
    """Only fatal messages; everything else would land between the lines of a progress bar or of JSON."""
    pycolmap.logging.minloglevel = pycolmap.logging.Level.FATAL.value


be_quiet()


def call(work: Callable[..., T], what: str, watch: Callable[[], None] = lambda: None) -> T:
    """Run a COLMAP call in a thread, calling `watch` now and then; an interrupt cancels it and waits for its end.

    Parameters
    ----------
    work : callable
        Takes `cancellation_token`.
    what : str
        Name of the stage, for messages.

    Raises
    ------
    StageError
        If COLMAP fails, with its reason in one line.
    """
    token = pycolmap.CancellationToken()
    result: list[T] = []
    failure: list[Exception] = []

    def body() -> None:
        be_quiet()  # a bundle adjustment on its own makes COLMAP talk again
        try:
            result.append(work(cancellation_token=token))
        except (RuntimeError, ValueError, IndexError, TypeError, OSError) as error:
            failure.append(error)

    thread = threading.Thread(target=body, name=what)
    thread.start()
    try:
        while thread.is_alive():
            thread.join(0.25)
            watch()
    finally:
        if thread.is_alive():
            token.cancel()
            thread.join()
    if failure:
        reason = " ".join(str(failure[0]).split())[:200]
        raise StageError(f"{what}: COLMAP stopped: {reason}") from failure[0]
    return result[0]


@contextmanager
def no_stderr() -> Iterator[None]:
    """Send what compiled code writes to standard error nowhere; for code that knows no other way to be quiet."""
    sys.stderr.flush()
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def settle(database: Path) -> None:
    """Fold the write-ahead log into the database, so that it is one file and can be renamed."""
    with closing(sqlite3.connect(database)) as link:
        link.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        link.execute("PRAGMA journal_mode=DELETE")


def remove_logs(database: Path) -> None:
    """Remove what SQLite may have left beside a database that is given up."""
    for suffix in ("-wal", "-shm", "-journal"):
        database.with_name(database.name + suffix).unlink(missing_ok=True)
