"""Makes tables: as many trials as were asked for, or as many as a budget of time has room for.

With a budget the first block of each table is made, which tells what a block costs here; then whole blocks are added to
the table on which the least time was spent, until no further one has room. What was finished stays in the campaign's
folder, so the same call goes on where it was stopped.

Methods and approaches side by side, measured; each cell with the command that shows it.

The paper has two tables of methods in words, which are not quoted here. In their place stand two that are flown: the
methods of this package, and ways to stir less that need no such method.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.core.jit.precompile import compile_kernels
from wakewise.core.settings import seed_number
from wakewise.experiments.campaigns import ProcessExecutor
from wakewise.experiments.campaigns import run as run_campaign
from wakewise.experiments.campaigns.definition import keep_plan
from wakewise.experiments.campaigns.store import CampaignStore, open_store
from wakewise_paper.reproduction.claim import CLAIMS, TABLES, UNQUOTED, PublishedFigure
from wakewise_paper.reproduction.rows import CompletedTrial, Row, TableTrials, once_rows, table_rows
from wakewise_paper.reproduction.table_trials import (
    APPROACHES,
    COMPARED,
    FIRST_SEED,
    NOWHERE,
    TABLE,
    Block,
    TableRequest,
    blocks_of,
)
from wakewise_paper.reproduction.worlds import water

COLUMNS = (
    ("target_speed_mean_m_s", "wash at the target", "mm/s", 1e3),
    ("position_rmse_mm", "distance from the desired place", "mm", 1.0),
    ("roll_pitch_rms_deg", "roll and pitch", "deg", 1.0),
    ("energy_kJ", "energy", "kJ", 1.0),
    ("sign_flips_per_s", "reversals", "1/s", 1.0),
    ("ray_optical_depth", "silt on the rays", "", 1.0),
    ("solve_ms_p99", "control step, 99th percentile", "ms", 1.0),
    ("collisions", "collisions", "", 1.0),
)
"""Figure, title, unit and factor of each column."""


def comparison_claims() -> tuple[PublishedFigure, ...]:
    """A claim for each cell; the paper's value is not known for any."""
    return tuple(
        PublishedFigure(
            method=method,
            figure=figure,
            title=title,
            unit=unit,
            paper=None,
            said=UNQUOTED,
            side="none",
            scale=scale,
            how=command_of(method),
        )
        for method in (*COMPARED, *APPROACHES)
        for figure, title, unit, scale in COLUMNS
    )


def command_of(method: str) -> str:
    """What to type to see a cell's flights again."""
    return f"wakewise reproduce comparison --methods '{method}'"


def tables() -> dict[str, tuple[str, ...]]:
    """Both tables: title and rows."""
    return {"methods": COMPARED, "approaches": tuple(APPROACHES)}


MOST_TRIALS = 1000
TRIAL_LIMIT_S = 3600.0
"""A trial that takes longer is ended: sixty times what one takes here."""
RESERVE = 0.9
"""Share of what is left of a budget that is planned: the last trials do not end together."""
LAST = 1.25
"""At this times the budget what is under way is stopped."""


@dataclass(frozen=True, kw_only=True)
class ReproduceOptions:
    """How tables are made.

    `trials` counts seeds from `first_seed` for each target in each world; with a budget (`budget_s`, wall time for all
    tables) it is the most of them. `worlds`, `methods`, `targets` replace the tables' own; `duration_s` flies only
    the first part of each flight; `workers` trials are made at a time; `again` tries trials anew that failed before.
    """

    trials: int | None = None
    first_seed: int = FIRST_SEED
    budget_s: float | None = None
    worlds: tuple[str, ...] | None = None
    methods: tuple[str, ...] | None = None
    targets: tuple[str, ...] | None = None
    duration_s: float | None = None
    workers: int = 2
    again: bool = False
    progress: Progress = no_progress

    def __post_init__(self) -> None:
        if self.trials is not None and not 1 <= self.trials <= MOST_TRIALS:
            raise InputError(f"--trials {self.trials}, allowed 1 to {MOST_TRIALS}")
        seed_number(self.first_seed, "--first-seed")
        if self.budget_s is not None and not self.budget_s > 0.0:
            raise InputError(f"--budget {self.budget_s:g} s, must be more than 0")

    @property
    def request(self) -> TableRequest:
        """What is asked of each table."""
        trials = self.trials or (MOST_TRIALS if self.budget_s is not None else 1)
        return TableRequest(
            trials=trials,
            first_seed=self.first_seed,
            worlds=self.worlds,
            methods=self.methods,
            targets=self.targets,
            duration_s=self.duration_s,
        )


