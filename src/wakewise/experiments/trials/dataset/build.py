"""A folder of trials becomes a data set: trial by trial, so that it goes on where it was cut off, and whole or not.

It grows in a hidden folder beside its place and moves there at the end, so that a data set that is there is whole.

A data sheet: what a data set is, how it was made, what for, and what it is not.

Its questions are those of T. Gebru et al., Datasheets for Datasets (Communications of the ACM 64(12), 2021, doi
10.1145/3458723), section by section; its text is in `sheet.md`. What can be counted is counted; what only its makers
can say is marked as theirs.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import polars as pl

from wakewise.core.checks import counted
from wakewise.core.errors import InputError
from wakewise.core.files import sha256_of, whole_file, write_json, write_text
from wakewise.core.interfaces import no_progress
from wakewise.core.run_lock import LOCK, exclusive_run
from wakewise.experiments.trials.dataset.checksums import SUMS, sums_text
from wakewise.experiments.trials.dataset.metadata import FIGURES, METADATA, OWN_SUM, SHEET, TRIALS, columns_of, metadata
from wakewise.experiments.trials.dataset.part import KNOWN, NOTE, TRUTH, TrialPart, TrialSource, part_of, trials_of
from wakewise.experiments.trials.dataset.statement import QUESTIONS, DatasetStatement

UNSAID = "*For its makers to say.*"


def description_of(parts: Sequence[TrialPart]) -> str:
    """A few sentences for search engines."""
    photographs = sum(part.facts["photographs"] for part in parts)
    minutes = sum(part.facts["duration_s"] for part in parts) / 60.0
    simulated = sum(part.facts["simulated"] for part in parts)
    where = "simulated" if simulated == len(parts) else "real" if not simulated else "real and simulated"
    return (
        f"{counted(len(parts), 'flight')} of over-actuated underwater vehicles round delicate targets ({where}): "
        f"states at every control step, {counted(photographs, 'photograph')} with camera poses, and, apart from what "
        f"a controller could know, true states, the water at the target and the target's surface. {minutes:.1f} "
        "minutes in all."
    )


def data_sheet(
    words: DatasetStatement, parts: Sequence[TrialPart], left_out: Mapping[str, str], sizes: Mapping[str, int]
) -> str:
    """Text of DATASHEET.md."""
    facts = [part.facts for part in parts]
    simulated = sum(fact["simulated"] for fact in facts)
    lacking = Counter(what for part in parts for what in part.lacks)
    lacks = [f"{what} of {count} of {counted(len(parts), 'trial')}" for what, count in sorted(lacking.items())]
    reasons = "".join(f"\n- {name}: {why}" for name, why in sorted(left_out.items()))
    return (
        (files(__package__) / "sheet.md")
        .read_text(encoding="utf-8")
        .format_map(
            {
                "name": words.name,
                "version": words.version,
                "published": words.published,
                "creators": ", ".join(words.creators),
                "licence": words.licence,
                "where": words.url if words.url != "./" else UNSAID,
                **{question: words.answers.get(question, UNSAID) for question in QUESTIONS},
                "rows": "\n".join(f"| {what} | {value} |" for what, value in _rows(parts, sizes)),
                "missing": "; ".join(lacks) + "." if lacks else "No trial lacks a part.",
                "left_out": f"No; {len(left_out)} were left out:\n{reasons}"
                if left_out
                else "Yes, all that were there.",
                "noise": _noise(simulated, len(facts)),
                "acquired": _acquired(simulated, len(facts)),
                "not_concluded": (
                    "Simulated water is not the sea: what holds here holds in the tank's model, whose limits its "
                    "makers list. "
                    if simulated
                    else ""
                ),
            }
        )
    )


def _rows(parts: Sequence[TrialPart], sizes: Mapping[str, int]) -> list[tuple[str, str]]:
    facts = [part.facts for part in parts]
    with_truth = sum(any(path.endswith("/target.ply") for path in part.sums) for part in parts)
    return [
        ("trials", str(len(parts))),
        ("control steps", f"{sum(fact['steps'] for fact in facts):,}"),
        ("time in flight", f"{sum(fact['duration_s'] for fact in facts) / 60.0:.1f} min"),
        ("photographs", f"{sum(fact['photographs'] for fact in facts):,}"),
        ("surfaces of targets (ground truth)", str(with_truth)),
        *((f"{key}s", _counted(facts, key)) for key in ("vehicle", "method", "pilot", "world", "target")),
        ("different seeds", str(len({fact["seed"] for fact in facts if fact["seed"] is not None}))),
        ("flown by Wakewise", _counted(facts, "wakewise")),
        ("files of trials", f"{len(sizes):,}, {sum(sizes.values()) / 1e6:.1f} MB"),
    ]


def _acquired(simulated: int, trials: int) -> str:
    if not simulated:
        return "By a real vehicle; there is no truth to compare with."
    were = "was" if simulated == 1 else "were"
    return (
        f"{simulated} of {counted(trials, 'trial')} {were} flown in Wakewise's simulated tank, photographs rendered; "
        "`scenario.yaml` says with what, and flies them again."
    )


def _noise(simulated: int, trials: int) -> str:
    if not simulated:
        return "Those of the vehicle's own sensors."
    some = "" if simulated == trials else f" of the {counted(simulated, 'simulated trial')}"
    return (
        f"Sensors{some} have the noise, biases, delays and dropouts that `scenario.yaml` states. Photographs of one "
        "orbit overlap on purpose."
    )


def _counted(facts: Sequence[Mapping[str, Any]], key: str) -> str:
    counts = Counter(str(fact[key]) if fact[key] is not None else "unknown" for fact in facts)
    return ", ".join(f"{name} ({count})" for name, count in counts.most_common())


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

    `folder` is of a campaign, of trials, or of one trial; `out` does not exist yet, or is empty.

    Raises InputError if there is no trial that can be taken, `out` holds something, or another process makes the same
    data set.
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
            raise InputError(f"{folder}: none of {counted(len(left_out), 'trial')} can be taken; {name}: {why}")
        columns_of(parts)  # refuses before anything is moved
        for path in (growing / _PARTS).iterdir():
            if path.name not in {part.trial for part in parts}:  # an attempt before took it
                shutil.rmtree(path)
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


def _finish(
    growing: Path, parts: Sequence[TrialPart], left_out: dict[str, str], words: DatasetStatement
) -> dict[str, int]:
    """Lay everything out anew from the parts, and write what describes all of them; returns sizes by path."""
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
    write_text(growing / OWN_SUM, sums_text({METADATA: sha256_of(growing / METADATA)}))
    (growing / KNOWN).mkdir()
    # From here on only names change. A part without its note is made again, should this be cut off.
    for part in parts:
        (growing / _PARTS / part.trial / NOTE).unlink()
        for side in (KNOWN, TRUTH):
            (growing / _PARTS / part.trial / side).replace(growing / side / part.trial)
    shutil.rmtree(growing / _PARTS)
    for name in (SUMS, METADATA, OWN_SUM):
        sizes[name] = (growing / name).stat().st_size
    return sizes
