"""What the coverage guide would have said of a trial's photographs before leaving, held against the model made of them.

The guide gets what a pilot's would: the target as it was surveyed, the poses as the vehicle estimated them and how
sharp each photograph is. The truth enters only where the two are compared, patch by patch.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.operation import Parts, read_scenario
from wakewise.operation.finding import MISSED_RGB, SEEN_RGB, SURFACE_FILE
from wakewise.scene.missions import Coverage, patches_of
from wakewise.scene.missions.coverage import HALF
from wakewise.scene.missions.point_surface import SAMPLES
from wakewise.scene.missions.visibility import NORMAL_SHARE, REACH_M, SEED, CameraIntrinsics, clustered
from wakewise.scene.targets import Target
from wakewise.vision.evaluation import Crop, compare_surface, sample_surface, umeyama
from wakewise.vision.reconstruction import read_cloud

MAPPED_M = 0.01
"""Mapped points farther off the true surface say nothing of it."""
FROM_MODEL = ("coverage_agreement_pct", "coverage_trivial_pct")
"""Figures of the guide that need a model to be held against."""
Shot = tuple[Pose, float | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class CoverageAgreement:
    """Patches as the guide saw them and as the model has them.

    `complete_share`, shape (patches,), is the share of each patch's true surface within 3 mm of the model, -1 where no
    sample of the truth fell on it; `complete` and `well` say which patches are complete, and seen well, over more than
    half of their area. `predicted_pct` and `completeness_pct` are by area: what the guide expects, and what came of it.
    """

    complete_share: Array
    complete: BoolArray
    well: BoolArray
    predicted_pct: float
    completeness_pct: float

    def __post_init__(self) -> None:
        freeze(self, complete_share=(None,))

    @property
    def agreement_pct(self) -> float:
        """Share of the patches of which both say the same."""
        judged = self.complete_share >= 0.0
        return 100.0 * float((self.complete == self.well)[judged].mean())

    @property
    def trivial_pct(self) -> float:
        """The same of the better of two guesses that need no guide: all is complete, or nothing is."""
        share = float(self.complete[self.complete_share >= 0.0].mean())
        return 100.0 * max(share, 1.0 - share)


def shots_of(photos: pl.DataFrame) -> list[Shot]:
    """Estimated camera pose and sharpness of each row of images.csv."""
    places = photos.select("est_x_m", "est_y_m", "est_z_m").to_numpy()
    turns = photos.select("est_qw", "est_qx", "est_qy", "est_qz").to_numpy()
    return [(Pose(p, q), sharp) for p, q, sharp in zip(places, turns, photos["sharpness"].to_list(), strict=True)]


def coverage_of(
    target: Target, lens: CameraIntrinsics, shots: Iterable[Shot], spent_ms: list[float] | None = None
) -> Coverage:
    """The guide after a flight's photographs, in their order.

    `target` is as it was found; `shots` are the estimated X_WC of each photograph and its sharpness, None where that is
    not known; `spent_ms` takes the thread CPU time of each photograph.
    """
    coverage = Coverage.begin(patches_of(target.mesh, target.bed_z_m))
    for X_WC, sharpness in shots:
        began = time.thread_time()
        coverage = coverage.seen(X_WC, lens, sharpness)
        _ = coverage.share, coverage.score
        if spent_ms is not None:
            spent_ms.append(1e3 * (time.thread_time() - began))
    return coverage


def agreement_with(coverage: Coverage, parts: Parts, cloud_W_m: Array) -> CoverageAgreement:
    """Patch by patch, what the guide saw well and what of the truth a model has within 3 mm.

    `coverage` is of patches of `parts.surveyed_target`; `cloud_W_m`, shape (n, 3), are the model's points in the
    truth's frame, as `compare_surface` leaves them.
    """
    patches, target = coverage.patches, parts.target
    truth = sample_surface(target.mesh, Crop(bed_z_m=target.bed_z_m), np.random.default_rng(0))
    there = np.asarray(KDTree(cloud_W_m).query(truth.points_m)[0]) < REACH_M
    # The estimated surface laid on the true one, so that what is compared is the same piece of it.
    shift = parts.surveyed_target.centre_W_m - target.centre_W_m
    facing = NORMAL_SHARE * target.radius_m
    own = np.concatenate([patches.points_W_m - shift, facing * patches.normals], axis=1)
    asked = np.concatenate([truth.points_m, facing * truth.normals], axis=1)
    patch = patches.patch[np.asarray(KDTree(own).query(asked)[1])]
    held = np.bincount(patch, minlength=patches.count)
    share = np.where(held > 0, np.bincount(patch, there, patches.count) / np.maximum(held, 1), -1.0)
    return CoverageAgreement(
        complete_share=share,
        complete=share > HALF,
        well=coverage.well,
        predicted_pct=100.0 * coverage.share,
        completeness_pct=100.0 * float(there.mean()),
    )


def coverage_figures(parts: Parts, photos: pl.DataFrame, cloud_W_m: Array | None) -> dict[str, float]:
    """What the guide expects of the model, and where there is one, in the truth's frame, how far the two agree."""
    coverage = coverage_of(parts.surveyed_target, parts.camera, shots_of(photos))
    figures = {"coverage_predicted_pct": 100.0 * coverage.share, "coverage_sure_pct": 100.0 * coverage.sure}
    if cloud_W_m is None:
        return figures
    both = agreement_with(coverage, parts, cloud_W_m)
    return figures | dict(zip(FROM_MODEL, (both.agreement_pct, both.trivial_pct), strict=True))


