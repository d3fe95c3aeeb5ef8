"""All trials of a folder at a glance: a cache of what their own folders say, rebuilt wherever it does not fit them.

One Parquet file holds a row per trial with the stamp of the files that it was read from. Stamps are compared for being
equal, never for being older, so that no clock has to be right; a missing, old or damaged cache only costs time.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from wakewise.core.files import whole_file
from wakewise.experiments.campaigns import attempt_log
from wakewise.experiments.campaigns.attempt_log import ATTEMPTS, Attempts, read_attempts
from wakewise.experiments.campaigns.store import FIGURES, CampaignStore, read_figures
from wakewise.experiments.campaigns.task import Figure

INDEX = "index.parquet"
_SCHEMA = {
    "key": pl.String,
    "figures_ns": pl.Int64,
    "figures_bytes": pl.Int64,
    "attempts_bytes": pl.Int64,
    "figures": pl.String,
    "took_s": pl.Float64,
    "begun": pl.Int64,
    "failed": pl.Int64,
    "how": pl.String,
    "reason": pl.String,
}
_Stamp = tuple[int, int, int]


@dataclass(frozen=True)
class IndexEntry:
    """A trial of a folder: its figures, if it is finished, and its attempts."""

    key: str
    figures: dict[str, Figure] | None
    took_s: float
    attempts: Attempts


def listing(store: CampaignStore) -> dict[str, IndexEntry]:
    """All trials that were ever begun, by key; what the cache lacks is read from the trials' folders and added."""
    stamps = _stamps(store.trials)
    known = _read(store.folder / INDEX)
    found: dict[str, IndexEntry] = {}
    fresh = len(known) != len(stamps)
    for key, stamp in stamps.items():
        kept = known.get(key)
        if kept is not None and kept[0] == stamp:
            found[key] = kept[1]
        else:
            place = store.place(key)
            figures, took_s = read_figures(place) or (None, 0.0)
            found[key], fresh = IndexEntry(key, figures, took_s, read_attempts(place)), True
    if fresh:
        # A full disk, for which polars raises either, or a folder of other users: the cache only saves time.
        with suppress(OSError, pl.exceptions.ComputeError):
            _write(store.folder / INDEX, [(stamps[key], listed) for key, listed in found.items()])
    return found


def _stamps(trials: Path) -> dict[str, _Stamp]:
    """Of each trial's folder, what changes with its files: when and how long figures are, how long attempts are."""
    found: dict[str, _Stamp] = {}
    with os.scandir(trials) as entries:
        for entry in entries:
            if entry.name.startswith("."):
                continue
            ns, size = _stat(f"{entry.path}/{FIGURES}")
            _, length = _stat(f"{entry.path}/{ATTEMPTS}")
            found[entry.name] = (ns, size, length)
    return found


def _stat(path: str) -> tuple[int, int]:
    """When a file was changed, in ns, and its length; -1 for both where there is none."""
    try:
        told = os.stat(path)  # noqa: PTH116  (of ten thousand files: a Path for each takes longer than the call)
    except OSError:
        return -1, -1
    return told.st_mtime_ns, told.st_size


def _read(path: Path) -> dict[str, tuple[_Stamp, IndexEntry]]:
    """What the cache holds; nothing if it cannot be read."""
    try:
        table = pl.read_parquet(path)
        if table.schema != pl.Schema(_SCHEMA):
            return {}
        rows = table.rows(named=True)
        return {
            row["key"]: ((row["figures_ns"], row["figures_bytes"], row["attempts_bytes"]), _listed_of(row))
            for row in rows
        }
    except (OSError, pl.exceptions.PolarsError, ValueError):
        return {}


def _listed_of(row: dict[str, Any]) -> IndexEntry:
    attempts = Attempts(row["begun"], row["failed"], attempt_log.parse_outcome(row["how"]), row["reason"])
    figures = None if row["figures"] is None else json.loads(row["figures"])
    return IndexEntry(row["key"], figures, row["took_s"], attempts)


def _write(path: Path, rows: Iterable[tuple[_Stamp, IndexEntry]]) -> None:
    table = pl.DataFrame(
        [
            (
                listed.key,
                *stamp,
                None if listed.figures is None else json.dumps(listed.figures),
                listed.took_s,
                listed.attempts.begun,
                listed.attempts.failed,
                listed.attempts.how,
                listed.attempts.reason,
            )
            for stamp, listed in rows
        ],
        schema=_SCHEMA,
        orient="row",
    )
    with whole_file(path) as temporary:
        table.write_parquet(temporary)
