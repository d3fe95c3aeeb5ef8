"""Keeps what flights gave, so that a bench that was stopped goes on where it was.

A flight is known by a hash of everything that its trial says and of the source of all that flies it: change either and
it is flown anew. One small JSON file each, written whole.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from wakewise.files import write_json

FLIES = (
    "allocation",
    "control",
    "estimation",
    "evaluation",
    "geometry",
    "interfaces.py",
    "lattice",
    "missions",
    "operation",
    "planning",
    "studies/gentle",
    "studies/worlds",
    "tank",
    "targets",
    "thrusters",
    "vehicles",
    "wake",
    "water",
)
"""Parts of the package that can change a flight."""
_SOURCES = {".py", ".yaml", ".csv", ".json"}


def store_folder(bench: str = "gentle") -> Path:
    """Where a bench's flights are kept unless told otherwise: the user's cache folder (XDG base directories)."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if base else Path.home() / ".cache") / "wakewise" / bench


PHOTOGRAPHS = (*FLIES, "imaging", "reconstruction", "trials")
"""Parts of the package that can change a model made from a flight's photographs."""


@lru_cache(maxsize=4)
def source_version(parts: tuple[str, ...] = FLIES) -> str:
    """Hash of the source that flies, or of these parts of the package."""
    root = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for part in parts:
        place = root / part
        files = [place] if place.is_file() else sorted(place.rglob("*"))
        for file in (f for f in files if f.suffix in _SOURCES):
            digest.update(file.relative_to(root).as_posix().encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class FlightStore:
    """Figures of flights by what was flown and by the source of `parts`; `fresh` forgets what is there."""

    folder: Path
    fresh: bool = False
    parts: tuple[str, ...] = FLIES

    def path(self, trial: Any) -> Path:
        """File of a trial (a dataclass of plain values)."""
        told = json.dumps({"trial": asdict(trial), "source": source_version(self.parts)}, sort_keys=True, default=str)
        return self.folder / f"{hashlib.sha256(told.encode()).hexdigest()[:32]}.json"

    def load(self, trial: Any) -> dict[str, float | None] | None:
        """Figures of a trial that was flown before, or None."""
        if self.fresh:
            return None
        try:
            kept = json.loads(self.path(trial).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        figures = kept.get("figures") if isinstance(kept, dict) else None
        return figures if isinstance(figures, dict) else None

    def save(self, trial: Any, figures: dict[str, float | None]) -> None:
        """Keep the figures of a trial, with what was flown beside them for people to read."""
        write_json(self.path(trial), {"trial": asdict(trial), "figures": figures})
