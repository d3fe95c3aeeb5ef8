"""Solid body in the water: potential flow by sources under its surface, and jets that flow round it or strike it.

*Potential flow* (J. L. Hess and A. M. O. Smith 1967, Prog. Aerosp. Sci. 8, 1, doi 10.1016/0376-0421(67)90003-6): a few
smooth sources below the surface, of zero total strength, minimise the mean square normal velocity at points on the
surface. Shapes finer than the distance between sources are blocked in part only.
Not modelled: boundary layer, separation, wake.

*Jets round a body.* In potential flow parcels would stop at stagnation points and accumulate impulse without bound. A
jet's outer streamlines are at ambient pressure, so a turned jet keeps its speed (G. I. Taylor 1960, Proc. R. Soc. A
259, 1, for jets on plates, from memory), and behind the widest place of a blunt body the flow separates. A parcel
therefore moves at the speed of the jets' own water, in the direction of the whole water, without attraction to the
body.

*Jets that strike it.* A piece of the surface that faces a parcel's impulse m, of area dA and normal n, intercepts

    dA (-n . m/|m|) exp(-r^2 / 2 sigma^2) / (2 pi sigma^2)

of it, r its distance from the line along the impulse. Within 1.7 to 0.3 sigma of the surface
(`bedjets.STRIKE_HEIGHT`) that share is lost to the body's pressure and as much leaves sideways. On shapes with hollows
each piece counts by the hull's area over the shape's. Not modelled: friction, attached jets, sheets to all sides.
`wakewise.simulation.tank.validation_limits` compares this with the lattice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.jit.njit import assign, njit
from wakewise.scene.targets import Target
from wakewise.simulation.water.induction import (
    SINGLE,
    FixedSources,
    over_points,
    smooth_share,
    spatial_order,
    sum_sources,
)

_POINTS = 480
_SOURCES = 160
# Of the sources' spacing: wide enough that what they make is even along the surface, and so deep that little water is
# made outside. Half ball flow is then right to 5 %; half as wide and deep they let twice as much through corals.
_SIGMA, _DEPTH = 0.8, 1.4
_DAMPING = 1e-4  # of the mean square singular value: strengths stay of the order of the flow


class PackedBlockage(NamedTuple):
    """A `Blockage` as the compiled step takes it; of no body all are empty.

    `points` and `normals`, shape (k, 3), are as in `Blockage`, and `answers`, shape (k, s), its response the other way
    round; `sources`, shape (4, 2 s), are the sources' places and one over their sizes, images after originals, and
    `per_area`, shape (s,), is one over their sizes squared. `ball`, shape (4,), is the middle and how far it is felt,
    `radius` how far the points reach from there, and `piece`, in m2, the area that each stands for.
    """

    points: Array
    normals: Array
    answers: Array
    sources: np.ndarray
    per_area: Array
    ball: Array
    constants: np.ndarray
    radius: float
    piece: float

    @classmethod
    def none(cls) -> PackedBlockage:
        """No body."""
        v = np.zeros((0, 3))
        return cls(v, v, np.zeros((0, 0)), np.zeros((4, 0), np.float32), np.zeros(0), np.zeros(4), SINGLE, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Blockage:
    """Sources that keep water out of a body standing on the bed."""

    # points_m, normals: shape (k, 3): on the surface, and outward from it: where the flow across is made least.
    points_m: Array
    normals: Array
    sources_m: Array  # shape (s, 3)
    sigmas_m: Array  # shape (s,)
    response: Array  # shape (s, k): strengths in m3/s for a unit velocity across the surface at each point
    bed_z_m: float  # the sources are mirrored there
    piece_m2: float  # area of the convex hull, or of the surface if that is less, over the number of points
    rows: PackedBlockage = field(init=False, repr=False)

    def __post_init__(self) -> None:
        k, s = len(self.points_m), len(self.sigmas_m)
        images = np.array(self.sources_m)
        images[:, 2] = 2 * self.bed_z_m - images[:, 2]
        both = FixedSources(np.concatenate([self.sources_m, images]), np.tile(self.sigmas_m, 2))
        middle = np.mean(self.points_m, axis=0)
        radius = float(np.linalg.norm(self.points_m - middle, axis=1).max())
        rows = PackedBlockage(
            np.ascontiguousarray(self.points_m, dtype=np.float64),
            np.ascontiguousarray(self.normals, dtype=np.float64),
            np.ascontiguousarray(self.response.T, dtype=np.float64),
            both.columns,
            1.0 / self.sigmas_m**2,
            np.array([*middle, 4.0 * radius]),
            SINGLE,
            radius,
            self.piece_m2,
        )
        object.__setattr__(self, "rows", rows)
        freeze(self, points_m=(k, 3), normals=(k, 3), sources_m=(s, 3), sigmas_m=(s,), response=(s, k))

    @classmethod
    def of(cls, target: Target) -> Blockage:
        """For a target on its bed; the same target always gives the same sources."""
        points, normals, area = _surface(target, _POINTS, np.random.default_rng(0))
        order = spatial_order(points)  # which suits the sums over jets there
        points, normals = points[order], normals[order]
        inner, inward, _ = _surface(target, _SOURCES, np.random.default_rng(1))
        size = math.sqrt(area / _SOURCES)
        sigmas = np.full(_SOURCES, _SIGMA * size)
        sources = inner - _DEPTH * size * inward
        across = _across(points, normals, sources, sigmas, target.bed_z_m)
        response = _least_squares(across, _DAMPING)
        piece = min(area, _hull_area(target)) / _POINTS
        return cls(points, normals, sources, sigmas, response, target.bed_z_m, piece)

    def strengths_m3_s(self, undisturbed_m_s: Array) -> Array:
        """Source strengths, shape (s,), for the velocity that there would be at `points_m` without the body."""
        strengths: Array = answer(self.rows, np.ascontiguousarray(undisturbed_m_s))
        return strengths

    def felt_at(self, points_W_m: Array) -> bool:
        """Whether any of the points, shape (n, 3), is within four times the body's radius."""
        return bool(any_near(self.rows.ball, points_W_m))

    def velocity(self, points_W_m: Array, strengths_m3_s: Array) -> Array:
        """What the sources add, shape (n, 3), at points, shape (n, 3); nothing beyond four times the body's radius."""
        out = np.zeros_like(points_W_m)
        self.add_velocity(points_W_m, strengths_m3_s, out)
        return out

    def add_velocity(self, points_W_m: Array, strengths_m3_s: Array, out: Array) -> None:
        """Add to `out` what the sources add, both shape (n, 3)."""
        points = np.ascontiguousarray(points_W_m, dtype=np.float64)
        cost = len(points) * self.rows.sources.shape[1] // 4
        over_points(lambda some, result: add_body(self.rows, some, strengths_m3_s, result), points, out, cost)


