"""From trials to rows: the paper's figure, ours with its interval, whether it is met, and how sure a difference is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.statistics import (
    WORST,
    Interval,
    as_reduction,
    compare_pairs,
    holm,
    mean_interval,
    pairs_needed,
    probability_of_improvement,
    share_interval,
)
from wakewise.experiments.campaigns.summary import ENOUGH, FEWEST, by_target
from wakewise.experiments.campaigns.task import TrialOutcome
from wakewise_paper.reproduction.claim import DIFFERENCES, ORDER, PublishedFigure, setup_of
from wakewise_paper.reproduction.table_trials import NOWHERE

Row = dict[str, Any]
Known = tuple[str, int]
"""Target and seed: what pairs are known by."""


ORDER_DRAWS = 4000
"""Draws of the bootstrap that says how often the means stand in the paper's order."""
ORDER_SURE_PCT = 95.0
"""Share of these draws from which on the order is sure."""
NOT_MADE = "not finished"
"""What a campaign says of a trial that it has not come to, or was stopped at."""


@dataclass(frozen=True)
class CompletedTrial:
    """A trial of a table and what became of it."""

    plan: PlannedTrial
    outcome: TrialOutcome

    @property
    def flown(self) -> bool:
        """Whether it was made at all: one that a budget left undone is no failure."""
        return self.outcome.figures is not None or (self.outcome.attempts > 0 and self.outcome.reason != NOT_MADE)


class TableTrials:
    """The trials of one table in one world, by method."""

    def __init__(self, made: Iterable[CompletedTrial]) -> None:
        self._rows: dict[str, dict[Known, Mapping[str, Any] | None]] = {}
        for one in made:
            if one.flown:
                self._rows.setdefault(one.plan.method, {})[one.plan.target, one.plan.seed] = one.outcome.figures

    @property
    def methods(self) -> list[str]:
        """Those that were flown."""
        return list(self._rows)

    def of(self, method: str, target: str | None = None) -> dict[Known, Mapping[str, Any] | None]:
        """Figures by target and seed, None of a trial that failed; of one target or all."""
        return {k: v for k, v in self._rows.get(method, {}).items() if target is None or k[0] == target}

    def values(self, method: str, figure: str, target: str | None = None, itt: bool = False) -> dict[Known, float]:
        """A figure where it is known; where `itt`, the worst of it in place of what is missing."""
        found: dict[Known, float] = {}
        for known, row in self.of(method, target).items():
            value = None if row is None else row.get(figure)
            if value is None or not math.isfinite(float(value)):
                if itt and figure in WORST:
                    found[known] = WORST[figure]
                continue
            found[known] = float(value)
        return found

    def targets(self, method: str) -> list[str]:
        """Targets that it has trials of."""
        return list(dict.fromkeys(known[0] for known in self._rows.get(method, {})))


SIGNED = ("bias_far_pct", "r2_wake", "r2_core")
"""Figures that may be below 0."""


def table_rows(claims: Sequence[PublishedFigure], worlds: Mapping[str, TableTrials]) -> list[Row]:
    """Rows of a table whose trials are flights or scans, world by world; claims without a trial have none there."""
    rows: list[Row] = []
    for world, trials in worlds.items():
        here: list[Row] = []
        for claim in claims:
            if claim.worlds and world not in claim.worlds:
                continue
            if claim.method not in trials.methods and claim.reading != "order":
                continue
            if claim.than is not None and claim.than not in trials.methods:
                continue
            row = _read(claim, trials, worlds)
            if row is None:
                continue
            here.append(_whole(claim, world, None, row, _others(claim, trials, worlds)))
            targets = trials.targets(claim.method)
            if claim.reading == "mean" and len(targets) > 1 and not claim.itt:
                here += [
                    _whole(claim, world, target, found, quoted=False)
                    for target in targets
                    if (found := _mean(claim, trials, target)) is not None
                ]
        _correct(here)
        rows += here
    return rows


def _read(claim: PublishedFigure, trials: TableTrials, worlds: Mapping[str, TableTrials]) -> Row | None:
    if claim.reading == "more_pct":
        return _more_pct(claim, trials, worlds.get(claim.against or ""))
    return _READ[claim.reading](claim, trials)


