"""A campaign as people write it: methods x targets x worlds x vehicles x variations x seeds, as YAML.

Every combination is a scenario, checked before the first trial is made, and a trial of its own (`planned_trials`). A
program that lists trials itself, as the studies of wakewise-paper do, makes `PlannedTrial`s directly. What a folder was
made for is kept in its plan.json (`keep_plan`). Files and modules from outside the package are part of a trial's key,
files by their bytes and packages by their source, so that a controller that was changed is flown anew.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from importlib.metadata import version
from importlib.resources import files
from importlib.util import find_spec
from inspect import signature
from itertools import product
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, ValidationError, field_validator, model_validator

from wakewise.control import MAKERS
from wakewise.core.errors import InputError
from wakewise.core.files import name_fault, sha256_of, write_json
from wakewise.core.plugins import find
from wakewise.core.safe_yaml import yaml_file
from wakewise.core.settings import Seed, Settings
from wakewise.experiments.campaigns.flights import FLY, MODEL
from wakewise.experiments.campaigns.store import open_store, read_store
from wakewise.experiments.campaigns.task import FLIES, PHOTOGRAPHS, Task, function_named, source_version
from wakewise.operation.flying import check_duration
from wakewise.operation.scenario import PRESETS, Scenario, describe_fault, load_scenario
from wakewise.operation.scenario.layers import merged, nested
from wakewise.scene.targets import procedural_kinds
from wakewise.simulation.tank import tank_ambient


def external_parts(scenario: Scenario) -> dict[str, str]:
    """Parts that come from elsewhere, each with what says its version.

    Raises InputError if a controller or a file cannot be found or read.
    """
    found = dict(scenario.parts().external_parts)
    if scenario.method not in MAKERS:
        find("method", scenario.method, MAKERS)
    method, world, flow, pilot = scenario.method, scenario.world, scenario.flow, scenario.pilot
    both = {"target": scenario.target.kind, "current": scenario.tank.current.file}
    both["detector"] = scenario.perception.detector
    for name, named in {"vehicle": scenario.vehicle, "control_log": scenario.control_log, **both}.items():
        if (path := Path(named or "").expanduser()).is_file():
            found[f"{name} file"] = digest(path)
    modules = {"method": method, "world": world, "flow": flow, "pilot": pilot, "wake": scenario.control.wake.model}
    for name, named in (modules | both).items():
        if ":" in (named or "") and f"{name} file" not in found:
            found[f"{name} source"] = module_digest(str(named).partition(":")[0])
    return found


def digest(path: Path) -> str:
    """Hash of a file."""
    try:
        return sha256_of(path)
    except OSError as fault:
        raise InputError(f"{path}: cannot be read, {fault.strerror}") from None


def module_digest(module: str) -> str:
    """Hash of a module's file, or of all Python files of the package that it is in."""
    top = find_spec(module.partition(".")[0])
    if top is None or top.origin is None:
        return "unknown"
    if not top.submodule_search_locations:
        return digest(Path(top.origin))
    folder = Path(top.origin).parent
    whole = hashlib.sha256()
    for file in sorted(folder.rglob("*.py")):
        whole.update(f"{file.relative_to(folder).as_posix()} {digest(file)}\n".encode())
    return whole.hexdigest()


FACTORS = ("method", "target", "world", "vehicle", "variation", "seed")
"""What a trial of a campaign differs in, in the order of its name."""
MOST_TRIALS = 100_000
AS_IS = "as-is"
"""Name of the variation that changes nothing."""
FLIGHT_SOURCES = (*FLIES, "experiments/campaigns/flights.py")
"""Sources that can change the figures of a flight of a campaign."""
MODEL_SOURCES = (*PHOTOGRAPHS, "experiments/campaigns/flights.py")
"""Sources that can change a model made from a flight's photographs."""
_WORK = {"fly": FLY, "model": MODEL}
_SOURCES = {"fly": FLIGHT_SOURCES, "model": MODEL_SOURCES}


