"""Trials without figures: left out, as the paper does, or counted as failures, as trials of medicines do.

A method that fails on the hard seeds looks better by what is left. So both are told wherever a model is judged.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from wakewise.core.arrays import Array

WORST: dict[str, float] = {"rmse_mm": 20.0, "completeness_pct": 0.0, "completeness_visible_pct": 0.0, "success": 0.0}
"""What a trial counts as that was to make a model and made none: the cap of the RMSE, nothing covered, no success."""

Row = Mapping[str, Any]


def dropped(rows: Iterable[Row | None], figure: str) -> Array:
    """Values of a figure over the trials that have it, shape (n,)."""
    known = (None if row is None else row.get(figure) for row in rows)
    return np.array([float(v) for v in known if v is not None and np.isfinite(v)], dtype=np.float64)


def as_worst(rows: Iterable[Row | None], figure: str, worst: Mapping[str, float] = WORST) -> Array:
    """Values over all trials that were meant to be made, shape (n,); those without one count as the worst.

    Raises
    ------
    KeyError
        If no worst is stated for this figure: nobody knows what a failed flight's energy is.
    """
    least = worst[figure]
    known = (None if row is None else row.get(figure) for row in rows)
    return np.array([least if v is None or not np.isfinite(v) else float(v) for v in known], dtype=np.float64)
