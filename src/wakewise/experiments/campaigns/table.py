"""What came of a campaign: how many trials are where, and each group's figures with how sure they are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
import polars as pl

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.experiments.campaigns import trial_lock
from wakewise.experiments.campaigns.attempt_log import FINAL, RETRIED, Attempts
from wakewise.experiments.campaigns.definition import FACTORS, CampaignPlan, PlanEntry, read_plan
from wakewise.experiments.campaigns.index import listing
from wakewise.experiments.campaigns.run import active_drivers
from wakewise.experiments.campaigns.statistics import mean_interval, share_interval
from wakewise.experiments.campaigns.store import CampaignStore, read_store
from wakewise.experiments.campaigns.task import Figure

State = Literal["done", "failed", "running", "waiting"]
SHARES = ("success",)
"""Figures that are yes or no; their interval is exact. A trial that failed is no success."""


class ComparisonMetric(NamedTuple):
    """A figure that methods are judged by, its unit in words, the factor to that, and whether less is better."""

    figure: str
    words: str
    scale: float
    less: bool


MEASURES = (
    ComparisonMetric("success", "% of models good", 100.0, False),
    ComparisonMetric("rmse_mm", "mm RMSE of the model", 1.0, True),
    ComparisonMetric("completeness_pct", "% of the surface", 1.0, False),
    ComparisonMetric("target_speed_mean_m_s", "mm/s of water at the target", 1e3, True),
    ComparisonMetric("exposure_speed_mean_m_s", "mm/s while the shutter is open", 1e3, True),
    ComparisonMetric("position_rmse_mm", "mm off the desired place", 1.0, True),
    ComparisonMetric("energy_kJ", "kJ of the thrusters", 1.0, True),
)
"""What a table shows by default and a page judges by, as far as trials have it."""


@dataclass(frozen=True, kw_only=True)
class TrialRecord:
    """A trial of a campaign and what has become of it."""

    entry: PlanEntry
    state: State
    figures: Mapping[str, Figure]
    reason: str | None
    attempts: int
    took_s: float


@dataclass(frozen=True, kw_only=True)
class Results:
    """A campaign's plan and all of its trials."""

    plan: CampaignPlan
    made: tuple[TrialRecord, ...]
    drivers: int
    others: int
    """Trials in the folder that are not the plan's any more."""

    def count(self, state: State) -> int:
        """How many trials are in a state."""
        return sum(one.state == state for one in self.made)


def results(folder: Path) -> Results:
    """What has become of a campaign.

    Raises InputError if there is no campaign, or one of another version.
    """
    plan, store = read_plan(folder), read_store(folder)
    listed = listing(store)
    made = []
    for entry in plan.trials:
        kept = listed.get(entry.key)
        told = kept.attempts if kept is not None else Attempts()
        done = kept is not None and kept.figures is not None
        state: State = "done" if done else _state(store, entry.key, told)
        figures = kept.figures if kept is not None and kept.figures is not None else {}
        reason = told.reason if state in ("failed", "waiting") else None
        took_s = kept.took_s if kept is not None and done else told.took_s
        made.append(
            TrialRecord(entry=entry, state=state, figures=figures, reason=reason, attempts=told.begun, took_s=took_s)
        )
    keys = {entry.key for entry in plan.trials}
    return Results(
        plan=plan, made=tuple(made), drivers=len(active_drivers(folder)), others=sum(key not in keys for key in listed)
    )


def status(found: Results) -> dict[str, Any]:
    """How many trials are where, and why those failed that did; a trial that several rows share counts once."""
    distinct = replace(found, made=tuple({one.entry.key: one for one in found.made}.values()))
    took = [one.took_s for one in distinct.made if one.state == "done"]
    return {
        "name": found.plan.name,
        "trials": len(distinct.made),
        **{state: distinct.count(state) for state in get_args(State)},
        "attempts": sum(one.attempts for one in distinct.made),
        "others": found.others,
        "drivers": found.drivers,
        "trial_s": float(np.mean(took)) if took else None,
        "wakewise": found.plan.wakewise,
        "sources": found.plan.sources,
        "failures": failures(distinct),
        "why": {} if took else {"trial_s": "no trial is finished"},
    }


def failures(found: Results) -> list[dict[str, Any]]:
    """Trials that failed, and why."""
    return [
        {"name": one.entry.name, "reason": one.reason, "attempts": one.attempts, "key": one.entry.key}
        for one in found.made
        if one.state == "failed"
    ]


def varying_factors(plan: CampaignPlan) -> tuple[str, ...]:
    """Factors that differ in a campaign, seeds aside: what its table is grouped by by default."""
    found = {factor: {entry.factors.get(factor) for entry in plan.trials} for factor in FACTORS if factor != "seed"}
    return tuple(factor for factor, values in found.items() if len(values) > 1) or ("method",)


