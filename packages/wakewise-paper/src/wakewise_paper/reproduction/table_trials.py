"""Which trials a table is made of, in blocks: all methods on one seed, in one world, at one target.

A block is what a comparison in pairs needs, so tables grow by whole blocks and a run that is stopped has whole pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.experiments.campaigns.task import FLIES, PHOTOGRAPHS, Task
from wakewise.scene.targets import coral_kinds
from wakewise_paper.reproduction.claim import ORDER, TABLES
from wakewise_paper.reproduction.published_tables import VARIANTS, W_TRACKS
from wakewise_paper.reproduction.worlds import (
    CACO3,
    FIELD,
    PAPER,
    PUMP_TANK,
    TableWorld,
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

_FLIGHT = (*FLIES, "studies/reproduce/flights.py", "studies/reproduce/piv_flights.py", "studies/gentle", "studies/piv")
_SCAN = (*PHOTOGRAPHS, "studies/reproduce/scans.py")
_OPERATOR = (*FLIES, "studies/operator", "studies/gentle", "studies/reproduce/measured.py")
_BENCH = ("benches/planner.py", "benches/paper_planner.py", "benches/solver.py")
_SOLVER = ("planning", "wake", "vehicles", "thrusters", *_BENCH)
_WAKE = ("wake", "water", "lattice", "studies/wake_validation.py", "studies/flows.py", "studies/oracle.py")


@dataclass(frozen=True, kw_only=True)
class TableCase:
    """One trial of a table, and what it is called in it."""

    table: str
    world: str
    method: str
    target: str
    seed: int
    task: Task


Block = tuple[TableCase, ...]


@dataclass(frozen=True, kw_only=True)
class TableRequest:
    """What is wished of a table; None takes the table's own.

    Parameters
    ----------
    trials : int
        Seeds, from 1, for each target in each world.
    worlds, methods, targets : tuple of str or None
    duration_s : float or None
        Only the first part of each flight; scans are flown whole.
    """

    trials: int
    worlds: tuple[str, ...] | None = None
    methods: tuple[str, ...] | None = None
    targets: tuple[str, ...] | None = None
    duration_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class TableDefinition:
    """How a table is made.

    Parameters
    ----------
    methods, worlds : tuple of str
        What it has unless told otherwise.
    targets : callable
        From a world's name to the targets that it has there.
    plan : callable
        `(water, method, target, seed, wish) -> Task`.
    block_s : float
        About how much CPU time a block takes, in seconds: for choosing the first of a budget.
    weight : float
        Its share of a budget, over that of others.
    once : bool
        Nothing in it is drawn: one trial says all.
    has_targets : bool
        Its targets are things, and others can be put in their place.
    """

    methods: tuple[str, ...]
    worlds: tuple[str, ...]
    targets: Callable[[str], tuple[str, ...]]
    plan: Callable[[str, str, str, int, TableRequest], Task]
    block_s: float
    weight: float = 1.0
    once: bool = False
    has_targets: bool = True


def blocks_of(name: str, wish: TableRequest) -> Iterator[Block]:
    """Blocks of a table, seed by seed, worlds and targets in turn.

    Raises
    ------
    InputError
        If a world, method or target is not known to the table; at once, not when the first is taken.
    """
    table = TABLE[name]
    worlds = _known("--world", wish.worlds, (NOWHERE,) if table.worlds == (NOWHERE,) else water_names(), table.worlds)
    methods = _known("--methods", wish.methods, table.methods, table.methods)
    wished = None if wish.targets is None or not table.has_targets else tuple(_target(t) for t in wish.targets)
    return _blocks(name, wish, worlds, methods, {world: wished or table.targets(world) for world in worlds})


def _blocks(
    name: str,
    wish: TableRequest,
    worlds: tuple[str, ...],
    methods: tuple[str, ...],
    targets: Mapping[str, tuple[str, ...]],
) -> Iterator[Block]:
    table = TABLE[name]
    for seed in range(1, (1 if table.once else wish.trials) + 1):
        for number in range(max(len(own) for own in targets.values())):
            for world in (world for world in worlds if number < len(targets[world])):
                target = targets[world][number]
                yield tuple(
                    TableCase(
                        table=name,
                        world=world,
                        method=method,
                        target=target,
                        seed=seed,
                        task=table.plan(world, method, target, seed, wish),
                    )
                    for method in methods
                )


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
    option: str, wished: tuple[str, ...] | None, allowed: tuple[str, ...], default: tuple[str, ...]
) -> tuple[str, ...]:
    if wished is None or allowed == (NOWHERE,):
        return default
    for name in wished:
        if name not in allowed:
            raise InputError(f"{option}: '{name}' is not known here, allowed: {', '.join(allowed)}")
    return tuple(dict.fromkeys(wished))


def _name(*parts: object) -> str:
    return "/".join(str(part) for part in parts if part != OWN)


def _fields(where: TableWorld, method: str, target: str, seed: int) -> dict[str, Any]:
    own: dict[str, Any] = {} if target == OWN else {"target.kind": target}
    return where.told | own | {"method": method, "seed": seed}


def _scan(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:  # noqa: ARG001
    fields = _fields(water(world), method, target, seed)
    return Task(
        name=_name("scan", world, target, method, seed),
        work="wakewise_paper.reproduction.scans:scan_one",
        settings={"fields": fields, "extent": True},
        sources=_SCAN,
    )


def _varied(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:  # noqa: ARG001
    kind = CORALS[(seed - 1) % len(CORALS)] if target == OWN and world == PUMP_TANK else target
    mission = varied_mission(world, None if kind == OWN else kind, seed)
    fields = _fields(water(world), method, kind, seed) | dict(mission)
    return Task(
        name=_name("varied", world, target, method, seed),
        work="wakewise_paper.reproduction.scans:scan_one",
        settings={"fields": fields, "extent": False},
        sources=_SCAN,
    )


def _plain_scan(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:  # noqa: ARG001
    fields = _fields(water(world), method, target, seed)
    return Task(
        name=_name("scan", world, target, method, seed),
        work="wakewise_paper.reproduction.scans:scan_one",
        settings={"fields": fields, "extent": False},
        sources=_SCAN,
    )


def _flight(course: str, piv_instants: int = 0) -> Callable[[str, str, str, int, TableRequest], Task]:
    def plan(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:
        settings: dict[str, Any] = {
            "fields": _fields(water(world), method, target, seed),
            "course": course,
            "duration_s": wish.duration_s,
        }
        if piv_instants:
            settings["piv_instants"] = piv_instants
        return _fly(_name(course, world, target, method, seed), settings)

    return plan


def _fly(name: str, settings: Mapping[str, Any]) -> Task:
    return Task(name=name, work="wakewise_paper.reproduction.flights:fly_one", settings=settings, sources=_FLIGHT)


def _ablated(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:
    six = method == "six thrusters"
    task = _flight("round")(world, "wake-aware" if six else method, target, seed, wish)
    settings = dict(task.settings)
    if six:
        settings["fields"] = settings["fields"] | {"vehicle": "paper-six-thrusters"}
    return _fly(_name("ablation", world, target, method, seed), settings)


_SCRIPT = "script"


def _operated(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:
    who, _, w_track = method.partition(", w_track ")
    told: dict[str, Any] = {"world": world, "method": who, "seed": seed}
    told["course" if world == PAPER else "pilot"] = target
    if w_track:
        told["w_track"] = float(w_track)
    if world != PAPER and wish.duration_s is not None:
        told["duration_s"] = wish.duration_s
    return Task(
        name=_name("operator", world, target, method, seed),
        work="wakewise_paper.reproduction.scans:operator_one",
        settings=told,
        sources=_OPERATOR,
    )


def _solved(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:  # noqa: ARG001
    return Task(name="solver", work="wakewise_benchmarks.solver:solve_one", settings={"instants": 100}, sources=_SOLVER)


def _validated(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:  # noqa: ARG001
    return Task(
        name="wake",
        work="wakewise_paper.reproduction.scans:wake_one",
        settings={"quick": True},
        sources=_WAKE,
    )


APPROACHES: dict[str, dict[str, Any]] = {
    "nothing (dp)": {"method": "dp"},
    "farther off": {"method": "dp", "mission.standoff_m": 0.8},
    "ballast": {"method": "dp", "ballast": True},
    "soft thrusters": {"method": "dp", "vehicle": "soft-thrusters"},
    "a rule (no-forward-jets)": {"method": "no-forward-jets"},
    "shares (allocation-only)": {"method": "allocation-only"},
    "a plan (wake-aware)": {"method": "wake-aware"},
    "a tilting camera": {"method": "wake-aware", "vehicle": "paper-tilting"},
    "a plan and ballast": {"method": "wake-aware", "ballast": True},
}
"""Ways to stir less, the paper's kind and others: fields of a scenario, and whether the vehicle is trimmed first."""
COMPARED = (
    "dp",
    "manual",
    "ardusub",
    "no-forward-jets",
    "pseudo-inverse",
    "mpc",
    "mpc-smooth",
    "linear",
    "allocation-only",
    "wake-aware",
)
"""Methods of the comparison."""


