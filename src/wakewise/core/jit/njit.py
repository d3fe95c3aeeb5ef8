"""`njit` as the kernels of this package use it: compiled by Numba, or run as the Python that they are written in.

Numba has nothing for 32-bit computers such as the one in a BlueROV2. What is small enough to be interpreted, such as
the gentle meter (`wakewise_ardusub.wash_meter`), runs there from the same lines; everything else would be far too slow.
With NUMBA_DISABLE_JIT=1 kernels are run so where there is a Numba, too: for a debugger, or to see which lines a test
runs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

__all__ = ["COMPILED", "assign", "assign_rows", "njit", "prange"]

try:
    from wakewise.core.jit.kernel_cache import JIT, njit, prange

    COMPILED = JIT
except ModuleNotFoundError as fault:
    if (fault.name or "").partition(".")[0] not in {"numba", "llvmlite"}:
        raise
    COMPILED = False
    prange = range

    def njit(function: Callable[..., Any] | None = None, *, apart: bool = False, **options: Any) -> Any:
        """The function as it is written, whatever Numba would be told."""
        del apart, options
        return (lambda work: work) if function is None else function


@njit(inline="always")
def assign(target: Any, source: Any) -> None:
    """`target[:] = source` for vectors of one length, within a kernel.

    Numba's own slice assignment brings the making of a message about shapes into each kernel: seconds to compile.
    """
    for i in range(target.size):
        target[i] = source[i]


@njit(inline="always")
def assign_rows(target: Any, source: Any) -> None:
    """`target[:] = source` for matrices of one shape, within a kernel, for the same reason."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]
