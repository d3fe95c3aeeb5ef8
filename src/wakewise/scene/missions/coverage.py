"""Coverage of a target: parts of its surface that photographs show well enough for reconstruction; reasons for gaps.

A place is covered when three photographs show it well (`visibility`), one of which makes a stereo pair with each of the
other two, at an angle that suits how well both show it. The dense stage needs one depth map and one that agrees
(`agreeing_views` 2; COLMAP's fusion has the same 2 in `filter_min_num_consistent`). Of each photograph its pose and how
well it shows each sample are kept.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.jit.njit import njit
from wakewise.scene.missions.reachability import CandidateViews, direction_words
from wakewise.scene.missions.visibility import (
    BEST,
    CameraIntrinsics,
    SurfacePatches,
    VisibilityCriteria,
    view_quality,
    well_visible,
)

Counts = NDArray[np.uint8]

SHOWN, PAIRED, WELL = 1, 2, 3
"""How far a sample has come: shown by one photograph, by a pair, by three that hang together."""
LEAST_GAIN = 0.002
"""A view is not worth going to for less: a five-hundredth of the surface."""
PHOTO_WAY_M = 0.15
"""A photograph costs as much as this much way: half the distance of two views that make a good pair at 0.5 m."""
HALF = 0.5
"""A patch is seen well when more than half of it is, as it is complete when more than half of it is in the model."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Coverage:
    """What has been seen so far; each photograph makes a new one, at least as good."""

    patches: SurfacePatches
    need: VisibilityCriteria = field(default_factory=VisibilityCriteria)
    centres_W_m: Array  # shape (k, 3): where the photographs that count were taken from
    quality: Counts  # shape (k, n): how well each of them shows the samples, as `view_quality`
    partners: Counts  # shape (k, n): with how many others it makes a pair at each sample
    level: Counts  # shape (n,): how far each sample has come: 0, `SHOWN`, `PAIRED` or `WELL`
    views: CandidateViews  # from where the next photographs could be taken
    joins: Counts  # shape (c, n): with how many photographs each of them would make a pair at each sample
    # photos, blurred: photographs taken, and those of them that were not sharp enough to count.
    photos: int = 0
    blurred: int = 0
    sharpest: float = 0.0  # sharpness of the sharpest so far

    @classmethod
    def begin(
        cls, patches: SurfacePatches, views: CandidateViews | None = None, need: VisibilityCriteria | None = None
    ) -> Coverage:
        """Nothing seen yet; without views (`reachable_views`) nothing can be said of where to go next."""
        n = len(patches.points_W_m)
        views = views or CandidateViews.none(patches)
        return cls(
            patches=patches,
            need=need or VisibilityCriteria(),
            centres_W_m=np.empty((0, 3)),
            quality=np.empty((0, n), dtype=np.uint8),
            partners=np.empty((0, n), dtype=np.uint8),
            level=np.zeros(n, dtype=np.uint8),
            views=views,
            joins=np.zeros((len(views.places), n), dtype=np.uint8),
        )

    def seen(self, X_WC: Pose, camera: CameraIntrinsics, sharpness: float | None = None) -> Coverage:
        """The coverage with one photograph more.

        `X_WC`: where it was taken from, as it is believed. `sharpness`: in any unit that is higher for sharper ones and
        the same for all of a flight. A photograph less than `VisibilityCriteria.sharp` times as sharp as the sharpest
        before it does not count. None: it is sharp. Raises InputError if the sharpness is negative or not finite.
        """
        if sharpness is not None and not (math.isfinite(sharpness) and sharpness >= 0.0):
            raise InputError(f"sharpness: {sharpness!r}, allowed 0 or more, or None where it is not known")
        if sharpness is not None and sharpness < self.need.sharp * self.sharpest:
            return replace(self, photos=self.photos + 1, blurred=self.blurred + 1)
        quality = view_quality(self.patches, X_WC, camera, self.need)
        if not quality.any():
            return replace(self, photos=self.photos + 1)
        low, high = self.need.apart_rad
        limits = np.array([math.cos(low), math.cos(high), BEST * self.need.support])
        level, partners, own = _with_one_more(
            self.patches.points_W_m,
            self.centres_W_m,
            self.quality,
            self.partners,
            self.level,
            X_WC.p_m,
            quality,
            limits,
        )
        joins = _joined(
            self.patches.points_W_m,
            self.views.points_W_m(),
            self.views.quality,
            self.joins,
            X_WC.p_m,
            quality,
            limits,
        )
        return replace(
            self,
            centres_W_m=np.concatenate([self.centres_W_m, X_WC.p_m[None]]),
            quality=np.concatenate([self.quality, quality[None]]),
            partners=np.concatenate([partners, own[None]]),
            level=level,
            joins=joins,
            photos=self.photos + 1,
            sharpest=max(self.sharpest, sharpness or 0.0),
        )

    def without_view(self, number: int) -> Coverage:
        """The same with one place fewer to go to: what is photographed twice from one place gains little."""
        kept = np.arange(len(self.views.places)) != number
        views = replace(self.views, places=self.views.places[kept], quality=self.views.quality[kept])
        return replace(self, views=views, joins=self.joins[kept])

    @cached_property
    def score(self) -> Array:
        """How far each patch has come, 0 (never shown) to 1 (all of it seen well), shape (patches,)."""
        return self.patches.mean(np.maximum(self.level / WELL, self.covered))

    @cached_property
    def well(self) -> BoolArray:
        """Which patches are seen well, over more than half of their area; shape (patches,)."""
        return np.asarray(self.patches.mean(self.covered) > HALF)

    @property
    def share(self) -> float:
        """Share of the surface that is seen well, 0 to 1: the completeness that the model is expected to have."""
        return float(self.covered.mean())

    @property
    def sure(self) -> float:
        """Share that is seen well with a photograph to spare, 0 to 1, at most `share`.

        Where photographs overlap no more than they must, thin or rough parts may come out worse than expected: of ten
        models, each had what lies between the two, to two points (docs/research-log/0046).
        """
        if len(self.partners) == 0:
            return 0.0
        return float(self.patches.spread(self.partners.max(axis=0) >= WELL).mean())

    @cached_property
    def covered(self) -> BoolArray:
        """Samples that are seen well or lie so near to one that is that the model will reach them, shape (n,)."""
        return self.patches.spread(self.level == WELL)

    @cached_property
    def gains(self) -> Array:
        """By how much a sharp photograph from each view would raise the mean score, shape (c,)."""
        shows, level, joins = self.views.quality > 0, self.level[None], self.joins
        after = np.where(joins >= 2, WELL, np.where(joins == 1, np.minimum(level + 1, WELL), SHOWN))
        after = np.where((joins == 1) & (level < PAIRED), PAIRED, after)
        return np.asarray((shows * (np.maximum(after, level) - level.astype(np.int64))).mean(axis=1) / WELL)

    def best_view(self, X_WC: Pose) -> int | None:
        """Number of the view that raises the score most per metre of way from here; None where none is worth going."""
        if len(self.gains) == 0 or self.gains.max() < LEAST_GAIN:
            return None
        worth = np.where(self.gains >= LEAST_GAIN, self.gains, 0.0) / (self.views.ways_m(X_WC.p_m) + PHOTO_WAY_M)
        return int(np.argmax(worth))

    def next_view(self, X_WC: Pose) -> Pose | None:
        """Where to go next from a camera's place now, looking at the target; None where all within reach is seen."""
        best = self.best_view(X_WC)
        return None if best is None else self.views.pose(best)

    def words(self, X_WC: Pose) -> str:
        """Directions to the next view, in words for an operator at this pose."""
        view = self.next_view(X_WC)
        if view is None:
            return f"{100.0 * self.share:.0f} % is seen well, nothing within reach adds to it"
        return direction_words(X_WC, view, self.views.centre_W_m)


