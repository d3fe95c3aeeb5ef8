"""Derivatives of the disturbance by thrust, position and attitude of the vehicle; Gauss-Newton blocks for a planner.

Variables. Position p_WB in world axes (m). Attitude as a rotation vector theta on the body's side, R_WB exp([theta]),
so in body axes (rad). Thrusts (N).

Roots at zero. D goes with s = sqrt(T), whose slope at T = 0 is infinite. With `smooth_N` = e > 0 the roots are

    s(T+) = a(T) / (T^2 + e^2)^(1/4),   a(T) = (T + sqrt(T^2 + e^2/4)) / 2,   s(T-) = the same of -T

which is smooth, within 1 % of sqrt(T) for T > 4.4 e, and at T = 0 leaves a speed as of e / 16 newtons in either
direction (0.03 N for e = 0.5 N). With e = 0 the roots are exact. Then a thrust of exactly zero has slope 0 in the
result: with jets of other thrusters in the same place D has a cusp there, with none it has a kink, and 0 stands for
"stay".

The edge. A sharp cone makes D jump when a point crosses the edge. Between crossings the derivatives here are exact; but
a region is made of finitely many points, and the derivative of their sum knows nothing of the crossings to come, which
for the region that they stand for add a flux through the moving edge (12-15 % of the gradient in the median, more on
bad days). A smooth edge has that flux as the slope of the edge itself, and its derivatives contain it: give cones
an edge of about 3 deg in anything that follows gradients. The jets' Gaussian tails need nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array
from wakewise.core.checks import one_of
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.wake.finite_difference import FiniteDifferenceWake
from wakewise.wake.gram import gram_slope_sum
from wakewise.wake.input_checks import explain, same_sizes
from wakewise.wake.jets import AxialJet
from wakewise.wake.stage_cost import stage_sum
from wakewise.wake.wall_jet import ImpingingJet
from wakewise.wake.wall_jet_gram import floor_gram_sum, floor_stage_sum

Superposition = Literal["coherent", "incoherent"]
SUPERPOSITIONS: tuple[Superposition, ...] = get_args(Superposition)
"""How jets that meet may be added up."""


@dataclass(frozen=True, eq=False)
class GramDerivatives:
    """G, shape (2 m, 2 m), and `by_pose`, (6, 2 m, 2 m): by position in W (0 to 2), rotation vector in B (3 to 5)."""

    gram: Array
    by_pose: Array


@dataclass(frozen=True, eq=False)
class DisturbanceDerivatives:
    """D in (m/s)^2; `by_pose`, shape (6,), per m and per rad; `by_thrust`, shape (m,), per N."""

    value: float
    by_pose: Array
    by_thrust: Array


@dataclass(frozen=True, eq=False)
class GaussNewton:
    """D, its gradient, (6 + m,), and the matrix 2 J'J, (6 + m, 6 + m), over (position, rotation vector, thrusts).

    D = r'r. The residuals r of the coherent sum are the three components of every point's velocity times the root of
    its weight, without a floor as seen by the body's axes; of the incoherent sum, every jet's velocity at every point.
    For thrusts 2 J'J has only half the curvature that bounds D from above: double that block for a majoriser.
    """

    value: float
    gradient: Array
    hessian: Array


def gram_with_derivatives(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    X_WB: Pose,
    positions_B_m: Array,
    axes_B: Array,
    areas_m2: Array,
    superposition: Superposition = "coherent",
) -> GramDerivatives:
    """G of D = s' G s (see `wakewise.wake.gram`) and how it changes with the vehicle's pose.

    Parameters
    ----------
    model : WakeModel
        One of this room, or one from outside, whose derivatives are central differences
        (`wakewise.wake.finite_difference`).
    region_points_W : ndarray, shape (n, 3)
    weights : ndarray, shape (n,)
    X_WB : Pose
    positions_B_m, axes_B : ndarray, shape (m, 3)
        Centres of the thrusters' disks and unit force axes (for T > 0), on the body.
    areas_m2 : ndarray, shape (m,)
    superposition : "coherent" or "incoherent"

    Raises
    ------
    InputError
        If shapes do not belong together, something is not finite, a weight is negative or an area not positive.
    """
    one_of(superposition, SUPERPOSITIONS, "superposition")
    same_sizes(region_points_W, weights, positions_B_m, axes_B, areas_m2)
    place = (region_points_W, weights, X_WB.p_m, X_WB.q, positions_B_m, axes_B, areas_m2)
    if isinstance(model, AxialJet):
        G, dG, check = gram_slope_sum(*place, *model.law)
    elif isinstance(model, ImpingingJet):
        G, dG, check = floor_gram_sum(*place, *model.jet.law, model.numbers, True)
    else:
        (G, dG), check = _numeric(model, *place, 0.0, superposition).gram_slopes(X_WB), 0.0
    if check != 0.0:
        raise explain(region_points_W, weights, positions_B_m, axes_B, areas_m2)
    if superposition == "incoherent":
        keep = np.eye(len(G))
        G, dG = G * keep, dG * keep
    return GramDerivatives(G, dG)


def disturbance_slopes(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    X_WB: Pose,
    positions_B_m: Array,
    axes_B: Array,
    areas_m2: Array,
    thrusts_N: ArrayLike,
    *,
    smooth_N: float = 0.0,
    superposition: Superposition = "coherent",
) -> DisturbanceDerivatives:
    """D at thrusts, shape (m,), and its gradient; arguments and errors as for `gram_with_derivatives`.

    `smooth_N` rounds off the roots near zero thrust, see this module's text; 0 is exact.
    """
    place = (region_points_W, weights, X_WB, positions_B_m, axes_B, areas_m2)
    D, gradient, _ = _stage(model, *place, thrusts_N, smooth_N, superposition, False)
    return DisturbanceDerivatives(D, gradient[:6], gradient[6:])


def gauss_newton(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    X_WB: Pose,
    positions_B_m: Array,
    axes_B: Array,
    areas_m2: Array,
    thrusts_N: ArrayLike,
    *,
    smooth_N: float = 0.5,
    superposition: Superposition = "coherent",
) -> GaussNewton:
    """D at thrusts with gradient and Gauss-Newton matrix; arguments and errors as for `gram_with_derivatives`."""
    place = (region_points_W, weights, X_WB, positions_B_m, axes_B, areas_m2)
    return GaussNewton(*_stage(model, *place, thrusts_N, smooth_N, superposition, True))


def smooth_roots(thrusts_N: ArrayLike, smooth_N: float) -> Array:
    """Vector (s(T+), s(T-)), shape (2 m,), of thrusts, shape (m,), rounded off near zero: see this module's text."""
    T = np.asarray(thrusts_N, dtype=np.float64)
    split = np.concatenate([T, -T])
    if smooth_N == 0.0:
        return np.asarray(np.sqrt(np.maximum(split, 0.0)))
    return np.asarray(0.5 * (split + np.hypot(split, 0.5 * smooth_N)) / np.sqrt(np.hypot(split, smooth_N)))


