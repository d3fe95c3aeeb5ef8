"""What may be asked of a reconstruction besides its photographs: lengths, masks, a box to cut to, where to stop."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.vision.reconstruction.clouds import read_cloud, write_cloud
from wakewise.vision.reconstruction.scale.bars import ScaleBars
from wakewise.vision.reconstruction.scale.position_fixes import PositionFixes

LEAST_POINTS = 100


@dataclass(frozen=True, kw_only=True, eq=False)
class CropBox:
    """What is kept of a model: from one corner to the other along its axes, in its units (m where it has a scale)."""

    low: Array
    high: Array

    def __post_init__(self) -> None:
        freeze(self, low=(3,), high=(3,))
        if not (np.isfinite(self.low).all() and np.isfinite(self.high).all() and (self.low < self.high).all()):
            raise InputError(
                f"crop: from {np.round(self.low, 6).tolist()} to {np.round(self.high, 6).tolist()}; each of X0 Y0 Z0 "
                "must be below X1 Y1 Z1"
            )

    def holds(self, points: Array) -> BoolArray:
        """Which points, shape (n, 3), lie in it."""
        return np.asarray(((points >= self.low) & (points <= self.high)).all(axis=1))

    def key(self) -> list[float]:
        """Plain values."""
        return [*self.low.tolist(), *self.high.tolist()]


@dataclass(frozen=True, kw_only=True)
class ReconstructionRequest:
    """bars: lengths that give scale; fixes: weak knowledge of places, which gives it without bars; masks: a folder of
    them; crop: what dense points and mesh are kept of; until: the last stage.
    """

    bars: ScaleBars | None = None
    fixes: PositionFixes | None = None
    masks: Path | None = None
    crop: CropBox | None = None
    until: Literal["sparse", "dense", "mesh"] = "mesh"


def cut_cloud(path: Path, box: CropBox) -> int:
    """Keep of a cloud on disk what lies in a box; how many points that is.

    Raises
    ------
    StageError
        If too little is left; the message says where the points are.
    """
    cloud = read_cloud(path)
    kept = box.holds(cloud.points_m)
    if kept.sum() < LEAST_POINTS:
        low, high = np.quantile(cloud.points_m, (0.01, 0.99), axis=0)
        path.unlink()
        raise StageError(
            f"crop: {kept.sum()} of {len(kept)} points lie in the box, at least {LEAST_POINTS} must; nearly all lie "
            f"from {np.round(low, 4).tolist()} to {np.round(high, 4).tolist()}"
        )
    write_cloud(path, cloud.only(kept))
    return int(kept.sum())
