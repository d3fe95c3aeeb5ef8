"""Which trials a table is made of, in blocks: all methods on one seed, in one world, at one target.

A block is what a comparison in pairs needs, so tables grow by whole blocks and a run that is stopped has whole pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from wakewise.control.velocity_reference import PAPER_W_TRACK
from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.study import flight_trial
from wakewise.experiments.campaigns.task import PHOTOGRAPHS, Task
from wakewise.scene.targets import coral_kinds
from wakewise_paper import flights
from wakewise_paper.operator_study.bench import W_TRACKS
from wakewise_paper.operator_study.flight import operator_trial
from wakewise_paper.operator_study.paper import paper_trial
from wakewise_paper.reproduction.claim import ORDER, TABLES
from wakewise_paper.reproduction.piv_flights import PIV
from wakewise_paper.reproduction.worlds import (
    CACO3,
    FIELD,
    PAPER,
    PUMP_TANK,
    varied_mission,
    water,
    water_names,
)

CORALS = ("branching", "brain", "plate")
"""In place of the paper's three."""
OWN = "the world's"
"""Target of the worlds with the trouble: what can be harmed there."""
NOWHERE = "-"
"""World of what is not flown."""
TROUBLE = "payload"
"""Where users have the trouble: the world that presets fly in (docs/research-log/0032)."""
SHELTERED = "sheltered"
"""Where wash alone moves a soft target, so that models can fail by it (docs/wash-and-models.md)."""

_OWN = ("wakewise_paper:reproduction",)
_FLIGHT = (*flights.SOURCES, *_OWN)
_SCAN = (*PHOTOGRAPHS, *_OWN)
_BENCH = "wakewise_benchmarks"
_SOLVER = (
    *("planning", "wake", "robot/vehicles", "robot/thrusters"),
    *(f"{_BENCH}:{name}.py" for name in ("planner", "paper_planner", "solver")),
)
_WAKE = (
    *("wake", "simulation/water", "simulation/lattice"),
    *("wakewise_paper:wake_validation.py", "wakewise_paper:flows.py"),
)

Block = tuple[PlannedTrial, ...]
"""Trials of all methods on one seed, in one world, at one target; their factors name the table as `variation`."""


FIRST_SEED = 3001
"""First seed of the tables and of the last part of `bench models`; nothing was chosen or tuned from here on."""
SEED_STRIDE = 3
"""Worlds beside the paper's own set-up are flown on each third seed, for the sake of more pairs in that set-up."""

METHOD_PLACES = {"dp-paper": "wakewise_paper.dp_paper:make_dp_paper"}
"""Methods of this package, by where they are made, so that a worker finds them without entry points."""


@dataclass(frozen=True, kw_only=True)
class TableRequest:
    """What is wanted of a table; None takes the table's own.

    `trials` counts seeds, from `first_seed`, for each target in each world. `duration_s` flies only the first part of
    each flight; scans are flown whole.
    """

    trials: int
    first_seed: int = FIRST_SEED
    worlds: tuple[str, ...] | None = None
    methods: tuple[str, ...] | None = None
    targets: tuple[str, ...] | None = None
    duration_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class TrialCell:
    """One combination of a table and what is wanted of it."""

    world: str
    method: str
    target: str
    seed: int
    request: TableRequest

    def fields(self) -> dict[str, Any]:
        """Fields of the scenario, by dotted name."""
        target: dict[str, Any] = {} if self.target == OWN else {"target.kind": self.target}
        return (
            water(self.world).told | target | {"method": METHOD_PLACES.get(self.method, self.method), "seed": self.seed}
        )

    def name(self, what: str) -> str:
        """Name of its trial."""
        parts = (what, self.world, self.target, self.method, self.seed)
        return "/".join(str(part) for part in parts if part != OWN)


