"""Worlds by name: water, bed, target and vehicle mismatch of typical missions.

Each is a YAML file: its purpose, and fields of a scenario, each with a value or a distribution, and the source of the
number. `_every.yaml` holds the distributions that all worlds share. A world is merged over a preset and below the
user's settings.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from importlib import resources
from typing import Any

from pydantic import Field, ValidationError, model_validator

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, read_yaml
from wakewise.core.settings import Settings, describe_faults, guess
from wakewise.operation.scenario.randomization import FieldDistribution


class WorldField(Settings):
    """One field of a world: its value or distribution, and the source of the number."""

    value: Any = Field(None, description="what the field is")
    randomize: FieldDistribution | None = Field(None, description="from where the seed draws it")
    source: str = Field(..., min_length=3, description="where the number comes from")

    @model_validator(mode="after")
    def _has_one(self) -> WorldField:
        if (self.value is None) == (self.randomize is None):
            raise ValueError("gives value and randomize or neither, must give one of them")
        return self


class WorldFile(Settings):
    """What a world's file holds."""

    title: str = Field(..., min_length=3, description="the world in a few words")
    why: str = Field(..., min_length=20, description="who meets it, and what can be harmed in it")
    flow: str = Field("tank", description="the water: a name as `flow` of a scenario has it")
    fields: dict[str, WorldField] = Field(..., min_length=1, description="fields of a scenario by their dotted names")


@dataclass(frozen=True, kw_only=True, eq=False)
class NamedWorld:
    """A world of the library."""

    name: str
    file: WorldFile

    @property
    def values(self) -> dict[str, Any]:
        """Values by dotted field."""
        return {name: field.value for name, field in self.file.fields.items() if field.randomize is None}

    @property
    def randomize(self) -> dict[str, FieldDistribution]:
        """Distributions by dotted field."""
        return {name: field.randomize for name, field in self.file.fields.items() if field.randomize is not None}

    def layer(self) -> dict[str, Any]:
        """The world as a layer of a scenario: a tree of values, with its draws."""
        tree: dict[str, Any] = {}
        for dotted, value in self.values.items():
            *parents, leaf = dotted.split(".")
            branch = tree
            for parent in parents:
                branch = branch.setdefault(parent, {})
            branch[leaf] = value
        return tree | {"randomize": {name: draw.model_dump(exclude_none=True) for name, draw in self.randomize.items()}}


@functools.cache
def world_names() -> tuple[str, ...]:
    """Names of the worlds that come with the package, sorted."""
    folder = resources.files("wakewise.operation.worlds") / "library_data"
    names = (e.name.removesuffix(".yaml") for e in folder.iterdir() if e.name.endswith(".yaml"))
    return tuple(sorted(name for name in names if not name.startswith("_")))


def own_file(name: str) -> str:
    """A hint if a file is given in place of a world's name; empty for any other name."""
    if not name.lower().endswith((".yaml", ".yml")):
        return ""
    return f"a world of your own is given as the scenario, `wakewise scan {name}` (docs/worlds.md), by name "


@functools.cache
def load_world(name: str) -> NamedWorld:
    """A world of the library.

    Raises InputError if there is none of that name, or its file is not one.
    """
    if name not in world_names():
        hint = own_file(name) or guess(name, world_names())
        raise InputError(f"world '{name}': not in the library, {hint}allowed are {', '.join(world_names())}")
    own = parse_world(name, _text(name)).file
    return NamedWorld(name=name, file=own.model_copy(update={"fields": every_world() | own.fields}))


@functools.cache
def every_world() -> dict[str, WorldField]:
    """Fields of all worlds, which a world may override, by their dotted names."""
    return parse_world("_every", _text("_every")).file.fields


def _text(name: str) -> str:
    return (resources.files("wakewise.operation.worlds") / "library_data" / f"{name}.yaml").read_text("utf-8")


def parse_world(name: str, text: str) -> NamedWorld:
    """A world from the text of its file.

    Raises InputError, naming the field, what was found and what is allowed.
    """
    try:
        return NamedWorld(name=name, file=WorldFile.model_validate(read_yaml(text)))
    except YamlError as fault:
        line = "" if fault.line is None else f" line {fault.line}"
        raise InputError(f"world {name}{line}: not YAML ({fault.reason})") from None
    except ValidationError as fault:
        raise InputError(f"world {name}: {describe_faults(fault, WorldFile, 'world')}") from None
