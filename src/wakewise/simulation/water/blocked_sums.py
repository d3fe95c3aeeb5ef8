"""Long sums over points, split among threads without changing a byte."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import TypeVar

from wakewise.core.arrays import Array, IntArray

A = TypeVar("A", Array, IntArray)

_CHUNK = 256  # least points of a piece
_BLOCKS = 256
_THREADED_PAIRS = 700_000  # about 0.7 ms of work; below it threads cost more than they save
_MOST = 8  # threads
_PIECES = 4  # per thread: they are not all as long


def over_points(kernel: Callable[[A, A], None], points: A, out: A, pairs: int) -> None:
    """Call `kernel(points, out)` on all points or indices, in pieces on several threads if there are many pairs.

    The kernel must release the interpreter's lock and compute each row of `out` from its own point alone, or from its
    own group of successive points whose length divides 256; then the result does not depend on the pieces. The caller
    takes pieces, too: a thread that only waited would leave its core to the one that it has just woken, and the others
    idle for the milliseconds that all this takes.
    """
    if pairs < _THREADED_PAIRS or len(points) < 2 * _CHUNK or (workers := min(cores(), _MOST)) == 1:
        kernel(points, out)
        return
    # Whole blocks: kernels may look up to `_BLOCKS` successive points up together.
    size = max(_CHUNK, -(-len(points) // (_PIECES * workers * _BLOCKS)) * _BLOCKS)
    starts = deque(range(0, len(points), size))

    def take_pieces() -> None:
        while True:
            try:
                s = starts.popleft()
            except IndexError:
                return
            kernel(points[s : s + size], out[s : s + size])

    others = [_helpers().submit(take_pieces) for _ in range(workers - 1)]
    try:
        take_pieces()
    finally:
        # One that has not begun has nothing left to do.
        begun = [other for other in others if not other.cancel()]
        wait(begun)
    for other in begun:
        other.result()


@cache
def cores() -> int:
    """How many cores this process may use."""
    there = os.cpu_count() or 1
    return min(there, len(os.sched_getaffinity(0))) if hasattr(os, "sched_getaffinity") else there


@cache
def _helpers() -> ThreadPoolExecutor:
    """Threads that sleep until there is work: waiting by spinning would take the cores from other trials."""
    return ThreadPoolExecutor(_MOST - 1, thread_name_prefix="sums")


# Threads do not survive a fork, where there is such a thing; the child starts its own.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_helpers.cache_clear)