def _others(claim: PublishedFigure, trials: TableTrials, worlds: Mapping[str, TableTrials]) -> list[float | None]:
    """The figure of a claim of every other method here; none where nothing is asked of it."""
    if claim.bar is None or claim.side == "none":
        return []
    others = (method for method in trials.methods if method not in (claim.method, claim.than))
    rows = (_read(replace(claim, method=method), trials, worlds) for method in others)
    return [None if row is None else row["ours"] for row in rows]


def once_rows(claims: Sequence[PublishedFigure], figures: Mapping[str, Any], world: str = NOWHERE) -> list[Row]:
    """Rows of one measurement, whose figures are called "METHOD/FIGURE", or "METHOD/TARGET/FIGURE"."""
    rows: list[Row] = []
    for claim in claims:
        for key, value in figures.items():
            method, *between, figure = key.split("/")
            if method != claim.method or figure != claim.figure:
                continue
            target = between[0] if between else None
            found = {"ours": value, "low": None, "high": None, "n": 1, "failed": 0}
            if value is None:
                found["why"] = "the data do not reach it"
            if not between:
                found |= _counted(claim, figures)
            others = [other for name, other in figures.items() if name.split("/")[1:] == key.split("/")[1:]]
            rows.append(_whole(claim, world, target, found, others if len(others) > 1 else ()))
    return rows


def _whole(
    claim: PublishedFigure,
    world: str,
    target: str | None,
    found: Row,
    others: Sequence[float | None] = (),
    quoted: bool = True,
) -> Row:
    """A row with all its keys; of a part of what the paper's figure is about, no paper's figure.

    `others` has the same figure of the other methods there.
    """
    ours, low, high, n = found["ours"], found["low"], found["high"], found["n"]
    met = found.pop("met") if "met" in found else claim.met(ours) if quoted else None
    by_all = None if met is None or not others else met and all(bool(claim.met(value)) for value in others)
    sure = found.pop("sure", None)
    if met is not None and low is not None and high is not None and claim.bar is not None:
        worst = high if (claim.side == "less") == met else low
        sure = claim.met(worst) == met
    of_pairs = claim.reading in DIFFERENCES and ours is not None
    known = low is not None and high is not None
    holds_zero = known and low <= 0.0 <= high
    apart = known and not holds_zero and n >= FEWEST if of_pairs and claim.reading != "order" else None
    # No method is less than another where the interval of the difference contains zero.
    unshown = claim.reading == "less_pct" and bool(met) and holds_zero
    if unshown:
        met, sure, by_all = False, False, None if by_all is None else False
    if of_pairs and met is not None and n < FEWEST:
        sure = False
    row: Row = {
        "method": claim.method,
        "target": target,
        "figure": claim.title,
        "paper": claim.paper if quoted else None,
        "ours": ours,
        "low": low,
        "high": high,
        "n": found["n"],
        "met": met,
        "world": world,
        "unit": claim.unit,
        "key": claim.figure,
        "reading": claim.reading,
        "than": claim.than,
        "asked": claim.bar if quoted else None,
        "side": claim.side if quoted else "none",
        "paper_says": claim.said if quoted else "not quoted by target",
        "failed": found["failed"],
        "sure": sure,
        "how": claim.how,
        "met_by_all": by_all,
        "baseline": claim.baseline,
        "source": claim.where or None,
        "setup": setup_of(world, target if world == NOWHERE else None),
        "told_apart": apart,
        "preliminary": n < ENOUGH if of_pairs else None,
        "paper_sd": claim.sd if quoted else None,
    }
    row |= {key: value for key, value in found.items() if key not in row}
    why = {} if "why" not in row else {"ours": row.pop("why")}
    if low is None:
        why["low"] = why["high"] = _without_interval(claim, n)
    if unshown:
        why["met"] = "the pairs do not tell the methods apart: the interval contains zero"
    if by_all is None:
        why["met_by_all"] = "not judged" if met is None else "there is no other method to hold it against"
    if apart is None:
        why["told_apart"] = "no difference of two methods or worlds"
    if not of_pairs:
        why["preliminary"] = "no difference of pairs"
    why |= {key: "the paper has none here" for key in ("baseline", "source", "paper_sd") if row[key] is None}
    if row["paper"] is None:
        why["paper"] = row["paper_says"]
    if met is None:
        why["met"] = why.get("ours", "the paper's number is not quoted here")
    return row | {"why": why}


