"""Croissant 1.0: what a data set holds, in JSON-LD that search engines and loaders of data sets read.

Terms, required properties and the context are those of the specification
(https://docs.mlcommons.org/croissant/docs/croissant-spec.html, http://mlcommons.org/croissant/1.0).

Check sums of a folder's files, as `sha256sum -c` reads them, and whether the folder is still as they say.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from wakewise.core.errors import InputError

CONFORMS_TO = "http://mlcommons.org/croissant/1.0"
Kind = Literal["sc:Float", "sc:Integer", "sc:Boolean", "sc:Text"]

CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "equivalentProperty": "cr:equivalentProperty",
    "samplingRate": "cr:samplingRate",
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}
"""The context that the specification recommends (its appendix 1)."""


@dataclass(frozen=True, kw_only=True)
class DatasetDescription:
    """What a data set is called, by whom, under which licence (an address), and when it was published (ISO date)."""

    name: str
    description: str
    licence: str
    creators: tuple[str, ...]
    url: str
    published: str
    version: str = "1.0.0"
    keywords: tuple[str, ...] = ()

    @property
    def citation(self) -> str:
        """How it is cited, in BibTeX."""
        key = "".join(letter for letter in self.name if letter.isalnum()) or "dataset"
        year = self.published[:4]
        where = "" if self.url == "./" else f", url = {{{self.url}}}"
        # An institution's name in braces is not taken apart.
        authors = " and ".join(f"{{{name}}}" for name in self.creators)
        return (
            f"@misc{{{key}{year}, title = {{{self.name}}}, author = {{{authors}}}, year = {{{year}}}, "
            f"version = {{{self.version}}}{where}}}"
        )


@dataclass(frozen=True, kw_only=True)
class FileObject:
    """One file."""

    path: str
    size: int
    sha256: str
    mime: str
    description: str


@dataclass(frozen=True, kw_only=True)
class FileSet:
    """Files of one kind, by a glob pattern from the data set's folder."""

    name: str
    includes: str
    mime: str
    description: str


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of a table."""

    name: str
    kind: Kind
    description: str


@dataclass(frozen=True, kw_only=True)
class RecordSet:
    """Records: the rows of a file or of every file of a set; `key` names the columns that no two rows share."""

    name: str
    source: FileObject | FileSet
    columns: tuple[Column, ...]
    key: tuple[str, ...]
    description: str


def croissant(
    about: DatasetDescription, files: Sequence[FileObject | FileSet], tables: Sequence[RecordSet]
) -> dict[str, Any]:
    """The metadata, ready for JSON."""
    return {
        "@context": CONTEXT,
        "@type": "sc:Dataset",
        "name": about.name,
        "conformsTo": CONFORMS_TO,
        "description": about.description,
        "license": about.licence,
        "url": about.url,
        "citeAs": about.citation,
        "creator": [{"@type": "sc:Organization", "name": name} for name in about.creators],
        "datePublished": about.published,
        "version": about.version,
        "keywords": list(about.keywords),
        "isLiveDataset": False,
        "distribution": [_file(one) for one in files],
        "recordSet": [_table(table) for table in tables],
    }


def _file(one: FileObject | FileSet) -> dict[str, Any]:
    if isinstance(one, FileSet):
        return {
            "@type": "cr:FileSet",
            "@id": one.name,
            "name": one.name,
            "description": one.description,
            "encodingFormat": one.mime,
            "includes": one.includes,
        }
    return {
        "@type": "cr:FileObject",
        "@id": one.path,
        "name": one.path.rpartition("/")[2],
        "description": one.description,
        "contentUrl": one.path,
        "contentSize": f"{one.size} B",
        "encodingFormat": one.mime,
        "sha256": one.sha256,
    }


def _table(table: RecordSet) -> dict[str, Any]:
    source = table.source
    where = {"fileSet": {"@id": source.name}} if isinstance(source, FileSet) else {"fileObject": {"@id": source.path}}
    return {
        "@type": "cr:RecordSet",
        "@id": table.name,
        "name": table.name,
        "description": table.description,
        "key": [{"@id": f"{table.name}/{name}"} for name in table.key],
        "field": [
            {
                "@type": "cr:Field",
                "@id": f"{table.name}/{column.name}",
                "name": column.name,
                "description": column.description,
                "dataType": column.kind,
                "source": {**where, "extract": {"column": column.name}},
            }
            for column in table.columns
        ],
    }


SUMS = "SHA256SUMS"
_LINE = re.compile(r"([0-9a-f]{64})  ([^\0\n]+)\Z")
_CHUNK = 1 << 20


@dataclass(frozen=True)
class ChecksumMismatch:
    """A file that is not as it was, and in what."""

    path: str
    what: str


def sha256_of(path: Path) -> str:
    """Check sum of a file, as 64 hexadecimal digits."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def copied(source: Path, target: Path) -> str:
    """Copy a file and return its check sum, of the very bytes that were read."""
    digest = hashlib.sha256()
    with source.open("rb") as reading, target.open("wb") as writing:
        while chunk := reading.read(_CHUNK):
            digest.update(chunk)
            writing.write(chunk)
    return digest.hexdigest()


def sums_text(sums: Mapping[str, str]) -> str:
    """Text of SHA256SUMS for check sums by path, in the order of paths."""
    return "".join(f"{sums[path]}  {path}\n" for path in sorted(sums))


def read_sums(path: Path) -> dict[str, str]:
    """Check sums by path.

    Raises
    ------
    InputError
        If a line is none, a path leads out of the folder, or stands there twice.
    """
    found: dict[str, str] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        match = _LINE.match(line)
        if match is None:
            raise InputError(f"{path}: line {number} is no check sum; the file was changed")
        name = match[2]
        if name.startswith("/") or ".." in Path(name).parts or name in found:
            raise InputError(f"{path}: line {number} names {name}, which lies outside or stands there twice")
        found[name] = match[1]
    return found


def differences(
    folder: Path, sums: Mapping[str, str], known: frozenset[str], progress: Callable[[int, int, str], None]
) -> list[ChecksumMismatch]:
    """Files that are missing, changed, or there without a check sum; `known` ones need none."""
    found = []
    for number, (name, wanted) in enumerate(sorted(sums.items())):
        progress(number, len(sums), name)
        path = folder / name
        if not path.is_file():
            found.append(ChecksumMismatch(name, "missing"))
        elif sha256_of(path) != wanted:
            found.append(ChecksumMismatch(name, "changed"))
    here = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir()}
    return found + [ChecksumMismatch(name, "not in the list") for name in sorted(here - set(sums) - known)]
