"""Long sums over points, split among threads without changing a byte."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from wakewise.arrays import Array

_CHUNK = 192  # least points of a piece
_BLOCKS = 64
_THREADED_PAIRS = 700_000  # about 0.7 ms of work; below it threads cost more than they save
_PIECES = 4  # per thread: they are not all as long


def over_points(kernel: Callable[[Array, Array], None], points: Array, out: Array, pairs: int) -> None:
    """Call `kernel(points, out)` on all points, in pieces on several threads if there are many pairs.

    The kernel must release the interpreter's lock and compute each row of `out` from its own point alone, or from its
    own block of successive points whose length divides 64; then the result does not depend on the pieces. Threads live
    for one call only: a pool that waits by spinning takes the cores from other trials that run beside this one, and a
    pool that stays does not survive a fork. The caller takes pieces, too: a thread that only waited would leave its
    core to the one that it has just woken, and the others idle for the milliseconds that all this takes.
    """
    if pairs < _THREADED_PAIRS or len(points) < 2 * _CHUNK or (workers := min(os.cpu_count() or 1, 8)) == 1:
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

    with ThreadPoolExecutor(workers - 1) as pool:
        others = [pool.submit(take_pieces) for _ in range(workers - 1)]
        take_pieces()
        for other in others:
            other.result()