@njit
def _joined(
    points: Array, places: Array, quality: Counts, joins: Counts, centre: Array, own_quality: Counts, limits: Array
) -> Counts:
    """Pairs that each view would make at each sample, now that a photograph from `centre` shows some; shape (c, n)."""
    joins = joins.copy()
    for i in range(len(points)):
        if not own_quality[i]:
            continue
        x, y, z = centre[0] - points[i, 0], centre[1] - points[i, 1], centre[2] - points[i, 2]
        squared = x * x + y * y + z * z
        for j in range(len(places)):
            least = min(quality[j, i], own_quality[i])
            if not least or joins[j, i] == 255:
                continue
            a, b, c = places[j, 0] - points[i, 0], places[j, 1] - points[i, 1], places[j, 2] - points[i, 2]
            dot, lengths = x * a + y * b + z * c, math.sqrt(squared * (a * a + b * b + c * c))
            if limits[1] * lengths <= dot <= limits[0] * lengths and limits[2] * (lengths - dot) <= least * lengths:
                joins[j, i] += 1
    return joins


@njit
def _with_one_more(
    points: Array,
    centres: Array,
    quality: Counts,
    partners: Counts,
    level: Counts,
    centre: Array,
    own_quality: Counts,
    limits: Array,
) -> tuple[Counts, Counts, Counts]:
    """Levels and partners with another photograph, and that one's own partners, shape (n,).

    `limits` are the cosines of the least and the largest angle of a pair, and the quality that it needs over one minus
    the cosine of its angle.
    """
    k, n = quality.shape
    level, partners, own = level.copy(), partners.copy(), np.zeros(n, np.uint8)
    for i in range(n):
        if not own_quality[i]:
            continue
        x, y, z = centre[0] - points[i, 0], centre[1] - points[i, 1], centre[2] - points[i, 2]
        squared, most = x * x + y * y + z * z, 0
        for j in range(k):
            least = min(quality[j, i], own_quality[i])
            if not least:
                continue
            a, b, c = centres[j, 0] - points[i, 0], centres[j, 1] - points[i, 1], centres[j, 2] - points[i, 2]
            dot, lengths = x * a + y * b + z * c, math.sqrt(squared * (a * a + b * b + c * c))
            if limits[1] * lengths <= dot <= limits[0] * lengths and limits[2] * (lengths - dot) <= least * lengths:
                if own[i] < 255:
                    own[i] += 1
                if partners[j, i] < 255:
                    partners[j, i] += 1
                most = max(most, int(partners[j, i]))
        most = max(most, int(own[i]))
        level[i] = max(int(level[i]), min(most, 2) + 1)
    return level, partners, own


