"""Croissant metadata of a data set of trials: its files, and what every column of every table means.

Whether a data set is still what it was when it was made.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.interfaces import no_progress
from wakewise.experiments.exports.croissant import (
    SUMS,
    ChecksumMismatch,
    Column,
    DatasetDescription,
    FileObject,
    FileSet,
    Kind,
    RecordSet,
    croissant,
    differences,
    read_sums,
    sha256_of,
)
from wakewise.experiments.trials.dataset.part import KNOWN, TRUTH, TrialPart, meaning
from wakewise.experiments.trials.dataset.statement import DatasetStatement

METADATA, SHEET, TRIALS, FIGURES = "croissant.json", "DATASHEET.md", "trials.parquet", "truth/figures.parquet"
PARQUET = "application/x-parquet"
"""As readers of Croissant 1.0 know it; the type that is registered since is application/vnd.apache.parquet."""
_SETS = {
    f"{KNOWN}/states": ("states as a controller had them, a row per control step", "known-states"),
    f"{TRUTH}/states": ("true states and the water at the target, a row per control step", "true-states"),
    f"{KNOWN}/images": ("photographs with estimated camera poses, a row each", "known-images"),
    f"{TRUTH}/images": ("true camera poses of the photographs, a row each", "true-images"),
}
_LOOSE = {
    f"{KNOWN}/*/images/*": ("photographs", "image-files"),
    f"{KNOWN}/*/cameras.txt": ("the camera as the crew knew it, COLMAP's text format", "known-cameras"),
    f"{KNOWN}/*/model.ply": ("models made from the photographs, north-east-down in m", "models"),
    f"{TRUTH}/*/target.ply": ("ground truth: the target's surface, north-east-down in m", "true-targets"),
    f"{TRUTH}/*/camera.json": ("the camera as it is, OpenCV's model, centres of pixels at +0.5", "true-cameras"),
    f"{TRUTH}/*/scenario.yaml": ("everything a trial was set to, the seed included", "scenarios"),
    f"{TRUTH}/*/metrics.json": ("figures of a trial with unit and definition", "figures-of-trials"),
}
_MIME = {".png": "image/png", ".jpg": "image/jpeg", ".ply": "model/ply", ".json": "application/json",
         ".txt": "text/plain", ".yaml": "application/yaml"}  # fmt: skip
_KINDS: dict[str, Kind] = {"Float64": "sc:Float", "Float32": "sc:Float", "Boolean": "sc:Boolean", "String": "sc:Text"}
_FACTS = {
    "trial": "name of the trial, and of its folders", "scenario": "name of its scenario", "vehicle": "vehicle's name",
    "method": "how thrusts were chosen", "pilot": "who flew", "world": "where it was flown",
    "target": "what was flown round",
    "seed": "every random draw of the trial follows from it", "simulated": "whether the truth is known, of a simulator",
    "steps": "control steps", "duration_s": "length of the flight, s", "photographs": "photographs taken",
    "thrusters": "thrusters of the vehicle", "wakewise": "version of the program that flew it",
}  # fmt: skip


def columns_of(parts: Sequence[TrialPart]) -> dict[str, dict[str, str]]:
    """Names and types of every table's columns over all trials.

    Raises
    ------
    InputError
        If a column has two types.
    """
    found: dict[str, dict[str, str]] = {}
    for part in parts:
        for table, columns in part.columns.items():
            known = found.setdefault(table, {})
            for name, kind in columns.items():
                if known.setdefault(name, kind) != kind:
                    raise InputError(f"{part.trial}: column {name} of {table} is {kind}, of others {known[name]}")
    return found


def metadata(
    folder: Path, words: DatasetStatement, description: str, parts: Sequence[TrialPart], figures: Sequence[str]
) -> dict[str, Any]:
    """Croissant of a data set whose other files are all in `folder`."""
    trials = _object(folder, TRIALS, PARQUET, "all trials, a row each")
    files: list[FileObject | FileSet] = [
        _object(folder, SUMS, "text/plain", "check sums of all files but this and croissant.json"),
        _object(folder, SHEET, "text/markdown", "data sheet: what it is, how it was made, what for"),
        trials,
    ]
    facts = {name: kind for name, kind in _types_of_facts(parts).items() if name in _FACTS}
    fields = tuple(Column(name=name, kind=kind, description=_FACTS[name]) for name, kind in facts.items())
    tables = [RecordSet(name="trials", source=trials, columns=fields, key=("trial",), description="one row per trial")]
    if figures:
        true = _object(folder, FIGURES, PARQUET, "figures by which trials were judged, which need the truth")
        files.append(true)
        names = ("trial", *figures)
        columns = tuple(
            Column(name=name, kind="sc:Text" if name == "trial" else "sc:Float", description=_figure(name))
            for name in names
        )
        tables.append(
            RecordSet(name="figures", source=true, columns=columns, key=("trial",), description="one row per trial")
        )
    for path, columns_told in columns_of(parts).items():
        about, name = _SETS[path]
        side, what = path.split("/")
        source = FileSet(name=f"{name}-files", includes=f"{side}/*/{what}.parquet", mime=PARQUET, description=about)
        files.append(source)
        tables.append(
            RecordSet(
                name=name,
                source=source,
                columns=_columns(columns_told, what == "images"),
                key=("trial", "name" if what == "images" else "time_s"),
                description=about,
            )
        )
    paths = [path for part in parts for path in part.sums]
    for pattern, (about, name) in _LOOSE.items():
        matching = [path for path in paths if Path(path).match(pattern)]
        if matching:
            mime = _MIME.get(Path(matching[0]).suffix.lower(), "application/octet-stream")
            files.append(FileSet(name=name, includes=pattern, mime=mime, description=about))
    about_it = DatasetDescription(
        name=words.name,
        description=description,
        licence=words.licence,
        creators=words.creators,
        url=words.url,
        published=words.published,
        version=words.version,
        keywords=("underwater robotics", "ROV", "photogrammetry", "thruster allocation", "wake"),
    )
    return croissant(about_it, files, tables)


def _object(folder: Path, path: str, mime: str, description: str) -> FileObject:
    file = folder / path
    return FileObject(path=path, size=file.stat().st_size, sha256=sha256_of(file), mime=mime, description=description)


def _columns(told: Mapping[str, str], of_camera: bool) -> tuple[Column, ...]:
    return tuple(
        Column(name=name, kind=_kind(kind), description=meaning(name, of_camera)) for name, kind in told.items()
    )


def _kind(dtype: str) -> Kind:
    return _KINDS.get(dtype, "sc:Integer" if dtype.startswith(("Int", "UInt")) else "sc:Text")


def _types_of_facts(parts: Sequence[TrialPart]) -> dict[str, Kind]:
    kinds: dict[type, Kind] = {bool: "sc:Boolean", int: "sc:Integer", float: "sc:Float"}
    found: dict[str, Kind] = {"trial": "sc:Text"}
    for part in parts:
        for name, value in part.facts.items():
            found.setdefault(name, "sc:Text")
            if value is not None:
                found[name] = kinds.get(type(value), "sc:Text")
    return found


def _figure(name: str) -> str:
    from wakewise.experiments.trials.metrics import DEFINITIONS, UNITS

    if name == "trial":
        return _FACTS["trial"]
    unit = UNITS.get(name, "")
    return f"{DEFINITIONS.get(name, name.replace('_', ' '))}{f'; {unit}' if unit else ''}"


@dataclass(frozen=True, kw_only=True)
class ChecksumReport:
    """How many files were read, and those that are not as they were."""

    files: int
    bytes: int
    differences: tuple[ChecksumMismatch, ...]


def check_dataset(folder: Path, progress: Callable[..., None] = no_progress) -> ChecksumReport:
    """Hold every file against its check sum, and the list of these against croissant.json.

    Raises
    ------
    InputError
        If the folder is no data set, or its metadata cannot be read.
    """
    path = folder / METADATA
    if not path.is_file() or not (folder / SUMS).is_file():
        raise InputError(f"{folder}: is no data set; it must hold {METADATA} and {SUMS}")
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        wanted = {one["@id"]: one["sha256"] for one in told["distribution"] if "sha256" in one}
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{path}: is no Croissant metadata; it was changed") from None
    if SUMS not in wanted:
        raise InputError(f"{path}: does not name {SUMS}; it was changed")
    if sha256_of(folder / SUMS) != wanted[SUMS]:
        return ChecksumReport(files=0, bytes=0, differences=(ChecksumMismatch(SUMS, "changed"),))
    sums = read_sums(folder / SUMS)
    found = differences(folder, sums, frozenset({METADATA, SUMS}), progress)
    told_wrong = [ChecksumMismatch(name, "other check sum in croissant.json") for name, digest in sorted(wanted.items())
                  if name != SUMS and sums.get(name) != digest]  # fmt: skip
    size = sum((folder / name).stat().st_size for name in sums if (folder / name).is_file())
    return ChecksumReport(files=len(sums), bytes=size, differences=(*found, *told_wrong))
