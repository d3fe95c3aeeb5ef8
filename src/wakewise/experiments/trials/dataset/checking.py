"""Whether a data set is still what it was when it was made."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from wakewise.core.errors import InputError
from wakewise.core.interfaces import no_progress
from wakewise.experiments.exports.checksums import SUMS, ChecksumMismatch, differences, read_sums, sha256_of
from wakewise.experiments.trials.dataset.metadata import METADATA


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
