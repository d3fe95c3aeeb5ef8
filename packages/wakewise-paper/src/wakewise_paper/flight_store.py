"""Flights of the benches as trials of a campaign: known by what was flown and by the source of all that flies it.

One store for all (`wakewise.experiments.campaigns.store`): a bench that was stopped goes on where it was, a flight that
is known is not flown again, and two benches may run side by side.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wakewise.experiments.campaigns import versions
from wakewise.experiments.campaigns.store import open_store
from wakewise.experiments.campaigns.task import Figures, Task, WorkProgress, function_named

_BENCHES = ("studies/gentle", "studies/worlds")
FLIES = (*versions.FLIES, *_BENCHES)
"""Parts of the package that can change a flight of a bench."""
PHOTOGRAPHS = (*versions.PHOTOGRAPHS, *_BENCHES)
"""Parts of the package that can change a model made from a flight's photographs."""


def store_folder(bench: str = "gentle") -> Path:
    """Where a bench's flights are kept unless told otherwise: the user's cache folder (XDG base directories)."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "wakewise" / "campaigns" / bench


@dataclass(frozen=True)
class FlightStore:
    """Figures of flights by what was flown and by the source of `parts`; `fresh` forgets what is there."""

    folder: Path
    fresh: bool = False
    parts: tuple[str, ...] = FLIES

    def task(self, trial: Any, fly: str, name: str = "") -> Task:
        """A flight as a trial of a campaign.

        Parameters
        ----------
        trial : dataclass of plain values
        fly : str
            ``package.module:function`` that gives its figures.
        name : str
            For people.
        """
        kind = type(trial)
        settings = {"fly": fly, "kind": f"{kind.__module__}:{kind.__qualname__}", "trial": asdict(trial)}
        return Task(name=name, work=f"{__name__}:fly_kept", settings=settings, sources=self.parts)

    def load(self, trial: Any, fly: str) -> dict[str, float | None] | None:
        """Figures of a trial that was flown before, or None."""
        if self.fresh or not self.folder.exists():
            return None
        figures = open_store(self.folder).figures(self.task(trial, fly).key)
        return None if figures is None else numbers(figures)


def fly_kept(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:  # noqa: ARG001
    """Work of such a trial: build it from its plain values and fly it."""
    kind, fly = function_named(settings["kind"]), function_named(settings["fly"])
    figures: Figures = fly(kind(**{name: _hashable(value) for name, value in settings["trial"].items()}))
    return figures


def numbers(figures: Figures) -> dict[str, float | None]:
    """Figures of a flight that are numbers, as all of the benches' are."""
    return {name: value for name, value in figures.items() if not isinstance(value, str)}


def _hashable(value: Any) -> Any:
    """Tuples, as trials have them, for the lists that JSON makes of them."""
    return tuple(map(_hashable, value)) if isinstance(value, list) else value
