"""One piece of work at a time on a thread of its own, beside what the caller does meanwhile."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable


class Beside:
    """Starts work and waits for it; with one core the work is done at once.

    A thread lives for one piece of work only: one that waited for the next would not survive a fork, and one that
    waited by spinning would take its core from other trials.
    """

    def __init__(self) -> None:
        self._thread: threading.Thread | None = None
        self._failure: BaseException | None = None

    def start(self, work: Callable[[], None]) -> None:
        """Begin a piece of work, after the one before it has ended."""
        self.wait()
        if (os.cpu_count() or 1) == 1:
            work()
            return

        def run() -> None:
            try:
                work()
            except BaseException as failure:  # handed on by `wait`
                self._failure = failure

        self._thread = threading.Thread(target=run, name="wakewise-silt")
        self._thread.start()

    def wait(self) -> None:
        """Return when the work has ended; what it raised is raised here."""
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._failure is not None:
            failure, self._failure = self._failure, None
            raise failure
