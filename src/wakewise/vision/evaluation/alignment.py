"""Alignment of a model with the reference: similarity of paired points (Umeyama, robust), rigid point-to-plane ICP."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.arrays import Array, BoolArray, freeze
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


SPACED = 500
"""Samples of the truth by which their spacing is judged."""


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


def refine_icp(
    cloud_m: Array,
    surface_m: Array,
    normals: Array,
    distances_m: tuple[float, ...] = (0.008, 0.004),
    voxel_m: float = 0.002,
    limit_m: float = 0.02,
    least_matched_pct: float = 50.0,
) -> IcpRefinement:
    """Rigid point-to-plane ICP of a cloud onto samples of the true surface, coarse to fine.

    Y. Chen and G. Medioni, Object modelling by registration of multiple range images, Image and Vision Computing
    10(3), 1992, doi 10.1016/0262-8856(92)90066-C. Scale is left alone: a model of the wrong size must stay wrong.

    `cloud_m` has shape (n, 3). `surface_m`, `normals`, shape (k, 3): samples of the true surface and their unit
    normals. `distances_m`: largest distance of a match in each round; more where samples lie farther apart than half of
    the last. `limit_m`: largest mean displacement that counts
    as a refinement. `least_matched_pct`: share of the cloud that must lie within the last distance in the end. Raises
    StageError if too few points match or the cloud would move farther than `limit_m`: the alignment before it was
    wrong, or this is no model of that surface.
    """
    need("registration (ICP)", "photos", only=("small_gicp",))
    import small_gicp

    some = np.asarray(surface_m)[:: max(1, len(surface_m) // SPACED)]
    spacing_m = float(np.median(np.asarray(KDTree(surface_m).query(some, k=2)[0])[:, 1]))
    wider = max(1.0, 2.0 * spacing_m / distances_m[-1])
    distances_m = tuple(wider * distance for distance in distances_m)
    target = small_gicp.PointCloud(np.asarray(surface_m, dtype=np.float64))
    # Estimating makes room for normals; the true ones then take their place.
    small_gicp.estimate_normals(target, num_neighbors=10, num_threads=2)
    target.normals()[:, :3] = normals
    tree = small_gicp.KdTree(target, num_threads=1)
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
    offset = np.einsum("ij,ij->i", moved - np.asarray(surface_m)[index], np.asarray(normals)[index])
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
