"""Why parts of a target were not seen well: what no photograph can show, and what photographs showed too poorly."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.geometry import Pose
from wakewise.scene.missions.coverage import Coverage
from wakewise.scene.missions.visibility import CameraIntrinsics, well_visible

GRAZING_RAD = math.radians(87.0)


@dataclass(frozen=True, kw_only=True)
class CoverageGaps:
    """Shares of the surface that are not seen well, 0 to 1, by the first reason that holds; they add up to the rest.

    Parameters
    ----------
    unseen : float
        In no photograph: hidden by the target itself, facing away from all, or outside every picture.
    poorly : float
        In some, but only at a slant or from too far.
    seldom : float
        Shown well, but not by three that make pairs.
    """

    unseen: float
    poorly: float
    seldom: float


def find_coverage_gaps(coverage: Coverage, taken_from: Iterable[Pose], lens: CameraIntrinsics) -> CoverageGaps:
    """Sort what is not seen well by why.

    Parameters
    ----------
    coverage : Coverage
        After photographs.
    taken_from : iterable of Pose
        X_WC of those of them that were sharp; half of the time of counting them first is spent again.
    lens : CameraIntrinsics
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