@dataclass(frozen=True, kw_only=True)
class TableDefinition:
    """How a table is made: what it has unless told otherwise, and the task of each of its cells.

    `block_s` is about how much CPU time a block takes, in seconds, for choosing the first of a budget; `weight` the
    table's share of a budget, over that of others. `once`: nothing in it is drawn, one trial says all. `has_targets`:
    its targets are things, and others can be put in their place. `every_third` names the worlds that are flown on each
    `SEED_STRIDE`-th seed alone, where the table has others.
    """

    methods: tuple[str, ...]
    worlds: tuple[str, ...]
    targets: Callable[[str], tuple[str, ...]]
    task: Callable[[TrialCell], Task]
    block_s: float
    weight: float = 1.0
    once: bool = False
    has_targets: bool = True
    every_third: tuple[str, ...] = ()


def blocks_of(name: str, request: TableRequest) -> Iterator[Block]:
    """Blocks of a table, seed by seed, worlds and targets in turn.

    Raises
    ------
    InputError
        If a world, method or target is not known to the table; at once, not when the first is taken.
    """
    table = TABLE[name]
    waters = (NOWHERE,) if table.worlds == (NOWHERE,) else water_names()
    worlds = _known("--world", request.worlds, name, waters, table.worlds)
    methods = _known("--methods", request.methods, name, table.methods, table.methods)
    requested = None if request.targets is None or not table.has_targets else tuple(_target(t) for t in request.targets)
    return _blocks(name, request, worlds, methods, {world: requested or table.targets(world) for world in worlds})


def _blocks(
    name: str,
    request: TableRequest,
    worlds: tuple[str, ...],
    methods: tuple[str, ...],
    targets: Mapping[str, tuple[str, ...]],
) -> Iterator[Block]:
    table = TABLE[name]
    every_third = table.every_third if set(worlds) - set(table.every_third) else ()
    for seed in range(request.first_seed, request.first_seed + (1 if table.once else request.trials)):
        flown = [
            world for world in worlds if world not in every_third or (seed - request.first_seed) % SEED_STRIDE == 0
        ]
        for number in range(max(len(targets[world]) for world in flown)):
            for world in (world for world in flown if number < len(targets[world])):
                target = targets[world][number]
                yield tuple(_planned(name, world, method, target, seed, request) for method in methods)


def _planned(table: str, world: str, method: str, target: str, seed: int, request: TableRequest) -> PlannedTrial:
    task = TABLE[table].task(TrialCell(world=world, method=method, target=target, seed=seed, request=request))
    factors: dict[str, str | int] = {
        "method": method,
        "target": target,
        "world": world,
        "variation": table,
        "seed": seed,
    }
    return PlannedTrial(task=task, factors=factors)


def _target(name: str) -> str:
    """A kind of target, or a mesh file by its whole path.

    Raises
    ------
    InputError
        If it is neither.
    """
    if name in coral_kinds():
        return name
    if not Path(name).is_file():
        raise InputError(f"--targets: '{name}' is no mesh file, nor one of {', '.join(coral_kinds())}")
    return str(Path(name).resolve())


def _known(
    option: str, requested: tuple[str, ...] | None, table: str, allowed: tuple[str, ...], default: tuple[str, ...]
) -> tuple[str, ...]:
    if requested is None or allowed == (NOWHERE,):
        return default
    for name in requested:
        if name not in allowed:
            raise InputError(f"{option}: '{name}' is not in table {table}, allowed: {', '.join(allowed)}")
    return tuple(dict.fromkeys(requested))


def _scan(cell: TrialCell) -> Task:
    return _scanned(cell.name("scan"), cell.fields(), extent=True)


def _varied(cell: TrialCell) -> Task:
    kind = CORALS[(cell.seed - 1) % len(CORALS)] if cell.target == OWN and cell.world == PUMP_TANK else cell.target
    mission = varied_mission(cell.world, None if kind == OWN else kind, cell.seed)
    return _scanned(cell.name("varied"), replace(cell, target=kind).fields() | dict(mission), extent=False)