class Campaign(Settings):
    """What a campaign file says."""

    name: str = Field("campaign", min_length=1, max_length=80, description="what it is called in tables and pages")
    preset: Literal["quick", "standard"] = Field("quick", description="the scenario that everything is laid over")
    scenario: dict[str, Any] = Field(
        default={}, description="fields of the scenario of all trials, nested or by dotted names"
    )
    stages: Literal["fly", "model"] = Field(
        "model", description="fly: the flight and the water; model: photographs, model and its figures, too"
    )
    setup: dict[str, dict[str, Any]] = Field(
        default={},
        description="package.module:function with its arguments: (parts, **arguments) -> parts, such as a route; fly",
    )
    probes: dict[str, dict[str, Any]] = Field(
        default={}, description="package.module:Class with its arguments: a FlightProbe, which adds figures; fly"
    )
    duration_s: float | None = Field(None, gt=0.0, description="only the first part of each flight; fly")
    keep: Literal["figures", "all"] = Field(
        "figures", description="what stays of a trial: its figures and record, or its photographs and model, too"
    )
    methods: tuple[str, ...] = Field(("dp", "wake-aware"), min_length=1, description="names, or package.module:make")
    targets: tuple[str, ...] | dict[str, dict[str, Any]] = Field(
        default=(), description="kinds or mesh files; or names, each with fields of `target` (kind, seed, size_m)"
    )
    worlds: tuple[str, ...] = Field(default=(), description="worlds by name; the scenario's own if not given")
    vehicles: tuple[str, ...] = Field(default=(), description="library names or vehicle files; the scenario's own")
    variations: dict[str, dict[str, Any]] = Field(
        default={}, description="by name, fields of the scenario that a variation changes; {} changes nothing"
    )
    seeds: int | tuple[Seed, ...] = Field(3, description="seeds 1 to this, or a list of seeds")
    timeout_s: float | None = Field(1800.0, gt=0.0, description="a trial that takes longer is ended; null: never")
    memory_MB: float | None = Field(None, gt=0.0, description="a trial that takes more memory is ended; null: never")
    retries: int = Field(
        2, ge=0, le=100, description="how often a trial is tried again whose process died or was ended"
    )

    @field_validator("methods", "worlds", "vehicles", "targets", mode="before")
    @classmethod
    def _one_is_a_list(cls, value: Any) -> Any:
        return (value,) if isinstance(value, str) else value

    @field_validator("methods", "worlds", "vehicles", "targets")
    @classmethod
    def _none_twice(cls, value: Any) -> Any:
        for one in value:
            if list(value).count(one) > 1:
                raise ValueError(f"'{one}' is named twice")
        return value

    @field_validator("seeds")
    @classmethod
    def _counts(cls, value: int | tuple[int, ...]) -> int | tuple[int, ...]:
        if isinstance(value, int):
            if not 1 <= value <= MOST_TRIALS:
                raise ValueError(f"allowed are 1 to {MOST_TRIALS}, or a list of seeds")
        elif not value or len(set(value)) < len(value):
            raise ValueError("a list of seeds needs at least one, none twice")
        return value

    @field_validator("name")
    @classmethod
    def _names_a_folder(cls, value: str) -> str:
        if fault := name_fault(value):
            raise ValueError(f"names a folder, so {fault}")
        return value

    @model_validator(mode="after")
    def _of_flights(self) -> Self:
        if self.stages != "fly" and (self.setup or self.probes or self.duration_s is not None):
            raise ValueError("setup, probes and duration_s are of `stages: fly`")
        return self

    @property
    def all_seeds(self) -> tuple[int, ...]:
        """The seeds of every combination."""
        return tuple(range(1, self.seeds + 1)) if isinstance(self.seeds, int) else self.seeds


@dataclass(frozen=True, kw_only=True)
class PlannedTrial:
    """A trial of a campaign: the task, and where in the campaign it stands (see `FACTORS`)."""

    task: Task
    factors: Mapping[str, str | int]

    @property
    def world(self) -> str:
        """Where it is flown."""
        return str(self.factors["world"])

    @property
    def method(self) -> str:
        """Method, or whatever else it is compared by."""
        return str(self.factors["method"])

    @property
    def target(self) -> str:
        """What is looked at; "" where that does not differ."""
        return str(self.factors.get("target", ""))

    @property
    def seed(self) -> int:
        """Trials of one seed are compared in pairs."""
        return int(self.factors["seed"])


def load_campaign(path: Path) -> Campaign:
    """Read a campaign file.

    Raises InputError, which names the file, the field, what was found and what is allowed.
    """
    tree = yaml_file(path)
    if not isinstance(tree, dict):
        raise InputError(f"{path}: holds {type(tree).__name__}, must hold fields of a campaign such as 'methods: [dp]'")
    return check_campaign(tree, str(path))


