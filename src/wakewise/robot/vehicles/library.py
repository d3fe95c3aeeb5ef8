"""Vehicles by name or file: one YAML file per cited parameter set, checked on reading."""

from __future__ import annotations

import functools
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from wakewise.core.errors import InputError
from wakewise.core.safe_yaml import YamlError, read_yaml, text_of
from wakewise.core.settings import describe_faults, guess
from wakewise.robot.vehicles.draft import VehicleDraft
from wakewise.robot.vehicles.needs import NEEDED_FIELDS, PLACEHOLDER
from wakewise.robot.vehicles.vehicle import Vehicle
from wakewise.robot.vehicles.vehicle_file import VehicleFile


@functools.cache
def draft_names() -> tuple[str, ...]:
    """Names of all vehicles that come with the package, whole or not, sorted."""
    folder = resources.files("wakewise.robot.vehicles") / "library_data"
    return tuple(sorted(e.name.removesuffix(".yaml") for e in folder.iterdir() if e.name.endswith(".yaml")))


@functools.cache
def _flyable_names() -> tuple[str, ...]:
    return tuple(name for name in draft_names() if not load_draft(name).missing)


def vehicle_names(*, flyable_only: bool = True) -> list[str]:
    """Names of the vehicles that come with the package, sorted; by default only those whose file holds all of one."""
    return list(_flyable_names() if flyable_only else draft_names())


def load_vehicle(name_or_path: str) -> Vehicle:
    """Read a vehicle of the library by name, or any vehicle file by path (anything with a slash or .yaml/.yml).

    Raises
    ------
    InputError
        If there is no such vehicle or file, the file does not hold a usable vehicle (the message names the field), or
        it lacks something that flying needs (the message lists it).
    """
    draft = load_draft(name_or_path)
    draft.require_whole(name_or_path)
    return draft.vehicle()


def load_draft(name_or_path: str) -> VehicleDraft:
    """Read what a vehicle file says, whole or not; names and paths as for `load_vehicle`.

    Raises
    ------
    InputError
        If there is no such vehicle or file, or a value in it cannot be used; the message names the field.
    """
    if name_or_path in draft_names():
        text = (resources.files("wakewise.robot.vehicles") / "library_data" / f"{name_or_path}.yaml").read_text("utf-8")
        return parse_vehicle(text, f"{name_or_path}.yaml", name_or_path)
    path = Path(name_or_path)
    if not path.is_file():
        if is_path(name_or_path):
            raise InputError(f"vehicle file {name_or_path}: no such file")
        hint, names = guess(name_or_path, draft_names()), ", ".join(draft_names())
        raise InputError(f"vehicle {name_or_path!r}: not in the library, {hint}allowed {names} or the path of a file")
    try:
        text = text_of(path)
    except (OSError, UnicodeDecodeError, YamlError) as error:
        raise InputError(f"vehicle file {name_or_path}: not readable as UTF-8 text ({error})") from error
    return parse_vehicle(text, name_or_path, path.stem)


def is_path(name: str) -> bool:
    """Whether a name is meant as that of a file: it holds a slash, or ends as files do."""
    return Path(name).name != name or Path(name).suffix != ""


def parse_vehicle(text: str, where: str, name: str) -> VehicleDraft:
    """Read the text of a vehicle file; `where` is what messages call it.

    Raises
    ------
    InputError
        If the text is not a vehicle file or a value in it cannot be used.
    """
    if text.lstrip().startswith("<"):
        raise InputError(f"vehicle file {where}: is XML, not a vehicle file; see wakewise vehicle import")
    try:
        value = read_yaml(text)
    except YamlError as error:
        raise InputError(f"vehicle file {where}: not valid YAML ({error})") from error
    if not isinstance(value, dict):
        raise InputError(f"vehicle file {where}: holds {type(value).__name__}, must be a mapping of groups")
    value = _on_its_base(value, where)
    try:
        return VehicleFile.model_validate(value).draft(name)
    except ValidationError as error:
        told = describe_faults(
            error, VehicleFile, "file", lambda _, found: "not filled in" if found == PLACEHOLDER else None
        )
        raise InputError(f"vehicle file {where}: {told}{_lacks(value, told)}") from error
    except InputError as error:
        raise InputError(f"vehicle file {where}: {error}{_lacks(value, str(error))}") from error


def _lacks(tree: dict[str, Any], told: str) -> str:
    """What a flight needs beside what was told, of a file that cannot be read as it is."""
    layout = tree.get("thruster_layout")
    mounts = layout.get("mounts") if isinstance(layout, dict) else None
    own = {key for mount in mounts if isinstance(mount, dict) for key in mount} if isinstance(mounts, list) else set()
    lacking = []
    for dotted in NEEDED_FIELDS:
        group, _, field = dotted.partition(".")
        fields = tree.get(group)
        at_mounts = {"diameter_m": "disk_diameter_m"}.get(field, field) in own
        if (
            dotted not in told
            and not at_mounts
            and (fields is None or (isinstance(fields, dict) and fields.get(field) is None))
        ):
            lacking.append(dotted)
    return f"; for a flight it lacks {', '.join(lacking)} too" if lacking else ""


def _on_its_base(value: dict[str, Any], where: str) -> dict[str, Any]:
    """A file's groups, and those of the library's vehicle that it names as its `base` where it has none itself."""
    if "base" not in value:
        return value
    own = {group: fields for group, fields in value.items() if group != "base"}
    base = value["base"]
    if base not in draft_names():
        raise InputError(f"vehicle file {where}: base: {base!r}, allowed {', '.join(draft_names())}")
    under = read_yaml((resources.files("wakewise.robot.vehicles") / "library_data" / f"{base}.yaml").read_text("utf-8"))
    if "base" in under:
        raise InputError(f"vehicle file {where}: base: {base!r} has a base itself, name {under['base']!r}")
    return {**under, **own}
