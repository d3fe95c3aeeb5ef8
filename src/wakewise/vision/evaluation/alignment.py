"""Alignment of a model with the reference: similarity of paired points (Umeyama, robust), rigid point-to-plane ICP."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.core.optional_dependencies import need

# Median and 99.9th percentile of the length of a 3D normal vector, in standard deviations (chi, 3 degrees of freedom).
_CHI3_MEDIAN, _CHI3_999 = 1.538, 4.033


@dataclass(frozen=True, kw_only=True, eq=False)
class Similarity:
    """x_A = scale * R_AB x_B + t_A: takes points of frame B into frame A, changing their scale."""

    scale: float
    R_AB: Array
    t_A_m: Array

    def __post_init__(self) -> None:
        freeze(self, R_AB=(3, 3), t_A_m=(3,))

    def apply(self, points_B: Array) -> Array:
        """Points of B, shape (n, 3), in A."""
        return self.scale * np.asarray(points_B) @ self.R_AB.T + self.t_A_m


def umeyama(points_B: Array, points_A: Array, with_scale: bool = True) -> Similarity:
    """Similarity (or rigid motion) that brings points_B onto points_A with the least squared error.

    Source: S. Umeyama, Least-squares estimation of transformation parameters between two point patterns,
    IEEE TPAMI 13(4), 1991, doi 10.1109/34.88573, eqs. 38-42.

    `points_B`, `points_A` have shape (n, 3), n >= 3. Raises InputError if the shapes differ, there are fewer than 3
    pairs, or the points lie on one line (the turn about it is open).
    """
    B, A = np.asarray(points_B, dtype=np.float64), np.asarray(points_A, dtype=np.float64)
    if B.shape != A.shape or B.ndim != 2 or B.shape[1] != 3 or len(B) < 3:
        raise InputError(f"points to align: shapes {B.shape} and {A.shape}, allowed is the same (n, 3) with n >= 3")
    mean_B, mean_A = B.mean(axis=0), A.mean(axis=0)
    X, Y = B - mean_B, A - mean_A
    for name, Z in (("first", X), ("second", Y)):
        spread = np.linalg.svd(Z, compute_uv=False)
        if spread[1] <= 1e-9 * max(spread[0], 1e-300):
            raise InputError(f"points to align: the {name} set lies on one line or in one place, it must span a plane")
    U, S, Vt = np.linalg.svd(Y.T @ X / len(B))
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    R = (U * signs) @ Vt
    scale = float((S * signs).sum() / (X**2).sum(axis=1).mean()) if with_scale else 1.0
    return Similarity(scale=scale, R_AB=R, t_A_m=mean_A - scale * R @ mean_B)


def robust_similarity(
    points_B: Array, points_A: Array, rng: np.random.Generator, with_scale: bool = True, trials: int = 500
) -> tuple[Similarity, BoolArray]:
    """Similarity from paired points of which up to half may be wrong, and which pairs it rests on.

    Least squares over all pairs unless some are outliers; then least median of squares over random triples (P. J.
    Rousseeuw and A. M. Leroy, Robust Regression and Outlier Detection, Wiley 1987, doi 10.1002/0471725382) and least
    squares over the pairs whose error is below what 999 in 1000 normally distributed ones keep to, the spread being
    told by the median: no threshold in metres has to be known.

    Returns `similarity`; `inliers`, shape (n,).
    """
    n = len(points_B)
    fit = umeyama(points_B, points_A, with_scale)
    everything = np.ones(n, dtype=np.bool_)
    # With fewer than 7 pairs the median does not separate bad pairs from a bad fit.
    if n < 7 or _near(fit, points_B, points_A).all():
        return fit, everything
    best, median = fit, float(np.median(_error(fit, points_B, points_A)))
    for _ in range(trials):
        pick = rng.choice(n, size=3, replace=False)
        try:
            candidate = umeyama(points_B[pick], points_A[pick], with_scale)
        except InputError:
            continue
        value = float(np.median(_error(candidate, points_B, points_A)))
        if value < median:
            best, median = candidate, value
    # The best triple is a rough fit: let it grow to all pairs that agree with the fit to those that agree.
    inliers = _near(best, points_B, points_A)
    for _ in range(20):
        try:
            best = umeyama(points_B[inliers], points_A[inliers], with_scale)
        except InputError:
            break
        again = _near(best, points_B, points_A)
        if np.array_equal(again, inliers):
            break
        inliers = again
    return best, inliers


def _error(similarity: Similarity, points_B: Array, points_A: Array) -> Array:
    """Distance of each pair after alignment, shape (n,)."""
    return np.asarray(np.linalg.norm(similarity.apply(points_B) - points_A, axis=1))


def _near(similarity: Similarity, points_B: Array, points_A: Array) -> BoolArray:
    """Pairs whose error fits a 3D normal distribution with the median of all errors; shape (n,)."""
    error = _error(similarity, points_B, points_A)
    floor = 1e-9 * float(np.linalg.norm(np.ptp(points_A, axis=0)))
    return np.asarray(error <= max(_CHI3_999 * float(np.median(error)) / _CHI3_MEDIAN, floor))


SPACED, ICP_NEIGHBOURS, NORMAL_NEIGHBOURS = 500, 10, 20
"""Samples of the truth by which their spacing is judged; neighbours through which ICP lays its planes, and those of the
residual where no normals are known."""
THREADS = os.cpu_count() or 1


def neighbour_tree(points_m: Array) -> Any:
    """Tree of small_gicp over points, shape (n, 3), for `nearest_m` and `refine_icp`."""
    need("distances between clouds", "photos", only=("small_gicp",))
    import small_gicp

    return small_gicp.KdTree(np.asarray(points_m, dtype=np.float64), num_threads=THREADS)


def nearest_m(tree: Any, points_m: Array, from_m: Array) -> Array:
    """Distance in m from each of `from_m`, shape (k, 3), to the nearest of the tree's points, shape (n, 3)."""
    rows = np.asarray(tree.batch_knn_search(from_m, 1, num_threads=THREADS)[0])[:, 0].astype(np.int64)
    # The tree's own squares are summed in another order, and so differ in the last bit.
    off = (from_m - points_m[rows]) ** 2
    return np.asarray(np.sqrt(off[:, 0] + off[:, 1] + off[:, 2]))


