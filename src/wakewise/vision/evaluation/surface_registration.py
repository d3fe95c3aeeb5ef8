"""Registration of two surfaces of one place at two dates on what did not change.

Point-to-plane ICP (`small_gicp`) from several places to begin with, then least squares reweighted by Tukey's biweight
(A. E. Beaton and J. W. Tukey, Technometrics 16(2), 1974, doi 10.1080/00401706.1974.10489171): changed places weigh
nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from wakewise.core.arrays import Array, BoolArray, IntArray, freeze
from wakewise.core.errors import StageError
from wakewise.core.optional_dependencies import need
from wakewise.scene.targets import Mesh
from wakewise.vision.evaluation.alignment import Similarity
from wakewise.vision.evaluation.bed_and_colony import BedFit
from wakewise.vision.evaluation.cloud_to_surface import Crop, SurfaceSamples, sample_surface

TURNS, ROUGH_POINTS, FINE_STARTS, ROUNDS = 72, 1500, 6, 40
BIWEIGHT, LEAST_MATCHED_PCT = 4.685, 30.0


@dataclass(frozen=True, kw_only=True, eq=False)
class DatedSurface:
    """Evenly spread points of a surface, m, their unit normals, shape (n, 3), and which stand above the bed, (n,).

    `bed` is None where none was found: then all stands. `cell_m2` is the area of a point.
    """

    points_m: Array
    normals: Array
    standing: BoolArray
    bed: BedFit | None
    cell_m2: float

    def __post_init__(self) -> None:
        freeze(self, points_m=(None, 3), normals=(None, 3))

    @property
    def middle_m(self) -> Array:
        """Middle of what stands, shape (3,)."""
        return np.asarray(self.points_m[self.standing].mean(axis=0))

    @property
    def spread_m(self) -> float:
        """Root mean square distance of what stands from its middle."""
        return float(np.sqrt(((self.points_m[self.standing] - self.middle_m) ** 2).sum(axis=1).mean()))

    def moved(self, similarity: Similarity) -> DatedSurface:
        """The surface in another frame; its bed is then unknown."""
        return DatedSurface(
            points_m=similarity.apply(self.points_m),
            normals=self.normals @ similarity.R_AB.T,
            standing=self.standing,
            bed=None,
            cell_m2=similarity.scale**2 * self.cell_m2,
        )

    def only(self, kept: BoolArray) -> DatedSurface:
        """The points that a mask of shape (n,) keeps."""
        return DatedSurface(
            points_m=self.points_m[kept],
            normals=self.normals[kept],
            standing=self.standing[kept],
            bed=self.bed,
            cell_m2=self.cell_m2,
        )


def sampled(mesh: Mesh, bed: BedFit | None, cut_m: float, count: int, rng: np.random.Generator) -> DatedSurface:
    """Points of a mesh, evenly by area; what is higher than `cut_m` above the bed stands, all without a bed."""
    found: SurfaceSamples = sample_surface(mesh, Crop(), rng, count)
    points, normals = found.points_m, found.normals
    standing = np.ones(len(points), dtype=np.bool_)
    if bed is not None:
        standing = bed.to_plane(points)[:, 2] > cut_m
        if float((normals @ bed.axes[2]).sum()) < 0.0:
            normals = -normals
    return DatedSurface(
        points_m=points,
        normals=normals,
        standing=standing,
        bed=bed,
        cell_m2=float(mesh.face_areas_m2.sum()) / len(points),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Registration:
    """Similarity that takes B's frame into A's; residual of what did not change, m; share of B that did not, 0 to 100.

    free_scale: scale of B that fits best, 1 where the two agree.
    """

    similarity: Similarity
    residual_m: float
    unchanged_pct: float
    free_scale: float


def register(A: DatedSurface, B: DatedSurface, with_scale: bool = False) -> Registration:
    """Registration of B on A over unchanged places, rigid unless `with_scale`.

    It begins at the same frame and, where both have a bed, at bed on bed and colony on colony in 72 turns. Raises
    StageError if less than 30 % of B fits A anywhere.
    """
    need("registration of two models", "photos", only=("small_gicp",))
    ratio = A.spread_m / B.spread_m
    tree, facing_m = _tree(A)
    rough = _Rough(A, B)
    # Twice the size is no growth; and the places nearest to those far away take long to find.
    alike, same = 0.5 < ratio < 2.0, abs(ratio - 1.0) <= 0.1
    scales = (1.0,) if same else (1.0, ratio) if alike else (ratio,)
    begun = [rough.improved(start, (0.3, 0.1)) for scale in scales for start in _starts(A, B, scale)]
    finer = sorted(begun, key=lambda fitted: fitted[0])[:FINE_STARTS]
    best = min((rough.improved(one, (0.05, 0.02)) for _, one in finer), key=lambda fitted: fitted[0])[1]
    free = _reweighted(A, B, tree, facing_m, best, with_scale=True)
    if with_scale or not alike:
        found = free
    else:
        begin = Similarity(scale=1.0, R_AB=best.R_AB, t_A_m=A.middle_m - best.R_AB @ B.middle_m)
        found = _reweighted(A, B, tree, facing_m, best if best.scale == 1.0 else begin, with_scale=False)
    if found[2] < LEAST_MATCHED_PCT and abs(free[0].scale - 1.0) < 0.2:
        raise StageError(
            f"registration: {found[2]:.0f} % of the second model fits the first, at least {LEAST_MATCHED_PCT:g} % "
            "must; are they of the same place?"
        )
    return Registration(
        similarity=found[0], residual_m=found[1], unchanged_pct=found[2], free_scale=float(free[0].scale)
    )


def _starts(A: DatedSurface, B: DatedSurface, scale: float) -> list[Similarity]:
    """Where to begin: the same frame, and colony on colony with up on up in several turns."""
    out = [Similarity(scale=1.0, R_AB=np.eye(3), t_A_m=np.zeros(3))] if scale == 1.0 else []
    turns = np.arange(TURNS) * 2.0 * np.pi / TURNS
    for angle in turns:
        if A.bed is not None and B.bed is not None:
            R = A.bed.axes.T @ Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix() @ B.bed.axes
            centre_A, centre_B = (one.middle_m for one in (A, B))
            t = centre_A - scale * R @ centre_B
            # Bed on bed: a colony that grew has its middle higher.
            gap = A.bed.to_plane((scale * R @ B.bed.origin_m + t)[None])[0, 2]
            out.append(Similarity(scale=scale, R_AB=R, t_A_m=t - gap * A.bed.axes[2]))
        elif angle == 0.0:
            out.append(Similarity(scale=scale, R_AB=np.eye(3), t_A_m=A.middle_m - scale * B.middle_m))
    return out


class _Rough:
    """Rigid ICP of some places of B on A from a place to begin with, at its scale, and how well it fits there."""

    def __init__(self, A: DatedSurface, B: DatedSurface) -> None:
        import small_gicp

        self._A, self._tree = A, KDTree(A.points_m)
        # As many of what stands as of the bed, which tells no turn.
        rows = [np.flatnonzero(B.standing == side) for side in (True, False)]
        self._parts = [B.points_m[row[:: max(1, len(row) // ROUGH_POINTS)]] for row in rows]
        self._some = np.concatenate(self._parts)
        self._target = small_gicp.PointCloud(np.asarray(A.points_m))
        small_gicp.estimate_normals(self._target, num_neighbors=10, num_threads=1)
        self._search = small_gicp.KdTree(self._target, num_threads=1)

    def fit(self, start: Similarity, shares: tuple[float, ...]) -> Similarity:
        """ICP with these largest distances of a match, in shares of the spread of A."""
        import small_gicp

        source, T = small_gicp.PointCloud(start.apply(self._some)), np.eye(4)
        for share in shares:
            T = np.asarray(
                small_gicp.align(
                    self._target, source, self._search, init_T_target_source=T, registration_type="PLANE_ICP",
                    max_correspondence_distance=share * self._A.spread_m, num_threads=1, max_iterations=15,
                ).T_target_source
            )  # fmt: skip
        turn = T[:3, :3]
        return Similarity(scale=start.scale, R_AB=turn @ start.R_AB, t_A_m=turn @ start.t_A_m + T[:3, 3])

    def improved(self, start: Similarity, shares: tuple[float, ...]) -> tuple[float, Similarity]:
        """Misfit and the fit, or where it began if that is better: growth all over draws ICP to one side."""
        both = ((self.misfit(one), one) for one in (start, self.fit(start, shares)))
        return min(both, key=lambda fitted: fitted[0])

    def misfit(self, similarity: Similarity) -> float:
        """Mean distance from A, along its normals where near; another scale must fit twice as well.

        Beside a bed, what stands is held to its own median: a colony that lost 3 mm all over is 3 mm off in its true
        turn, and may be less off in a wrong one, where the surfaces cross.
        """
        there, cap, far = similarity.apply(self._some), 0.1 * self._A.spread_m, 0.3 * self._A.spread_m
        away, nearest = (np.asarray(found) for found in self._tree.query(there, workers=1))
        along = np.einsum("ij,ij->i", there - self._A.points_m[nearest], self._A.normals[nearest])
        standing, near = np.arange(len(along)) < len(self._parts[0]), away < far
        if standing.any() and not standing.all() and (standing & near).any():
            along[standing] -= np.median(along[standing & near])
        mean = float(np.where(near, np.minimum(np.abs(along), cap), cap).mean())
        return mean if similarity.scale == 1.0 else 2.0 * mean


def _tree(surface: DatedSurface, facing_m: float | None = None) -> tuple[KDTree, float]:
    """Tree over place and normal, the normal in lengths that make the other side of a twig far."""
    length = 4.0 * np.sqrt(surface.cell_m2) if facing_m is None else facing_m
    return KDTree(np.hstack([surface.points_m, length * surface.normals])), float(length)


def matches(of: DatedSurface, tree: KDTree, facing_m: float) -> IntArray:
    """Nearest place of the tree's surface that faces alike, shape (n,)."""
    return np.asarray(tree.query(np.hstack([of.points_m, facing_m * of.normals]), workers=1)[1])


