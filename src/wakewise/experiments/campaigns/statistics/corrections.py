"""Several tests at once: p-values as they must be read when the best of many is looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError


def bonferroni(p: Sequence[float] | Array) -> Array:
    """Each p times how many there are, at most 1; shape (n,) in the order given.

    Raises
    ------
    InputError
        If one is not between 0 and 1.
    """
    values = _checked(p)
    return np.asarray(np.minimum(1.0, len(values) * values))


def holm(p: Sequence[float] | Array) -> Array:
    """Holm's step-down correction: never larger than Bonferroni's, as safe (Holm 1979, Scand. J. Statist. 6, 65).

    Raises
    ------
    InputError
        If one is not between 0 and 1.
    """
    values = _checked(p)
    order = np.argsort(values, kind="stable")
    weighed = (len(values) - np.arange(len(values))) * values[order]
    adjusted = np.empty_like(values)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(weighed))
    return adjusted


def _checked(p: Sequence[float] | Array) -> Array:
    values = np.asarray(p, dtype=np.float64)
    if values.ndim != 1 or not np.all((values >= 0.0) & (values <= 1.0)):
        raise InputError(f"p-values: {values!r}, must be a list of numbers from 0 to 1")
    return values