def mapped_figures(parts: Parts, folder: Path, photos: pl.DataFrame, cloud_W_m: Array | None) -> dict[str, float]:
    """The same figures where the guide had no mesh but the surface that was mapped in flight.

    Mapped points are brought to the truth's frame by the camera's estimated and true places at the photographs.
    """
    mapped = read_cloud(folder / SURFACE_FILE)
    well = mapped.colours[:, 1] < np.mean((SEEN_RGB[1], MISSED_RGB[1]))
    figures = {"coverage_predicted_pct": 100.0 * float(well.mean())}
    if cloud_W_m is None:
        return figures
    believed = photos.select("est_x_m", "est_y_m", "est_z_m").to_numpy()
    true = photos.select("true_x_m", "true_y_m", "true_z_m").to_numpy()
    places = umeyama(believed, true, with_scale=False).apply(mapped.points_m)
    truth = sample_surface(parts.target.mesh, Crop(bed_z_m=parts.target.bed_z_m), np.random.default_rng(0))
    away, nearest = KDTree(truth.points_m).query(places)
    there = (np.asarray(KDTree(cloud_W_m).query(truth.points_m)[0]) < REACH_M)[nearest]
    patch = clustered(places, mapped.normals, max(1, len(places) // SAMPLES), np.random.default_rng(SEED))
    judged, count = np.asarray(away) < MAPPED_M, int(patch.max()) + 1
    held = np.bincount(patch[judged], minlength=count)
    share, said = (
        np.where(held > 0, np.bincount(patch[judged], which[judged], count) / np.maximum(held, 1), -1.0)
        for which in (there, well)
    )
    both = CoverageAgreement(
        complete_share=share,
        complete=share > HALF,
        well=said > HALF,
        predicted_pct=figures["coverage_predicted_pct"],
        completeness_pct=100.0 * float(there[judged].mean()),
    )
    return figures | dict(zip(FROM_MODEL, (both.agreement_pct, both.trivial_pct), strict=True))


def measure_coverage(folder: Path) -> dict[str, Any]:
    """The guide on a finished trial, for benches: what it said, what came of it, what a photograph cost it.

    Returns coverage_predicted_pct, coverage_sure_pct, completeness_pct, coverage_agreement_pct, coverage_trivial_pct
    (agreement of the better of "all" and "nothing"), coverage_ms_per_photo (thread CPU, median; the first photograph,
    which loads kernels, left out), coverage_ms_per_photo_max, photos, blurred. Raises InputError if the folder is not
    one of a trial with a model.
    """
    for name in ("scenario.yaml", "images.csv", "dense.ply"):
        if not (folder / name).is_file():
            raise InputError(f"{folder}: has no {name}, a trial with a model is needed")
    parts = read_scenario(folder / "scenario.yaml").parts()
    photos = pl.read_csv(folder / "images.csv")
    spent_ms: list[float] = []
    coverage = coverage_of(parts.surveyed_target, parts.camera, shots_of(photos), spent_ms)
    crop = Crop(bed_z_m=parts.target.bed_z_m)
    compared = compare_surface(read_cloud(folder / "dense.ply").points_m, parts.target.mesh, crop=crop)
    both = agreement_with(coverage, parts, compared.points_W_m)
    return {
        "coverage_predicted_pct": both.predicted_pct,
        "coverage_sure_pct": 100.0 * coverage.sure,
        "completeness_pct": both.completeness_pct,
        "coverage_agreement_pct": both.agreement_pct,
        "coverage_trivial_pct": both.trivial_pct,
        **_costs(spent_ms),
        "photos": coverage.photos,
        "blurred": coverage.blurred,
    }


def _costs(spent_ms: list[float]) -> dict[str, float]:
    later_ms = spent_ms[1:] or spent_ms
    return {"coverage_ms_per_photo": float(np.median(later_ms)), "coverage_ms_per_photo_max": float(np.max(later_ms))}
