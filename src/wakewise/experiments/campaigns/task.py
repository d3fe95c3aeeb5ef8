"""One trial of a campaign as plain values, and what became of it.

A trial is its configuration and seed, written as JSON: anyone can read it, any process or machine can take it up, and
the same one has the same key.

Which version of the package's source a trial was made with: a hash of the parts that can change its figures.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.plugins import load

FLIES = (
    "allocation",
    "control",
    "core",
    "estimation",
    "operation",
    "perception",
    "planning",
    "robot",
    "scene",
    "simulation",
    "vision/evaluation",
    "vision/imaging",
    "wake",
)
"""Parts of the package that can change a flight; pictures do where the pilot is `find`."""

PHOTOGRAPHS = (*FLIES, "vision/reconstruction", "experiments/trials")
"""Parts of the package that can change a model made from a flight's photographs."""

_SOURCES = {".py", ".yaml", ".csv", ".json"}
_ROOT = Path(__file__).parents[2]


@lru_cache(maxsize=64)
def source_version(parts: tuple[str, ...] = FLIES) -> str:
    """Hash of source files: files or folders below this package, or `PACKAGE:PATH` below another installed one.

    Raises InputError if there is no such part.
    """
    digest = hashlib.sha256()
    for part in parts:
        package, colon, inside = part.rpartition(":")
        root = _root(package) if colon else _ROOT
        place = root / inside
        if not place.exists():
            raise InputError(f"sources: '{part}' is no part of {package or 'wakewise'}")
        files = [place] if place.is_file() else sorted(place.rglob("*"))
        for file in (f for f in files if f.suffix in _SOURCES):
            digest.update(file.relative_to(root).as_posix().encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()


def _root(package: str) -> Path:
    found = find_spec(package)
    if found is None or found.origin is None:
        raise InputError(f"sources: there is no package '{package}'")
    return Path(found.origin).parent


Figure = float | None | str
Figures = Mapping[str, Figure]
WorkProgress = Callable[..., None]
"""Called as `(done, total, note)`."""
Work = Callable[[Mapping[str, Any], Path, WorkProgress], Figures]

_KEY = 32  # characters of a key; half of SHA-256


@dataclass(frozen=True, kw_only=True)
class Task:
    """One trial to make.

    `work` is ``package.module:function``, a function `(settings, folder, progress) -> figures`; `settings` are plain
    values, all that the function is given, its seed with it; `sources` are the parts whose source can change the
    figures.

    Raises InputError if the settings are no plain values.
    """

    name: str
    work: str
    settings: Mapping[str, Any]
    sources: tuple[str, ...] = FLIES

    def __post_init__(self) -> None:
        try:
            told = json.dumps(self.settings, sort_keys=True, allow_nan=False)
        except (TypeError, ValueError) as fault:
            raise InputError(f"trial {self.name}: settings must be plain values, {fault}") from None
        module, colon, function = self.work.partition(":")
        if not (module and colon and function):
            raise InputError(f"trial {self.name}: work '{self.work}', must be package.module:function")
        object.__setattr__(self, "_told", told)

    @property
    def key(self) -> str:
        """Hash of work, settings and the sources that matter: the name of the trial's folder."""
        told: str = self.__dict__["_told"]
        whole = f"{self.work}\n{told}\n{source_version(self.sources)}"
        return hashlib.sha256(whole.encode()).hexdigest()[:_KEY]

    def plain(self) -> dict[str, Any]:
        """As JSON, to be handed to a worker and kept in the trial's folder."""
        told = {"name": self.name, "work": self.work, "settings": dict(self.settings)}
        return told | {"sources": list(self.sources), "key": self.key}


@dataclass(frozen=True, kw_only=True)
class TrialOutcome:
    """What became of a trial: its figures, or the reason that there are none.

    `reason` says in one line why there are no figures; `attempts` counts all runs of the campaign; `took_s` is the wall
    time of the attempt that counts, 0 where it never ended; `known`: it was finished before this run began; `how` the
    last attempt ended (`attempt_log.How`).
    """

    task: Task
    figures: dict[str, Figure] | None
    reason: str | None = None
    attempts: int = 0
    took_s: float = 0.0
    known: bool = False
    how: str | None = None


def function_named(name: str, kind: str = "work") -> Callable[..., Any]:
    """The function, or class, that ``package.module:function`` names; `kind` says what it is for.

    Raises InputError if it cannot be imported.
    """
    found: Callable[..., Any] = load(kind, name, name)
    return found
