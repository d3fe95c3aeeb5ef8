"""Scale stage: sparse/ and photographs in, the same sparse/ in metres out.

The result does not depend on the units of the model, so the stage may run again on its own output.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.files import whole_folder
from wakewise.core.interfaces import Progress
from wakewise.vision.evaluation import umeyama
from wakewise.vision.reconstruction.photos.calibration import CalibrationBoard
from wakewise.vision.reconstruction.photos.photo_folder import PhotoStore
from wakewise.vision.reconstruction.scale.bars import BarMeasurement, ScaleBars, fit_scale
from wakewise.vision.reconstruction.scale.marks import Sightings, TriangulatedPoint, find_board, find_targets, place
from wakewise.vision.reconstruction.scale.position_fixes import PositionFixes, figures, place_by_fixes, why_unused
from wakewise.vision.reconstruction.sfm.colmap import pycolmap
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto, read_views

MOST_SIDE_PCT = 2.0
"""A printed square's side may differ from what was meant by this much, and three times what is unsure about it."""
LEAST_CORNERS = 6


def scale_model(
    store: PhotoStore, sparse: Path, bars: ScaleBars, threads: int, progress: Progress, keep: bool = False
) -> dict[str, Any]:
    """Scale a sparse model so that bars have their lengths; about its origin, without turning it.

    `keep`: leave the model as it is: its scale comes from elsewhere, and the bars check it. Returns scale_bars: used
    (False where the bars only check), model_off_pct (how much longer lengths of the model are than by the bars, 0 where
    they are used), uncertainty_pct, family, bars (each bar's residual), targets (photographs, error in px, sides in mm
    and middle in m of each). Raises InputError if a target is seen in fewer than two registered photographs, its size
    differs from the stated one, or bars disagree.
    """
    views = {view.name: view for view in read_views(sparse, None)[0]}
    names = sorted(views)
    measured: list[BarMeasurement] = []
    family, targets = None, {}
    if bars.bars:
        family, sightings = find_targets(store, names, bars.wanted, bars.family, threads, progress)
        found = {number: _square(views, sightings.get(number, {})) for number in bars.wanted}
        for number in bars.wanted:
            if found[number] is None:
                raise InputError(_unseen(number, family, sightings, bars))
        middles = {number: corners for number, corners in found.items() if corners is not None}
        measured = [_measured(bar.name, bar.length_m, bar.sigma_m, *(middles[end] for end in bar.ends))
                    for bar in bars.bars]  # fmt: skip
        targets = middles
    if bars.board is not None:
        measured.append(_of_board(store, names, views, bars.board, bars.board_sigma, progress))
    fit = fit_scale(measured, keep)
    target_figures = [_target_figures(number, corners, fit.scale) for number, corners in targets.items()]
    _check_sizes(target_figures, bars.tag_m, fit.uncertainty_pct)
    figures_of_bars = {
        "used": not keep,
        "model_off_pct": 100.0 * (1.0 / fit.scale - 1.0) if keep else 0.0,
        "family": family,
        **fit.figures(),
        "targets": target_figures,
    }
    if not keep:
        model = pycolmap.Reconstruction(sparse)
        model.transform(pycolmap.Sim3d(fit.scale, pycolmap.Rotation3d(np.eye(3)), np.zeros(3)))
        with whole_folder(sparse) as temporary:
            model.write_binary(temporary)
    progress(1, 1, "scale")
    return {"scale_bars": figures_of_bars}


def place_model(sparse: Path, fixes: PositionFixes, keep: bool = False) -> dict[str, Any]:
    """Align a sparse model with the fixes of its cameras, in m, third axis down.

    `keep`: leave the model as it is: its scale comes from elsewhere, and the fixes check it. Returns scale_fixes: used,
    why (not), photos, uncertainty_pct (None where the scale is open), model_off_pct (how much longer lengths
    of the model are than by the fixes; None where these give the scale), horizontal_rms_m and depth_rms_m (of what is
    left), far (photos whose fix does not fit), north_known, origin_deg (latitude and longitude of the frame's origin).
    Raises InputError if too few registered photos have a fix.
    """
    model = pycolmap.Reconstruction(sparse)
    centres = {image.name: np.asarray(image.projection_center()) for image in model.images.values() if image.has_pose}
    placed = place_by_fixes(centres, fixes)
    used = not keep and why_unused(placed) is None
    if used:
        model.transform(pycolmap.Sim3d(placed.scale, pycolmap.Rotation3d(placed.R), placed.t))
        with whole_folder(sparse) as temporary:
            model.write_binary(temporary)
    return {"scale_fixes": figures(placed, fixes, used, keep)}


def _target_figures(number: int, corners: list[TriangulatedPoint], scale: float) -> dict[str, Any]:
    """A target's figures."""
    sigma = float(np.sqrt(np.mean([np.trace(corner.covariance) / 3.0 for corner in corners])))
    return {
        "target": number,
        "photos": min(len(corner.photos) for corner in corners),
        "error_px": float(np.sqrt(np.mean([corner.error_px**2 for corner in corners]))),
        "sides_mm": [1e3 * scale * float(side) for side in _sides(corners)],
        "corner_sigma_mm": 1e3 * scale * sigma,
        "middle_m": (scale * _middle(corners)).tolist(),
    }