@njit(apart=True, nogil=True)
def answer(body: PackedBlockage, undisturbed_m_s: Array) -> Array:
    """Strengths, shape (s,): see `Blockage.strengths_m3_s`. In one order, whatever the number of threads."""
    out = np.zeros(body.answers.shape[1])
    for p in range(body.answers.shape[0]):
        across = 0.0
        for k in range(3):
            across += undisturbed_m_s[p, k] * body.normals[p, k]
        unit = body.answers[p]
        for i in range(out.shape[0]):
            out[i] += unit[i] * across
    return out


@njit(nogil=True)
def any_near(ball: Array, points: Array) -> bool:
    """Whether any point, shape (n, 3), is in a ball: its middle and radius, shape (4,)."""
    for p in range(points.shape[0]):
        dx, dy, dz = points[p, 0] - ball[0], points[p, 1] - ball[1], points[p, 2] - ball[2]
        if dx * dx + dy * dy + dz * dz < ball[3] ** 2:
            return True
    return False


@njit(apart=True, nogil=True)
def near_body(body: PackedBlockage, points: Array) -> IntArray:
    """Indices of the points, shape (n, 3), that feel the body."""
    found = np.empty(points.shape[0], np.int64)
    count = 0
    for p in range(points.shape[0]):
        dx, dy, dz = points[p, 0] - body.ball[0], points[p, 1] - body.ball[1], points[p, 2] - body.ball[2]
        if dx * dx + dy * dy + dz * dz < body.ball[3] ** 2:
            found[count] = p
            count += 1
    return found[:count]


@njit(apart=True, nogil=True)
def add_body(body: PackedBlockage, points: Array, strengths_m3_s: Array, out: Array) -> None:
    """Add to `out` what the body's sources add at points, both shape (n, 3)."""
    near = near_body(body, points)
    if near.shape[0] == 0:
        return
    some, result = np.empty((near.shape[0], 3), np.float32), np.empty((near.shape[0], 3))
    for q in range(near.shape[0]):
        for k in range(3):
            some[q, k] = points[near[q], k]
    s = strengths_m3_s.shape[0]
    both = np.empty(2 * s, np.float32)
    for i in range(s):
        both[i] = both[s + i] = strengths_m3_s[i] * body.per_area[i]
    S = body.sources
    sum_sources(some, S[0], S[1], S[2], both, S[3], body.constants, result)
    for q in range(near.shape[0]):
        for k in range(3):
            out[near[q], k] += result[q, k]


