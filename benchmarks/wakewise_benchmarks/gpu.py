"""What may run on a graphics card, beside the same on the processor: the lattice, COLMAP's stages, a neural field.

Each part is run on both, on the same input, and gives the time of each and how far the results differ. A part that has
no card, or no library that can use it, gives the processor's figures, null for the card's, and the reason in `why`:

- `lattice` needs the extra `gpu` (numba-cuda),
- `colmap` a pycolmap with CUDA (package pycolmap-cuda12) in the place of pycolmap,
- `field` the extra `nerf` (PyTorch with CUDA).

All parts together take less than ten minutes of two cores; `--only lattice,colmap,field` chooses.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from wakewise.core.errors import InputError, WakewiseError
from wakewise.core.optional_dependencies import how_to_install
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.operation import Scenario, load_scenario
from wakewise.simulation.lattice.stencil import OPEN, smagorinsky_factor
from wakewise.vision.reconstruction.dense.dense_points import require_cuda
from wakewise_paper.lattice_reference.engines import make_engine, why_no_gpu
from wakewise_paper.photo_sets import PhotoSet, judge, planned_views, write_photos

PARTS = ("lattice", "colmap", "field")
CELLS, STEPS = 96, 40
VIEWS = (8, 6, 4)
SEED = 1
FIELD_STEPS = 300
_MODEL = ("rmse_mm", "completeness_visible_pct", "dense_points", "features_per_image")


def run(options: BenchOptions) -> dict[str, Any]:
    """Figures of each part, and why those of the card are missing.

    Raises
    ------
    InputError
        If there is no such part.
    """
    chosen = options.only or PARTS
    for name in chosen:
        if name not in PARTS:
            raise InputError(f"--only {name}: no such part, allowed {', '.join(PARTS)}")
    result: dict[str, Any] = {"card": card_name(), "parts": {}}
    why = {} if result["card"] else {"card": "no library here can use a graphics card"}
    scenario = load_scenario("quick", None, {"target.kind": "brain", "mission.views": list(VIEWS), "seed": SEED})
    with tempfile.TemporaryDirectory(prefix="wakewise-bench-") as scratch:
        photos: PhotoSet | None = None
        for k, name in enumerate(chosen):
            options.progress(k, len(chosen), name)
            if name == "lattice":
                figures, reason = _lattice()
            else:
                photos = photos or _photographs(scenario, Path(scratch) / "photographs", options)
                options.progress(k, len(chosen), name)
                part = _colmap if name == "colmap" else _field
                figures, reason = part(photos, scenario, Path(scratch) / name)
            result["parts"][name] = figures
            if reason is not None:
                why[name] = reason
    return result | {"why": why}


def card_name() -> str | None:
    """Name of the card that numba-cuda or PyTorch would use; None where neither finds one."""
    if why_no_gpu() is None:
        from numba import cuda

        name = cuda.get_current_device().name
        return name.decode() if isinstance(name, bytes) else str(name)
    try:
        torch = import_module("torch")  # an extra that no type checker knows
    except ImportError:
        return None
    return str(torch.cuda.get_device_name()) if torch.cuda.is_available() else None


def _photographs(scenario: Scenario, folder: Path, options: BenchOptions) -> PhotoSet:
    target = scenario.parts().target
    views = planned_views(target, scenario.mission, scenario.imaging.window_s, np.random.default_rng(SEED))
    return write_photos(folder, views, None, scenario.imaging, target, seed=SEED, progress=options.progress)


def _lattice() -> tuple[dict[str, Any], str | None]:
    """Random water in a cube with open faces; gap: largest difference over the largest population."""
    figures: dict[str, Any] = {"cells": CELLS**3, "cpu_mlups": None, "gpu_mlups": None, "ratio": None, "gap_rel": None}
    start = (1e-3 * np.random.default_rng(SEED).standard_normal((19, CELLS, CELLS, CELLS))).astype(np.float32)
    ends = {}
    reason = why_no_gpu()
    for name, device in (("cpu", "cpu"), *(() if reason else (("gpu", "cuda"),))):
        tau = np.full(CELLS + 2, 0.51), np.zeros((CELLS + 2, CELLS + 2))
        engine = make_engine(device, *tau, smagorinsky_factor(0.12), np.full(6, OPEN))
        engine.restore(start, np.zeros((8, CELLS, CELLS, CELLS)))
        engine.advance([])  # compiles
        engine.along_x(CELLS // 2, CELLS // 2)  # waits for the card
        began = time.perf_counter()
        for _ in range(STEPS):
            engine.advance([])
        engine.along_x(CELLS // 2, CELLS // 2)
        figures[f"{name}_mlups"] = CELLS**3 * STEPS / (time.perf_counter() - began) / 1e6
        ends[name] = np.array(engine.populations)
    if "gpu" in ends:
        figures["ratio"] = figures["gpu_mlups"] / figures["cpu_mlups"]
        figures["gap_rel"] = float(np.abs(ends["gpu"] - ends["cpu"]).max() / np.abs(ends["cpu"]).max())
    return figures, reason


def _colmap(photos: PhotoSet, scenario: Scenario, folder: Path) -> tuple[dict[str, Any], str | None]:
    """Features and exhaustive matching by COLMAP alone, then a whole model with stereo and with patch-match."""
    reason = None
    try:
        require_cuda()
    except InputError as fault:
        reason = str(fault)
    figures: dict[str, Any] = {"images": len(photos.names)}
    devices = (("cpu", pycolmap.Device.cpu), *(() if reason else (("gpu", pycolmap.Device.cuda),)))
    for name in ("cpu", "gpu"):
        figures |= dict.fromkeys(f"{name}_{key}" for key in ("features_s", "matching_s", "features", "inlier_matches"))
    for name, device in devices:
        found = _features_and_matches(photos.folder, folder / name, device)
        figures |= {f"{name}_{key}": value for key, value in found.items()}
    target, dense = scenario.parts().target, (("cpu", "stereo"), *(() if reason else (("gpu", "patch-match"),)))
    for name in ("cpu", "gpu"):
        figures |= dict.fromkeys(f"{name}_{key}" for key in ("dense_s", *_MODEL))
    for name, method in dense:
        model = judge(photos, target, scenario.reconstruction.model_copy(update={"dense": method}), folder / method)
        figures[f"{name}_dense_s"] = (model.get("stages_s") or {}).get("dense")
        figures |= {f"{name}_{key}": model.get(key) for key in _MODEL}
    return figures, reason


def _features_and_matches(images: Path, folder: Path, device: pycolmap.Device) -> dict[str, Any]:
    """Seconds of both stages, and what they found, in a database of its own."""
    folder.mkdir(parents=True)
    database = folder / "database.db"
    mode = pycolmap.CameraMode.SINGLE
    features_s = _seconds(lambda: pycolmap.extract_features(database, images, camera_mode=mode, device=device))
    matching_s = _seconds(lambda: pycolmap.match_exhaustive(database, device=device))
    with pycolmap.Database.open(database) as link:
        features, matches = link.num_keypoints(), link.num_inlier_matches()
    return {"features_s": features_s, "matching_s": matching_s, "features": features, "inlier_matches": matches}


def _field(photos: PhotoSet, scenario: Scenario, folder: Path) -> tuple[dict[str, Any], str | None]:
    """The small profile of a neural field for some hundred steps, from one model of the photographs."""
    names = [f"{device}_{key}" for device in ("cpu", "gpu") for key in ("train_s", "psnr_db", "loss")]
    figures: dict[str, Any] = {"steps": FIELD_STEPS, **dict.fromkeys(names)}
    try:
        torch = import_module("torch")
        from wakewise_nerf.field import build_field
        from wakewise_nerf.field.settings import PROFILES
    except ImportError:
        return figures, f"PyTorch is not installed: {how_to_install('nerf')}"
    target = scenario.parts().target
    judge(photos, target, scenario.reconstruction.model_copy(update={"mesh": False}), folder / "model")
    settings = PROFILES["cpu"].model_copy(update={"steps": FIELD_STEPS, "random_seed": SEED})
    reason = None if torch.cuda.is_available() else "PyTorch finds no CUDA device"
    for name, device in (("cpu", "cpu"), *(() if reason else (("gpu", "cuda"),))):
        train = partial(build_field, folder / "model", photos.folder, folder / name, settings, device=device)
        try:
            made = train(mesh=False)
        except WakewiseError as fault:
            return figures, f"{name}: {fault}"
        figures[f"{name}_train_s"] = made["stages_s"]["train"]
        figures |= {f"{name}_{key}": made[key] for key in ("psnr_db", "loss")}
    return figures, reason


def _seconds(work: Callable[[], Any]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began
