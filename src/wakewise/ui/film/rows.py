"""Methods in rows, times in columns: what the camera saw at 0, 5 and 10 s and what the water did, in one picture.

The pictures are taken as the trial's own photographs are, from the true pose of that instant and through the silt of
then, so that both methods are seen at the same times whatever their photographs' times are. Between two photographs
the silt is interpolated in time.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageDraw

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import no_progress
from wakewise.operation import Scenario, read_exposures, read_scenario
from wakewise.ui.film.external_view import FOV_RAD
from wakewise.ui.film.layout import INK, MUTED, PAPER, fill_frame, paste, write
from wakewise.ui.film.make import silt_at, view_of_flight
from wakewise.ui.film.wash import RecordedMotion, wash_of
from wakewise.ui.reports.text import number
from wakewise.ui.reports.trial import Trial, read_trial
from wakewise.vision.imaging import PinholeCamera, photograph

TIMES_S = (0.0, 5.0, 10.0)
CELL = (480, 360)
_GAP, _LEFT, _TOP, _NAME, _NOTE = 12, 20, 76, 46, 26


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparisonTile:
    """One method at one time: RGB pictures by the camera and from outside, and a line of figures."""

    camera: NDArray[np.uint8]
    outside: NDArray[np.uint8]
    note: str


def compared_trials(folder: Path) -> dict[str, Path]:
    """Folders of the trials that `wakewise compare` left, by method, in its order.

    Raises InputError if there is none.
    """
    if not folder.is_dir():
        raise InputError(f"--rows {folder}: no such folder, one that wakewise compare wrote is needed")
    found = {path.name: path for path in sorted(folder.iterdir()) if (path / "steps.parquet").is_file()}
    listed = folder / "comparison.json"
    if listed.is_file():
        order = list(json.loads(listed.read_text(encoding="utf-8")).get("methods", {}))
        found = {name: found[name] for name in order if name in found}
    if not found:
        raise InputError(f"--rows {folder}: holds no finished trials, one that wakewise compare wrote is needed")
    return found


def write_rows(
    folder: Path, out: Path, *, times_s: Sequence[float] = TIMES_S, progress: Callable[..., None] = no_progress
) -> Path:
    """Write the picture of a comparison, and give its path.

    `folder`: what `wakewise compare` left: a trial folder for each method. `out`: ends in .png, .jpg or .webp.
    `times_s`: counted from each trial's first photograph.

    Raises InputError if the folder holds no finished trials, or a time lies after a flight's end.
    """
    if out.suffix.lower() not in (".png", ".jpg", ".jpeg", ".webp"):
        raise InputError(f"--out {out}: ends in '{out.suffix}', allowed for rows are .png, .jpg, .webp")
    trials = compared_trials(folder)
    cells = {}
    for k, (name, path) in enumerate(trials.items()):
        progress(k, len(trials), name)
        cells[name] = cells_of(path, times_s)
    picture = rows_picture(cells, times_s)
    with whole_file(out) as temporary:
        Pictures.fromarray(picture).save(temporary, quality=92)
    progress(len(trials), len(trials), "")
    return out


def cells_of(folder: Path, times_s: Sequence[float]) -> list[ComparisonTile]:
    """Pictures of one trial at times counted from its first photograph."""
    trial: Trial = read_trial(folder)
    scenario: Scenario = read_scenario(folder / "scenario.yaml")
    if trial.steps is None or not trial.photographs:
        raise InputError(f"{folder}: no flight with photographs, a finished trial is needed")
    motion = RecordedMotion.of(trial.steps)
    first_s = min(shot.time_s for shot in trial.photographs)
    instants = np.array([first_s + t for t in times_s])
    if instants.max() > motion.time_s[-1]:
        left = motion.time_s[-1] - first_s
        raise InputError(f"--at: {max(times_s):g} s, {folder.name} flew for {left:.0f} s after its first photograph")
    parts = scenario.parts()
    exposures = read_exposures(folder / "exposures.npz")
    order = np.argsort(instants, kind="stable")
    kept = folder / ".rows.npz"
    tracers = wash_of(scenario, folder / "steps.parquet", instants[order], kept)
    kept.unlink(missing_ok=True)
    wash = {int(k): one for k, one in zip(order, tracers, strict=True)}
    flown = motion.p_W_m[motion.row(first_s) : motion.row(float(instants.max()) + 5.0)]
    far = PinholeCamera(*CELL, FOV_RAD)
    outside = view_of_flight(parts, far, flown)
    speed, turbidity = trial.column("target_speed_mean_m_s"), trial.column("turbidity_per_m")
    tilt_deg = trial.column("true_tilt_deg")  # none in trials that were flown before cameras had a joint
    out = []
    for k, time_s in enumerate(instants):
        row = motion.row(float(time_s))
        X_WB, silt = Pose(motion.p_W_m[row], motion.q_WB[row]), silt_at(exposures, float(time_s))
        rng = np.random.default_rng([scenario.seed, k])
        X_WC = X_WB @ parts.vehicle.X_BC_at(0.0 if tilt_deg is None else math.radians(float(tilt_deg[row])))
        photo = photograph(parts.scene, parts.camera, [X_WC], silt, scenario.imaging, rng, parts.grains)
        facts = [] if photo.sharpness is None else [f"sharpness {number(photo.sharpness)}"]
        facts += [] if turbidity is None else [f"silt {number(float(turbidity[row]), 2)} /m"]
        facts += [] if speed is None else [f"water {1e3 * float(speed[row]):.1f} mm/s"]
        seen, _ = outside.picture(X_WB, silt, wash[k])
        out.append(ComparisonTile(camera=fill_frame(photo.image, *CELL), outside=seen, note="   ".join(facts)))
    return out


def rows_picture(cells: dict[str, list[ComparisonTile]], times_s: Sequence[float]) -> NDArray[np.uint8]:
    """All cells on one page, shape (h, w, 3), RGB: for each method a row by the camera and a row from outside."""
    width, height = CELL
    columns = len(times_s)
    row_height = _NAME + 2 * height + _GAP + _NOTE
    page = Pictures.new("RGB", (2 * _LEFT + columns * (width + _GAP) - _GAP, _TOP + len(cells) * row_height + 4), PAPER)
    draw = ImageDraw.Draw(page)
    for c, time_s in enumerate(times_s):
        x = _LEFT + c * (width + _GAP)
        write(draw, (x, 50), f"t = {time_s:g} s", 24, bold=True)
        if c == 0:
            write(draw, (x + 130, 50), "after the first photograph", 15, MUTED)
    for r, (name, row) in enumerate(cells.items()):
        top = _TOP + r * row_height
        draw.line((_LEFT, top + 2, page.width - _LEFT, top + 2), fill=MUTED)
        write(draw, (_LEFT, top + 32), name, 20, INK, bold=True)
        for c, cell in enumerate(row):
            x = _LEFT + c * (width + _GAP)
            for picture, y in ((cell.camera, top + _NAME), (cell.outside, top + _NAME + height + _GAP)):
                paste(page, picture, (x, y, x + width, y + height), 6)
            write(draw, (x, top + _NAME + 2 * height + _GAP + 18), cell.note, 14, MUTED)
    return np.asarray(page)