def _compared(world: str, method: str, target: str, seed: int, wish: TableRequest) -> Task:
    told = dict(APPROACHES.get(method, {"method": method}))
    ballast = bool(told.pop("ballast", False))
    fields = _fields(water(world), told.pop("method"), target, seed) | told
    settings: dict[str, Any] = {"fields": fields, "course": "round", "duration_s": wish.duration_s}
    if ballast:
        settings["ballast"] = True
    return _fly(_name("comparison", world, target, method, seed), settings)


def _corals(world: str) -> tuple[str, ...]:
    return CORALS if world in (PUMP_TANK, "still-tank", PAPER, "lattice") else (OWN,)


def _own(world: str) -> tuple[str, ...]:  # noqa: ARG001
    return (OWN,)


def _nothing(world: str) -> tuple[str, ...]:  # noqa: ARG001
    return (NOWHERE,)


def _asked(world: str) -> tuple[str, ...]:
    return ("front", "over") if world == PAPER else (_SCRIPT,)


_FLOWN = (PUMP_TANK, TROUBLE, PAPER)
_STATION = ("manual", "dp", "mpc", "mpc-smooth", "wake-aware")

TABLE: dict[str, TableDefinition] = {
    "dynamic": TableDefinition(
        methods=ORDER, worlds=(PUMP_TANK, TROUBLE), targets=_corals, plan=_scan, block_s=400.0, weight=4.0
    ),
    "success": TableDefinition(
        methods=("mpc", "wake-aware"),
        worlds=(PUMP_TANK, TROUBLE),
        targets=_own,
        plan=_varied,
        block_s=200.0,
        weight=2.0,
    ),
    "station": TableDefinition(
        methods=_STATION, worlds=_FLOWN, targets=_own, plan=_flight("station"), block_s=150.0, weight=3.0
    ),
    "ablation": TableDefinition(
        methods=("wake-aware", *VARIANTS), worlds=_FLOWN, targets=_own, plan=_ablated, block_s=45.0
    ),
    "sediment": TableDefinition(
        methods=("mpc", "wake-aware"), worlds=(CACO3, "fluff"), targets=_own, plan=_plain_scan, block_s=220.0
    ),
    "flow": TableDefinition(
        methods=("dp", "mpc", "wake-aware"), worlds=_FLOWN, targets=_own, plan=_flight("round", 3), block_s=50.0
    ),
    "solver": TableDefinition(
        methods=(NOWHERE,),
        worlds=(NOWHERE,),
        targets=_nothing,
        plan=_solved,
        block_s=60.0,
        once=True,
        has_targets=False,
    ),
    "wake": TableDefinition(
        methods=(NOWHERE,),
        worlds=(NOWHERE,),
        targets=_nothing,
        plan=_validated,
        block_s=60.0,
        once=True,
        has_targets=False,
    ),
    "field": TableDefinition(
        methods=("dp", "wake-aware"), worlds=(FIELD,), targets=_own, plan=_plain_scan, block_s=220.0
    ),
    "operator": TableDefinition(
        methods=("dp", *(f"wake-aware, w_track {w:g}" for w in W_TRACKS)),
        worlds=(TROUBLE, PAPER),
        targets=_asked,
        plan=_operated,
        block_s=45.0,
        has_targets=False,
    ),
    "comparison": TableDefinition(
        methods=(*COMPARED, *APPROACHES), worlds=(TROUBLE,), targets=_own, plan=_compared, block_s=170.0
    ),
}
assert set(TABLE) == set(TABLES)