def group_table(found: Results, by: Sequence[str] = (), figures: Sequence[str] = ()) -> list[dict[str, Any]]:
    """A row per group: factors, trials, failures, and each figure's mean with its 95 % interval over trials.

    Means are over the trials that gave the figure; `n` says how many. Trials of several targets, worlds or vehicles in
    one group are strata of the interval.

    Raises InputError if a factor or a figure is not there.
    """
    by = tuple(by) or varying_factors(found.plan)
    for name in by:
        if name not in FACTORS:
            raise InputError(f"--by: '{name}' is no factor, allowed: {', '.join(FACTORS)}")
    known = dict.fromkeys(key for one in found.made for key in one.figures)
    for name in figures:
        if known and name not in known:
            raise InputError(f"--figures: '{name}' is in no trial, allowed: {', '.join(known)}")
    requested = tuple(figures) or tuple(measure.figure for measure in MEASURES if measure.figure in known)
    groups: dict[tuple[str | int, ...], list[TrialRecord]] = {}
    for one in found.made:
        groups.setdefault(tuple(one.entry.factors.get(name, "") for name in by), []).append(one)
    rows = []
    for names, members in groups.items():
        row: dict[str, Any] = dict(zip(by, names, strict=True))
        counted = Counter(one.state for one in members)
        row |= {"trials": len(members), "done": counted["done"], "failed": counted["failed"], "figures": {}}
        for name in requested:
            row["figures"][name] = _share(name, members) if name in SHARES else _mean(name, members, by)
        rows.append(row)
    return rows


def write_table(found: Results, path: Path) -> None:
    """Write all trials as a Parquet or CSV table: a row each, factors, state and figures as columns.

    In CSV a word that a spreadsheet would read as a formula has an apostrophe before it.

    Raises InputError if the file's ending is neither.
    """
    if path.suffix not in (".parquet", ".csv"):
        raise InputError(f"--write {path}: must end in .parquet or .csv")
    rows = [
        {"key": one.entry.key, "name": one.entry.name}
        | dict(one.entry.factors)
        | {"state": one.state, "reason": one.reason, "attempts": one.attempts, "took_s": one.took_s}
        | {name: value for name, value in one.figures.items() if name not in FACTORS}
        for one in found.made
    ]
    table = pl.DataFrame(rows, infer_schema_length=None)
    with whole_file(path, lasting=True) as temporary:
        if path.suffix == ".csv":
            table.with_columns(_as_text(pl.col(pl.String))).write_csv(temporary)
        else:
            table.write_parquet(temporary)


def _as_text(words: pl.Expr) -> pl.Expr:
    """Words as spreadsheets take them for words: an apostrophe before what they would read as a formula."""
    return pl.when(words.str.contains("^[=+@\t\r-]")).then("'" + words).otherwise(words).name.keep()


def _state(store: CampaignStore, key: str, told: Attempts) -> State:
    """Where a trial is that has no figures."""
    holder = trial_lock.holder_of(store.place(key)) if told.begun else None
    if holder is not None and not holder.is_gone:
        return "running"
    return "failed" if told.how in (*FINAL, *RETRIED) else "waiting"


def _mean(name: str, members: Sequence[TrialRecord], by: Sequence[str]) -> dict[str, Any]:
    """Mean of a figure over the trials that have it, with its interval."""
    known = [(one, value) for one in members if isinstance(value := one.figures.get(name), (int, float))]
    if not known:
        return {"mean": None, "low": None, "high": None, "n": 0, "why": "no trial gave it"}
    inner = [factor for factor in ("target", "world", "vehicle", "variation") if factor not in by]
    strata = [tuple(one.entry.factors.get(factor) for factor in inner) for one, _ in known]
    mean, interval = mean_interval([value for _, value in known], strata)
    if interval is None:
        return {"mean": mean, "low": None, "high": None, "n": 1, "why": "one trial has no interval"}
    return {"mean": mean, "low": interval.low, "high": interval.high, "n": len(known)}


def _share(name: str, members: Sequence[TrialRecord]) -> dict[str, Any]:
    """Share of trials that have it, of those that ended: one that failed has not."""
    ended = [one for one in members if one.state in ("done", "failed")]
    if not ended:
        return {"mean": None, "low": None, "high": None, "n": 0, "why": "no trial has ended"}
    count = sum(bool(one.figures.get(name)) for one in ended)
    interval = share_interval(count, len(ended))
    return {"mean": count / len(ended), "low": interval.low, "high": interval.high, "n": len(ended)}