def _square(views: Mapping[str, RegisteredPhoto], seen: Mapping[str, Array]) -> list[TriangulatedPoint] | None:
    """The four corners of a target in the model; None where one cannot be placed."""
    corners = [place(views, {name: four[k] for name, four in seen.items()}) for k in range(4)]
    known = [corner for corner in corners if corner is not None]
    return known if len(known) == 4 else None


def _middle(corners: list[TriangulatedPoint]) -> Array:
    return np.asarray(np.mean([corner.point_W for corner in corners], axis=0))


def _sides(corners: list[TriangulatedPoint]) -> Array:
    """Lengths of a target's four sides."""
    points = np.array([corner.point_W for corner in corners])
    return np.asarray(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1))


def _measured(
    name: str, length_m: float, sigma_m: float, one: list[TriangulatedPoint], two: list[TriangulatedPoint]
) -> BarMeasurement:
    way = _middle(two) - _middle(one)
    found = float(np.linalg.norm(way))
    # A pose error moves all four corners alike, so the middle has the uncertainty of a corner.
    spread = np.mean([corner.covariance for corner in one], axis=0) + np.mean([c.covariance for c in two], axis=0)
    sigma = float(np.sqrt(way @ spread @ way)) / found
    photos = min(len(corner.photos) for corner in (*one, *two))
    return BarMeasurement(name=name, length_m=length_m, sigma_m=sigma_m, found=found, found_sigma=sigma, photos=photos)


def _of_board(
    store: PhotoStore,
    names: list[str],
    views: Mapping[str, RegisteredPhoto],
    board: CalibrationBoard,
    sigma: float,
    progress: Progress,
) -> BarMeasurement:
    """A board as one bar: its corners' rms distance from their middle, on it and in the model."""
    wanted, seen = find_board(store, names, board, progress)
    placed = {number: place(views, {name: at[0] for name, at in by.items()}) for number, by in seen.items()}
    known = {number: at for number, at in placed.items() if at is not None}
    if len(known) < LEAST_CORNERS:
        raise InputError(
            f"board of {board.columns} x {board.rows}: {len(known)} of its corners are seen by two or more "
            f"registered photos, at least {LEAST_CORNERS} must be; are its squares counted right?"
        )
    flat = np.array([wanted[number] for number in known])
    points = np.array([at.point_W for at in known.values()])
    similarity = umeyama(points, flat)
    error = np.linalg.norm(similarity.apply(points) - flat, axis=1)
    length = float(np.sqrt(((flat - flat.mean(axis=0)) ** 2).sum(axis=1).mean()))
    # The rms misfit over the corners that average it out.
    misfit = float(np.sqrt((error**2).mean() / len(known))) / similarity.scale
    return BarMeasurement(
        name="board",
        length_m=length,
        sigma_m=sigma * length,
        found=length / similarity.scale,
        found_sigma=misfit,
        photos=min(len(at.photos) for at in known.values()),
    )


def _unseen(number: int, family: str, sightings: Sightings, bars: ScaleBars) -> str:
    """Why a target has no place, in a line."""
    name = next(bar.name for bar in bars.bars if number in bar.ends)
    photos = sorted(sightings.get(number, {}))
    others = ", ".join(str(other) for other in sorted(sightings)[:12]) or "none"
    if not photos:
        return f"bar {name}: target {number} of {family} is seen in no registered photo; seen are {others}"
    if len(photos) == 1:
        return f"bar {name}: target {number} is seen in one photo only ({photos[0]}), two or more are needed"
    return (
        f"bar {name}: the {len(photos)} photos that show target {number} ({photos[0]} ...) do not agree where it is, "
        "or look at it from one place; a target that moved or is there twice cannot end a bar"
    )


def _check_sizes(target_figures: list[dict[str, Any]], tag_m: float | None, uncertainty_pct: float) -> None:
    """Refuse targets whose size differs from the stated one, or that are not square.

    Raises InputError: names the first and what its sides are.
    """
    for one in target_figures:
        sides = np.array(one["sides_mm"])
        across, down = sides[[0, 2]].mean(), sides[[1, 3]].mean()
        allowed = MOST_SIDE_PCT + 3.0 * (uncertainty_pct + 100.0 * one["corner_sigma_mm"] / float(sides.mean()))
        if tag_m is not None:
            off = 100.0 * (sides.mean() / (1e3 * tag_m) - 1.0)
            if abs(off) > allowed:
                raise InputError(
                    f"target {one['target']}: its sides are {sides.mean():.1f} mm by the bars, {1e3 * tag_m:g} mm were "
                    f"said ({off:+.1f} %); it was printed at another size, or the bars' lengths are wrong"
                )
        stretch = 100.0 * (across / down - 1.0)
        if abs(stretch) > 2.0 * allowed:
            raise InputError(
                f"target {one['target']}: is {across:.1f} x {down:.1f} mm, no square; it was printed stretched, or is "
                "bent"
            )
