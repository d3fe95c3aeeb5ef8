"""Stages that are skipped if their files were made from the same input with the same settings; room on the disk."""

from __future__ import annotations

import hashlib
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wakewise.core.errors import EnvironmentFailure, InputError, WakewiseError, is_full
from wakewise.core.files import write_json
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.colmap import RESERVE_MB, pycolmap

LOW_DISK_MB = 5.0


def fingerprint(*parts: Any) -> str:
    """Digest of anything JSON can hold; the same value always gives the same digest."""
    text = json.dumps(parts, sort_keys=True, allow_nan=False)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


@dataclass(frozen=True, kw_only=True)
class StageResult:
    """Figures of a stage, its duration when it ran, its fingerprint, and whether it was skipped now."""

    figures: dict[str, Any]
    wall_s: float
    key: str
    skipped: bool


def run_stage(
    folder: Path, name: str, key: str, products: tuple[Path, ...], work: Callable[[], dict[str, Any]]
) -> StageResult:
    """Run `work` unless its products are there and its stamp, `folder/stages/<name>.json`, has the same key.

    The stamp is removed before and written after the work, so that a stage that was stopped is done again. What later
    stages made of the earlier product is removed once the new one is there: it is of another model.

    Raises EnvironmentFailure if a file cannot be read or written, or the disk is full; whatever `work` raises else.
    """
    stamp = folder / "stages" / f"{name}.json"
    known = read_stamp(folder, name)
    if known.get("key") == key and all(path.exists() for path in products):
        return StageResult(figures=known["figures"], wall_s=known["wall_s"], key=key, skipped=True)
    start = time.perf_counter()
    try:
        stamp.unlink(missing_ok=True)
        figures = work()
        wall_s = time.perf_counter() - start
        remove_later(folder, name)
        write_json(stamp, {"key": key, "wall_s": wall_s, "figures": figures})
    except OSError as fault:
        raise EnvironmentFailure(f"{name}: {no_room(fault, folder)}; the stages before it are kept") from fault
    except (EnvironmentFailure, InputError):
        raise
    except (WakewiseError, RuntimeError) as fault:
        # COLMAP and SQLite report a full disk in other messages, or not at all.
        free_MB = shutil.disk_usage(folder).free / 1e6
        if free_MB > LOW_DISK_MB and not is_full(fault):
            raise
        reason = " ".join(str(fault).split())[:200]
        raise EnvironmentFailure(f"{reason}; the disk of {folder} is full, {free_MB:.0f} MB are left") from fault
    return StageResult(figures=figures, wall_s=wall_s, key=key, skipped=False)


_MADE = {
    "match": (),
    "map": (),
    "scale": (),
    "dense": ("dense.ply", "dense.las"),
    "mesh": ("mesh.ply", "reconstruction.json", "report.html"),
    "outputs": ("mesh.glb", "textured.obj", "textured.mtl", "textured.png", "textured.glb", "orthophoto.png",
                "orthophoto.pgw", "orthophoto.json", "heights.png", "heights.pgw", "extent.json"),
}  # fmt: skip
"""Stages of a model in their order, and the files that stand for each in its folder besides database and sparse model.

Figures and report go with the dense points: the surface may be made after they are written."""


def remove_later(folder: Path, name: str) -> None:
    """Remove stamps and files of the stages after one; of a stage that is not in `_MADE`, none."""
    order = list(_MADE)
    for later in order[order.index(name) + 1 :] if name in order else ():
        (folder / "stages" / f"{later}.json").unlink(missing_ok=True)
        for file in _MADE[later]:
            (folder / file).unlink(missing_ok=True)


def invalidate_stage(folder: Path, name: str, changed: str) -> None:
    """Remove the stamp of a stage that is not requested any more, and of the stage whose files it changed."""
    stamps = folder / "stages"
    if (stamps / f"{name}.json").exists():
        (stamps / f"{changed}.json").unlink(missing_ok=True)
        (stamps / f"{name}.json").unlink()


def need_room(folder: Path, size_bytes: float, name: str) -> None:
    """Check for room before a stage whose library ends the whole process when the disk is full, as COLMAP's does.

    Raises EnvironmentFailure if less is free than the stage may write.
    """
    free = shutil.disk_usage(folder).free
    size_bytes += 1e6 * RESERVE_MB
    if free < size_bytes:
        raise EnvironmentFailure(
            f"{name}: the disk of {folder} is full, {free / 1e6:.1f} MB are left and about {size_bytes / 1e6:.1f} MB "
            "needed; the stages before it are kept"
        )


def no_room(fault: OSError, folder: Path) -> str:
    """Reason of a failed write, in one line."""
    if is_full(fault):
        return f"the disk of {folder} is full"
    return f"{fault.filename or folder}: {fault.strerror or fault}"


def make_folder(folder: Path) -> None:
    """Make a folder for results.

    Raises InputError if it cannot be made, such as where a file is.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as fault:
        raise InputError(f"{folder}: cannot be made a folder for the model ({fault.strerror})") from None


def read_stamp(folder: Path, name: str) -> dict[str, Any]:
    """Stamp of a stage: key, wall_s, figures; empty if it is missing or damaged."""
    path = folder / "stages" / f"{name}.json"
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    whole = isinstance(value, dict) and {"key", "wall_s", "figures"} <= value.keys()
    return value if whole else {}


# Part of every stage's fingerprint: raise it when a stage's result changes for the same input.
VERSION = 12
STAGES: dict[str, tuple[str, ...]] = {
    "match": ("detector", "max_features", "first_octave", "lens"),
    "map": (
        "mapper",
        "refine_camera",
        "check_shared_intrinsics",
        "known_cameras",
        "reprojection_px",
        "position_priors",
        "prior_sigma_m",
    ),
    "scale": (),
    "dense": ("dense", "dense_px", "dense_zoom", "stereo_paths", "stereo_partners", "agreeing_views"),
    "mesh": ("mesh_depth",),
}


def stage_key(settings: ReconstructionSettings, stage: str, before: str, *parts: Any) -> str:
    """Fingerprint of all inputs of a stage; `before` is that of the stage before."""
    used = {field: getattr(settings, field) for field in STAGES[stage]}
    return fingerprint(VERSION, pycolmap.__version__, stage, before, used, parts)