@dataclass
class _Growing:
    """A table while its trials are made."""

    name: str
    coming: Iterator[Block]
    taken: list[Block] = field(default_factory=list)
    made: list[CompletedTrial] = field(default_factory=list)
    block_s: float = 0.0
    spent_s: float = 0.0
    why: str | None = None

    def take(self) -> Block | None:
        """The next block, if there is one."""
        block = next(self.coming, None)
        if block is not None:
            self.taken.append(block)
        return block

    def leave(self, block: Block, planned: _Planned) -> bool:
        """Take a block back for which there is no room, but for trials that cost nothing more; whether all of it."""
        self.taken.remove(block)
        known = tuple(plan for plan in block if planned.has(plan.task.key))
        if known:
            self.taken.append(known)
        return not known


@dataclass
class _Planned:
    """What a run makes or knows already, whichever table it is of: tables share trials."""

    store: CampaignStore
    keys: set[str] = field(default_factory=set)

    def share(self, block: Block) -> float:
        """Share of a block's trials that are still to be made."""
        return sum(not self.has(plan.task.key) for plan in block) / len(block)

    def has(self, key: str) -> bool:
        """Whether a trial costs nothing more."""
        return key in self.keys or self.store.figures(key) is not None

    def add(self, block: Block) -> None:
        """Make these, too."""
        self.keys |= {plan.task.key for plan in block}


def reproduce(names: Sequence[str], folder: Path, options: ReproduceOptions) -> dict[str, dict[str, Any]]:
    """Tables by name: `rows` of paper and ours, `trials` (most seeds of a target), `seeds`, `config_hash` and more.

    `names` are of `claim.TABLES`; `folder` is a campaign's, made if it is not there.

    Raises
    ------
    InputError
        If a table, world or method is not known, or the folder holds something else.
    EnvironmentFailure
        If the disk is full; what was finished is kept.
    """
    began = time.monotonic()
    for name in names:
        if name not in TABLES:
            raise InputError(f"table '{name}': not known, allowed: {', '.join(TABLES)}, all")
    _check_methods(names, options.methods)
    for world in options.worlds or ():
        water(world)
    tables = [_Growing(name, blocks_of(name, _fitting(name, options.request))) for name in names]
    open_store(folder)  # one of another version is refused before kernels are compiled and a plan is written
    for table in tables:
        table.block_s = TABLE[table.name].block_s
    options.progress(0, 1, "compiling what is not compiled yet")
    compile_kernels(progress=options.progress)
    if options.budget_s is None:
        for table in tables:
            while table.take() is not None:
                pass
        _make(tables, folder, options, None)
    else:
        _within(tables, folder, options, began)
    return {table.name: _figures(table) for table in tables}


def _check_methods(names: Sequence[str], methods: Sequence[str] | None) -> None:
    """Raise InputError if a method is in none of the tables, which would leave it out without a word."""
    for method in methods or ():
        if not any(method in TABLE[name].methods for name in names):
            where = f"table {names[0]}" if len(names) == 1 else f"any of the tables {', '.join(names)}"
            allowed = dict.fromkeys(own for name in names for own in TABLE[name].methods if own != NOWHERE)
            known = f"allowed: {', '.join(allowed)}" if allowed else "it has no methods"
            raise InputError(f"--methods: '{method}' is not in {where}, {known}")


def _fitting(name: str, request: TableRequest) -> TableRequest:
    """What is requested of one table: methods that only others have say nothing of it."""
    if request.methods is None:
        return request
    own = tuple(method for method in request.methods if method in TABLE[name].methods)
    return replace(request, methods=own or request.methods)


def _within(tables: list[_Growing], folder: Path, options: ReproduceOptions, began: float) -> None:
    """The first block of each table that has room, then more of what cost least so far."""
    budget_s = options.budget_s or 0.0
    until = began + LAST * budget_s

    planned = _Planned(open_store(folder))

    def room_s() -> float:
        return max(0.0, RESERVE * (budget_s - (time.monotonic() - began)) * options.workers)

    left_s = room_s()
    for table in tables:
        block = table.take()
        if block is None:
            continue
        costs_s = table.block_s * planned.share(block)
        if costs_s > left_s and len(tables) > 1:
            if table.leave(block, planned):
                table.why = f"no room in {budget_s / 60.0:.0f} min: its first trials take some {costs_s:.0f} s"
            continue
        planned.add(block)
        left_s -= costs_s
    _make(tables, folder, _telling(options, "the first block of each table"), until)
    left_s = room_s()
    open_tables = [table for table in tables if table.why is None]
    while open_tables:
        cheapest = min(open_tables, key=lambda table: table.spent_s / TABLE[table.name].weight)
        block = cheapest.take()
        if block is None:
            open_tables.remove(cheapest)
            continue
        costs_s = cheapest.block_s * planned.share(block)
        if costs_s > left_s:
            cheapest.leave(block, planned)
            open_tables.remove(cheapest)
            continue
        planned.add(block)
        left_s -= costs_s
        cheapest.spent_s += cheapest.block_s
    _make(tables, folder, options, until)


