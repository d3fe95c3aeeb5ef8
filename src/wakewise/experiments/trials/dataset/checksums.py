"""Check sums of a folder's files, as `sha256sum -c` reads them, and whether the folder is still as they say."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.core.files import sha256_of

SUMS = "SHA256SUMS"
_LINE = re.compile(r"([0-9a-f]{64})  ([^\0\n]+)\Z")


@dataclass(frozen=True)
class ChecksumMismatch:
    """A file that is not as it was, and in what."""

    path: str
    what: str


def copied(source: Path, target: Path) -> str:
    """Copy a file and return the check sum of the copy."""
    shutil.copyfile(source, target)
    return sha256_of(target)


def sums_text(sums: Mapping[str, str]) -> str:
    """Text of SHA256SUMS for check sums by path, in the order of paths."""
    return "".join(f"{sums[path]}  {path}\n" for path in sorted(sums))


def read_sums(path: Path) -> dict[str, str]:
    """Check sums by path.

    Raises InputError if a line is none, a path leads out of the folder, or stands there twice.
    """
    found: dict[str, str] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
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
