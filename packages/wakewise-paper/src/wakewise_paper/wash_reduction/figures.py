"""From flights to figures: reductions over pairs of flights with intervals, by logarithms and by sums.

A pair is two flights of one seed, which meet the same world. Intervals hold 95 % of a bootstrap over pairs, drawn anew
within strata where each stratum has two pairs or more, else from all.

What the bounds on sharing say (`bound.py`): flight by flight, and over those in which `dp` leaves too much.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise_paper.flight_batches import Key
from wakewise_paper.wash_reduction.energy_optimum import ENERGIES, choose_under_budget

SPEED = "target_speed_mean_m_s"
TROUBLE_M_S = 0.010
"""What `dp` leaves where there is trouble, more than."""
RESAMPLES = 4000
LEAST_M_S = 0.5e-3
"""Speeds below count as this in logarithms: the tank merges rings with errors of up to three times that, and a flight
that happens to leave nothing would carry a mean."""

Row = Mapping[str, float | None]
Interval = tuple[float, float]
Pairs = list[tuple[float, float, Hashable]]
"""Theirs, ours, and the stratum, flight by flight."""


def pairs_of(base: Mapping[Any, Row], other: Mapping[Any, Row], figure: str, strata: Mapping[Any, Hashable]) -> Pairs:
    """Values of a figure where both flights have it, by what they are known by."""
    found: Pairs = []
    for key in sorted(set(base) & set(other), key=str):
        theirs, ours = base[key].get(figure), other[key].get(figure)
        if theirs is not None and ours is not None and np.isfinite(theirs) and np.isfinite(ours):
            found.append((float(theirs), float(ours), strata.get(key, "")))
    return found


def log_reduction_pct(pairs: Pairs, unanswered: int = 0) -> tuple[float | None, Interval | None, float | None]:
    """How much smaller speeds are, 1 - exp(mean ln ratio) in percent; its interval; and the worst flight's.

    Parameters
    ----------
    pairs : Pairs
    unanswered : int
        Flights of ours that failed where the other's did not: each counts as no gain.
    """
    if not pairs and not unanswered:
        return None, None, None
    logs = [float(np.log(max(ours, LEAST_M_S) / max(theirs, LEAST_M_S))) for theirs, ours, _ in pairs]
    logs += [0.0] * unanswered
    strata = [where for _, _, where in pairs] + ["failed"] * unanswered
    means = _resampled(np.array(logs)[:, None], strata)
    value, worst = (100.0 * (1.0 - float(np.exp(v))) for v in (np.mean(logs), max(logs)))
    return value, None if means is None else _ends(100.0 * (1.0 - np.exp(means[:, 0]))), worst


def ratio(pairs: Pairs) -> tuple[float | None, Interval | None]:
    """Sum of ours over the sum of theirs, and its interval; none where theirs is nothing."""
    values = np.array([(theirs, ours) for theirs, ours, _ in pairs], dtype=np.float64).reshape(-1, 2)
    if len(values) == 0 or not values[:, 0].sum() > 0.0:
        return None, None
    value = float(values[:, 1].sum() / values[:, 0].sum())
    means = _resampled(values, [where for _, _, where in pairs])
    if means is None:
        return value, None
    means = means[means[:, 0] > 0.0]  # of no base there is no share
    return value, _ends(means[:, 1] / means[:, 0])


def reduction_pct(
    base: Mapping[Any, Row], other: Mapping[Any, Row], figure: str, strata: Mapping[Any, Hashable] | None = None
) -> tuple[float | None, Interval | None]:
    """How much smaller the mean of a figure is, in percent of the base's, over the seeds that both flew."""
    value, interval = ratio(pairs_of(base, other, figure, strata or {}))
    less = None if interval is None else (100.0 * (1.0 - interval[1]), 100.0 * (1.0 - interval[0]))
    return None if value is None else 100.0 * (1.0 - value), less


def means(rows: Iterable[Row], keys: tuple[str, ...]) -> dict[str, Any]:
    """Mean of each figure over flights, an interval beside it, and how many flights; solve times: the worst."""
    listed = list(rows)
    answer: dict[str, Any] = {"flights": len(listed)}
    for key in keys:
        known = np.array([v for v in (row.get(key) for row in listed) if v is not None and np.isfinite(v)])
        mean = np.max if key == "solve_ms_p99" else np.mean
        answer[key] = float(mean(known)) if len(known) else None
        drawn = _resampled(known[:, None], [""] * len(known))
        answer[f"{key}_interval"] = None if drawn is None or key == "solve_ms_p99" else _ends(drawn[:, 0])
    return answer