def check_campaign(tree: Mapping[str, Any], source: str = "campaign") -> Campaign:
    """Turn plain values into a campaign; raises as `load_campaign`."""
    try:
        return Campaign.model_validate(dict(tree))
    except ValidationError as fault:
        raise InputError(f"{source}: {describe_fault(fault, Campaign)}") from None


def planned_trials(campaign: Campaign, source: str = "campaign") -> list[PlannedTrial]:
    """All trials of a campaign, seed by seed, so that one that is stopped has whole seeds of everything.

    Raises InputError if there are too many, or a combination is no scenario; the combination and the field are named.
    """
    outside: dict[str, str] = {}
    for name, given in (campaign.setup | campaign.probes).items():
        # What a flight gives first: the parts, and to a probe its folder.
        kind, first = ("probe", (None, None)) if name in campaign.probes else ("setup", (None,))
        try:
            signature(function_named(name, kind)).bind(*first, **given)
        except (InputError, TypeError, ValueError) as fault:
            said = fault if isinstance(fault, InputError) else f"{kind} {name}: {fault}"
            raise InputError(f"{source}: {said}") from None
        outside[f"{name.partition(':')[0]} source"] = module_digest(name.partition(":")[0])
    _check_factors(campaign, source)
    cells = list(_cells(campaign))
    seeds = campaign.all_seeds
    count = len(cells) * len(seeds)
    if count > MOST_TRIALS:
        raise InputError(f"{source}: {count} trials, at most {MOST_TRIALS} in one campaign")
    there: set[str] = set()
    resolved = [(cell, *_resolved(campaign, cell, seeds[0], source, there)) for cell in cells]
    return [_trial(campaign, cell, scenario, outside | own, seed) for seed in seeds for cell, scenario, own in resolved]


def _check_factors(campaign: Campaign, source: str) -> None:
    """Refuse what scenario or variations say in place of a factor: trials are named by factors."""
    given = campaign.targets.values() if isinstance(campaign.targets, dict) else [{"kind": ""}] * bool(campaign.targets)
    aimed = [{f"target.{key}" for key in one} for one in given]
    fixed = {"method", "seed", *(one for one in ("world", "vehicle") if getattr(campaign, f"{one}s"))}
    layers = {"scenario": (campaign.scenario, fixed.union(set.intersection(*aimed) if aimed else ()))}
    named = {"method", "seed", "world", "vehicle"}.union(*aimed or [{"target.kind"}])
    layers |= {f"variation {name}": (fields, named) for name, fields in campaign.variations.items()}
    for where, (fields, taken) in layers.items():
        for key, own in product(_dotted(fields), taken):
            if f"{key}.".startswith(f"{own}."):
                right = f"must be given under {own.partition('.')[0]}s, which name the trials"
                raise InputError(f"{source}: {where}: {key} {right}")


