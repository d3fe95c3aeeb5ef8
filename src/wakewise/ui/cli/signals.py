"""Signals and standard output of the `wakewise` program: Ctrl-C, SIGTERM, a closed pipe, a full disk."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

INTERRUPTED = threading.Event()
"""Set by Ctrl-C and SIGTERM. Libraries that try imports or call back from C may swallow the exception itself."""
TERMINATED = threading.Event()
"""Set by SIGTERM."""
EXIT_INTERRUPTED, EXIT_TERMINATED = 130, 143


@contextmanager
def program_signals() -> Iterator[None]:
    """Raise KeyboardInterrupt on Ctrl-C and SIGTERM while the block runs; ignore both after it.

    A second SIGTERM does not disturb the clean-up after the first. Ctrl-C stays ignored where the shell ignores it, as
    for a job in the background. After the block everything is said, and a late signal must not print a traceback.
    """
    signal.signal(signal.SIGTERM, _terminate)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def exit_code() -> int:
    """Exit code of a stopped command."""
    return EXIT_TERMINATED if TERMINATED.is_set() else EXIT_INTERRUPTED


def close_output() -> None:
    """Close standard output if it cannot be written, so that Python does not try again at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError):
            sys.stdout.close()


def _terminate(*_: Any) -> None:
    TERMINATED.set()
    INTERRUPTED.set()
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise KeyboardInterrupt


def _interrupt(*_: Any) -> None:
    INTERRUPTED.set()
    raise KeyboardInterrupt
