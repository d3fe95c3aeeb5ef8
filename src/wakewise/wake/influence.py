"""What a controller believes its jets would do to the target from where it believes to be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import one_of
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.core.jit.njit import njit
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import SUPERPOSITIONS, Superposition, gram, scattered_jet_gram
from wakewise.wake.jets import AxialJet, JetLaw
from wakewise.wake.learned import free_jet

if TYPE_CHECKING:
    from wakewise.robot.vehicles import Vehicle
    from wakewise.scene.targets import Region


class InfluenceMatrices(NamedTuple):
    """Matrices of D, shape (2 n, 2 n) each: `gram`, by which shares are chosen, and `sent`, of what thrusts do as sent.

    They are one unless `gram` also charges thrusts for what may be: others that join them, jets that go astray
    (`wakewise.control.null_space_allocation`).
    """

    gram: Array
    sent: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class InfluenceModel:
    """Places and axes of the thrusters on the body, the region's points in the world, and a wake model between them."""

    wake: WakeModel
    points_W_m: Array
    weights: Array
    positions_B_m: Array
    axes_B: Array
    areas_m2: Array
    superposition: Superposition = "coherent"

    def __post_init__(self) -> None:
        one_of(self.superposition, SUPERPOSITIONS, "superposition")
        n, m = len(self.points_W_m), len(self.positions_B_m)
        freeze(self, points_W_m=(n, 3), weights=(n,), positions_B_m=(m, 3), axes_B=(m, 3), areas_m2=(m,))
        if not np.sum(self.weights) > 0.0 or np.any(self.weights < 0.0):
            raise InputError("region: weights must not be negative, and at least one must be more than 0")

    @classmethod
    def of(
        cls, vehicle: Vehicle, region: Region, wake: WakeModel, superposition: Superposition = "coherent"
    ) -> InfluenceModel:
        """View of a region from a vehicle."""
        return cls(
            wake=wake,
            points_W_m=region.points_W_m,
            weights=region.weights,
            positions_B_m=vehicle.thruster_positions_B_m,
            axes_B=vehicle.thruster_axes_B,
            areas_m2=vehicle.disk_areas_m2,
            superposition=superposition,
        )

    @cached_property
    def total_weight(self) -> float:
        """Sum of the region's weights: D divided by it is a mean square speed."""
        return float(np.sum(self.weights))

    def gram(self, X_WB: Pose, flow: CrossFlow | None = None) -> Array:
        """Matrix G of D = s' G s, shape (2 n, 2 n), with the jets where a pose puts them and a flow carries them."""
        origins_W, axes_W = self.places(X_WB)
        place = (self.points_W_m, self.weights, origins_W, axes_W, self.areas_m2)
        return gram(self.wake, *place, superposition=self.superposition, flow=flow)

    def places(self, X_WB: Pose) -> tuple[Array, Array]:
        """Thruster origins and force axes in the world, shape (m, 3) each, of the body at a pose."""
        return cast("tuple[Array, Array]", _placed(X_WB.p_m, X_WB.q, self.positions_B_m, self.axes_B))

    def seen(self, X_WB: Pose, flow: CrossFlow | None = None) -> InfluenceMatrices:
        """Matrices of D: what to choose shares by, and what thrusts do as sent."""
        G = self.gram(X_WB, flow)
        return InfluenceMatrices(gram=G, sent=G)

    def astray(self, X_WB: Pose) -> Array | None:
        """Mean of D per newton of each jet if it goes astray, shape (2 n,) (see `disturbance`); None without a law."""
        if self._law is None:
            return None
        return cast(
            Array, scattered_jet_gram(self.points_W_m, self.weights, *self.places(X_WB), self.areas_m2, *self._law)
        )

    @cached_property
    def _law(self) -> JetLaw | None:
        jet = free_jet(self.wake)
        return jet.law if isinstance(jet, AxialJet) else None


@njit
def _placed(p: Array, q: Array, positions_B: Array, axes_B: Array) -> tuple[Array, Array]:
    """Thruster origins and axes in the world, shape (m, 3) each, of a body at p with unit quaternion q."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    origins, axes = np.empty(positions_B.shape), np.empty(axes_B.shape)
    for i in range(len(positions_B)):
        for row in range(3):
            origins[i, row] = p[row]
            axes[i, row] = 0.0
            for column in range(3):
                origins[i, row] += R[row, column] * positions_B[i, column]
                axes[i, row] += R[row, column] * axes_B[i, column]
    return origins, axes
