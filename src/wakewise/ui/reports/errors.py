"""How far model and truth are apart, place by place: what the pictures of the report are coloured by.

The same crop, alignment and distances as the figures of `evaluation`, kept as fields instead of summed up.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, fields

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError, StageError
from wakewise.scene.targets import MeshDistance
from wakewise.ui.reports.trial import Trial, TrialMesh
from wakewise.vision.evaluation import Crop, IcpRefinement, refine_icp, sample_surface, voxel_downsample

VOXEL_M = 0.0008
"""The cloud is thinned to one mean point per cell of this size, as the score does."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CloudErrors:
    """Distances in metres between the reconstructed cloud and the true surface, after fine alignment.

    `points_m`, shape (n, 3), and `accuracy_m`, shape (n,): points of the cloud that count, and their distance to the
    truth. `coverage_m`, shape (k,): distance of every vertex of the truth to the nearest point of the cloud, and
    `counts`, shape (k,): whether it stands clear of the bed and so counts. `samples_m`, shape (s,): the same distance
    for samples spread evenly over the surface that counts. `refinement`: the rigid ICP that was run first; None where
    it could not be. `box_m`: lowest and highest corner of what counts of the truth. `to_truth`: its distance.
    """

    points_m: Array
    accuracy_m: Array
    coverage_m: Array
    counts: BoolArray
    samples_m: Array
    refinement: IcpRefinement | None
    box_m: tuple[Array, Array]
    to_truth: MeshDistance

    @property
    def fine_aligned(self) -> bool:
        """Whether rigid ICP could be run first."""
        return self.refinement is not None

    def completeness_pct(self, within_m: float) -> float:
        """Share of the true surface that has a point of the cloud this near, in percent."""
        return 100.0 * float((self.samples_m < within_m).mean())


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelErrors(CloudErrors):
    """`CloudErrors` with the reconstructed mesh, cut and aligned likewise, and `model_accuracy_m` per vertex of it.

    Both are None where there is no mesh.
    """

    model: TrialMesh | None
    model_accuracy_m: Array | None


def cloud_errors(trial: Trial) -> CloudErrors | None:
    """Measure the cloud of a trial against its truth; None if either is missing or nowhere near the other."""
    if trial.truth is None or trial.cloud_m is None:
        return None
    truth, cloud = trial.truth, trial.cloud_m
    crop = Crop(bed_z_m=trial.bed_z_m)
    try:
        surface = sample_surface(truth, crop, np.random.default_rng(0), samples=60_000)
    except InputError:
        return None
    low, high = surface.points_m.min(axis=0), surface.points_m.max(axis=0)
    refinement = None
    with suppress(InputError, StageError):  # too little to align: shown as it came, and the report says so
        refinement = refine_icp(cloud[crop.keeps(cloud, low, high)], surface.points_m, surface.normals)
        cloud = refinement.apply(cloud)
    kept = voxel_downsample(cloud[crop.keeps(cloud, low, high)], VOXEL_M)
    if len(kept) == 0:
        return None
    near, tree = MeshDistance(truth.vertices_m, truth.faces), KDTree(kept)
    return CloudErrors(
        points_m=kept,
        accuracy_m=near(kept),
        coverage_m=np.asarray(tree.query(truth.vertices_m)[0], np.float64),
        counts=crop.above_bed(truth.vertices_m),
        samples_m=np.asarray(tree.query(surface.points_m)[0], np.float64),
        refinement=refinement,
        box_m=(low, high),
        to_truth=near,
    )


def model_errors(trial: Trial, cloud: CloudErrors | None = None) -> ModelErrors | None:
    """Measure the model of a trial against its truth; None if either is missing or nowhere near the other.

    `cloud`: what `cloud_errors` gives of this trial, if it is known already.
    """
    cloud = cloud or cloud_errors(trial)
    if cloud is None:
        return None
    model, accuracy = trial.model, None
    if model is not None:
        moved = model.vertices_m if cloud.refinement is None else cloud.refinement.apply(model.vertices_m)
        inside = Crop(bed_z_m=trial.bed_z_m).keeps(moved, *cloud.box_m)
        faces = model.faces[inside[model.faces].all(axis=1)]
        model = TrialMesh(vertices_m=moved, faces=faces) if len(faces) else None
    if model is not None:
        accuracy = cloud.to_truth(model.vertices_m)
    known = {field.name: getattr(cloud, field.name) for field in fields(CloudErrors)}
    return ModelErrors(**known, model=model, model_accuracy_m=accuracy)
