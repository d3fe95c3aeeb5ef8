"""How far the size of a model is from the truth's, and what is left of its error once that is taken out.

A model's scale comes from the vehicle's own estimates of where it was. Where these are off by millimetres for seconds,
the model is too large or too small, and no alignment that is honest may mend it; the figures say how much it costs.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.scene.targets import MeshDistance
from wakewise.vision.evaluation import Crop, evaluate_surface
from wakewise.vision.evaluation.alignment import umeyama
from wakewise.vision.evaluation.cloud_to_surface import MeshArrays

SIZE_FIGURES = ("scale_error_pct", "rmse_scaled_mm")
SAMPLES = 5_000
"""Samples of the true surface, which the error of the cloud hardly hangs on: they carry the alignment alone."""


def size_figures(
    cloud_W_m: Array,
    mesh: MeshArrays,
    crop: Crop,
    model_centres: Mapping[str, Array],
    true_centres: Mapping[str, Array],
    distance: MeshDistance | None = None,
) -> dict[str, float]:
    """`scale_error_pct` and `rmse_scaled_mm` of a model.

    Parameters
    ----------
    cloud_W_m : ndarray, shape (n, 3)
        The model's points in its own frame.
    mesh, crop
        The truth and what counts of it.
    model_centres, true_centres : mapping
        Where each photograph was taken from, by the model in its own frame and in truth, shape (3,).
    distance : MeshDistance, optional
        That of the mesh, where it is there already.

    Returns
    -------
    dict
        By how much the model is too large, from the spread of its camera centres; and `rmse_mm` of the model brought to
        the truth's frame and size by them.

    Raises
    ------
    InputError
        If fewer than three photographs are in both, or they were taken from one line.
    StageError
        If the model so brought does not lie about the truth.
    """
    names = sorted(model_centres.keys() & true_centres.keys())
    if len(names) < 3:
        raise InputError(f"scale: {len(names)} photographs are in model and truth, needs at least 3")
    to_truth = umeyama(np.array([model_centres[n] for n in names]), np.array([true_centres[n] for n in names]))
    score = evaluate_surface(to_truth.apply(cloud_W_m), mesh, crop=crop, samples=SAMPLES, distance=distance)
    return {"scale_error_pct": 100.0 * (1.0 / to_truth.scale - 1.0), "rmse_scaled_mm": score.rmse_mm}
