"""A folder of trials becomes a data set: trial by trial, so that it goes on where it was cut off, and whole or not.

It grows in a hidden folder beside its place and moves there at the end, so that a data set that is there is whole.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file, write_json, write_text
from wakewise.core.interfaces import no_progress
from wakewise.core.run_lock import LOCK, exclusive_run
from wakewise.experiments.exports.checksums import SUMS, sha256_of, sums_text
from wakewise.experiments.trials.dataset.metadata import FIGURES, METADATA, SHEET, TRIALS, columns_of, metadata
from wakewise.experiments.trials.dataset.part import KNOWN, NOTE, TRUTH, TrialPart, part_of
from wakewise.experiments.trials.dataset.sheet import data_sheet, description_of
from wakewise.experiments.trials.dataset.statement import DatasetStatement
from wakewise.experiments.trials.dataset.trial_sources import TrialSource, trials_of

_PARTS = ".parts"


@dataclass(frozen=True, kw_only=True)
class DatasetBuildResult:
    """What was written; `made` trials are new, the others were there from an attempt before."""

    path: Path
    trials: int
    made: int
    left_out: dict[str, str]
    photographs: int
    files: int
    bytes: int


def build_dataset(
    folder: Path, out: Path, words: DatasetStatement, progress: Callable[..., None] = no_progress
) -> DatasetBuildResult:
    """Make a data set.

    Parameters
    ----------
    folder : Path
        Of a campaign, of trials, or of one trial.
    out : Path
        Folder that does not exist yet, or is empty.
    words : DatasetStatement
        What only a person can say.
    progress : callable
        Called as `(done, total, note)`.

    Raises
    ------
    InputError
        If there is no trial that can be taken, `out` holds something, or another process makes the same data set.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"--out {out}: is there already and not empty; give a folder that does not exist yet")
    trials, unfinished = trials_of(folder)
    if out.resolve().is_relative_to(folder.resolve()) and out.resolve().parent.name != "export":
        raise InputError(f"--out {out}: lies among the trials that it is made from; give a folder elsewhere")
    growing = out.parent / f".{out.name}.building"
    with exclusive_run(growing):
        parts, left_out, made = _gather(trials, growing / _PARTS, progress)
        left_out |= dict.fromkeys(unfinished, "was not flown to its end")
        if not parts:
            name, why = next(iter(left_out.items()))
            raise InputError(f"{folder}: none of {len(left_out)} trials can be taken; {name}: {why}")
        columns_of(parts)  # refuses before anything is moved
        _forget_others(growing, {part.trial for part in parts})
        sizes = _finish(growing, parts, left_out, words)
    if out.exists():
        out.rmdir()
    growing.replace(out)
    return DatasetBuildResult(
        path=out,
        trials=len(parts),
        made=made,
        left_out=left_out,
        photographs=sum(part.facts["photographs"] for part in parts),
        files=len(sizes),
        bytes=sum(sizes.values()),
    )


def _gather(
    trials: dict[str, TrialSource], place: Path, progress: Callable[..., None]
) -> tuple[list[TrialPart], dict[str, str], int]:
    """Every trial's part; those that cannot be taken, and why; and how many were made now."""
    parts, left_out, made = [], {}, 0
    for number, (name, source) in enumerate(trials.items()):
        progress(number, len(trials), name)
        try:
            part, fresh = part_of(name, source, place / name)
        except InputError as fault:
            left_out[name] = str(fault).replace(f"{source.folder}/", "").replace(f"{source.settings.parent}/", "")
            continue
        parts.append(part)
        made += fresh
    progress(len(trials), len(trials))
    return parts, left_out, made


def _forget_others(growing: Path, names: set[str]) -> None:
    """Remove parts of trials that an attempt before took and this one does not."""
    for path in (growing / _PARTS).iterdir():
        if path.name not in names:
            shutil.rmtree(path)


def _finish(
    growing: Path, parts: Sequence[TrialPart], left_out: dict[str, str], words: DatasetStatement
) -> dict[str, int]:
    """Lay everything out anew from the parts, and write what tells of all of them; returns sizes by path."""
    for path in growing.iterdir():
        if path.name in (_PARTS, LOCK):
            continue
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    figures = sorted({name for part in parts for name in part.figures})
    rows = [{"trial": part.trial, **part.facts} for part in parts]
    (growing / TRUTH).mkdir()
    with whole_file(growing / TRIALS) as path:
        pl.DataFrame(rows, infer_schema_length=None).write_parquet(path)
    sums = {path: digest for part in parts for path, digest in part.sums.items()}
    sizes = {path: size for part in parts for path, size in part.sizes.items()}
    written = [TRIALS]
    if figures:
        table = [{"trial": part.trial, **{name: part.figures.get(name) for name in figures}} for part in parts]
        schema = {"trial": pl.String} | dict.fromkeys(figures, pl.Float64)
        with whole_file(growing / FIGURES) as path:
            pl.DataFrame(table, schema=schema).write_parquet(path)
        written.append(FIGURES)
    text = data_sheet(words, parts, left_out, sizes)
    write_text(growing / SHEET, text)
    for name in (*written, SHEET):
        sums[name], sizes[name] = sha256_of(growing / name), (growing / name).stat().st_size
    write_text(growing / SUMS, sums_text(sums))
    told = metadata(growing, words, description_of(parts), parts, figures)
    write_json(growing / METADATA, told)
    (growing / KNOWN).mkdir()
    # From here on only names change. A part without its note is made again, should this be cut off.
    for part in parts:
        (growing / _PARTS / part.trial / NOTE).unlink()
        for side in (KNOWN, TRUTH):
            (growing / _PARTS / part.trial / side).replace(growing / side / part.trial)
    shutil.rmtree(growing / _PARTS)
    for name in (SUMS, METADATA):
        sizes[name] = (growing / name).stat().st_size
    return sizes
