"""Scenarios of the gentle bench by name: YAML files that say what is flown, in which strata, and numbers' sources.

A scenario draws what every world draws (`_every.yaml` of the worlds), its own fields, and, by stratum, trim and
current.

Strata of a scenario: which trim a seed flies, and from which side the current comes.

A Latin square: three seeds in a row have every trim and every side once, nine have every pair. It is turned from one
scenario to the next, so that not all first seeds are heavy vehicles in a current towards the target.
"""

from __future__ import annotations

import functools
import zlib
from importlib import resources
from typing import Any, Literal, get_args

import numpy as np
from pydantic import Field, ValidationError

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import read_yaml
from wakewise.core.settings import Settings, describe_faults
from wakewise.operation.scenario.randomization import FieldDistribution
from wakewise.operation.worlds.library import NamedWorld, WorldField, WorldFile, every_world, load_world, world_names

Side = Literal["towards", "abeam", "away"]
SIDES: tuple[Side, ...] = get_args(Side)
"""Where the current carries the wash of a vehicle beside the target: onto it, past it, away from it."""

HALF_SIDE_RAD = np.pi / 4
"""A side reaches this far to both of its middle, so that the sides together are all directions."""


def stratum(trims: tuple[str, ...], turned: int, seed: int) -> tuple[str, Side]:
    """Trim and side of a seed (from 1) of a scenario whose square is turned by a number of sides."""
    place = seed - 1
    return trims[place % len(trims)], SIDES[(place + place // len(SIDES) + turned) % len(SIDES)]


def current_W_m_s(side: Side, azimuth_rad: float, speed_m_s: float, rng: np.random.Generator) -> tuple[float, ...]:
    """Level current that comes from a side of a vehicle at an azimuth of the target, north, east and down.

    Parameters
    ----------
    side : Side
    azimuth_rad : float
        Where the vehicle is, seen from the target.
    speed_m_s : float
    rng : numpy Generator
        Draws the angle within the side, and of `abeam` which of the two.
    """
    middle = {"towards": azimuth_rad + np.pi, "away": azimuth_rad, "abeam": azimuth_rad + 0.5 * np.pi}[side]
    off, other = rng.uniform(-HALF_SIDE_RAD, HALF_SIDE_RAD), rng.uniform() < 0.5
    heading = middle + off + (np.pi if side == "abeam" and other else 0.0)
    return (round(float(speed_m_s * np.cos(heading)), 6), round(float(speed_m_s * np.sin(heading)), 6), 0.0)


Span = tuple[float, float]
Course = Literal["orbit", "station", "close", "nadir", "brake"]

SCENARIOS = ("orbit", "station", "close", "nadir", "brake", "tether", "calm")
"""In the order of the tables; a scenario's place turns its square and begins its seeds, so new ones come last."""
VEHICLES = ("paper", "bluerov2-heavy")
"""A camera that is fixed, and one that tilts; the first flies in the worlds."""
SEEDS_EACH = 1000
"""Seeds of one scenario, so that no two share a draw: seed k of the n-th is 1000 n + k."""
WORLD = "world/"
"""Before the name of a world of the library, which `close` and others share with a scenario."""


class ScenarioFile(Settings):
    """What a scenario's file holds."""

    title: str = Field(..., min_length=3, description="the scenario in a few words")
    why: str = Field(..., min_length=20, description="who meets it, and what makes it hard")
    course: Course = Field(..., description="how it is flown, see courses.py")
    trims_N: dict[str, Span] = Field(..., min_length=1, description="buoyancy beyond the believed one, by stratum")
    trims_source: str = Field(..., min_length=3)
    current_m_s: Span = Field(..., description="speed of the current")
    current_source: str = Field(..., min_length=3)
    altitude_m: Span | None = Field(None, description="nadir: camera above the target's top")
    pull_N: Span | None = Field(None, description="pull of a cable down the current")
    plain: bool = Field(False, description="draws nothing of what every world draws")
    fields: dict[str, WorldField] = Field(..., min_length=1, description="fields of a scenario by their dotted names")


class SampledConditions(Settings):
    """What a seed of a scenario is, beside the fields that the scenario's own seed draws."""

    seed: int
    azimuth_rad: float
    trim: str
    side: Side
    trim_N: float
    current_W_m_s: tuple[float, float, float]
    altitude_m: float | None = None
    pull_N: float | None = None


@functools.cache
def load_scenario_file(name: str) -> ScenarioFile:
    """A scenario of the bench.

    Raises
    ------
    InputError
        If there is none of that name, or its file is not one.
    """
    if name not in SCENARIOS:
        raise InputError(f"scenario '{name}': not known, allowed: {', '.join(SCENARIOS)}")
    text = (resources.files("wakewise_paper.wash_reduction") / "scenarios" / f"{name}.yaml").read_text("utf-8")
    try:
        return ScenarioFile.model_validate(read_yaml(text))
    except ValidationError as fault:
        raise InputError(f"scenario {name}: {describe_faults(fault, ScenarioFile, 'file')}") from None


def sample_conditions(name: str, seed: int) -> SampledConditions:
    """What a seed, from 1, of a scenario is: its stratum, and what is drawn within."""
    file, number = load_scenario_file(name), SCENARIOS.index(name)
    own = SEEDS_EACH * (number + 1) + seed
    trim, side = stratum(tuple(file.trims_N), number, seed)

    def rng(what: str) -> np.random.Generator:
        return np.random.default_rng([own, 29, zlib.crc32(what.encode())])

    def among(what: str, span: Span | None) -> float | None:
        return None if span is None else round(float(rng(what).uniform(*span)), 6)

    azimuth = float(rng("azimuth").uniform(-np.pi, np.pi))
    speed = float(rng("current").uniform(*file.current_m_s))
    return SampledConditions(
        seed=own,
        azimuth_rad=azimuth,
        trim=trim,
        side=side,
        trim_N=round(float(rng("trim").uniform(*file.trims_N[trim])), 6),
        current_W_m_s=current_W_m_s(side, azimuth, speed, rng("side")),
        altitude_m=among("altitude", file.altitude_m),
        pull_N=among("pull", file.pull_N),
    )


def fields_of(name: str) -> tuple[dict[str, Any], dict[str, FieldDistribution]]:
    """Values and draws of a scenario's own fields and of those that every world has, by dotted name."""
    file = load_scenario_file(name)
    fields = file.fields if file.plain else every_world() | file.fields
    world = NamedWorld(
        name=name,
        file=WorldFile(title=file.title, why=file.why, fields=fields),
    )
    return world.values, world.randomize


def names_of(requested: tuple[str, ...] | None) -> tuple[str, ...]:
    """Full names of the scenarios requested, in the bench's order: `orbit/paper`, `world/mud`; all if None.

    `orbit` stands for both vehicles, `worlds` for all worlds of the library.

    Raises
    ------
    InputError
        If one is not known.
    """
    groups = {name: tuple(f"{name}/{vehicle}" for vehicle in VEHICLES) for name in SCENARIOS}
    groups["worlds"] = tuple(WORLD + name for name in world_names())
    every = tuple(full for names in groups.values() for full in names)
    chosen: set[str] = set()
    for name in every if requested is None else requested:
        if name not in groups and name not in every:
            raise InputError(f"scenarios: '{name}' is not known, allowed: {', '.join((*groups, *every))}, paper")
        chosen |= set(groups.get(name, (name,)))
    return tuple(name for name in every if name in chosen)


def title_of(full: str) -> str:
    """What a scenario or world is, in a few words."""
    if full.startswith(WORLD):
        return load_world(full.removeprefix(WORLD)).file.title
    return load_scenario_file(full.partition("/")[0]).title


def trim_of(full: str, seed: int) -> str:
    """The stratum's trim; a world has none of its own."""
    return "" if full.startswith(WORLD) else sample_conditions(full.partition("/")[0], seed).trim
