"""Long sums over points, split among threads without changing a byte."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from wakewise.arrays import Array

_CHUNK = 192  # least points of a piece
_BLOCKS = 64
_THREADED_PAIRS = 700_000  # about 0.7 ms of work; below it threads cost more than they save


def over_points(kernel: Callable[[Array, Array], None], points: Array, out: Array, pairs: int) -> None:
    """Call `kernel(points, out)` on all points, in pieces on several threads if there are many pairs.

    The kernel must release the interpreter's lock and compute each row of `out` from its own point alone, or from its
    own block of successive points whose length divides 64; then the result does not depend on the pieces. Threads live
    for one call only: a pool that waits by spinning takes the cores from other trials that run beside this one, and a
    pool that stays does not survive a fork.
    """
    if pairs < _THREADED_PAIRS or len(points) < 2 * _CHUNK or (workers := min(os.cpu_count() or 1, 8)) == 1:
        kernel(points, out)
        return
    # Whole blocks: kernels may look up to `_BLOCKS` successive points up together.
    size = max(_CHUNK, -(-len(points) // (2 * workers * _BLOCKS)) * _BLOCKS)
    starts = range(0, len(points), size)
    with ThreadPoolExecutor(workers) as pool:
        for done in [pool.submit(kernel, points[s : s + size], out[s : s + size]) for s in starts]:
            done.result()
