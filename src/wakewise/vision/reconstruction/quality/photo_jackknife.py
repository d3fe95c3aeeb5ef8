"""Spread of a surface by leaving out groups of photographs: the delete-a-group jackknife.

P. S. Kott, The delete-a-group jackknife, Journal of Official Statistics 17(4), 2001; J. Shao and D. Tu, The Jackknife
and Bootstrap, Springer 1995, doi 10.1007/978-1-4612-0795-5. Without a group of neighbouring photographs cameras, lens
and sparse points are adjusted again; the way that the points go moves the surface with them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree
from scipy.stats import t as student

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.core.interfaces import Progress, no_progress
from wakewise.scene.targets import Mesh
from wakewise.vision.evaluation import umeyama
from wakewise.vision.evaluation.bed_and_colony import BedFit
from wakewise.vision.evaluation.measurement import (
    DEFINITIONS,
    MOST_UNSEEN_PCT,
    ColonySize,
    MeasuringRule,
    measure,
    measuring_warnings,
    unseen_pct,
)
from wakewise.vision.reconstruction.quality.finished_models import FinishedModel
from wakewise.vision.reconstruction.sfm.colmap import bundle_adjustment, pycolmap, silence_logging

GROUPS, LEAST_GROUPS, LEAST_PHOTOS, LEAST_POINTS = 10, 4, 8, 100
NEIGHBOURS = 8
"""Sparse points whose mean way moves a place on the surface."""
ITERATIONS, FAR = 30, 4.0


def photo_groups(names: list[str], groups: int = GROUPS) -> list[list[str]]:
    """Groups of neighbours in order of name, of about the same size, with two photographs or more in each."""
    count = min(groups, len(names) // 2)
    return [list(part) for part in np.array_split(np.array(sorted(names)), count)]


def jackknife_vertices(
    sparse: Path, vertices_m: Array, unit_m: float, *, fixed: bool, progress: Progress = no_progress
) -> Iterator[Array]:
    """Vertices, shape (n, 3), m, of the surface without each group of photographs in turn.

    `sparse`: cameras and tracks, a unit of which is `unit_m`. `fixed`: cameras are known and stay, so that only points
    are found again. Raises InputError if there are too few photographs or points.
    """
    silence_logging()
    whole = pycolmap.Reconstruction(sparse)
    names = sorted(image.name for image in whole.images.values() if image.has_pose)
    if len(names) < LEAST_PHOTOS or whole.num_points3D() < LEAST_POINTS:
        raise InputError(
            f"{len(names)} photographs with {whole.num_points3D()} points, re-drawing needs {LEAST_PHOTOS} with "
            f"{LEAST_POINTS} or more"
        )
    places = {number: np.asarray(point.xyz) for number, point in whole.points3D.items()}
    centres = {i.name: np.asarray(i.projection_center()) for i in whole.images.values() if i.has_pose}
    parts = photo_groups(names)
    for k, left_out in enumerate(parts):
        progress(k, len(parts), "photographs re-drawn")
        try:
            at, way = _without(sparse, set(left_out), places, centres, fixed)
        except StageError:
            continue
        nearest = np.asarray(KDTree(unit_m * at).query(vertices_m, k=min(NEIGHBOURS, len(at)), workers=1)[1])
        yield vertices_m + unit_m * way[nearest].mean(axis=1)
    progress(len(parts), len(parts), "photographs re-drawn")


def _without(
    sparse: Path, left_out: set[str], places: dict[int, Array], centres: dict[str, Array], fixed: bool
) -> tuple[Array, Array]:
    """Sparse points and the way each goes when photographs are left out, both of shape (n, 3), in units of the model.

    Raises StageError if too little is left.
    """
    model = pycolmap.Reconstruction(sparse)
    manager = pycolmap.ObservationManager(model)
    for image in list(model.images.values()):
        if image.has_pose and image.name in left_out:
            manager.deregister_frame(image.frame_id)
    if fixed:
        options = pycolmap.BundleAdjustmentOptions()
        options.print_summary = False
        options.refine_focal_length = options.refine_extra_params = False
        options.refine_rig_from_world = options.refine_sensor_from_rig = False
        pycolmap.bundle_adjustment(model, options)
    else:
        bundle_adjustment(model, refine_intrinsics=True, threads=1, iterations=ITERATIONS)
    kept = sorted(set(places) & set(model.points3D))
    mine = {i.name: np.asarray(i.projection_center()) for i in model.images.values() if i.has_pose}
    both = sorted(set(mine) & set(centres))
    if len(kept) < LEAST_POINTS or len(both) < 3:
        raise StageError("re-drawn photographs: too little of the model is left")
    old, new = np.array([places[k] for k in kept]), np.array([model.points3D[k].xyz for k in kept])
    if not fixed:
        back = umeyama(np.array([mine[name] for name in both]), np.array([centres[name] for name in both]))
        new = back.apply(new)
    way = new - old
    size = np.linalg.norm(way, axis=1)
    near = size <= FAR * max(float(np.median(size)), 1e-12) + 1e-12
    return old[near], way[near]


@dataclass(frozen=True, kw_only=True)
class FigureInterval:
    """A figure with its 95 % interval, None where there is none, and the standard deviations that it is made of."""

    value: float
    low: float | None
    high: float | None
    photos_sigma: float | None
    surface_sigma: float | None
    scale_sigma: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredModel:
    """Figures of `measurement.DEFINITIONS` with intervals; `why` there are none; the bed; groups of photographs left
    out in turn; the surface that counted; warnings in lines.
    """

    intervals: dict[str, FigureInterval]
    why: str | None
    groups: int
    bed: BedFit
    surface: Mesh
    warnings: tuple[str, ...] = ()


def measure_model(
    model: FinishedModel, rule: MeasuringRule, rng: np.random.Generator, progress: Progress = no_progress
) -> MeasuredModel:
    """Size of a colony or box of a model with 95 % intervals (Student's t, a degree of freedom less than groups).

    Their variance is the sum of that of re-drawn photographs (jackknife), of the surface's noise at the two ends of a
    length, and of the scale, as far as the model states it. Raises InputError as `measure`.
    """
    state = rng.bit_generator.state

    def again(mesh: Mesh) -> tuple[ColonySize, BedFit, Mesh]:
        rng.bit_generator.state = state  # the same draws, so that only the photographs differ
        return measure(mesh, rule, rng)

    size, bed, surface = again(model.mesh)
    drawn: list[dict[str, float]] = []
    why = "a bare mesh has no photographs to draw again" if model.sparse is None else None
    if model.sparse is not None:
        moved = jackknife_vertices(
            model.sparse, model.mesh.vertices_m, model.unit_m, fixed=model.fixed, progress=progress
        )
        try:
            for vertices in moved:
                with suppress(InputError):
                    drawn.append(again(Mesh(vertices, model.mesh.faces))[0].values())
        except InputError as fault:
            why = str(fault)
        if why is None and len(drawn) < LEAST_GROUPS:
            why = f"{len(drawn)} groups of photographs can be left out, {LEAST_GROUPS} or more must"
    intervals = {
        key: _interval(key, value, drawn if why is None else [], model) for key, value in size.values().items()
    }
    warnings = measuring_warnings(model.mesh, rule, size, bed)
    unseen = 0.0 if model.dense_m is None else unseen_pct(surface, model.dense_m)
    if unseen > MOST_UNSEEN_PCT:
        warnings.append(
            f"{unseen:.0f} % of the surface has no dense points near it, it was filled in (gaps between branches, "
            "sides that no photograph shows): the volume is that of an envelope, areas are too small"
        )
    return MeasuredModel(
        intervals=intervals, why=why, groups=len(drawn), bed=bed, surface=surface, warnings=tuple(warnings)
    )


def _interval(key: str, value: float, drawn: list[dict[str, float]], model: FinishedModel) -> FigureInterval:
    power = DEFINITIONS[key][1]
    scale = None if model.scale_sigma_pct is None else 0.01 * power * model.scale_sigma_pct * abs(value)
    if not drawn:
        return FigureInterval(
            value=value, low=None, high=None, photos_sigma=None, surface_sigma=None, scale_sigma=scale
        )
    photos = jackknife_sigma(np.array([one[key] for one in drawn]))
    # A length has two ends, a height one: the bed is a mean over many places.
    ends = {"length_mm": 2, "width_mm": 2, "extent_mm": 2, "height_mm": 1}.get(key, 0)
    surface = 1e3 * float(np.sqrt(ends)) * (model.noise_m or 0.0)
    half = float(student.ppf(0.975, len(drawn) - 1) * np.sqrt(photos**2 + surface**2 + (scale or 0.0) ** 2))
    return FigureInterval(
        value=value,
        low=value - half,
        high=value + half,
        photos_sigma=photos,
        surface_sigma=surface,
        scale_sigma=scale,
    )


def jackknife_sigma(values: Array) -> float:
    """Standard deviation of a figure from its values without each of k groups, shape (k,)."""
    return float(np.sqrt((len(values) - 1) / len(values) * ((values - values.mean()) ** 2).sum()))
