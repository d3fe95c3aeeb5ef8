"""From flights to figures: means, paired reductions with intervals, and the table of levers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from wakewise.arrays import Array
from wakewise.studies.gentle.flight import FIGURES
from wakewise.studies.gentle.levers import Entry

SPEED = "target_speed_mean_m_s"
SHOT = "exposure_speed_mean_m_s"
RESAMPLES = 4000

Row = Mapping[str, float | None]
Flights = Mapping[str, Mapping[int, Row]]
"""Flights of one flow by name of method or lever, and by seed."""
Interval = tuple[float, float]


def reduction_pct(
    base: Mapping[int, Row], other: Mapping[int, Row], figure: str
) -> tuple[float | None, Interval | None]:
    """How much smaller the mean of a figure is, in percent of the base's, over the seeds that both flew.

    The interval holds 95 % of a bootstrap over pairs of flights with the same seed; there is none with one pair.
    """
    values = _pairs(base, other, figure)
    if len(values) == 0 or not values[:, 0].mean() > 0.0:
        return None, None
    value = 100.0 * (1.0 - float(values[:, 1].mean() / values[:, 0].mean()))
    if len(values) == 1:
        return value, None
    means = _resampled(values)
    means = means[means[:, 0] > 0.0]  # of no base there is no share
    low, high = np.percentile(100.0 * (1.0 - means[:, 1] / means[:, 0]), [2.5, 97.5])
    return value, (float(low), float(high))


def change(base: Mapping[int, Row], other: Mapping[int, Row], figure: str) -> tuple[float | None, Interval | None]:
    """Mean difference of a figure (other less base) over pairs, and 95 % of a bootstrap."""
    values = _pairs(base, other, figure)
    if len(values) == 0:
        return None, None
    apart = values[:, 1] - values[:, 0]
    if len(values) == 1:
        return float(apart[0]), None
    low, high = np.percentile(_resampled(apart[:, None])[:, 0], [2.5, 97.5])
    return float(apart.mean()), (float(low), float(high))


def means(rows: Iterable[Row]) -> dict[str, Any]:
    """Mean of each figure over flights, with an interval of the speeds, and how many flights."""
    listed = list(rows)
    answer: dict[str, Any] = {"flights": len(listed)}
    for key in listed[0] if listed else FIGURES:
        known = np.array([v for v in (row[key] for row in listed) if v is not None and np.isfinite(v)])
        answer[key] = float(known.mean()) if len(known) else None
        if key in (SPEED, SHOT) and len(known) > 1:
            low, high = np.percentile(_resampled(known[:, None])[:, 0], [2.5, 97.5])
            answer[f"{key}_interval"] = (float(low), float(high))
    return answer


def flow_figures(world: str, flights: Flights, methods: tuple[str, ...], table: Mapping[str, Entry]) -> dict[str, Any]:
    """Figures of one flow: methods, reductions of `wake-aware` against each other method, levers."""
    answer: dict[str, Any] = {
        "circular": world == "paper",
        "seeds": max((len(flights.get(name, {})) for name in methods), default=0),
        "methods": {name: means(flights.get(name, {}).values()) for name in methods},
    }
    gentle = flights.get("wake-aware", {})
    for base in (name for name in methods if name != "wake-aware"):
        tag = base.replace("-", "_")
        for figure, short in ((SPEED, ""), (SHOT, "_exposure"), ("disturbance", "_disturbance")):
            value, interval = reduction_pct(flights.get(base, {}), gentle, figure)
            answer[f"reduction_vs_{tag}{short}_pct"] = value
            answer[f"reduction_vs_{tag}{short}_interval_pct"] = interval
        worse, interval = change(flights.get(base, {}), gentle, "position_rmse_mm")
        answer[f"position_change_vs_{tag}_mm"] = worse
        answer[f"position_change_vs_{tag}_interval_mm"] = interval
    answer["levers"], answer["lever_details"] = {}, {}
    for name, entry in table.items():
        flown = flights.get(name, {})
        if flown:
            details = lever_figures(entry, flights)
            answer["levers"][name] = details["reduction_pct"]
            answer["lever_details"][name] = details
    return answer


def lever_figures(entry: Entry, flights: Flights) -> dict[str, Any]:
    """One line of the table: reduction against its base and against `dp`, and the flights' own figures."""
    flown = flights[entry.name]
    base = flights.get(entry.base, {})
    value, interval = reduction_pct(base, flown, SPEED)
    shot, shot_interval = reduction_pct(base, flown, SHOT)
    against_dp, dp_interval = reduction_pct(flights.get("dp", {}), flown, SPEED)
    return {
        "group": entry.group,
        "base": entry.base,
        "reduction_pct": value,
        "interval_pct": interval,
        "exposure_reduction_pct": shot,
        "exposure_interval_pct": shot_interval,
        "reduction_vs_dp_pct": against_dp,
        "dp_interval_pct": dp_interval,
        **means(flown.values()),
    }


def _pairs(base: Mapping[int, Row], other: Mapping[int, Row], figure: str) -> Array:
    pairs = [(base[s].get(figure), other[s].get(figure)) for s in sorted(set(base) & set(other))]
    return np.array([pair for pair in pairs if None not in pair], dtype=np.float64).reshape(-1, 2)


def _resampled(values: Array) -> Array:
    """Means over draws of rows with replacement, shape (RESAMPLES, columns)."""
    draws = np.random.default_rng(0).integers(0, len(values), (RESAMPLES, len(values)))
    return np.asarray(values[draws].mean(axis=1))
