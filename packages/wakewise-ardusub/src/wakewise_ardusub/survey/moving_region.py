"""Protected region of a survey: the bed under and ahead of the vehicle, moving with it.

The points are fixed in a frame on the bed below the vehicle, turned along the line. The Gram matrix depends on poses in
that frame alone, so one influence model serves the whole survey: `MovingRegionAllocator` gives the allocation the
vehicle's pose, and the water's velocity, in the frame of the moment.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.allocation import Allocation, Layout
from wakewise.control.null_space_allocation import Allocator
from wakewise.control.pipeline import PipelineState
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.core.interfaces import BodyState
from wakewise.scene.targets import Region

AHEAD_M = (-0.3, 0.8)
ASIDE_M = (-0.3, 0.3)
APART_M = 0.1
HEIGHT_M = 0.02
"""Points lie so far above the bed, where wall jets are fastest."""


def bed_region() -> Region:
    """Points above the bed, of one weight each, in the frame of `bed_frame`: a rectangle from behind to ahead."""
    ahead, aside = (np.arange(low, high + 0.5 * APART_M, APART_M) for low, high in (AHEAD_M, ASIDE_M))
    points = np.array([[x, y, -HEIGHT_M] for x in ahead for y in aside])
    return Region(points_W_m=points, weights=np.ones(len(points)), distance_m=np.zeros(len(points)))


def bed_frame(place_W_m: Array, bed_m: float, way_rad: float) -> Pose:
    """Pose in W of the frame on the bed (depth `bed_m`) below a place, shape (3,), its x axis along `way_rad`."""
    return Pose(np.array([place_W_m[0], place_W_m[1], bed_m]), quat_from_euler(0.0, 0.0, way_rad))


@dataclass(kw_only=True, eq=False)
class MovingRegionAllocator:
    """Stage 4 of the pipeline with a region that moves; implements `wakewise.control.pipeline.WrenchAllocator`.

    Parameters
    ----------
    inner : Allocator
        For the region in the bed's frame.
    bed_m : float
        Depth of the bed below the vehicle, to be set before each step; NaN: unknown, and the least thrusts are taken.
    way_rad : float
        Direction of the line.
    """

    inner: Allocator
    bed_m: float = math.nan
    way_rad: float = 0.0

    @property
    def layout(self) -> Layout:
        """Thrusters and their limits."""
        return self.inner.layout

    def allocate(
        self, state: PipelineState, wrench_B: Array, estimate: BodyState, dt_s: float
    ) -> tuple[PipelineState, Allocation | None]:
        """Thrusts that make a wrench, shape (6,), within limits; None where the bed or its wash is not a number."""
        if not math.isfinite(self.bed_m):
            return state, None
        frame = bed_frame(estimate.X_WB.p_m, self.bed_m, self.way_rad)
        water = None
        if estimate.current_W_m_s is not None:  # steady jets of a moving vehicle: water passes it by
            water = frame.R.T @ (estimate.current_W_m_s - estimate.X_WB.R @ estimate.nu_B[:3])
        seen = replace(estimate, X_WB=frame.inverse() @ estimate.X_WB, current_W_m_s=water)
        return self.inner.allocate(state, wrench_B, seen, dt_s)
