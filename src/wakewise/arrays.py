"""Read-only NumPy arrays for frozen records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wakewise.errors import InputError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
_FEW = 16
"""So many numbers Python adds up before NumPy has begun."""
_ONE_THREAD = 8192
"""OpenBLAS takes longer dot products to all cores, and its threads spin for a while after each."""


def frozen(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> Array:
    """Copy `value` into a read-only, C-contiguous float64 array of the given shape.

    Parameters
    ----------
    value : array_like
    shape : tuple
        Expected shape; `None` lets that axis have any length.
    name : str
        What the value is called in the error message.

    Raises
    ------
    InputError
        If the shape differs or an element is not finite.
    """
    array = np.array(value, dtype=np.float64, order="C")
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(want is not None and got != want for got, want in zip(array.shape, shape, strict=True))
    ):
        wanted = "(" + ", ".join("n" if s is None else str(s) for s in shape) + ")"
        raise InputError(f"{name}: shape {array.shape}, allowed {wanted}")
    flat = array.ravel()
    # A NaN or infinity shows in a sum, at a fraction of the cost; so may numbers that are merely large.
    if flat.size <= _FEW:
        quick = math.isfinite(sum(flat.tolist()))
    else:
        quick = flat.size <= _ONE_THREAD and math.isfinite(flat.dot(flat))
    if not quick and not np.isfinite(array).all():
        raise InputError(f"{name}: holds NaN or infinity, every element must be finite")
    array.setflags(write=False)
    return array


def freeze(record: Any, **shapes: tuple[int | None, ...]) -> None:
    """Replace the named array fields of a frozen dataclass by checked, read-only copies (call in `__post_init__`)."""
    for name, shape in shapes.items():
        object.__setattr__(record, name, frozen(getattr(record, name), shape, name))
