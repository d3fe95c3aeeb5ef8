"""`wakewise export --to dataset`: a folder of trials as a data set, and whether one is still what it was."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, print_json

LISTED = 5
"""Trials that were left out are listed up to so many; DATASHEET.md lists all."""


@dataclass(frozen=True, kw_only=True)
class DatasetOptions:
    """What the options that go with --to dataset said."""

    licence: str | None = None
    creators: tuple[str, ...] = ()
    name: str | None = None
    url: str | None = None
    published: str | None = None
    version: str | None = None
    answers: Path | None = None
    check: bool = False

    def refuse_beside(self, to: str) -> None:
        """Refuse them where another format is made."""
        names = {"licence": "license", "creators": "creator", "published": "date"}
        for one in fields(self):
            if getattr(self, one.name):
                raise InputError(f"--{names.get(one.name, one.name)}: goes with --to dataset only, not with {to}")


def export_dataset(folder: Path, out: Path | None, words: DatasetOptions, json: bool) -> None:
    """Make a data set, or check one."""
    if words.check:
        _check(folder, words, out, json)
        return
    from wakewise.experiments.trials.dataset import build_dataset, read_words
    from wakewise.experiments.trials.dataset.statement import QUESTIONS

    path = out or folder / "export" / "dataset"
    told = read_words(
        name=folder.resolve().name if words.name is None else words.name,
        licence=words.licence,
        creators=words.creators,
        url=words.url,
        published=words.published,
        version=words.version or "1.0.0",
        answers=words.answers,
    )
    with ProgressBars().stage("trials") as progress:
        built = build_dataset(folder, path, told, progress)
    facts: dict[str, Any] = {
        "to": "dataset",
        "path": str(built.path),
        "trials": built.trials,
        "photographs": built.photographs,
        "files": built.files,
        "bytes": built.bytes,
        "left_out": built.left_out,
    }
    if json:
        print_json(facts)
        return
    kept = f", {built.trials - built.made} of them from before" if built.made < built.trials else ""
    typer.echo(
        f"{built.path}: {built.trials} trials{kept}, {built.photographs} photographs, {built.files} files, "
        f"{built.bytes / 1e6:.1f} MB"
    )
    for name, why in list(built.left_out.items())[:LISTED]:
        typer.echo(f"left out        {name}: {why}")
    if len(built.left_out) > LISTED:
        typer.echo(f"                and {len(built.left_out) - LISTED} more, see DATASHEET.md")
    if unsaid := [question for question in QUESTIONS if question not in told.answers]:
        typer.echo(f"open            {', '.join(unsaid)}: DATASHEET.md asks, --answers FILE tells")


def _check(folder: Path, words: DatasetOptions, out: Path | None, json: bool) -> None:
    from wakewise.experiments.trials.dataset import check_dataset

    if out is not None or any(getattr(words, one.name) for one in fields(words) if one.name != "check"):
        raise InputError("--check: takes the folder of a data set and no other option")
    with ProgressBars().stage("check sums") as progress:
        checked = check_dataset(folder, progress)
    amiss = checked.differences
    if json:
        print_json(
            {
                "path": str(folder),
                "files": checked.files,
                "bytes": checked.bytes,
                "differences": {one.path: one.what for one in amiss},
            }
        )
    if amiss:
        more = f", and {len(amiss) - 1} more" if len(amiss) > 1 else ""
        raise InputError(f"{folder}: is not as it was made: {amiss[0].path} {amiss[0].what}{more}")
    if not json:
        typer.echo(f"{folder}: {checked.files} files, {checked.bytes / 1e6:.1f} MB, all as they were made")
