"""Shares of a model and of the truth within thresholds that suit the object's size, or that were asked for."""

from __future__ import annotations

from dataclasses import dataclass

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError

RELATIVE_PCT = (0.25, 0.5, 1.0)
"""Thresholds in percent of the diagonal of the truth's box where none are given: 1 to 4 mm of a thing of 0.4 m."""
TELLING_PCT = 2.0
"""A threshold above this share of the object says little: nearly everything about it is within."""


@dataclass(frozen=True, kw_only=True)
class ThresholdScore:
    """Precision and recall at one threshold.

    accuracy_pct: share of the model nearer to the truth than the threshold; completeness_pct: of the truth nearer to
    the model; f_score: their harmonic mean, 0 to 100.
    """

    threshold_mm: float
    accuracy_pct: float
    completeness_pct: float
    f_score: float


def shares(to_truth_mm: Array, to_model_mm: Array, thresholds_mm: tuple[float, ...]) -> tuple[ThresholdScore, ...]:
    """Shares at each threshold, of distances, shape (n,) and (m,)."""
    out = []
    for threshold in thresholds_mm:
        precision = 100.0 * float((to_truth_mm < threshold).mean())
        recall = 100.0 * float((to_model_mm < threshold).mean())
        both = precision + recall
        out.append(
            ThresholdScore(
                threshold_mm=threshold,
                accuracy_pct=precision,
                completeness_pct=recall,
                f_score=2.0 * precision * recall / both if both > 0.0 else 0.0,
            )
        )
    return tuple(out)


def read_thresholds(words: str | None, extent_mm: float) -> tuple[float, ...]:
    """Thresholds in mm from `0.5,1` (mm) or `0.5%,1%` (of the extent); by the object's size if none are given.

    Raises
    ------
    InputError
        If one is no number above 0.
    """
    parts = [f"{share}%" for share in RELATIVE_PCT] if words is None else [part.strip() for part in words.split(",")]
    out = []
    for part in parts:
        try:
            value = float(part.removesuffix("%"))
        except ValueError:
            value = 0.0
        if not 0.0 < value < 1e6:
            raise InputError(f"--thresholds '{part}': must be lengths above 0 in mm, or shares such as 0.5%,1%")
        out.append(0.01 * value * extent_mm if part.endswith("%") else value)
    return tuple(sorted(set(out)))