def _without_interval(claim: PublishedFigure, n: int) -> str:
    if n == 1:
        return "a single trial has no interval"
    return "too few pairs for their spread" if claim.reading in ("less_pct", "more_pct") else "not an estimate"


def _mean(claim: PublishedFigure, trials: TableTrials, target: str | None = None) -> Row | None:
    values = trials.values(claim.method, claim.figure, target, claim.itt)
    rows = trials.of(claim.method, target)
    failed = sum(known not in trials.values(claim.method, claim.figure, target) for known in rows)
    if not values:
        why = "no trial gave it" if rows else "not flown"
        return {"ours": None, "low": None, "high": None, "n": 0, "failed": failed, "why": why}
    scaled = claim.scale * np.array(list(values.values()))
    mean, ends = mean_interval(scaled, [known[0] for known in values])
    if ends is not None and claim.figure not in SIGNED:
        ends = Interval(max(ends[0], 0.0), ends[1])  # a speed or an error is no less than 0, and so its mean
    return _told(mean, ends, len(values), failed)


def _less_pct(claim: PublishedFigure, trials: TableTrials) -> Row | None:
    """Ratio over pairs that both have, with the test of the same quantity."""
    assert claim.than is not None
    ours, theirs = (trials.values(method, claim.figure) for method in (claim.method, claim.than))
    both = [known for known in ours if known in theirs]
    failed = len(trials.of(claim.method)) - len(both)
    if not both:
        return {"ours": None, "low": None, "high": None, "n": 0, "failed": failed, "why": "no pair was flown"}
    a, b = (np.array([side[known] for known in both]) for side in (ours, theirs))
    compared = compare_pairs(a, b)
    value, turned = as_reduction(compared.ratio, compared.interval)
    if value is None:
        return _told(None, None, len(both), failed) | {"why": "nothing to be less than"}
    test = compared.test
    better = probability_of_improvement(*(by_target(side, both) for side in (ours, theirs)))
    return _told(value, turned, len(both), failed) | {
        "of": compared.of,
        "theirs": float(b.mean()),
        "own": float(a.mean()),
        "p_t": test.p_t,
        "p_wilcoxon": test.p_wilcoxon,
        "d_z": test.d_z,
        "hedges_g": test.g_z,
        "improvement": better,
        "pairs_for_80_pct": None if test.d_z is None or test.d_z == 0.0 else pairs_needed(test.d_z),
    }


def _more_pct(claim: PublishedFigure, trials: TableTrials, other: TableTrials | None) -> Row | None:
    """How much more than the same method in another world, over the seeds that both have."""
    here = trials.values(claim.method, claim.figure)
    there = {} if other is None else other.values(claim.method, claim.figure)
    if not set(here) & set(there):  # a target has another name where it is the world's own
        here, there = ({("", seed): value for (_, seed), value in side.items()} for side in (here, there))
    both = [known for known in here if known in there]
    failed = len(trials.of(claim.method)) - len(here)
    if not both:
        why = f"no pair with {claim.against} was flown"
        return {"ours": None, "low": None, "high": None, "n": 0, "failed": failed, "why": why}
    compared = compare_pairs(np.array([here[k] for k in both]), np.array([there[k] for k in both]))
    if compared.ratio is None:
        return _told(None, None, len(both), failed) | {"why": "nothing to be more than"}
    ends = compared.interval
    more = None if ends is None else Interval(100.0 * (ends.low - 1.0), 100.0 * (ends.high - 1.0))
    return _told(100.0 * (compared.ratio - 1.0), more, len(both), failed) | {"of": compared.of}


def _made_pct(claim: PublishedFigure, trials: TableTrials) -> Row | None:
    """Share of the trials that gave the figure at all."""
    made, n = len(trials.values(claim.method, claim.figure)), len(trials.of(claim.method))
    ends = share_interval(made, n)
    return _told(100.0 * made / n, Interval(100.0 * ends.low, 100.0 * ends.high), n, n - made)


