"""How models get worse as water and camera do: silt, blur and particles, one at a time, until there is no model.

Each level is one set of photographs from planned orbits (no flight), one model, one score; each leaves a file, so that
a study that was stopped goes on where it was. A level without a model has a reason instead of figures.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.errors import InputError
from wakewise.core.files import write_json, write_text
from wakewise.core.interfaces import ScalarGrid
from wakewise.core.run_lock import exclusive_run
from wakewise.experiments.trials.stages import ProgressListener, SilentProgress, of_the_computer
from wakewise.operation import Scenario
from wakewise.scene.targets import Target
from wakewise.vision.imaging import Render
from wakewise_paper.photo_sets import judge, planned_views, render_clean, write_photos


@dataclass(frozen=True, kw_only=True)
class Factor:
    """One thing that makes photographs worse: its unit, what it is, and levels from none to more than enough."""

    name: str
    unit: str
    title: str
    levels: tuple[float, ...]


FACTORS = {
    factor.name: factor
    for factor in (
        Factor(
            name="silt",
            unit="mg/L",
            title="silt in all of the water, with the flakes it brings",
            levels=(0.0, 10.0, 20.0, 40.0, 60.0, 90.0, 130.0, 180.0, 250.0),
        ),
        Factor(
            name="blur",
            unit="px",
            title="way of the target across the photograph while the shutter is open",
            levels=(0.0, 1.0, 2.0, 4.0, 6.0, 9.0, 13.0, 18.0, 25.0, 35.0, 50.0, 70.0),
        ),
        Factor(
            name="particles",
            unit="1/m3",
            title="flakes in otherwise clear water",
            levels=(0.0, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6, 3e6, 1e7),
        ),
    )
}
COLUMNS = (
    "factor",
    "level",
    "unit",
    "success",
    "rmse_mm",
    "accuracy_median_mm",
    "completeness_pct",
    "completeness_visible_pct",
    "f_score",
    "images",
    "registered_images",
    "reprojection_px",
    "features_per_image",
    "inlier_matches",
    "total_cpu_s",
    "failure",
)


def degrade(
    scenario: Scenario,
    folder: Path,
    levels: dict[str, tuple[float, ...]] | None = None,
    watch: ProgressListener | None = None,
) -> list[dict[str, Any]]:
    """Go through the levels of each factor, up to and with the first that gives no model; write degradation.csv.

    Parameters
    ----------
    scenario : Scenario
        Target, orbits, camera and reconstruction; its tank and vehicle have no part in this.
    levels : dict, optional
        Levels by factor, rising; those of `FACTORS` if not given.

    Returns
    -------
    list of dict
        One row per level that was looked at, with the keys of `COLUMNS`; null where there is no model.

    Raises
    ------
    InputError
        If a factor is unknown, levels do not rise from 0 or more, the folder holds another study, or another run
        is at it.
    """
    watch = watch or SilentProgress()
    wanted = _checked({name: factor.levels for name, factor in FACTORS.items()} if levels is None else levels)
    _claim(folder, scenario)
    with exclusive_run(folder):
        return _study(scenario, folder, wanted, watch)


def _study(
    scenario: Scenario, folder: Path, wanted: dict[str, tuple[float, ...]], watch: ProgressListener
) -> list[dict[str, Any]]:
    target = scenario.parts().target
    clean: list[Render] = []
    rows = []
    for name, steps in wanted.items():
        for level in steps:
            path = folder / name / f"{level:g}.json"
            if not path.exists() or of_the_computer(json.loads(path.read_text(encoding="utf-8"))["failure"]):
                with watch.stage(f"{name} {level:g}") as progress:
                    write_json(path, _one(scenario, target, name, level, folder / name / f"{level:g}", clean, progress))
            figures = json.loads(path.read_text(encoding="utf-8"))
            row = {"factor": name, "level": level, "unit": FACTORS[name].unit}
            rows.append({key: row.get(key, figures.get(key)) for key in COLUMNS})
            if figures["failure"] is not None:
                break
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(folder / "degradation.csv", text.getvalue())
    write_json(folder / "degradation.json", {"rows": rows})
    return rows


def _checked(levels: dict[str, tuple[float, ...]]) -> dict[str, tuple[float, ...]]:
    for name, steps in levels.items():
        if name not in FACTORS:
            raise InputError(f"factor '{name}': no such factor, allowed {', '.join(FACTORS)}")
        if not steps or any(not np.isfinite(s) or s < 0 for s in steps) or list(steps) != sorted(set(steps)):
            raise InputError(f"levels of {name}: {', '.join(f'{s:g}' for s in steps)}; must rise, from 0 or more")
    return levels


def _claim(folder: Path, scenario: Scenario) -> None:
    """Leave a fingerprint of what is studied, or check that the one in the folder is the same."""
    parts = [
        getattr(scenario, name).model_dump(mode="json") for name in ("target", "mission", "imaging", "reconstruction")
    ]
    text = json.dumps([*parts, scenario.seed], sort_keys=True)
    key = hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
    path = folder / "study.json"
    if path.exists() and json.loads(path.read_text(encoding="utf-8")).get("key") != key:
        raise InputError(f"--out {folder}: holds a study of another scenario; give another --out or remove it")
    if not path.exists():
        write_json(path, {"key": key, "target": scenario.target.kind, "seed": scenario.seed})


def _one(
    scenario: Scenario,
    target: Target,
    factor: str,
    level: float,
    folder: Path,
    clean: list[Render],
    progress: Callable[..., None],
) -> dict[str, Any]:
    """Photographs and model of one level; the photographs are removed again. `clean` is filled on the first call."""
    imaging = scenario.imaging
    camera, standoff_m = imaging.camera(), scenario.mission.standoff_m
    smear_m = level * standoff_m / camera.focal_px if factor == "blur" else 0.0
    # The same draws at every level: only the factor changes.
    rng = np.random.default_rng(scenario.seed)
    views = planned_views(target, scenario.mission, imaging.window_s, rng, smear_m)
    if not clean:
        clean += render_clean(target, views, imaging, scenario.target.seed, progress)
    if factor == "particles":
        imaging = imaging.model_copy(update={"flakes_per_m3": level})
    silt = _everywhere(level * 1e-3, scenario) if factor == "silt" and level > 0.0 else None
    shutil.rmtree(folder, ignore_errors=True)
    photos = write_photos(folder, views, clean, imaging, target, silt=silt, seed=scenario.seed, progress=progress)
    settings = scenario.reconstruction.model_copy(update={"mesh": False})
    figures = judge(photos, target, settings, folder / "model", progress)
    shutil.rmtree(folder)
    return {"factor": factor, "level": level} | figures


def _everywhere(silt_kg_m3: float, scenario: Scenario) -> ScalarGrid:
    """The same concentration in all of the tank."""
    length, width, depth = scenario.tank.size_m
    spacing_m = 0.25
    counts = [int(np.ceil(side / spacing_m)) + 1 for side in (length, width, depth)]
    origin = np.array([-length / 2, -width / 2, 0.0])
    return ScalarGrid(origin_W_m=origin, spacing_m=spacing_m, values=np.full(counts, silt_kg_m3))