@njit
def _least_squares(across: Array, damping: float) -> Array:
    """Strengths, shape (s, k), that leave least of a unit velocity across the surface at each point.

    `across`, shape (k, s), is what unit strengths make there. Strengths sum to zero: the search is in the space across
    (1, ..., 1). By Cholesky's way, written out: a library's sums would depend on the number of threads.
    """
    k, s = across.shape
    M = across.copy()
    for p in range(k):
        M[p] -= across[p].mean()
    L, trace = np.zeros((s, s)), 0.0
    for p in range(k):
        for i in range(s):
            trace += M[p, i] ** 2
            for j in range(i + 1):
                L[i, j] += M[p, i] * M[p, j]
    for i in range(s):
        L[i, i] += damping * trace / s
    for j in range(s):
        for i in range(j, s):
            for n in range(j):
                L[i, j] -= L[i, n] * L[j, n]
            L[i, j] = math.sqrt(L[j, j]) if i == j else L[i, j] / L[j, j]
    out = np.empty((s, k))
    x = np.empty(s)
    for p in range(k):
        for i in range(s):
            x[i] = -M[p, i]
            for n in range(i):
                x[i] -= L[i, n] * x[n]
            x[i] /= L[i, i]
        for i in range(s - 1, -1, -1):
            for n in range(i + 1, s):
                x[i] -= L[n, i] * x[n]
            x[i] /= L[i, i]
        assign(out[:, p], x - x.mean())
    return out


def _hull_area(target: Target) -> float:
    """Of the convex hull, above the bed, in m2."""
    hull = ConvexHull(target.mesh.vertices_m)
    corners = hull.points[hull.simplices]
    twice = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return float(0.5 * twice[corners.mean(axis=1)[:, 2] < target.bed_z_m - 1e-4].sum())


def _across(points: Array, normals: Array, sources: Array, sigmas: Array, bed_z_m: float) -> Array:
    """Velocity across the surface at each point for a unit source and its image in the bed, shape (k, s)."""
    total = np.zeros((len(points), len(sources)))
    for flip in (1.0, -1.0):
        place = sources.copy()
        if flip < 0.0:
            place[:, 2] = 2 * bed_z_m - place[:, 2]
        d = (points[:, None] - place) / sigmas[:, None]
        q = np.einsum("ksi,ksi->ks", d, d)
        total += smooth_share(q) * np.einsum("ksi,ki->ks", d, normals) / sigmas**2
    return total


def _surface(target: Target, count: int, rng: np.random.Generator) -> tuple[Array, Array, float]:
    """Points evenly by area over the surface above the bed, outward normals there, and its whole area."""
    corners = target.mesh.vertices_m[target.mesh.faces]
    turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.einsum("ni,ni->n", corners[:, 0] - target.centre_W_m, turned).sum()
    twice = np.linalg.norm(turned, axis=1)
    area = np.where(corners.mean(axis=1)[:, 2] < target.bed_z_m - 1e-4, 0.5 * twice, 0.0)
    sums = np.cumsum(area)
    picks = (np.arange(count) + rng.uniform(size=count)) / count * sums[-1]
    face = np.minimum(np.searchsorted(sums, picks, side="right"), len(area) - 1)
    a, b = rng.uniform(size=(2, count))
    fold = a + b > 1
    a, b = np.where(fold, 1 - a, a)[:, None], np.where(fold, 1 - b, b)[:, None]
    one, two, three = (corners[face, k] for k in range(3))
    normals = turned[face] / twice[face, None] * (1.0 if volume > 0 else -1.0)
    return one + a * (two - one) + b * (three - one), normals, float(sums[-1])


_BEFORE, _WITHIN = 1.0, 0.7  # sigma before the surface where half of what strikes has turned, and over how many it does
_REACH = 3.0  # standard deviations beyond which nothing meets a surface
_SLIGHT = 1e-3  # of the jets' own speed: a lesser answer turns nothing
_LEAST_LEFT = 0.05  # of the slipstream: what is left of it can still strike


@njit(nogil=True)
def deflect_velocity(body: PackedBlockage, x: Array, u: Array, answer: Array) -> None:
    """Turn the velocity u of the jets' own water at a parcel, in place, the way that the body's answer there says.

    All shape (3,); `answer` is changed as well.
    """
    before = ahead = after = 0.0
    for k in range(3):
        before += u[k] ** 2
        after += answer[k] ** 2
    if before == 0.0 or after <= _SLIGHT**2 * before:
        return
    _draw_none(body, x, answer)
    after = 0.0
    for k in range(3):
        ahead += u[k] * (u[k] + answer[k])
    back = min(ahead / before, 0.0)
    for k in range(3):
        answer[k] += (1.0 - back) * u[k]
        after += answer[k] ** 2
    if after > 1e-12 * before:
        kept = math.sqrt(before / after)
        for k in range(3):
            u[k] = kept * answer[k]