def _telling(options: ReproduceOptions, words: str) -> ReproduceOptions:
    """The same, with these words before what is told of progress: its time left is not that of the budget."""

    def progress(done: float, total: float, note: str = "") -> None:
        options.progress(done, total, f"{words}: {note}")

    return replace(options, progress=progress)


def _make(tables: list[_Growing], folder: Path, options: ReproduceOptions, until: float | None) -> None:
    """Have all that was taken made, side by side; what is known already costs nothing."""
    plans = [(table, plan) for table in tables for block in table.taken for plan in block]
    if not plans:
        return
    trials = [plan for _, plan in plans]
    keep_plan(folder, "reproduce", trials, {"name": "reproduce"})
    outcomes = run_campaign(
        [trial.task for trial in trials],
        folder,
        ProcessExecutor(options.workers),
        timeout_s=TRIAL_LIMIT_S,
        progress=options.progress,
        until=until,
        again=options.again,
    )
    for table in tables:
        table.made = [
            CompletedTrial(plan, out) for (own, plan), out in zip(plans, outcomes, strict=True) if own is table
        ]
        took = [one.outcome.took_s for one in table.made if one.outcome.took_s > 0.0]
        if took and table.taken:
            table.spent_s = sum(took)
            table.block_s = sum(took) / len(took) * len(table.taken[0])


def _figures(table: _Growing) -> dict[str, Any]:
    """A table as it is printed and written."""
    flown = [one for one in table.made if one.flown]
    return {
        "table": table.name,
        "title": TABLES[table.name],
        "rows": rows_of(table.name, table.made),
        "trials": _trials(flown),
        "seeds": sorted({one.plan.seed for one in flown}),
        "config_hash": config_hash(table.made),
        "worlds": list(dict.fromkeys(one.plan.world for one in flown if one.plan.world != NOWHERE)),
        "methods": list(dict.fromkeys(one.plan.method for one in flown if one.plan.method != NOWHERE)),
        "made": len(flown),
        "left_undone": len(table.made) - len(flown),
        "failed": sum(one.outcome.figures is None for one in flown),
        "failures": [
            {"trial": one.plan.task.name, "reason": one.outcome.reason} for one in flown if one.outcome.figures is None
        ],
        "trial_s": sum(one.outcome.took_s for one in flown),
        "places": [place_of(one) for one in flown],
        "why": {} if table.why is None else {"rows": table.why},
    }


def rows_of(name: str, made: Sequence[CompletedTrial]) -> list[Row]:
    """Rows of a table from its trials."""
    claims = comparison_claims() if name == "comparison" else CLAIMS[name]
    if TABLE[name].once:
        return [
            row
            for one in made
            if one.outcome.figures is not None
            for row in once_rows(claims, one.outcome.figures, one.plan.world)
        ]
    worlds: dict[str, list[CompletedTrial]] = {}
    for one in made:
        worlds.setdefault(one.plan.world, []).append(one)
    return table_rows(claims, {world: TableTrials(own) for world, own in worlds.items()})


def config_hash(made: Sequence[CompletedTrial]) -> str:
    """Hash of all trials of a table: what was flown, by which source."""
    keys = "\n".join(sorted(one.plan.task.key for one in made))
    return hashlib.sha256(keys.encode()).hexdigest()[:16]


def place_of(one: CompletedTrial) -> dict[str, Any]:
    """Where a page finds what a trial left, below the campaign's folder."""
    figures: Mapping[str, Any] = one.outcome.figures or {}
    return {
        "world": one.plan.world,
        "method": one.plan.method,
        "target": one.plan.target,
        "seed": one.plan.seed,
        "folder": f"trials/{one.plan.task.key}/work",
        "figures": dict(figures) if one.plan.world != NOWHERE else {},
        "reason": one.outcome.reason if one.outcome.figures is None else figures.get("failure"),
    }


def _trials(flown: Sequence[CompletedTrial]) -> int:
    counts: dict[tuple[str, str, str], int] = {}
    for one in flown:
        key = (one.plan.world, one.plan.method, one.plan.target)
        counts[key] = counts.get(key, 0) + 1
    return max(counts.values(), default=0)