def _dotted(fields: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    for key, value in fields.items():
        yield from _dotted(value, f"{prefix}{key}.") if isinstance(value, dict) else (f"{prefix}{key}",)


@dataclass(frozen=True)
class _Cell:
    """A combination, but for the seed: names of its factors, and the scenario's fields in the order they are laid."""

    names: Mapping[str, str]
    fields: dict[str, Any]


def _cells(campaign: Campaign) -> Iterator[_Cell]:
    own = load_scenario(campaign.preset, None, dict(campaign.scenario))
    named = campaign.targets if isinstance(campaign.targets, dict) else {t: {"kind": t} for t in campaign.targets}
    targets = dict(named) or {Path(own.target.kind).stem: {}}
    worlds = campaign.worlds or (own.world,)
    vehicles = campaign.vehicles or (own.vehicle,)
    variations = campaign.variations or {AS_IS: {}}
    for variation, target, world, vehicle, method in product(variations, targets, worlds, vehicles, campaign.methods):
        names = {"method": method, "target": target, "world": world, "vehicle": vehicle, "variation": variation}
        aimed = {f"target.{key}": value for key, value in targets[target].items()}
        fields = {**campaign.scenario, **aimed, "world": world, "vehicle": vehicle, "method": method}
        told = (nested(*one) for layer in (fields, variations[variation]) for one in layer.items())
        yield _Cell(names, reduce(merged, told))


def _resolved(
    campaign: Campaign, cell: _Cell, seed: int, source: str, there: set[str]
) -> tuple[Scenario, dict[str, str]]:
    """The scenario of a combination, and what of it comes from outside the package; all of it can be found.

    `there` holds vehicles with targets and currents that have been loaded once.
    """
    where = ", ".join(f"{key} {name}" for key, name in cell.names.items() if key != "variation" or name != AS_IS)
    try:
        scenario = load_scenario(campaign.preset, None, cell.fields | {"seed": seed})
        if campaign.duration_s is not None:
            check_duration(campaign.duration_s, scenario)
        loaded = f"{scenario.vehicle} {scenario.ballast} {scenario.target} {scenario.tank.current}"
        if loaded not in there:
            parts = scenario.parts()
            _ = parts.vehicle, parts.target, tank_ambient(parts.scenario.tank, parts.seeds.tank())
            there.add(loaded)
        return scenario, external_parts(scenario)
    except InputError as fault:
        raise InputError(f"{source}: {where}: {fault}") from None


def _trial(campaign: Campaign, cell: _Cell, scenario: Scenario, outside: dict[str, str], seed: int) -> PlannedTrial:
    factors: dict[str, str | int] = {**cell.names, "seed": seed}
    settings: dict[str, Any] = {
        "scenario": scenario.model_copy(update={"seed": seed, "name": campaign.name}).model_dump(mode="json"),
        "keep": campaign.keep,
    }
    for name in ("setup", "probes", "duration_s"):
        if value := getattr(campaign, name):
            settings[name] = value
    if outside:
        settings["outside"] = outside
    alike = [key for key in ("vehicle", "variation") if len(getattr(campaign, f"{key}s")) <= 1]
    shown = [str(value) for key, value in factors.items() if key not in alike]
    task = Task(name="/".join(shown), work=_WORK[campaign.stages], settings=settings, sources=_SOURCES[campaign.stages])
    return PlannedTrial(task=task, factors=factors)


def example() -> str:
    """A campaign file to begin with."""
    text = (files(__package__) / "example.yaml").read_text(encoding="utf-8")
    return text.format(presets=" or ".join(PRESETS), corals=", ".join(procedural_kinds()))


PLAN = "plan.json"


@dataclass(frozen=True, kw_only=True)
class PlanEntry:
    """A trial of the plan."""

    key: str
    name: str
    factors: Mapping[str, str | int]


@dataclass(frozen=True, kw_only=True)
class CampaignPlan:
    """What a campaign's folder was made for: its file, resolved, the package's version, the hash of its sources."""

    name: str
    campaign: Mapping[str, Any]
    wakewise: str
    sources: str
    trials: tuple[PlanEntry, ...]


def keep_campaign(folder: Path, campaign: Campaign, trials: Sequence[PlannedTrial]) -> None:
    """Write the plan of a campaign file into its folder, in place of an earlier one of the same version.

    Raises InputError if what is there was made by other sources: figures of two versions are no comparison.
    """
    sources = source_version(trials[0].task.sources)
    if (folder / PLAN).exists():
        before = read_plan(folder)
        if before.sources != sources and before.campaign.get("stages") == campaign.stages:
            raise InputError(
                f"--out {folder}: holds trials of another version (Wakewise {before.wakewise}, sources "
                f"{before.sources[:8]}; now {version('wakewise')}, {sources[:8]}); give another --out"
            )
    keep_plan(folder, campaign.name, trials, campaign.model_dump(mode="json"))


def keep_plan(folder: Path, name: str, trials: Sequence[PlannedTrial], campaign: Mapping[str, Any]) -> None:
    """Write what a folder was made for: `wakewise campaign status|table|page` read it.

    Raises InputError if the folder holds something that is no campaign.
    """
    open_store(folder)
    told = {
        "name": name,
        "campaign": dict(campaign),
        "wakewise": version("wakewise"),
        "sources": source_version(trials[0].task.sources),
        "trials": [{"key": one.task.key, "name": one.task.name, "factors": dict(one.factors)} for one in trials],
    }
    write_json(folder / PLAN, told, lasting=True)


def read_plan(folder: Path) -> CampaignPlan:
    """The plan of a campaign's folder.

    Raises InputError if there is no campaign, or one of another version.
    """
    read_store(folder)
    path = folder / PLAN
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        return CampaignPlan(**told | {"trials": tuple(PlanEntry(**one) for one in told["trials"])})
    except FileNotFoundError:
        raise InputError(f"{folder}: no campaign file was run here, its {PLAN} is missing") from None
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{path}: cannot be read; `wakewise campaign run` with the same file writes it anew") from None
