"""Influence matrix of a vehicle: the Gram matrix G of D = s' G s at a pose, from thruster geometry and wake model."""

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
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import SUPERPOSITIONS, Superposition, gram, scattered_jet_gram
from wakewise.wake.gram import place
from wakewise.wake.jets import AxialJet, JetLaw
from wakewise.wake.learned import free_jet

if TYPE_CHECKING:
    from wakewise.robot.vehicles import Vehicle
    from wakewise.scene.targets import Region


class InfluenceMatrices(NamedTuple):
    """Matrices of D, shape (2 n, 2 n) each: `gram` for the choice of thrusts, `actual` for D of the thrusts themselves.

    They differ only if `gram` has extra costs: jets that may merge, jets of uncertain direction
    (`wakewise.control.null_space_allocation`).
    """

    gram: Array
    actual: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class InfluenceModel:
    """Thruster positions and axes on the body, weighted points of the region in the world, and a wake model."""

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
        """Influence of a vehicle on a region."""
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
        """Matrix G of D = s' G s, shape (2 n, 2 n), at a pose; `flow` advects the jets."""
        origins_W, axes_W = self.places(X_WB)
        place = (self.points_W_m, self.weights, origins_W, axes_W, self.areas_m2)
        return gram(self.wake, *place, superposition=self.superposition, flow=flow)

    def places(self, X_WB: Pose) -> tuple[Array, Array]:
        """Thruster origins and force axes in the world, shape (m, 3) each, of the body at a pose."""
        _, origins_W, axes_W = place(X_WB.p_m, X_WB.q, self.positions_B_m, self.axes_B)
        return origins_W, axes_W

    def matrices(self, X_WB: Pose, flow: CrossFlow | None = None) -> InfluenceMatrices:
        """Matrices of D for the choice of thrusts and for its value."""
        G = self.gram(X_WB, flow)
        return InfluenceMatrices(gram=G, actual=G)

    def scattered_gram(self, X_WB: Pose) -> Array | None:
        """Mean of D per newton of each jet of uncertain direction, shape (2 n,) (`scattered_jet_gram`), or None."""
        if self._law is None:
            return None
        return cast(
            Array, scattered_jet_gram(self.points_W_m, self.weights, *self.places(X_WB), self.areas_m2, *self._law)
        )

    @cached_property
    def _law(self) -> JetLaw | None:
        jet = free_jet(self.wake)
        return jet.law if isinstance(jet, AxialJet) else None
