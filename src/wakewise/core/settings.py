"""Base of every group of settings that a user may write in a file, and the words for what is wrong in one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Annotated, Any, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, ValidationInfo, field_validator

from wakewise.core.checks import quoted, whole_number
from wakewise.core.errors import InputError

MAX_SEED = 2**63 - 1
"""Largest seed of a random draw: what a signed number of 64 bits holds."""

Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]
"""Seed of random draws."""

MOST_FAULTS = 6
"""So many faults of one file are told in full; of the others, how many there are."""


class Settings(BaseModel):
    """Frozen, refuses unknown fields, NaN and infinity; each room's settings derive from it."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _yes_is_no_number(cls, value: Any, info: ValidationInfo) -> Any:
        """Keep `true` from being read as 1 where a number is meant."""
        if isinstance(value, bool) and info.field_name is not None:
            annotation = cls.model_fields[info.field_name].annotation
            meant = {annotation, *get_args(annotation)}
            if bool not in meant and meant & {int, float}:
                raise ValueError("must be a number, not true or false")
        return value


def seed_number(value: object, name: str = "seed") -> int:
    """The value as a seed of random draws: a whole number from 0 to 2^63 - 1.

    Raises InputError if it is another.
    """
    return whole_number(value, name, 0, MAX_SEED)


def guess(word: str, known: list[str] | tuple[str, ...]) -> str:
    """The known word nearest to a misspelt one, as the beginning of a hint; empty where none is near."""
    close = get_close_matches(word, known, 1)
    return f"did you mean {close[0]}? " if close else ""


def describe_faults(
    error: ValidationError, model: type[BaseModel], whole: str, known: Callable[[str, Any], str | None] | None = None
) -> str:
    """All faults of a file in one line: which field of `model` is wrong, what was found and what is allowed.

    `model`: what the file was read as. `whole`: what the file is called where a fault is of no single field. `known`:
    called with dotted name and value of each; words that it returns are told in place of ours.
    """
    told: dict[str, str] = {}
    alike: dict[str, list[str]] = {}
    more = 0
    for fault in error.errors(include_url=False):
        dotted = ".".join(str(part) for part in fault["loc"]) or whole
        words = None if known is None else known(dotted, fault["input"])
        # Numbers of one list that are wrong in one way are told as one.
        owner = f"{dotted.rpartition('.')[0]} {fault['type']}" if isinstance(["", *fault["loc"]][-1], int) else dotted
        if owner in told:
            alike[owner].append(dotted.rpartition(".")[2])
        elif words is None and len(told) >= MOST_FAULTS:
            more += 1
        else:
            told[owner], alike[owner] = f"{dotted}: {words or _words(fault, model)}", []
    lines = [line + (f" (so are {', '.join(alike[owner])})" if alike[owner] else "") for owner, line in told.items()]
    return "; ".join(lines) + (f"; and {more} more" if more else "")


def _words(fault: Mapping[str, Any], model: type[BaseModel]) -> str:
    """What is wrong with a field and what is allowed."""
    *parents, name = [str(part) for part in fault["loc"]] or [""]
    if fault["type"] == "extra_forbidden":
        allowed = list(_owner(model, parents).model_fields)
        return f"no such field, {guess(name, allowed).rstrip() or 'allowed are ' + ', '.join(allowed)}"
    if fault["type"] == "missing":
        return "missing, it is required"
    found = fault["input"]
    plain = isinstance(found, (str, int, float, bool, type(None)))
    shown = f"found {quoted(found)}, " if plain else ""
    if fault["type"] in {"model_type", "model_attributes_type"}:
        fields = list(_owner(model, [*parents, name]).model_fields)
        one = ".".join([*parents, name, fields[0]])
        return f"{shown}should be a group with the fields {', '.join(fields)}; one of them alone is set as {one}"
    message = str(fault["msg"]).removeprefix("Value error, ").replace("Input should", "should").replace("\n", " ")
    message = message.removesuffix(", unable to parse string as a number")
    field = _owner(model, parents).model_fields.get(name)
    usual = list(field.default) if field is not None and isinstance(field.default, tuple) else []
    for kind in ("a valid tuple", "a valid list"):
        message = message.replace(kind, "a list in square brackets" + (f", such as {usual}" if usual else ""))
    return f"{shown}{message[:1].lower()}{message[1:]}"


def _owner(model: type[BaseModel], parents: list[str]) -> type[BaseModel]:
    """The group of settings that a dotted name's parents lead to."""
    owner = model
    for part in parents:
        if part in owner.model_fields:  # or the place in a list, whose items the list's type names
            owner = next(iter(_groups(owner.model_fields[part].annotation)), owner)
    return owner


def _groups(annotation: Any) -> list[type[BaseModel]]:
    """Groups of settings that an annotation names, however deep."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [group for inner in get_args(annotation) for group in _groups(inner)]


class Faults:
    """All that is wrong with one input, gathered so that it is told in one line."""

    def __init__(self) -> None:
        self.found: list[InputError] = []

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Keep an InputError that is raised within, and go on after it."""
        try:
            yield
        except InputError as fault:
            self.found.append(fault)

    def tell(self) -> None:
        """Raise what was gathered, if anything was.

        Raises the InputError that was gathered, or one whose message joins those of all.
        """
        if len(self.found) == 1:
            raise self.found[0]
        if self.found:
            rest = len(self.found) - MOST_FAULTS
            more = f"; and {rest} more" if rest > 0 else ""
            raise InputError("; ".join(str(fault) for fault in self.found[:MOST_FAULTS]) + more) from self.found[0]