@njit(nogil=True)
def _draw_none(body: PackedBlockage, x: Array, answer: Array) -> None:
    """Take from the answer at x what of it points to the body: against the normals near by, the nearest most."""
    P, N = body.points, body.normals
    a = b = c = 0.0
    for k in range(P.shape[0]):
        dx, dy, dz = x[0] - P[k, 0], x[1] - P[k, 1], x[2] - P[k, 2]
        gap2 = dx * dx + dy * dy + dz * dz + body.piece
        weight = 1.0 / (gap2 * gap2)
        a, b, c = a + weight * N[k, 0], b + weight * N[k, 1], c + weight * N[k, 2]
    size2 = a * a + b * b + c * c
    inward = a * answer[0] + b * answer[1] + c * answer[2]
    if inward < 0.0:
        answer[0] -= inward / size2 * a
        answer[1] -= inward / size2 * b
        answer[2] -= inward / size2 * c


@njit(nogil=True)
def strike_body(body: PackedBlockage, before: Array, x: Array, flow: Array, sigma: float, impulse: Array) -> float:
    """Turn aside what of a parcel strikes the body on its way from `before` to `x`; the length its impulse loses.

    - `before`, `x`, `flow`, shape (3,): places in m, and where the parcel is going.
    - `sigma`: in m.
    - `impulse`, shape (3,): in m4/s, changed in place.
    """
    size = math.sqrt(impulse[0] ** 2 + impulse[1] ** 2 + impulse[2] ** 2)
    if size == 0.0:
        return 0.0
    a, b, c = impulse[0] / size, impulse[1] / size, impulse[2] / size
    dx, dy, dz = body.ball[0] - x[0], body.ball[1] - x[1], body.ball[2] - x[2]
    ahead = a * dx + b * dy + c * dz
    near, far = body.radius + _REACH * sigma, body.radius + (_BEFORE + _REACH * _WITHIN) * sigma
    if not -near < ahead < far or dx * dx + dy * dy + dz * dz - ahead * ahead > near * near:
        return 0.0
    way = a * (x[0] - before[0]) + b * (x[1] - before[1]) + c * (x[2] - before[2])
    if way <= 0.0:
        return 0.0
    struck, striking = _met(body, x, a, b, c, sigma)
    left = math.exp(-striking * way / max(1.0 - struck, _LEAST_LEFT))
    straight = a * flow[0] + b * flow[1] + c * flow[2]
    sx, sy, sz = flow[0] - straight * a, flow[1] - straight * b, flow[2] - straight * c
    across = math.sqrt(sx * sx + sy * sy + sz * sz)
    turned = size * (1.0 - left) / across if across > 0.0 else 0.0
    impulse[0] = impulse[0] * left + turned * sx
    impulse[1] = impulse[1] * left + turned * sy
    impulse[2] = impulse[2] * left + turned * sz
    return size - math.sqrt(impulse[0] ** 2 + impulse[1] ** 2 + impulse[2] ** 2)


@njit(nogil=True)
def _met(body: PackedBlockage, x: Array, a: float, b: float, c: float, sigma: float) -> tuple[float, float]:
    """Share of a slipstream along (a, b, c) that has met the body when its parcel is at x, and its growth per metre."""
    P, N = body.points, body.normals
    per = 1.0 / sigma
    struck = striking = 0.0
    for k in range(P.shape[0]):
        facing = -(a * N[k, 0] + b * N[k, 1] + c * N[k, 2])
        if facing <= 0.0:
            continue
        dx, dy, dz = per * (P[k, 0] - x[0]), per * (P[k, 1] - x[1]), per * (P[k, 2] - x[2])
        ahead = a * dx + b * dy + c * dz
        aside2 = dx * dx + dy * dy + dz * dz - ahead * ahead
        come = (_BEFORE - ahead) / _WITHIN
        if aside2 > _REACH * _REACH or come < -_REACH:
            continue
        share = facing * math.exp(-0.5 * aside2)
        struck += share * (0.5 * math.erfc(-math.sqrt(0.5) * come) if come < _REACH else 1.0)
        striking += share * math.exp(-0.5 * come * come)
    each = body.piece * per * per / (2.0 * math.pi)
    return each * struck, each * striking * per / (_WITHIN * math.sqrt(2.0 * math.pi))
