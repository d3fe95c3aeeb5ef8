"""Which version of the package's source a trial was made with: a hash of the parts that can change its figures."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from wakewise.core.errors import InputError

FLIES = (
    "allocation",
    "control",
    "core",
    "estimation",
    "operation",
    "planning",
    "robot",
    "scene",
    "simulation",
    "vision/evaluation",
    "wake",
)
"""Parts of the package that can change a flight."""

PHOTOGRAPHS = (*FLIES, "vision/imaging", "vision/reconstruction", "experiments/trials")
"""Parts of the package that can change a model made from a flight's photographs."""

_SOURCES = {".py", ".yaml", ".csv", ".json"}
_ROOT = Path(__file__).parents[2]


@lru_cache(maxsize=16)
def source_version(parts: tuple[str, ...] = FLIES) -> str:
    """Hash of the source of these parts of the package: files or folders, from the package's root.

    Raises
    ------
    InputError
        If there is no such part.
    """
    digest = hashlib.sha256()
    for part in parts:
        place = _ROOT / part
        if not place.exists():
            raise InputError(f"sources: '{part}' is no part of the package")
        files = [place] if place.is_file() else sorted(place.rglob("*"))
        for file in (f for f in files if f.suffix in _SOURCES):
            digest.update(file.relative_to(_ROOT).as_posix().encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