def _scanned(name: str, fields: Mapping[str, Any], *, extent: bool) -> Task:
    settings = {"scenario": dict(fields), "preset": "quick", "extent": extent}
    return Task(name=name, work="wakewise_paper.reproduction.scans:scan_one", settings=settings, sources=_SCAN)


def _station(cell: TrialCell) -> Task:
    return _flown(cell, "station", {flights.STATION: {}})


def _flow(cell: TrialCell) -> Task:
    return _flown(cell, "round", _ROUND, {PIV: {"instants": 3, "duration_s": cell.request.duration_s}})


def _ablated(cell: TrialCell) -> Task:
    """The scan of `dynamic`, which makes those of its methods once for both tables."""
    six = {"method": "wake-aware", "vehicle": "paper-six-thrusters"} if cell.method == "six thrusters" else {}
    return _scanned(cell.name("scan"), cell.fields() | six, extent=True)


def _compared(cell: TrialCell) -> Task:
    told = dict(APPROACHES.get(cell.method, {"method": cell.method}))
    ballast: dict[str, dict[str, Any]] = {flights.BALLASTED: {}} if told.pop("ballast", False) else {}
    return _flown(cell, "comparison", _ROUND | ballast, own=told)


def _flown(
    cell: TrialCell,
    what: str,
    setup: Mapping[str, Mapping[str, Any]],
    probes: Mapping[str, Mapping[str, Any]] | None = None,
    own: Mapping[str, Any] | None = None,
) -> Task:
    trial = flight_trial(
        cell.world,
        cell.method,
        cell.seed,
        cell.fields() | dict(own or {}),
        setup=setup,
        probes={flights.DISTURBANCE_SERIES: {}} | dict(probes or {}),
        duration_s=cell.request.duration_s,
        sources=_FLIGHT,
    )
    return replace(trial.task, name=cell.name(what))


_ROUND: dict[str, dict[str, Any]] = {flights.HOVER_AND_ARC: {"about": "found"}}
_SCRIPT = "script"


def _operated(cell: TrialCell) -> Task:
    who, _, word = cell.method.partition(", w_track ")
    w_track = float(word) if word else PAPER_W_TRACK
    if cell.world == PAPER:
        trial = paper_trial(cell.target, who, cell.seed, w_track)
    else:
        trial = operator_trial(cell.world, cell.target, who, cell.seed, w_track, duration_s=cell.request.duration_s)
    return replace(trial.task, name=cell.name("operator"))


def _solved(_: TrialCell) -> Task:
    return Task(name="solver", work=f"{_BENCH}.solver:solve_one", settings={"instants": 100}, sources=_SOLVER)


def _validated(_: TrialCell) -> Task:
    work = "wakewise_paper.reproduction.scans:wake_one"
    return Task(name="wake", work=work, settings={"quick": True}, sources=_WAKE)


APPROACHES: dict[str, dict[str, Any]] = {
    "nothing (dp)": {"method": "dp"},
    "farther off": {"method": "dp", "mission.standoff_m": 0.8},
    "ballast": {"method": "dp", "ballast": True},
    "soft thrusters": {"method": "dp", "vehicle": "soft-thrusters"},
    "a rule (no-forward-jets)": {"method": "no-forward-jets"},
    "a price on thrusters (weighted-pseudo-inverse)": {"method": "weighted-pseudo-inverse"},
    "shares (allocation-only)": {"method": "allocation-only"},
    "a plan (wake-aware)": {"method": "wake-aware"},
    "a tilting camera": {"method": "wake-aware", "vehicle": "paper-tilting"},
    "a plan and ballast": {"method": "wake-aware", "ballast": True},
}
"""Ways to stir less, the paper's kind and others: fields of a scenario, and whether the vehicle is trimmed first."""
COMPARED = (
    "dp",
    "manual",
    "manual-careful",
    "ardusub",
    "no-forward-jets",
    "weighted-pseudo-inverse",
    "pseudo-inverse",
    "mpc",
    "mpc-smooth",
    "linear",
    "allocation-only",
    "wake-aware",
)
"""Methods of the comparison."""