def _reweighted(
    A: DatedSurface, B: DatedSurface, tree: KDTree, facing_m: float, start: Similarity, *, with_scale: bool
) -> tuple[Similarity, float, float]:
    """Similarity, robust residual, m, and share of B that is unchanged, in percent."""
    found, middle = start, A.middle_m
    sigma, weight = 0.0, np.ones(len(B.points_m))
    for _ in range(ROUNDS):
        there = B.moved(found)
        nearest = matches(there, tree, facing_m)
        n, p = A.normals[nearest], there.points_m
        off = np.einsum("ij,ij->i", p - A.points_m[nearest], n)
        stands = A.standing[nearest]
        # Growth all over moves no place sideways: what stands is held to its own median, the bed to zero.
        level = float(np.median(off[stands])) if A.bed is not None and stands.any() and not stands.all() else 0.0
        off = off - np.where(stands, level, 0.0)
        sigma = max(1.4826 * float(np.median(np.abs(off))), 1e-7)
        weight = np.clip(1.0 - (off / (BIWEIGHT * sigma)) ** 2, 0.0, None) ** 2
        J = np.hstack([np.cross(p - middle, n) / A.spread_m, n])
        if with_scale:
            J = np.hstack([J, np.einsum("ij,ij->i", p - middle, n)[:, None] / A.spread_m])
        root = np.sqrt(weight)
        # What the places do not hold, such as a shift along a flat bed, stays as it is.
        step = np.linalg.lstsq(J * root[:, None], -off * root, rcond=1e-3)[0]
        turn = Rotation.from_rotvec(step[:3] / A.spread_m).as_matrix()
        grow = 1.0 + float(np.clip(step[6] / A.spread_m, -0.2, 0.2)) if with_scale else 1.0
        R = turn @ found.R_AB
        t = grow * turn @ (found.t_A_m - middle) + middle + step[3:6]
        found = Similarity(scale=grow * found.scale, R_AB=R, t_A_m=t)
        if float(np.abs(step).max()) < 1e-7:
            break
    return found, sigma, 100.0 * float((weight > 0.25).mean())
