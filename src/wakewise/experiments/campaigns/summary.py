"""Methods compared at a glance: the first against the next best, by how much, from how many pairs, at what cost.

What of a campaign is compared with what: methods in each world, or whatever else its trials differ in.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.definition import FACTORS
from wakewise.experiments.campaigns.flights import HOVER_ONLY
from wakewise.experiments.campaigns.statistics import WORST, compare_pairs, probability_of_improvement
from wakewise.experiments.campaigns.table import MEASURES, ComparisonMetric, Results, varying_factors

Place = Mapping[str, Any]
"""A trial: world, method, target, seed, folder below the store, figures, and reason if it failed."""

FEWEST = 6
"""Pairs from which on a difference can be told apart from none: five agree by chance alone once in sixteen times."""
ENOUGH = 20
"""Pairs from which on a difference is no longer preliminary."""


@dataclass(frozen=True, kw_only=True)
class MethodSummary:
    """Methods in one world in a few words.

    `means` are in the unit of `words`, worst last; `winner` has the best mean and `rival` the next best. `less_pct` is
    how much better the winner is in percent, with its interval: how much less where `less_is_better`, else how much
    more. `energy_ratio` is what it costs over the rival, `silt_ratio` the silt between camera and target over the
    rival's; `failed` counts trials by method.
    """

    world: str
    figure: str
    words: str
    means: dict[str, float]
    winner: str
    rival: str | None
    less_pct: float | None
    interval_pct: tuple[float, float] | None
    p_t: float | None
    improvement: float | None
    energy_ratio: float | None
    failed: dict[str, int]
    trials: int
    silt_ratio: float | None = None
    less_is_better: bool = True

    @property
    def is_sure(self) -> bool:
        """Whether the pairs are enough, and the interval of the difference holds no zero."""
        return self.trials >= FEWEST and self.interval_pct is not None and self.interval_pct[0] > 0.0

    @property
    def sure(self) -> str:
        """What the pairs show of the difference, in words."""
        if self.rival is None:
            return "there was no other method"
        if self.trials < FEWEST:
            return f"too few pairs ({self.trials})"
        if not self.is_sure:
            return "not told apart"
        return "told apart" if self.trials >= ENOUGH else f"told apart, preliminary (n < {ENOUGH})"


def summarize(measure: ComparisonMetric, world: str, places: Sequence[Place]) -> MethodSummary | None:
    """Methods in one world; None where no seed was flown by all."""
    figure, words, scale, less = measure
    here = [place for place in places if place["world"] == world]
    values: dict[str, dict[tuple[str, int], float]] = {}
    failed: dict[str, int] = {}
    for place in here:
        method, known = place["method"], (place["target"], place["seed"])
        value = place["figures"].get(figure)
        failed.setdefault(method, 0)
        if value is None:
            failed[method] += 1
            value = WORST.get(figure)
        if value is not None:
            values.setdefault(method, {})[known] = scale * float(value)
    both = [known for known in next(iter(values.values()), {}) if all(known in own for own in values.values())]
    if not both:
        return None
    means = {method: float(np.mean([own[known] for known in both])) for method, own in values.items()}
    ranked = sorted(means, key=lambda method: means[method] if less else -means[method])
    winner, rival = ranked[0], ranked[1] if len(ranked) > 1 else None
    told: dict[str, Any] = dict.fromkeys(("less_pct", "interval_pct", "p_t", "improvement", "energy_ratio"))
    if rival is not None:
        ours, theirs = (np.array([values[who][known] for known in both]) for who in (winner, rival))
        compared = compare_pairs(ours, theirs)
        if compared.ratio is not None:
            sign = 1.0 if less else -1.0
            told["less_pct"] = sign * 100.0 * (1.0 - compared.ratio)
            if compared.interval is not None:
                low, high = sorted(sign * 100.0 * (1.0 - end) for end in compared.interval)
                told["interval_pct"] = (low, high)
        told["p_t"] = compared.test.p_t
        groups = [by_target(values[who], both) for who in (winner, rival)]
        told["improvement"] = probability_of_improvement(*groups, less_is_better=less)
        told["energy_ratio"] = _ratio(here, "energy_kJ", winner, rival, both)
        told["silt_ratio"] = _ratio(here, "ray_optical_depth", winner, rival, both)
    told |= {"world": world, "figure": figure, "words": words, "winner": winner, "rival": rival, "failed": failed}
    in_order = {method: means[method] for method in ranked}
    return MethodSummary(means=in_order, trials=len(both), less_is_better=less, **told)


def _ratio(
    places: Sequence[Place], figure: str, one: str, other: str, pairs: Sequence[tuple[str, int]]
) -> float | None:
    """Sum of a figure over pairs by one method over that by another; None where a trial lacks it or there is none."""
    known = {(p["method"], p["target"], p["seed"]): p["figures"].get(figure) for p in places}
    sums = []
    for method in (one, other):
        values = [known.get((method, *pair)) for pair in pairs]
        if any(value is None for value in values):
            return None
        sums.append(sum(float(value) for value in values if value is not None))
    return sums[0] / sums[1] if sums[1] > 0.0 else None


def worst_trials(measure: ComparisonMetric, world: str, places: Sequence[Place]) -> dict[str, Place]:
    """The worst trial of each method in a world: one that failed, else the one with the worst figure."""
    figure, _, _, less = measure

    def badness(place: Place) -> float:
        value = place["figures"].get(figure)
        return float("inf") if value is None else (1.0 if less else -1.0) * float(value)

    found: dict[str, Place] = {}
    for place in (p for p in places if p["world"] == world):
        method = place["method"]
        if method not in found or badness(place) > badness(found[method]):
            found[method] = place
    return found


def by_target(values: Mapping[tuple[str, int], float], which: Iterable[tuple[str, int]]) -> dict[str, list[float]]:
    """Values by target, of those that are known by target and seed."""
    found: dict[str, list[float]] = {}
    for known in which:
        found.setdefault(known[0], []).append(values[known])
    return found


_LEADING = ("rmse_mm", "target_speed_mean_m_s")
"""The first of these that trials have leads."""


def hover_words(found: Results) -> str:
    """Of how many flights the settling hover alone was flown, in words; empty where of none."""
    hovers = sum(bool(one.figures.get(HOVER_ONLY)) for one in found.made)
    done = found.count("done")
    which = f"{hovers} of {done} flights" if hovers < done else "all flights" if done > 1 else "the flight"
    return f"Hover only: {which} ended before the first leg (duration_s)." if hovers else ""


def paired_groups(found: Results, compare: str = "") -> list[Place]:
    """Trials that have ended, as `summarize` compares them: `method` is the compared factor, `world` what else differs.

    Raises InputError if `compare` is no factor of a campaign that can be compared.
    """
    varying = varying_factors(found.plan)
    compare = compare or varying[0]
    if compare not in FACTORS or compare == "seed":
        allowed = ", ".join(factor for factor in FACTORS if factor != "seed")
        raise InputError(f"--compare: '{compare}', allowed: {allowed}")
    apart = [factor for factor in varying if factor not in (compare, "target")]
    told: list[Place] = []
    for one in found.made:
        if one.state not in ("done", "failed"):
            continue
        factors = one.entry.factors
        world = ", ".join(str(factors.get(factor, "")) for factor in apart)
        if not world and compare != "world":
            world = str(factors.get("world", ""))
        told.append(
            {
                "world": world or "all",
                "method": str(factors.get(compare, "")),
                "target": "" if compare == "target" else str(factors.get("target", "")),
                "seed": int(factors.get("seed", 0)),
                "folder": f"trials/{one.entry.key}/work",
                "figures": dict(one.figures),
                "reason": one.reason,
            }
        )
    return told


def measures(found: list[Place]) -> list[ComparisonMetric]:
    """Those that some trial has, the leading one first."""
    known = {key for place in found for key, value in place["figures"].items() if value is not None}
    there = [measure for measure in MEASURES if measure.figure in known]
    leading = next((figure for figure in _LEADING if figure in known), "")
    return sorted(there, key=lambda measure: measure.figure != leading)


def method_contrasts(found: list[Place]) -> list[tuple[ComparisonMetric, MethodSummary]]:
    """Each measure in each world, over the trials that all of the compared have ended."""
    worlds = dict.fromkeys(place["world"] for place in found)
    pairs = ((measure, summarize(measure, world, found)) for measure in measures(found) for world in worlds)
    return [(measure, one) for measure, one in pairs if one is not None]
