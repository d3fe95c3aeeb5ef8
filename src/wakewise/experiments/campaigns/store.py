"""A campaign's folder: a folder per trial is the truth, `figures.json` in it the last thing written.

FOLDER/store.json              format of what lies here
FOLDER/trials/KEY/trial.json   what is made: work, settings, versions
FOLDER/trials/KEY/attempts.jsonl, log.txt, claim.json while a process works on it
FOLDER/trials/KEY/work         what the work leaves
FOLDER/trials/KEY/figures.json the trial is finished
"""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wakewise.core.errors import FULL, EnvironmentFailure, InputError, is_full
from wakewise.core.files import write_json
from wakewise.experiments.campaigns import attempt_log
from wakewise.experiments.campaigns.task import Figure, Task, TrialOutcome

FORMAT = 1
"""Of the folder; another one is refused."""
FIGURES, TRIAL, LOG, WORK = "figures.json", "trial.json", "log.txt", "work"
RESUME_HINT = "what was finished is kept, run the same command again to go on"
_STORE, _TRIALS = "store.json", "trials"


@dataclass(frozen=True)
class CampaignStore:
    """A campaign's folder; make one with `open_store`."""

    folder: Path

    @property
    def trials(self) -> Path:
        """Where the trials' folders are."""
        return self.folder / _TRIALS

    def place(self, key: str) -> Path:
        """Folder of a trial."""
        return self.trials / key

    def figures(self, key: str) -> dict[str, Figure] | None:
        """Figures of a finished trial, else None."""
        kept = read_figures(self.place(key))
        return None if kept is None else kept[0]

    def outcome(self, task: Task, known: bool = False) -> TrialOutcome:
        """What has become of a trial so far."""
        place = self.place(task.key)
        kept, told = read_figures(place), attempt_log.read_attempts(place)
        figures, took_s = (None, told.took_s) if kept is None else kept
        reason, how = (told.reason or "not finished", told.how) if kept is None else (None, "done")
        begun = told.begun if kept is None else max(1, told.begun)
        return TrialOutcome(
            task=task, figures=figures, reason=reason, attempts=begun, took_s=took_s, known=known, how=how
        )

    def forget(self, key: str) -> None:
        """Remove what is known of a trial."""
        (self.place(key) / FIGURES).unlink(missing_ok=True)
        shutil.rmtree(self.place(key), ignore_errors=True)


def open_store(folder: Path) -> CampaignStore:
    """The store in a folder, which is made if it is not there.

    Raises InputError if the folder holds something else, or a store of another version.
    """
    path = folder / _STORE
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, must be a folder or not exist")
    if not path.exists():
        # Another driver may be opening it at this moment.
        own = {_STORE, _TRIALS}
        if folder.exists() and any(not e.name.startswith(".") and e.name not in own for e in folder.iterdir()):
            raise InputError(f"{folder}: holds something that is no campaign; give another folder")
        (folder / _TRIALS).mkdir(parents=True, exist_ok=True)
        write_json(path, {"format": FORMAT}, lasting=True)
    return read_store(folder)


def read_store(folder: Path) -> CampaignStore:
    """The store that is in a folder.

    Raises InputError if there is none, or one of another version.
    """
    path = folder / _STORE
    try:
        told = json.loads(path.read_text(encoding="utf-8"))["format"]
    except FileNotFoundError:
        raise InputError(f"{folder}: no campaign is there, its {_STORE} is missing") from None
    except (OSError, ValueError, KeyError, TypeError):
        raise InputError(f"{path}: cannot be read, must say the format of the campaign's folder") from None
    if told != FORMAT:
        raise InputError(f"{folder}: results of format {told}, this Wakewise reads {FORMAT}; give another folder")
    return CampaignStore(folder)


@contextmanager
def report_full_disk(folder: Path) -> Iterator[None]:
    """Raise EnvironmentFailure, with what to do, where the block meets a full disk."""
    try:
        yield
    except Exception as fault:  # all but a full disk is raised again
        if not is_full(fault):
            raise
        raise EnvironmentFailure(f"{folder}: {FULL}; {RESUME_HINT}") from None


def read_figures(place: Path) -> tuple[dict[str, Figure], float] | None:
    """Figures of a trial's folder and how long they took, s; None where it is not finished."""
    try:
        kept = json.loads((place / FIGURES).read_bytes())
        return dict(kept["figures"]), float(kept["took_s"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def write_figures(place: Path, figures: Mapping[str, Any], took_s: float) -> None:
    """Keep a trial's figures: with this it is finished, whatever happens next.

    Raises TypeError if one is neither a number nor a word nor None.
    """
    write_json(place / FIGURES, {"figures": plain_figures(figures), "took_s": round(took_s, 3)}, lasting=True)


def plain_figures(figures: Mapping[str, Any]) -> dict[str, Figure]:
    """Figures as JSON can hold them: numbers, words, None; what is not finite is None."""
    plain: dict[str, Figure] = {}
    for key, value in figures.items():
        if value is None or isinstance(value, str):
            plain[str(key)] = value
        else:
            number = float(value)
            plain[str(key)] = number if math.isfinite(number) else None
    return plain
