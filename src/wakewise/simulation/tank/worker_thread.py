"""Work done beside the one who asked for it, on a second core where there is one."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache

from wakewise.simulation.water.blocked_sums import cores


class WorkerThread:
    """Does one piece of work after another, in the order in which they were given, on a thread of its own.

    Where there is one core only, or nothing is to be done `beside` who asked, each is done at once. Threads are shared
    by all lanes of a name, and the order of a lane's own pieces is kept among those of others; what a piece does must
    not depend on what others do meanwhile.
    """

    def __init__(self, name: str, beside: bool = True) -> None:
        self._name, self._beside = name, beside
        self._under_way: deque[Future[None]] = deque()

    def do(self, work: Callable[[], None]) -> None:
        """Take on a piece of work; what an earlier one raised is raised here or by `wait`."""
        while self._under_way and self._under_way[0].done():
            self._under_way.popleft().result()
        if cores() == 1 or not self._beside:
            work()
        else:
            self._under_way.append(_thread(self._name).submit(work))

    def wait(self) -> None:
        """Return once all of it is done; raise what a piece raised."""
        while self._under_way:
            self._under_way.popleft().result()


@cache
def _thread(name: str) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix=name)


# Threads do not survive a fork, where there is such a thing; the child starts its own.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_thread.cache_clear)
