"""One piece of work at a time on a thread of its own, beside what the caller does meanwhile."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor


class Beside:
    """Starts work and waits for it; with one core the work is done at once.

    The thread sleeps between two pieces of work and ends with its owner. Starting one for each piece would make the
    caller wait until it runs, for up to a millisecond.
    """

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=name) if (os.cpu_count() or 1) > 1 else None
        self._under_way: Future[None] | None = None

    def start(self, work: Callable[[], None]) -> None:
        """Begin a piece of work, after the one before it has ended."""
        self.wait()
        if self._pool is None:
            work()
        else:
            self._under_way = self._pool.submit(work)

    def wait(self) -> None:
        """Return when the work has ended; what it raised is raised here."""
        if self._under_way is not None:
            ended, self._under_way = self._under_way, None
            ended.result()
