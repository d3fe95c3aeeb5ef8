"""pycolmap without its signal handlers: blocking calls that are quiet, observed and stoppable.

Other modules take pycolmap from here, because its import sets handlers that are undone here.
"""

from __future__ import annotations

import os
import pickle
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pycolmap

from wakewise.core.errors import EnvironmentFailure, StageError
from wakewise.core.subprocesses import end_process, start_python

__all__ = [
    "NEVER",
    "RESERVE_MB",
    "bundle_adjustment",
    "call",
    "call_in_process",
    "checkpoint_database",
    "database_folder",
    "keep_sigterm",
    "no_stderr",
    "open_database",
    "pycolmap",
    "silence_logging",
]

T = TypeVar("T")
NEVER = 2**31 - 1
"""Residuals from which on COLMAP uses several threads: never."""
# Room that a disk must keep while COLMAP writes its database: what it writes in about a second.
RESERVE_MB = 16.0
# Linux's file system in memory, and the largest database that is put there.
MEMORY, MOST_IN_MEMORY = Path("/dev/shm"), 200e6


def silence_logging() -> None:
    """Only fatal messages; others would mix with a progress bar or with JSON."""
    pycolmap.logging.minloglevel = pycolmap.logging.Level.FATAL.value


def keep_sigterm() -> None:
    """Restore the handler of SIGTERM: COLMAP's log takes it on import, to print a stack and end without clean-up."""
    with suppress(ValueError):  # only the main thread may
        signal.signal(signal.SIGTERM, signal.getsignal(signal.SIGTERM))


silence_logging()
keep_sigterm()


def call(work: Callable[..., T], what: str, watch: Callable[[], None] = lambda: None, *, disk: Path | None = None) -> T:
    """Run a COLMAP call in a thread, calling `watch` now and then; an interrupt cancels it and waits for its end.

    `work`: takes `cancellation_token`. `what`: name of the stage, for messages. `disk`: folder that the call writes to.
    COLMAP ends the whole process when its database finds no room, so the call is cancelled when another program leaves
    less than `RESERVE_MB` there. Raises StageError if COLMAP fails, with its reason in one line; EnvironmentFailure if
    the disk fills; OSError if a file cannot be read or written.
    """
    token = pycolmap.CancellationToken()
    result: list[T] = []
    failure: list[Exception] = []
    # Not the thread itself: a join with a time limit that is interrupted leaves a running thread looking dead in
    # CPython 3.11, and its database was removed under its hands.
    ended = threading.Event()

    def body() -> None:
        try:
            silence_logging()  # a bundle adjustment on its own makes COLMAP talk again
            result.append(work(cancellation_token=token))
        except (RuntimeError, ValueError, IndexError, TypeError, OSError) as error:
            failure.append(error)
        finally:
            ended.set()

    thread = threading.Thread(target=body, name=what)
    try:
        thread.start()
        watch()
        while not ended.wait(0.25 if disk is None else 0.05):
            watch()
            if disk is not None and not ended.is_set() and (free := shutil.disk_usage(disk).free / 1e6) < RESERVE_MB:
                raise EnvironmentFailure(
                    f"{what}: the disk of {disk} is full, {free:.0f} MB are left and {RESERVE_MB:g} MB needed; the "
                    "stages before it are kept"
                )
    finally:
        token.cancel()
        _wait_for_end(thread, ended)
    if failure:
        if isinstance(failure[0], OSError):
            raise failure[0]
        reason = " ".join(str(failure[0]).split())[:200]
        raise StageError(f"{what}: COLMAP stopped: {reason}") from failure[0]
    return result[0]