GRAZING_RAD = math.radians(87.0)


@dataclass(frozen=True, kw_only=True)
class CoverageGaps:
    """Shares of the surface that are not seen well, 0 to 1, by the first reason that holds; they add up to the rest."""

    unseen: float  # in no photograph: hidden by the target itself, facing away from all, or outside every picture
    poorly: float  # in some, but only at a slant or from too far
    seldom: float  # shown, but not well enough by three that make pairs


def find_coverage_gaps(coverage: Coverage, taken_from: Iterable[Pose], lens: CameraIntrinsics) -> CoverageGaps:
    """Sort what is not seen well by why.

    `coverage`: after photographs. `taken_from`: X_WC of those of them that were sharp; half of the time of counting
    them first is spent again.
    """
    patches = coverage.patches
    lenient = replace(coverage.need, incidence_rad=GRAZING_RAD, pixel_m=math.inf)
    glimpsed = np.zeros(len(patches.points_W_m), dtype=np.bool_)
    for X_WC in taken_from:
        glimpsed |= well_visible(patches, X_WC, lens, lenient)
    shown, left = coverage.level > 0, ~coverage.covered
    glimpsed |= shown
    return CoverageGaps(
        unseen=float((left & ~glimpsed).mean()),
        poorly=float((left & glimpsed & ~shown).mean()),
        seldom=float((left & shown).mean()),
    )
