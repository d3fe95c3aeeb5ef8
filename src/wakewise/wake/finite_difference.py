"""Disturbance D and its derivatives by central differences, for wake models that have only `unit_velocity`.

Residuals r = sqrt(w) v at every point, D = r'r, gradient 2 J'r, Gauss-Newton matrix 2 J'J. By thrusts J is exact, since
v is linear in the roots; by pose it is a central difference. The models of this package have compiled sums instead
(`wakewise.wake.gram`, `wakewise.wake.plan_disturbance`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_rotvec, quat_multiply
from wakewise.core.interfaces import WakeModel
from wakewise.wake.gram import smooth_root

STEP_M, STEP_RAD = 1e-4, 1e-4
"""Half-widths of the differences: far below a jet's width, far above the rounding of a velocity."""

MOST_POINTS = 100
"""A planner asks at this many points: thirteen looks at every stage take their time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FiniteDifferenceWake:
    """A wake model over weighted points, seen from a body; nothing in it is compiled."""

    model: WakeModel
    points_W_m: Array  # shape (P, 3)
    weights: Array  # shape (P,)
    # positions_B_m, axes_B: shape (m, 3): centres of the thrusters' disks and unit force axes (for T > 0), on the body.
    positions_B_m: Array
    axes_B: Array
    areas_m2: Array  # shape (m,)
    coherent: bool = True  # velocities of jets that meet add up; else squares of speeds do
    smooth_N: float = 0.0  # thrust below which the root is rounded off, see `wakewise.wake.smooth_roots`

    def velocities(self, X_WB: Pose) -> Array:
        """Velocity per square root of newton in B, shape (2 m, P, 3): row i with T_i > 0, row m + i with T_i < 0."""
        origins, axes = X_WB.apply(self.positions_B_m), self.axes_B @ X_WB.R.T
        found = self.model.unit_velocity(
            self.points_W_m,
            np.concatenate([origins, origins]),
            np.concatenate([-axes, axes]),
            np.concatenate([self.areas_m2, self.areas_m2]),
        )
        wanted = (2 * len(origins), len(self.points_W_m), 3)
        if np.shape(found) != wanted:
            raise InputError(f"wake model {self.model.name}: gave shape {np.shape(found)}, must give {wanted}")
        # As seen by the body: D does not depend on the axes, and the Gauss-Newton matrix is that of our own kernels.
        return np.asarray(np.asarray(found, dtype=np.float64) @ X_WB.R)

    def value(self, X_WB: Pose, thrusts_N: Array) -> float:
        """D in (m/s)^2 at thrusts, shape (m,)."""
        r = self._residuals(self.velocities(X_WB), _roots(thrusts_N, self.smooth_N)[0])
        return float(r @ r)

    def stage(self, X_WB: Pose, thrusts_N: Array) -> tuple[float, Array, Array]:
        """D, its gradient, (6 + m,), and 2 J'J, (6 + m, 6 + m), by position in W, rotation vector in B, thrusts."""
        roots, slopes = _roots(thrusts_N, self.smooth_N)
        V, m = self.velocities(X_WB), len(thrusts_N)
        r = self._residuals(V, roots)
        J = np.empty((len(r), 6 + m))
        for k in range(6):
            J[:, k] = self._by_pose(X_WB, k, roots)
        for i in range(m):
            own = np.zeros(2 * m)
            own[i], own[m + i] = slopes[i], slopes[m + i]
            J[:, 6 + i] = self._residuals(V, own)
        return float(r @ r), 2.0 * J.T @ r, 2.0 * J.T @ J

    def gram_slopes(self, X_WB: Pose) -> tuple[Array, Array]:
        """G, shape (2 m, 2 m), and its differences by pose, (6, 2 m, 2 m)."""
        G = self._gram(X_WB)
        slopes = []
        for k in range(6):
            step = STEP_M if k < 3 else STEP_RAD
            slopes.append((self._gram(_moved(X_WB, k, step)) - self._gram(_moved(X_WB, k, -step))) / (2.0 * step))
        return G, np.array(slopes)

    def _gram(self, X_WB: Pose) -> Array:
        V = self.velocities(X_WB)
        return np.asarray(np.einsum("n,inx,jnx->ij", self.weights, V, V))

    def _residuals(self, V: Array, roots: Array) -> Array:
        """Roots of the weights times velocities: of all jets together, or of each."""
        one = np.sqrt(self.weights)[:, None] * roots[:, None, None] * V
        return np.asarray((one.sum(axis=0) if self.coherent else one).reshape(-1))

    def _by_pose(self, X_WB: Pose, k: int, roots: Array) -> Array:
        step = STEP_M if k < 3 else STEP_RAD
        ahead = self._residuals(self.velocities(_moved(X_WB, k, step)), roots)
        behind = self._residuals(self.velocities(_moved(X_WB, k, -step)), roots)
        return np.asarray((ahead - behind) / (2.0 * step))


def thinned(points_W_m: Array, weights: Array, most: int = MOST_POINTS) -> tuple[Array, Array]:
    """At most so many of weighted points, evenly from their order, with weights that add up to the same."""
    if len(points_W_m) <= most:
        return points_W_m, weights
    picks = np.unique(np.linspace(0, len(points_W_m) - 1, most).astype(int))
    some = weights[picks]
    total = float(some.sum())
    if not total > 0.0:
        return points_W_m, weights
    return points_W_m[picks], some * (float(weights.sum()) / total)


def _moved(X_WB: Pose, k: int, by: float) -> Pose:
    """The pose moved along axis k of W (0 to 2), or turned about axis k - 3 of the body."""
    step = np.zeros(3)
    step[k % 3] = by
    if k < 3:
        return Pose(X_WB.p_m + step, X_WB.q)
    return Pose(X_WB.p_m, quat_multiply(X_WB.q, quat_from_rotvec(step)))


def _roots(thrusts_N: Array, smooth_N: float) -> tuple[Array, Array]:
    """(s(T+), s(T-)), shape (2 m,), rounded off near zero as `smooth_roots` does it, and their slopes by T."""
    T = np.asarray(thrusts_N, dtype=np.float64)
    sides = [smooth_root(sign * thrust, smooth_N) for sign in (1.0, -1.0) for thrust in T]
    signs = np.concatenate([np.ones(len(T)), -np.ones(len(T))])
    return np.array([root for root, _ in sides]), signs * np.array([slope for _, slope in sides])