@dataclass(frozen=True, kw_only=True, eq=False)
class IcpRefinement:
    """Result of ICP. `displacement_mm`: mean displacement of the points, large after a bad initial alignment.

    `accepted` is False, and nothing moved, where the cloud fitted no better after than before. `matched_pct` is the
    share of the cloud within the last round's distance of the surface.
    """

    R: Array
    t_m: Array
    displacement_mm: float
    turn_deg: float
    residual_mm: float
    matched_pct: float
    accepted: bool

    def __post_init__(self) -> None:
        freeze(self, R=(3, 3), t_m=(3,))

    def apply(self, points_m: Array) -> Array:
        """Moved points, shape (n, 3)."""
        return np.asarray(points_m) @ self.R.T + self.t_m


def _plane_normals(tree: Any, points_m: Array, at: IntArray) -> Array:
    """Normals of planes through the neighbours of some of the tree's points, shape (k,) to (k, 3)."""
    rows, back = np.unique(at, return_inverse=True)
    near = tree.batch_knn_search(points_m[rows], NORMAL_NEIGHBOURS, num_threads=THREADS)[0].astype(np.int64)
    off = points_m[near] - points_m[near].mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.eigh(np.einsum("nki,nkj->nij", off, off))[1][back, :, 0])


def refine_icp(
    cloud_m: Array,
    surface_m: Array,
    normals: Array | None = None,
    distances_m: tuple[float, ...] = (0.008, 0.004),
    voxel_m: float = 0.002,
    limit_m: float = 0.02,
    least_matched_pct: float = 50.0,
    tree: Any = None,
) -> IcpRefinement:
    """Rigid point-to-plane ICP of a cloud onto samples of the true surface, coarse to fine.

    Y. Chen and G. Medioni, Object modelling by registration of multiple range images, Image and Vision Computing
    10(3), 1992, doi 10.1016/0262-8856(92)90066-C. Scale is left alone: a model of the wrong size must stay wrong.

    `cloud_m` has shape (n, 3). `surface_m`, `normals`, shape (k, 3): samples of the true surface and their unit
    normals, which the residual is along; those of planes through neighbours if not given. `distances_m`: largest
    distance of a match in each round; more where samples lie farther apart than half of the last. `limit_m`: largest
    mean displacement that counts as a refinement. `least_matched_pct`: share of the cloud that must lie within the last
    distance in the end. `tree`: `neighbour_tree` of the samples, where it is there already. Raises StageError if too
    few points match or the cloud would move farther than `limit_m`: the alignment before it was wrong, or this is no
    model of that surface.
    """
    need("registration (ICP)", "photos", only=("small_gicp",))
    import small_gicp

    target = small_gicp.PointCloud(np.asarray(surface_m, dtype=np.float64))
    tree = neighbour_tree(surface_m) if tree is None else tree
    some = np.asarray(surface_m, dtype=np.float64)[:: max(1, len(surface_m) // SPACED)]
    spacing_m = float(np.median(np.sqrt(tree.batch_knn_search(some, 2)[1][:, 1])))
    wider = max(1.0, 2.0 * spacing_m / distances_m[-1])
    distances_m = tuple(wider * distance for distance in distances_m)
    # small_gicp takes no normals from outside: `normals()` is a copy.
    small_gicp.estimate_normals(target, tree, num_neighbors=ICP_NEIGHBOURS, num_threads=THREADS)
    source = small_gicp.voxelgrid_sampling(np.asarray(cloud_m, dtype=np.float64), voxel_m, num_threads=1)
    if source.size() < 50:
        raise StageError(f"ICP: {source.size()} points after thinning to {voxel_m * 1e3:g} mm, needs at least 50")
    T = np.eye(4)
    for distance in distances_m:
        result = small_gicp.align(
            target,
            source,
            tree,
            init_T_target_source=T,
            registration_type="PLANE_ICP",
            max_correspondence_distance=distance,
            num_threads=1,
            max_iterations=50,
            rotation_epsilon=1e-5,
            translation_epsilon=1e-6,
        )
        if result.num_inliers < 50:
            raise StageError(
                f"ICP: {result.num_inliers} of {source.size()} points lie within {distance * 1e3:g} mm of the surface, "
                "needs at least 50"
            )
        T = np.asarray(result.T_target_source)
    points = np.asarray(source.points())[:, :3]
    moved = points @ T[:3, :3].T + T[:3, 3]
    displacement = float(np.linalg.norm(moved - points, axis=1).mean())
    if not displacement <= limit_m:
        raise StageError(
            f"ICP: moved the cloud by {displacement * 1e3:.1f} mm, at most {limit_m * 1e3:g} mm is allowed"
        )
    before_index, before = tree.batch_nearest_neighbor_search(points, num_threads=1)
    index, squared = tree.batch_nearest_neighbor_search(moved, num_threads=1)
    accepted = _misfit(squared, distances_m[-1]) <= _misfit(before, distances_m[-1])
    if not accepted:
        T, moved, displacement, index, squared = np.eye(4), points, 0.0, before_index, before
    turn = float(np.degrees(np.arccos(np.clip((np.trace(T[:3, :3]) - 1) / 2, -1, 1))))
    across = _plane_normals(tree, surface_m, index) if normals is None else np.asarray(normals)[index]
    offset = np.einsum("ij,ij->i", moved - np.asarray(surface_m)[index], across)
    near = np.asarray(squared) < distances_m[-1] ** 2
    matched_pct = 100.0 * float(near.mean())
    if matched_pct < least_matched_pct:
        raise StageError(
            f"ICP: {matched_pct:.0f} % of the model lies within {distances_m[-1] * 1e3:g} mm of the true surface, "
            f"at least {least_matched_pct:g} % must for the two to be the same thing"
        )
    return IcpRefinement(
        R=T[:3, :3],
        t_m=T[:3, 3],
        displacement_mm=1e3 * displacement,
        turn_deg=turn,
        residual_mm=1e3 * float(np.sqrt((offset[near] ** 2).mean())) if near.any() else float("inf"),
        matched_pct=matched_pct,
        accepted=accepted,
    )


def _misfit(squared_m2: Array, limit_m: float) -> float:
    """Mean squared distance, each capped at the limit: what robust ICP makes smaller."""
    return float(np.minimum(np.asarray(squared_m2), limit_m**2).mean())
