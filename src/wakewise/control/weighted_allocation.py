"""`weighted-pseudo-inverse`: dynamic positioning with a price on thrusters that blow at the target; no wake model.

The strongest simple rival. It takes the wrench of `dp` and minimises sum_i c_i T_i^2 under B T = wrench (weighted
pseudo-inverse: T. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2021, section 11.2). A weight c_i
is 1, and more for a thruster that blows at the target in the direction of its thrust:

- its jet points at the target to within `AIM_DEG` degrees (in proportion to the cosine), or
- it is a level thruster on the target's side of the middle and blows to that side. Jets of such a pair cross and merge.

The price grows with the thrust that the least thrusts would send at the target: none below the first of `ONSET_N`, all
of it above the second. The result is blended with the least thrusts until limits and power allow it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from wakewise.allocation import Allocation, Layout, PowerLaw, disturbance_of, min_norm_allocation
from wakewise.control.null_space_allocation import FULL, power_law, vehicle_layout
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, WakeModel
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Region
from wakewise.wake.influence import InfluenceModel

if TYPE_CHECKING:
    from wakewise.control.pipeline import PipelineState
    from wakewise.control.settings import ControlSettings

PRICE = 30.0
"""Weight that a thruster gains if it blows straight at the target. With it and the three constants below the rule was
compared with `wake-aware` before it became a method; none was fitted to a scenario."""
ONSET_N = (0.10, 0.30)
AIM_DEG = 25.0
POWER_RATIO = 1.3
"""Electrical power allowed, as a multiple of that of the least thrusts."""
EXTRA_W = 0.5
"""Power allowed beside that, so that a vehicle almost at rest may choose, too."""
LEVEL = 0.5
"""A thruster is level if the vertical part of its axis is less than this."""
TO_SIDE = 0.3
"""Least share of a level jet's speed towards the target's side that counts as blowing to it."""
NEAR_M = 0.15
"""A target less than this off the vertical through the vehicle has no side."""
SWEEPS = 8
"""Weights depend on the signs of thrusts, so the pseudo-inverse is repeated; each sweep goes half the way."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WeightedAllocator:
    """Stage 4 of the pipeline: weighted pseudo-inverse by the geometry of thrusters and target.

    `view` is only asked what D the thrusts cause.
    """

    layout: Layout
    law: PowerLaw
    positions_B_m: Array  # shape (n, 3)
    axes_B: Array  # shape (n, 3): direction of the force of a positive thrust
    target_W_m: Array  # shape (3,): middle of the region
    view: InfluenceModel

    def allocate(
        self, state: PipelineState, wrench_B: Array, estimate: BodyState, dt_s: float
    ) -> tuple[PipelineState, Allocation | None]:
        """Thrusts that make a wrench, shape (6,), within limits; None if the wake model gives what is not finite."""
        del dt_s
        gram = self.view.gram(estimate.X_WB)
        if not np.isfinite(gram).all():
            return state, None
        least = min_norm_allocation(self.layout, wrench_B, gram)
        aims = self.aims(estimate)
        sent_N = float((np.maximum(least.thrusts_N, 0.0) * aims[0] + np.maximum(-least.thrusts_N, 0.0) * aims[1]).sum())
        price = PRICE * float(np.clip((sent_N - ONSET_N[0]) / (ONSET_N[1] - ONSET_N[0]), 0.0, 1.0))
        if price == 0.0 or least.scale < FULL:
            return state, least
        thrusts_N = self._blended(least.thrusts_N, self._weighted(least.thrusts_N, wrench_B, 1.0 + price * aims))
        return state, replace(
            least,
            thrusts_N=thrusts_N,
            wrench_B=self.layout.B @ thrusts_N,
            disturbance=disturbance_of(gram, thrusts_N),
            method="weighted pseudo-inverse",
        )

    def aims(self, estimate: BodyState) -> Array:
        """Share, 0 to 1, by which each thruster blows at the target: row 0 for thrusts > 0, row 1 for thrusts < 0.

        Shape (2, n). A positive thrust sends its jet against the thruster's axis.
        """
        to_target_B = estimate.X_WB.R.T @ (self.target_W_m - estimate.X_WB.p_m)
        sight = to_target_B - self.positions_B_m
        sight /= np.linalg.norm(sight, axis=1, keepdims=True)
        side = np.array([to_target_B[0], to_target_B[1], 0.0])
        aside_m = float(np.linalg.norm(side))
        side /= max(aside_m, 1e-9)
        before = (np.abs(self.axes_B[:, 2]) < LEVEL) & (self.positions_B_m @ side > 0.0) & (aside_m > NEAR_M)
        edge = math.cos(math.radians(AIM_DEG))
        rows = []
        for jets_B in (-self.axes_B, self.axes_B):
            straight = np.clip((np.einsum("ij,ij->i", jets_B, sight) - edge) / (1.0 - edge), 0.0, 1.0)
            rows.append(np.maximum(straight, before & (jets_B @ side > TO_SIDE)))
        return np.array(rows)

    def _weighted(self, least_N: Array, wrench_B: Array, weights: Array) -> Array:
        """Thrusts, shape (n,), of least weighted squares; `weights`, shape (2, n), by the sign of the thrust."""
        thrusts_N = least_N
        for sweep in range(SWEEPS):
            scaled = self.layout.B / np.where(thrusts_N > 0.0, weights[0], weights[1])
            # Of a wrench that the thrusters cannot make, the part that they can.
            found = scaled.T @ np.linalg.pinv(self.layout.B @ scaled.T, hermitian=True) @ wrench_B
            thrusts_N = found if sweep == 0 else 0.5 * (thrusts_N + found)
        return thrusts_N

    def _blended(self, least_N: Array, desired_N: Array) -> Array:
        """The largest tenth of the way from the least to the desired thrusts that limits and power allow."""
        most_W = POWER_RATIO * float(self.law.power_W(least_N)) + EXTRA_W
        for tenths in range(10, 0, -1):
            thrusts_N = least_N + tenths / 10.0 * (desired_N - least_N)
            inside = (thrusts_N >= self.layout.lower_N) & (thrusts_N <= self.layout.upper_N)
            if inside.all() and float(self.law.power_W(thrusts_N)) <= most_W:
                return thrusts_N
        return least_N


def weighted_allocator(
    vehicle: Vehicle, region: Region, wake: WakeModel, settings: ControlSettings
) -> WeightedAllocator:
    """The allocator of a vehicle near a region; the wake model is only asked what D the thrusts cause."""
    layout = vehicle_layout(vehicle)
    return WeightedAllocator(
        layout=layout,
        law=power_law(vehicle),
        positions_B_m=vehicle.thruster_positions_B_m,
        axes_B=vehicle.thruster_axes_B,
        target_W_m=region.weights @ region.points_W_m / region.weights.sum(),
        view=InfluenceModel.of(vehicle, region, wake, settings.superposition),
    )