def _corals(world: str) -> tuple[str, ...]:
    return CORALS if world in (PUMP_TANK, "still-tank", PAPER, "lattice") else (OWN,)


def _own(_: str) -> tuple[str, ...]:
    return (OWN,)


def _silted(world: str) -> tuple[str, ...]:
    """Of clear water the coral of `caco3`, which is held against it."""
    return ("branching",) if world == PUMP_TANK else (OWN,)


def _nothing(_: str) -> tuple[str, ...]:
    return (NOWHERE,)


def _asked(world: str) -> tuple[str, ...]:
    return ("front", "over") if world == PAPER else (_SCRIPT,)


VARIANTS = ("mpc", "linear", "six thrusters")
"""Methods of the ablation; the whole is `wake-aware`."""
_FLOWN = (PUMP_TANK, TROUBLE, PAPER)
_BY_HAND = ("manual", "manual-careful")
_STATION_METHODS = (*_BY_HAND, "dp-paper", "dp", "weighted-pseudo-inverse", "mpc", "mpc-smooth", "wake-aware")

TABLE: dict[str, TableDefinition] = {
    "dynamic": TableDefinition(
        methods=(*_BY_HAND, *ORDER[1:]),
        worlds=(PUMP_TANK, TROUBLE, SHELTERED),
        targets=_corals,
        task=_scan,
        block_s=500.0,
        weight=4.0,
        every_third=(TROUBLE, SHELTERED),
    ),
    "success": TableDefinition(
        methods=("mpc", "wake-aware"),
        worlds=(PUMP_TANK, TROUBLE, SHELTERED),
        targets=_own,
        task=_varied,
        block_s=200.0,
        weight=2.0,
        every_third=(TROUBLE, SHELTERED),
    ),
    "station": TableDefinition(
        methods=_STATION_METHODS,
        worlds=_FLOWN,
        targets=_own,
        task=_station,
        block_s=170.0,
        weight=3.0,
        every_third=(TROUBLE, PAPER),
    ),
    "ablation": TableDefinition(
        methods=("wake-aware", *VARIANTS),
        worlds=(PUMP_TANK, TROUBLE),
        targets=_corals,
        task=_ablated,
        block_s=200.0,
        weight=2.0,
        every_third=(TROUBLE,),
    ),
    "sediment": TableDefinition(
        methods=("mpc", "wake-aware"),
        worlds=(PUMP_TANK, CACO3, "fluff"),
        targets=_silted,
        task=_scan,
        block_s=120.0,
        every_third=("fluff",),
    ),
    "flow": TableDefinition(methods=("dp", "mpc", "wake-aware"), worlds=_FLOWN, targets=_own, task=_flow, block_s=50.0),
    "solver": TableDefinition(
        methods=(NOWHERE,),
        worlds=(NOWHERE,),
        targets=_nothing,
        task=_solved,
        block_s=60.0,
        once=True,
        has_targets=False,
    ),
    "wake": TableDefinition(
        methods=(NOWHERE,),
        worlds=(NOWHERE,),
        targets=_nothing,
        task=_validated,
        block_s=60.0,
        once=True,
        has_targets=False,
    ),
    "field": TableDefinition(methods=("dp", "wake-aware"), worlds=(FIELD,), targets=_own, task=_scan, block_s=220.0),
    "operator": TableDefinition(
        methods=("dp", *(f"wake-aware, w_track {w:g}" for w in W_TRACKS)),
        worlds=(TROUBLE, PAPER),
        targets=_asked,
        task=_operated,
        block_s=45.0,
        has_targets=False,
    ),
    "comparison": TableDefinition(
        methods=(*COMPARED, *APPROACHES), worlds=(TROUBLE,), targets=_own, task=_compared, block_s=178.0
    ),
}
assert set(TABLE) == set(TABLES)
