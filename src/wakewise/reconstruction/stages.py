"""Stages that are skipped when their files are there and were made from the same input with the same settings."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wakewise.files import write_json


def fingerprint(*parts: Any) -> str:
    """Digest of anything JSON can hold; the same value always gives the same digest."""
    text = json.dumps(parts, sort_keys=True, allow_nan=False)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


@dataclass(frozen=True, kw_only=True)
class StageResult:
    """What a stage found (figures), how long it took when it ran, its fingerprint, and whether it was skipped now."""

    figures: dict[str, Any]
    wall_s: float
    key: str
    skipped: bool


def run_stage(
    folder: Path, name: str, key: str, products: tuple[Path, ...], work: Callable[[], dict[str, Any]]
) -> StageResult:
    """Run `work` unless its products are there and its stamp, `folder/stages/<name>.json`, has the same key.

    The stamp is removed before and written after the work, so that a stage that was stopped is done again.
    """
    stamp = folder / "stages" / f"{name}.json"
    known = _read_stamp(stamp)
    if known.get("key") == key and all(path.exists() for path in products):
        return StageResult(figures=known["figures"], wall_s=known["wall_s"], key=key, skipped=True)
    stamp.unlink(missing_ok=True)
    start = time.perf_counter()
    figures = work()
    wall_s = time.perf_counter() - start
    write_json(stamp, {"key": key, "wall_s": wall_s, "figures": figures})
    return StageResult(figures=figures, wall_s=wall_s, key=key, skipped=False)


def _read_stamp(path: Path) -> dict[str, Any]:
    """What a stamp says; nothing if it is missing or damaged."""
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    whole = isinstance(value, dict) and {"key", "wall_s", "figures"} <= value.keys()
    return value if whole else {}
