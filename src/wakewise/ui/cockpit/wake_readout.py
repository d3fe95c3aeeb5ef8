"""What the thrusts of now do to the target, as the controller's own wake model sees it.

The flown thrusts are held against those that direct allocation, the least thrusts, would give for the same wrench at
the same place: what differs is what sparing the target brings. The jets are carried by the current that the estimator
finds, as they are for the controller (see `wakewise.control.watch`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from wakewise.allocation import disturbance_of, min_norm_allocation
from wakewise.control.spare import watching
from wakewise.control.watch import Watch
from wakewise.core.arrays import Array, freeze
from wakewise.core.interfaces import BodyState
from wakewise.operation import Parts
from wakewise.simulation.tank.probes import surface_points
from wakewise.wake import InfluenceModel, free_jet
from wakewise.wake.advected_jets import CrossFlow
from wakewise.wake.disturbance import carried_velocity
from wakewise.wake.jets import AxialJet

POINTS = 300
"""Places on the target's surface that are shown."""
_LEAST_N = 1e-3


@dataclass(frozen=True, kw_only=True, eq=False)
class WakeReadout:
    """A vehicle's thrusters, a target's region and the wake model between them.

    `points_W_m`, shape (n, 3), are places on the target where it is taken to be, evenly by area; `true_points_W_m` the
    same places where it is.
    """

    view: InfluenceModel
    watch: Watch
    points_W_m: Array
    true_points_W_m: Array

    def __post_init__(self) -> None:
        n = len(self.points_W_m)
        freeze(self, points_W_m=(n, 3), true_points_W_m=(n, 3))

    @classmethod
    def of(cls, parts: Parts) -> WakeReadout:
        """The gauges of a flight."""
        true = surface_points(parts.target, POINTS, np.random.default_rng(parts.scenario.seed))
        off_m = parts.found_target.centre_W_m - parts.target.centre_W_m
        made_of = (parts.vehicle, parts.region, parts.wake)
        return cls(
            view=InfluenceModel.of(*made_of, parts.control.superposition),
            watch=watching(*made_of, parts.control),
            points_W_m=true + off_m,
            true_points_W_m=true,
        )

    def disturbances(self, estimate: BodyState, thrusts_N: Array) -> tuple[float, float]:
        """D of thrusts, shape (n,), and D of the least thrusts that make the same wrench, in (m/s)^2."""
        layout = self.watch.layout
        direct_N = min_norm_allocation(layout, layout.B @ thrusts_N).thrusts_N
        one, other = (disturbance_of(self.watch.gram(estimate, thrusts), thrusts) for thrusts in (thrusts_N, direct_N))
        return one, other

    def rms_m_s(self, disturbance: float) -> float:
        """Root mean square speed of the water at the target that a disturbance D in (m/s)^2 amounts to."""
        return math.sqrt(disturbance / self.view.total_weight) if disturbance >= 0.0 else math.nan

    def predicted_m_s(self, estimate: BodyState, thrusts_N: Array) -> Array:
        """Speed that the jets of thrusts, shape (n,), have at `points_W_m` by the wake model, shape (points,)."""
        on = np.abs(thrusts_N) > _LEAST_N
        if not on.any():
            return np.zeros(len(self.points_W_m))
        X_WB, view, size_N = estimate.X_WB, self.view, np.abs(thrusts_N[on])
        jets_W = -np.sign(thrusts_N[on])[:, None] * (view.axes_B[on] @ X_WB.R.T)
        place = (self.points_W_m, X_WB.apply(view.positions_B_m[on]), jets_W, view.areas_m2[on])
        flow = self.watch.flow(estimate, thrusts_N)
        if flow is not None and isinstance(free_jet(view.wake), AxialJet):
            own = CrossFlow(current_W_m_s=flow.current_W_m_s, unsure_m_s=flow.unsure_m_s, thrusts_N=thrusts_N[on])
            unit = carried_velocity(view.wake, *place, size_N, own)
        else:
            unit = view.wake.unit_velocity(*place)
        velocity = np.einsum("i,inx->nx", np.sqrt(size_N), unit)
        return np.asarray(np.linalg.norm(velocity, axis=1))