def _share_pct(claim: PublishedFigure, trials: TableTrials) -> Row | None:
    values = trials.values(claim.method, claim.figure, itt=True)
    if not values:
        return {"ours": None, "low": None, "high": None, "n": 0, "failed": 0, "why": "not flown"}
    good, n = round(sum(values.values())), len(values)
    ends = share_interval(good, n)
    return _told(100.0 * good / n, Interval(100.0 * ends.low, 100.0 * ends.high), n, n - good)


def _spread_pct(claim: PublishedFigure, trials: TableTrials) -> Row | None:
    """Coefficient of variation over seeds, mean over the targets that have two or more."""
    shares, n = [], 0
    for target in trials.targets(claim.method):
        values = np.array(list(trials.values(claim.method, claim.figure, target).values()))
        if len(values) >= 2 and values.mean() > 0.0:
            shares.append(100.0 * float(values.std(ddof=1) / values.mean()))
            n += len(values)
    if not shares:
        return {"ours": None, "low": None, "high": None, "n": 0, "failed": 0, "why": "no target was modelled twice"}
    return _told(float(np.mean(shares)), None, n, 0)


def _order(claim: PublishedFigure, trials: TableTrials) -> Row | None:
    """How often a bootstrap's draws have the paper's order, over the trials that all methods have."""
    named = [method for method in ORDER if method in trials.methods]
    if len(named) < len(ORDER):
        return None
    values = [trials.values(method, claim.figure, itt=True) for method in ORDER]
    both = [known for known in values[0] if all(known in other for other in values)]
    if not both:
        return {"ours": None, "low": None, "high": None, "n": 0, "failed": 0, "why": "no block was flown whole"}
    table = np.array([[side[known] for side in values] for known in both])
    means = table.mean(axis=0)
    ours = " > ".join(ORDER[k] for k in np.argsort(-means, kind="stable"))
    drawn = table[np.random.default_rng(0).integers(len(table), size=(ORDER_DRAWS, len(table)))].mean(axis=1)
    share = 100.0 * float(_falls(drawn).mean()) if len(table) > 1 else None
    met = bool(_falls(means[None])[0])
    sure = share is not None and (share if met else 100.0 - share) >= ORDER_SURE_PCT
    found = _told(share, None, len(both), 0) | {"our_order": ours, "met": met, "sure": sure}
    return found if share is not None else found | {"why": "a single block says only its own order"}


def _falls(means: Array) -> Array:
    return np.asarray((np.diff(means, axis=1) < 0.0).all(axis=1))


def _counted(claim: PublishedFigure, figures: Mapping[str, Any]) -> Row:
    """Intervals of the planner's figures, which come with their counts."""
    plans = figures.get(f"{claim.method}/plans")
    if not plans:
        return {}
    n = round(float(plans))
    counts = {"converged_pct": "converged", "late_pct": "late"}
    if claim.figure in counts:
        ends = share_interval(round(float(figures[f"{claim.method}/{counts[claim.figure]}"])), n)
        return {"low": 100.0 * ends.low, "high": 100.0 * ends.high, "n": n}
    if claim.figure == "ms_mean":
        half = 1.96 * float(figures[f"{claim.method}/ms_sd"]) / math.sqrt(n)
        mean = float(figures[f"{claim.method}/ms_mean"])
        return {"low": mean - half, "high": mean + half, "n": n, "sd": figures[f"{claim.method}/ms_sd"]}
    return {"n": n} if claim.figure in ("thrusts_beyond", "clearance_broken") else {}


def _told(value: float | None, ends: Interval | None, n: int, failed: int) -> Row:
    low, high = (None, None) if ends is None else ends
    return {"ours": value, "low": low, "high": high, "n": n, "failed": failed}


def _correct(rows: list[Row]) -> None:
    """Holm's correction over the differences of one table in one world."""
    tested = [row for row in rows if row.get("p_t") is not None]
    for row, p in zip(tested, holm([row["p_t"] for row in tested]) if tested else (), strict=True):
        row["p_holm"] = float(p)


_READ = {
    "mean": _mean,
    "less_pct": _less_pct,
    "share_pct": _share_pct,
    "made_pct": _made_pct,
    "spread_pct": _spread_pct,
    "order": _order,
}
