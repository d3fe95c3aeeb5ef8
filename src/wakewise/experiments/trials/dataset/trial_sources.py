"""Which folders are trials, and where each keeps its flight, its settings and its figures."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from wakewise.core.errors import InputError

STEPS, SCENARIO, METRICS = "steps.parquet", "scenario.yaml", "metrics.json"
TASK, FIGURES = "trial.json", "figures.json"
"""What a campaign keeps of each of its trials: what is made, and, once it is finished, its figures."""
_WORK = ("work/trial", "work")
"""Where a campaign's work leaves its flight: a whole trial, or a flight alone."""


@dataclass(frozen=True)
class TrialSource:
    """A trial: the folder of its flight; settings and figures, which a campaign keeps elsewhere.

    `settings` is a scenario (YAML) or a campaign's task (JSON); files may not be there.
    """

    folder: Path
    settings: Path
    figures: Path


def source_in(folder: Path) -> TrialSource | None:
    """The trial in a folder, its own or a campaign's; None where none was flown to its end."""
    if (folder / STEPS).is_file():
        return TrialSource(folder, folder / SCENARIO, folder / METRICS)
    if (folder / TASK).is_file() and (folder / FIGURES).is_file():
        for work in _WORK:
            flown = folder / work
            if (flown / STEPS).is_file():
                settings, figures = flown / SCENARIO, flown / METRICS
                return TrialSource(
                    flown,
                    settings if settings.is_file() else folder / TASK,
                    figures if figures.is_file() else folder / FIGURES,
                )
    return None


def trials_of(folder: Path) -> tuple[dict[str, TrialSource], list[str]]:
    """Trials by name, and names of folders that hold one that was not flown to its end.

    A trial's own folder is one trial; a campaign's holds them below trials/; else every folder in it that is a trial,
    and those one further down, whose names are then joined.

    Raises
    ------
    InputError
        If there is none.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give that of a campaign, of trials, or of one trial")
    alone = source_in(folder)
    if alone is not None:
        return {_name(folder.resolve().name): alone}, []
    top = folder / "trials" if (folder / "trials").is_dir() else folder
    found: dict[str, TrialSource] = {}
    unfinished: list[str] = []
    for path in _folders(top):
        inner = [path] if _is_trial(path) else [deep for deep in _folders(path) if _is_trial(deep)]
        for trial in inner:
            name = _name("-".join(trial.relative_to(top).parts))
            source = source_in(trial)
            if source is None:
                unfinished.append(name)
            elif name in found:
                raise InputError(f"{trial}: a trial of the name {name} is there already; rename one of them")
            else:
                found[name] = source
    if not found:
        more = f", {len(unfinished)} not flown to their end" if unfinished else ""
        raise InputError(f"{folder}: holds no trial (a folder with {STEPS}){more}")
    return found, unfinished


def _folders(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))


def _is_trial(folder: Path) -> bool:
    return any((folder / name).is_file() for name in (STEPS, SCENARIO, TASK))


def _name(text: str) -> str:
    """A name that every file system and every glob pattern takes as it is."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", text).strip(".") or "trial"
