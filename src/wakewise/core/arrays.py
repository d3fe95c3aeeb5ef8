"""Read-only NumPy arrays for frozen records."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wakewise.core.errors import InputError


class NotFinite(InputError):  # noqa: N818  (it is what the array is)
    """An array holds NaN or infinity; where nobody gave it, something has diverged."""


Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
_FLOAT = np.dtype(np.float64)
_KINDS = {"b": "True and False", "c": "complex numbers", "U": "words", "S": "bytes", "M": "dates", "m": "time spans"}
"""What an array holds that is no array of real numbers, by NumPy's letter."""
_FEW = 16
"""So many numbers Python adds up before NumPy has begun."""
_REASON = 100
"""So many letters of another library's reason are told."""
_ONE_THREAD = 8192
"""OpenBLAS takes longer dot products to all cores, and its threads spin for a while after each."""


def frozen(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> Array:
    """Copy `value` into a read-only, C-contiguous float64 array of the given shape.

    `shape`: expected shape; `None` lets that axis have any length. `name`: what the value is called in the error
    message. Raises InputError if it holds anything but real numbers, the shape differs, or an element is not finite.
    """
    known = type(value) is np.ndarray and value.dtype is _FLOAT
    array = np.array(value if known else _real(value, name), dtype=np.float64, order="C")
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
        raise NotFinite(f"{name}: holds NaN or infinity, every element must be finite")
    array.setflags(write=False)
    return array


def _real(value: ArrayLike, name: str) -> NDArray[Any]:
    """`value` as an array of real numbers, of whatever type."""
    parts = (value, *value) if isinstance(value, (list, tuple)) else (value,)
    if any(isinstance(part, np.ma.MaskedArray) and np.ma.is_masked(part) for part in parts):
        raise InputError(f"{name}: is masked in part, allowed: real numbers, all of them known")
    try:
        array = np.asarray(value)
    except Exception as fault:  # ragged lists, and whatever the conversion of a thing from outside raises
        reason = " ".join(str(fault).split())[:_REASON]
        raise InputError(f"{name}: no array of numbers can be made of it ({type(fault).__name__}: {reason})") from None
    if array.dtype.kind not in "iuf":
        raise InputError(f"{name}: holds {_KINDS.get(array.dtype.kind, 'objects')}, allowed: real numbers")
    return array


def frozen_indices(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> IntArray:
    """Copy `value` into a read-only, C-contiguous int64 array of the given shape (see `frozen`).

    Raises InputError if it holds anything but whole numbers, or the shape differs.
    """
    array = np.array(frozen(value, shape, name), dtype=np.int64, order="C")
    if not np.array_equal(array, np.asarray(value)):
        raise InputError(f"{name}: holds fractions, allowed: whole numbers")
    array.setflags(write=False)
    return array


def freeze(record: Any, **shapes: tuple[int | None, ...]) -> None:
    """Replace the named array fields of a frozen dataclass by checked, read-only copies (call in `__post_init__`)."""
    for name, shape in shapes.items():
        object.__setattr__(record, name, frozen(getattr(record, name), shape, name))
