"""From flights in a world to its table: means with intervals over seeds, and what each method leaves of `dp`'s wash."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise_paper.wash_reduction.figures import reduction_pct

Row = Mapping[str, float | None]
RESAMPLES = 4000
RATIOS = (
    ("target_speed_mean_m_s", "target_speed"),
    ("exposure_speed_mean_m_s", "exposure_speed"),
    ("bed_shear_p95_Pa", "bed_shear"),
    ("silt_lifted_g", "silt_lifted"),
    ("silt_suspended_max_g", "silt_suspended"),
    ("ray_optical_depth", "ray_optical_depth"),
    ("sway_rms_mm", "sway"),
    ("sway_wash_mm", "sway_wash"),
    ("position_rmse_mm", "position"),
    ("energy_kJ", "energy"),
)
"""Figures whose ratio to the first method is told, and the ratio's name."""


def method_figures(rows: Mapping[int, Row], keys: tuple[str, ...]) -> dict[str, Any]:
    """Mean of each figure over seeds, an interval of 95 % by bootstrap, and reasons for what is missing.

    A figure that no seed has is null; the interval of one seed is null.
    """
    answer: dict[str, Any] = {"flights": len(rows)}
    for key in keys:
        known = np.array([v for v in (row.get(key) for row in rows.values()) if v is not None and np.isfinite(v)])
        answer[key] = float(known.mean()) if len(known) else None
        answer[f"{key}_interval"] = _interval(known) if len(known) > 1 else None
    return answer


def ratios(base: Mapping[int, Row], other: Mapping[int, Row]) -> dict[str, Any]:
    """How much smaller each figure's mean is than the base's, in percent, over the seeds that both flew.

    With an interval of 95 % over pairs, and of the target's speed the worst and the best seed.
    """
    answer: dict[str, Any] = {}
    for figure, name in RATIOS:
        value, interval = reduction_pct(base, other, figure)
        answer[f"{name}_less_pct"], answer[f"{name}_less_interval_pct"] = value, interval
    each = [
        100.0 * (1.0 - ours / theirs)
        for seed in sorted(set(base) & set(other))
        if (ours := other[seed].get(RATIOS[0][0])) is not None and (theirs := base[seed].get(RATIOS[0][0]))
    ]
    answer["target_speed_less_worst_pct"] = min(each) if each else None
    answer["target_speed_less_best_pct"] = max(each) if each else None
    return answer


def _interval(values: Array) -> tuple[float, float]:
    rng = np.random.default_rng(0)
    means = values[rng.integers(len(values), size=(RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(low), float(high)
