"""Croissant 1.0 metadata of a data set: its files, and what every column of every table means, as JSON-LD.

`croissant.json` beside this module is the template: context, files, sets of files and tables. Filled in are what the
statement says, sizes and check sums, and the columns that the tables have; what a data set does not hold is left out.
Terms are those of https://docs.mlcommons.org/croissant/docs/croissant-spec.html. Parquet has the media type that
readers of Croissant 1.0 accept.
"""

from __future__ import annotations

import json
import mimetypes
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.files import sha256_of
from wakewise.core.interfaces import no_progress
from wakewise.experiments.trials.dataset.checksums import SUMS, ChecksumMismatch, differences, read_sums
from wakewise.experiments.trials.dataset.part import TrialPart, meaning
from wakewise.experiments.trials.dataset.statement import DatasetStatement
from wakewise.experiments.trials.metrics import DEFINITIONS, UNITS

METADATA, SHEET, TRIALS, FIGURES = "croissant.json", "DATASHEET.md", "trials.parquet", "truth/figures.parquet"
OWN_SUM = f"{METADATA}.sha256"
_KINDS = {"Float64": "sc:Float", "Float32": "sc:Float", "Boolean": "sc:Boolean", "String": "sc:Text"}
_PYTHON = {bool: "Boolean", int: "Int64", float: "Float64"}
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

    Raises InputError if a column has two types.
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
    told: dict[str, Any] = json.loads((files(__package__) / METADATA).read_text(encoding="utf-8"))
    told |= {
        "name": words.name,
        "description": description,
        "license": words.licence,
        "url": words.url,
        "citeAs": words.citation,
        "creator": [{"@type": "sc:Organization", "name": name} for name in words.creators],
        "datePublished": words.published,
        "version": words.version,
    }
    paths = [path for part in parts for path in part.sums]
    told["distribution"] = [one for one in told["distribution"] if _completed(one, folder, paths)]
    tables = {"trials": _facts_of(parts)} | columns_of(parts)
    if figures:
        tables["figures"] = {"trial": "String"} | dict.fromkeys(figures, "Float64")
    told["recordSet"] = [_records(one, tables) for one in told["recordSet"] if one["field"]["table"] in tables]
    return told


def _completed(one: dict[str, Any], folder: Path, paths: Sequence[str]) -> bool:
    """Fill in size and check sum of a file, or the type of a set's files; False of what the data set does not hold."""
    if "includes" in one:
        matching = [path for path in paths if Path(path).match(one["includes"])]
        if matching and one["includes"].endswith("*"):
            one["encodingFormat"] = mimetypes.guess_type(matching[0])[0] or "application/octet-stream"
        return bool(matching)
    file = folder / one["contentUrl"]
    if not file.is_file():
        return False
    one |= {"contentSize": f"{file.stat().st_size} B", "sha256": sha256_of(file)}
    return True


def _records(one: dict[str, Any], tables: Mapping[str, Mapping[str, str]]) -> dict[str, Any]:
    """A table of the template with its columns."""
    name, field = one["@id"], one["field"]
    return one | {
        "key": [{"@id": f"{name}/{key}"} for key in one["key"]],
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"{name}/{column}",
                "name": column,
                "description": _described(field["table"], column),
                "dataType": _KINDS.get(kind, "sc:Integer" if kind.startswith(("Int", "UInt")) else "sc:Text"),
                "source": {**field["source"], "extract": {"column": column}},
            }
            for column, kind in tables[field["table"]].items()
        ],
    }


def _described(table: str, column: str) -> str:
    if table == "trials" or (table == "figures" and column == "trial"):
        return _FACTS[column]
    if table != "figures":
        return meaning(column, table.endswith("images"))
    unit = UNITS.get(column, "")
    return f"{DEFINITIONS.get(column, column.replace('_', ' '))}{f'; {unit}' if unit else ''}"


def _facts_of(parts: Sequence[TrialPart]) -> dict[str, str]:
    """Names and types of the columns of the table of trials."""
    found = {"trial": "String"}
    for name, value in ((name, value) for part in parts for name, value in part.facts.items() if name in _FACTS):
        if value is not None or name not in found:
            found[name] = _PYTHON.get(type(value), "String")
    return found


@dataclass(frozen=True, kw_only=True)
class ChecksumReport:
    """How many files were read, and those that are not as they were."""

    files: int
    bytes: int
    differences: tuple[ChecksumMismatch, ...]


def check_dataset(folder: Path, progress: Callable[..., None] = no_progress) -> ChecksumReport:
    """Hold every file against its check sum, the list of these against croissant.json, and that against its own.

    Raises InputError if the folder is no data set, or its metadata cannot be read.
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
    own = folder / OWN_SUM
    sums = (read_sums(own) if own.is_file() else {}) | read_sums(folder / SUMS)
    found = differences(folder, sums, frozenset({OWN_SUM, SUMS, *({METADATA} - set(sums))}), progress)
    if METADATA not in sums:
        found.insert(0, ChecksumMismatch(OWN_SUM, "missing or empty"))
    told_wrong = [ChecksumMismatch(name, "other check sum in croissant.json") for name, digest in sorted(wanted.items())
                  if name != SUMS and sums.get(name) != digest]  # fmt: skip
    size = sum((folder / name).stat().st_size for name in sums if (folder / name).is_file())
    return ChecksumReport(files=len(sums), bytes=size, differences=(*found, *told_wrong))