def _ends(values: Array) -> Interval:
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def _resampled(values: Array, strata: list[Any]) -> Array | None:
    """Means over draws of rows with replacement, shape (RESAMPLES, columns), within strata; None of a single row."""
    if len(values) < 2:
        return None
    groups = [np.flatnonzero([where == name for where in strata]) for name in dict.fromkeys(strata)]
    if min(len(group) for group in groups) < 2:
        groups = [np.arange(len(values))]
    rng = np.random.default_rng(0)
    picked = np.concatenate([group[rng.integers(len(group), size=(RESAMPLES, len(group)))] for group in groups], axis=1)
    return np.asarray(values[picked].mean(axis=1))


NAMED = ("rule", "belief", "belief_any")
KINDS = ("bound", "attained")


def bound_figures(rows: Mapping[Key, Row]) -> dict[str, Any]:
    """Table of all flights, by name, and `trouble`, over those in which `dp` leaves more than 10 mm/s; None of none."""
    trouble = [row for row in rows.values() if (row["dp_m_s"] or 0.0) > TROUBLE_M_S]
    return {
        "flights": {f"{scenario} {seed}": reductions(row) for (scenario, _, seed), row in rows.items()},
        "trouble": over_flights(trouble) if trouble else None,
    }


def reductions(row: Row) -> dict[str, float | None]:
    """A flight's figures with speeds as `*_less_pct` than `dp` as it was flown, whose own stays in m/s.

    Speeds below `LEAST_M_S` count as it.
    """
    told: dict[str, float | None] = {}
    for key, value in row.items():
        if key.endswith("_m_s") and key != "dp_m_s":
            less = None if value is None else 100.0 * (1.0 - float(np.exp(_log(row, key))))
            told[key.removesuffix("_m_s") + "_less_pct"] = less
        else:
            told[key] = value
    return told


def over_flights(rows: list[Row]) -> dict[str, Any]:
    """Over flights: reductions by the mean of logarithms, energies by sums, as in the headline.

    `bound_1.3_less_pct` and the like hold each flight to the bound on energy; `bound_1.3_summed_less_pct` holds their
    sum to it, so that flights in which power buys much may have more. The rule, and what is believed, are beside them,
    each over the flights that have it, and the least thrusts without the noise of the wrench, `least_less_pct`.
    """
    told: dict[str, Any] = {"flights": len(rows)}
    told["least_less_pct"] = _less([_log(row, "least_m_s") for row in rows])
    for name in NAMED:
        own = [row for row in rows if row[f"{name}_m_s"] is not None]
        told[f"{name}_flights"] = len(own)
        told[f"{name}_less_pct"] = _less([_log(row, f"{name}_m_s") for row in own])
        told[f"{name}_energy"] = _ratio(own, [float(row[f"{name}_energy"] or 0.0) for row in own])
    for kind in KINDS:
        for name, most in ENERGIES.items():
            told[f"{kind}_{name}_less_pct"] = _less([_log(row, f"{kind}_{name}_m_s") for row in rows])
            told[f"{kind}_{name}_energy"] = _ratio(rows, [float(row[f"{kind}_{name}_energy"] or 0.0) for row in rows])
            told[f"{kind}_{name}_summed_less_pct"] = _summed(rows, kind, most)
    return told


def _summed(rows: list[Row], kind: str, most: float) -> float | None:
    """Reduction if the flights share a bound on their summed energy, each at one of its own or with the least."""
    powers = np.array([float(row["least_power_W"] or 0.0) for row in rows])
    logs = np.array([[_log(row, "least_m_s"), *(_log(row, f"{kind}_{name}_m_s") for name in ENERGIES)] for row in rows])
    energy = np.array([[1.0, *(float(row[f"{kind}_{name}_energy"] or 0.0) for name in ENERGIES)] for row in rows])
    picks = choose_under_budget(logs, energy * powers[:, None], most * float(powers.sum()))
    return _less([float(own[pick]) for own, pick in zip(logs, picks, strict=True)])


def _log(row: Row, key: str) -> float:
    """Logarithm of a speed over that of `dp` as flown."""
    return float(np.log(max(row[key] or 0.0, LEAST_M_S) / max(row["dp_m_s"] or 0.0, LEAST_M_S)))


def _less(logs: list[float]) -> float | None:
    return 100.0 * (1.0 - float(np.exp(np.mean(logs)))) if logs else None


def _ratio(rows: list[Row], energies: list[float]) -> float | None:
    """Energy of all flights over that of the least thrusts; flights of a scenario last about the same."""
    powers = np.array([float(row["least_power_W"] or 0.0) for row in rows])
    return float(powers @ np.array(energies) / powers.sum()) if rows else None
