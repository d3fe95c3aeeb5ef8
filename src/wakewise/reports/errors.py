"""How far model and truth are apart, place by place: what the pictures of the report are coloured by.

The same crop, alignment and distances as the figures of `evaluation`, kept as fields instead of summed up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from wakewise.arrays import Array, BoolArray
from wakewise.errors import InputError, StageError
from wakewise.evaluation import Crop, refine_icp, sample_surface, thin
from wakewise.reports.trial import Surface, Trial
from wakewise.targets import MeshDistance

VOXEL_M = 0.0008
"""The cloud is thinned to one mean point per cell of this size, as the score does."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelErrors:
    """Distances in metres between the reconstructed model and the true surface, after fine alignment.

    `points_m`, shape (n, 3), and `accuracy_m`, shape (n,): points of the cloud that count, and their distance to the
    truth. `model`: the reconstructed mesh, cut and aligned likewise, with `model_accuracy_m` per vertex; None without
    one. `coverage_m`, shape (k,): distance of every vertex of the truth to the nearest point of the cloud, and
    `counts`, shape (k,): whether it stands clear of the bed and so counts. `samples_m`, shape (s,): the same distance
    for samples spread evenly over the surface that counts. `fine_aligned`: whether rigid ICP could be run first.
    """

    points_m: Array
    accuracy_m: Array
    model: Surface | None
    model_accuracy_m: Array | None
    coverage_m: Array
    counts: BoolArray
    samples_m: Array
    fine_aligned: bool

    def completeness_pct(self, within_m: float) -> float:
        """Share of the true surface that has a point of the cloud this near, in percent."""
        return 100.0 * float((self.samples_m < within_m).mean())


def model_errors(trial: Trial) -> ModelErrors | None:
    """Measure the model of a trial against its truth; None if either is missing or nowhere near the other."""
    if trial.truth is None or trial.cloud_m is None:
        return None
    truth = trial.truth
    crop = Crop(bed_z_m=trial.bed_z_m)
    try:
        surface = sample_surface(truth, crop, np.random.default_rng(0), samples=60_000)
    except InputError:
        return None
    low, high = surface.points_m.min(axis=0), surface.points_m.max(axis=0)
    cloud = trial.cloud_m
    model = trial.model
    fine_aligned = False
    try:
        refinement = refine_icp(cloud[crop.keeps(cloud, low, high)], surface.points_m, surface.normals)
        cloud = refinement.apply(cloud)
        if model is not None:
            model = Surface(vertices_m=refinement.apply(model.vertices_m), faces=model.faces)
        fine_aligned = True
    except (InputError, StageError):
        pass  # too little to align: shown as it came, and the report says so
    kept = thin(cloud[crop.keeps(cloud, low, high)], VOXEL_M)
    if len(kept) == 0:
        return None
    near, tree = MeshDistance(truth.vertices_m, truth.faces), KDTree(kept)
    if model is not None:
        inside = crop.keeps(model.vertices_m, low, high)
        faces = model.faces[inside[model.faces].all(axis=1)]
        model = Surface(vertices_m=model.vertices_m, faces=faces) if len(faces) else None
    return ModelErrors(
        points_m=kept,
        accuracy_m=near(kept),
        model=model,
        model_accuracy_m=None if model is None else near(model.vertices_m),
        coverage_m=np.asarray(tree.query(truth.vertices_m)[0], np.float64),
        counts=crop.above_bed(truth.vertices_m),
        samples_m=np.asarray(tree.query(surface.points_m)[0], np.float64),
        fine_aligned=fine_aligned,
    )