def _stage(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    X_WB: Pose,
    positions_B_m: Array,
    axes_B: Array,
    areas_m2: Array,
    thrusts_N: ArrayLike,
    smooth_N: float,
    superposition: Superposition,
    hessian: bool,
) -> tuple[float, Array, Array]:
    same_sizes(region_points_W, weights, positions_B_m, axes_B, areas_m2)
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    if thrusts.shape != areas_m2.shape:
        raise InputError(f"thrusts_N: shape {thrusts.shape}, allowed {areas_m2.shape}, one per thruster")
    if not smooth_N >= 0.0:
        raise InputError(f"smooth_N {smooth_N:g}: must be 0 or more")
    place = (region_points_W, weights, X_WB.p_m, X_WB.q, positions_B_m, axes_B, areas_m2)
    how = (thrusts, float(smooth_N), superposition == "coherent", hessian)
    if isinstance(model, AxialJet):
        D, gradient, H, check = stage_sum(*place, *model.law, *how)
    elif isinstance(model, ImpingingJet):
        D, gradient, H, check = floor_stage_sum(*place, *model.jet.law, model.numbers, *how)
    else:
        (D, gradient, H), check = _numeric(model, *place, smooth_N, superposition).stage(X_WB, thrusts), 0.0
    if check != 0.0:
        raise explain(region_points_W, weights, positions_B_m, axes_B, areas_m2)
    if not np.isfinite(D):
        raise InputError("thrusts_N: holds NaN or infinity, every element must be finite")
    return D, gradient, H


def _numeric(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    _p: Array,
    _q: Array,
    positions_B_m: Array,
    axes_B: Array,
    areas_m2: Array,
    smooth_N: float,
    superposition: Superposition,
) -> FiniteDifferenceWake:
    return FiniteDifferenceWake(
        model=model,
        points_W_m=region_points_W,
        weights=weights,
        positions_B_m=positions_B_m,
        axes_B=axes_B,
        areas_m2=areas_m2,
        coherent=superposition == "coherent",
        smooth_N=smooth_N,
    )
