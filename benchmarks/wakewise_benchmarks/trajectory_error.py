"""Error of a camera path against the true one, paired instant by instant."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.vision.evaluation.alignment import umeyama


@dataclass(frozen=True, kw_only=True)
class TrajectoryError:
    """Absolute trajectory error (ATE) of positions, in mm, over `pairs` instants, and the scale that alignment took."""

    rmse_mm: float
    mean_mm: float
    median_mm: float
    max_mm: float
    scale: float
    pairs: int


def read_tum(path: Path) -> tuple[Array, Array]:
    """Times in s, shape (n,), and positions in m, shape (n, 3), of a file in the TUM format (t x y z qx qy qz qw).

    Raises
    ------
    InputError
        If there is no such file or a line does not hold eight numbers; the message names the line.
    """
    if not path.is_file():
        raise InputError(f"trajectory {path}: no such file")
    rows = []
    for number, line in enumerate(path.read_text("utf-8", errors="replace").splitlines(), start=1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) != 8 or not np.all(np.isfinite(values)):
            raise InputError(f"trajectory {path}, line {number}: needs eight numbers, t x y z qx qy qz qw")
        rows.append(values)
    if not rows:
        raise InputError(f"trajectory {path}: holds no poses")
    table = np.array(rows)
    return table[:, 0], table[:, 1:4]


def paired_instants(times_s: Array, other_s: Array, most_apart_s: float = 0.01) -> tuple[IntArray, IntArray]:
    """Indices of instants of two clocks, each of `times_s` with the nearest of `other_s`, at most `most_apart_s` apart.

    Both must ascend. An instant of `other_s` may serve twice, as in the usual tools.
    """
    after = np.clip(np.searchsorted(other_s, times_s), 1, len(other_s) - 1)
    nearest = np.where(times_s - other_s[after - 1] <= other_s[after] - times_s, after - 1, after)
    near = np.abs(other_s[nearest] - times_s) <= most_apart_s
    return np.flatnonzero(near), nearest[near]


def trajectory_error(
    estimate_m: Array, truth_m: Array, align: Literal["none", "rigid", "similarity"] = "rigid"
) -> TrajectoryError:
    """Absolute trajectory error after the chosen alignment (least squares over all instants).

    J. Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems, IROS 2012, doi 10.1109/IROS.2012.6385773,
    eq. 2; the similarity for paths whose scale is open, such as those of one camera.

    Parameters
    ----------
    estimate_m, truth_m : ndarray, shape (n, 3)
        Positions at the same instants.

    Raises
    ------
    InputError
        If the shapes differ or the path cannot fix the alignment.
    """
    estimate, truth = np.asarray(estimate_m, dtype=np.float64), np.asarray(truth_m, dtype=np.float64)
    if estimate.shape != truth.shape or estimate.ndim != 2 or estimate.shape[1] != 3 or len(estimate) == 0:
        raise InputError(f"trajectories: shapes {estimate.shape} and {truth.shape}, allowed is the same (n, 3), n >= 1")
    scale = 1.0
    if align != "none":
        similarity = umeyama(estimate, truth, with_scale=align == "similarity")
        estimate, scale = similarity.apply(estimate), similarity.scale
    error_mm = 1e3 * np.linalg.norm(estimate - truth, axis=1)
    return TrajectoryError(
        rmse_mm=float(np.sqrt((error_mm**2).mean())),
        mean_mm=float(error_mm.mean()),
        median_mm=float(np.median(error_mm)),
        max_mm=float(error_mm.max()),
        scale=scale,
        pairs=len(error_mm),
    )