def call_in_process(what: str, function: str, *arguments: Any, watch: Callable[[], None] = lambda: None) -> None:
    """Run a function of pycolmap that cannot be cancelled in a process of its own, which an interrupt ends at once.

    `what`: name of the stage, for messages. `function`: its name; it takes and leaves files. `arguments`: paths, and
    options of pycolmap's own. Raises StageError if it fails, with its reason in one line.
    """
    order: bytes | None = pickle.dumps((function, arguments))
    # Its own session: a terminal's Ctrl-C goes to whoever waits for it, and that ends it.
    child = start_python("-c", _CALL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, new_session=True)
    errors = b""
    try:
        while True:
            try:
                _, errors = child.communicate(order, timeout=0.25)
                break
            except subprocess.TimeoutExpired:
                order = None  # it has it
                watch()
    finally:
        end_process(child)
    if child.returncode != 0:
        last = errors.decode(errors="replace").strip().splitlines()[-1:] or [f"exit code {child.returncode}"]
        raise StageError(f"{what}: COLMAP stopped: {' '.join(last[0].split())[:200]}")


_CALL = """
import pickle, sys
import pycolmap
pycolmap.logging.minloglevel = pycolmap.logging.Level.FATAL.value
function, arguments = pickle.load(sys.stdin.buffer)
getattr(pycolmap, function)(*arguments)
"""


def bundle_adjustment(
    model: pycolmap.Reconstruction,
    *,
    refine_intrinsics: bool,
    threads: int,
    iterations: int,
    tolerance: float | None = None,
    robust: bool = False,
) -> None:
    """Adjust all poses and points of a model, and its intrinsics if asked to.

    With `robust`, residuals beyond 1 px count linearly. `tolerance`: relative gain at which it ends. Raises StageError
    if COLMAP fails.
    """
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_focal_length = options.refine_extra_params = refine_intrinsics
    solver = options.ceres.solver_options
    solver.max_num_iterations, solver.num_threads = iterations, threads
    if tolerance is not None:
        solver.function_tolerance = tolerance
    # Two threads sum in any order, and the same photos would give another model.
    options.ceres.min_num_residuals_for_cpu_multi_threading = NEVER
    if robust:
        options.ceres.loss_function_type, options.ceres.loss_function_scale = pycolmap.LossFunctionType.SOFT_L1, 1.0
    with no_stderr():  # it announces itself whatever the level of logging
        call(partial(pycolmap.bundle_adjustment, model, options), "bundle adjustment")


@contextmanager
def open_database(path: str | Path) -> Iterator[pycolmap.Database]:
    """COLMAP's database, closed at the end of the block."""
    link = pycolmap.Database.open(path)
    try:
        yield link
    finally:
        link.close()


def _wait_for_end(thread: threading.Thread, ended: threading.Event) -> None:
    """Wait for a cancelled call to come back, however often the user presses Ctrl-C meanwhile."""
    while thread.ident is not None and not ended.is_set():
        with suppress(KeyboardInterrupt):
            ended.wait(1.0)


@contextmanager
def database_folder(beside: Path, size_bytes: float) -> Iterator[Path]:
    """Folder for a database that COLMAP works in, removed afterwards: in memory if that is small beside what is there.

    COLMAP ends the whole process when its database finds no room, so it should not lie where others write. A large one,
    or a system without a file system in memory, gets a folder next to `beside`.
    """
    where = beside.parent
    roomy = size_bytes <= MOST_IN_MEMORY and os.access(MEMORY, os.W_OK)
    if roomy and shutil.disk_usage(MEMORY).free > 2.0 * size_bytes + 1e6 * RESERVE_MB:
        where = MEMORY
    _sweep(where)
    with tempfile.TemporaryDirectory(prefix=f".wakewise-{os.getpid()}-", dir=where) as folder:
        yield Path(folder)


def _sweep(where: Path) -> None:
    """Remove the folders of processes that were killed."""
    for left in where.glob(".wakewise-*-*"):
        process = left.name.split("-")[1]
        if process.isdecimal() and not Path("/proc", process).exists():
            shutil.rmtree(left, ignore_errors=True)


@contextmanager
def no_stderr() -> Iterator[None]:
    """Discard what compiled code writes to standard error."""
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


def checkpoint_database(database: Path) -> None:
    """Merge the write-ahead log into the database, so that it is one file and can be renamed."""
    with closing(sqlite3.connect(database)) as link:
        link.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        link.execute("PRAGMA journal_mode=DELETE")
