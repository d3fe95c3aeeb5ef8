"""Disturbance D of a target: weighted sum of squared water speeds at the points of a region; Gram matrix, derivatives.

Coherent (as in the paper): velocities of jets add up, D = sum_j w_j |sum_i v_i(p_j)|^2. With v_i proportional to
sqrt(|T_i|) this is D = s' G s, s = (sqrt(T+), sqrt(T-)). The Gram matrix G depends on the thrusters' poses only.

Incoherent: squares add up, D = sum_j w_j sum_i |v_i(p_j)|^2, which keeps only the diagonal of G. It is linear in the
split thrusts (T+, T-) >= 0, hence convex, and excludes cancellation of jets.

Derivatives are by position p_WB in world axes (m), rotation vector theta on the body's side, R_WB exp([theta]) (rad),
and thrusts (N).

Roots at zero. s = sqrt(T) has infinite slope at T = 0. With `smooth_N` = e > 0 the roots are

    s(T+) = a(T) / (T^2 + e^2)^(1/4),   a(T) = (T + sqrt(T^2 + e^2/4)) / 2,   s(T-) = the same of -T

which are smooth, within 1 % of sqrt(T) for T > 4.4 e, and at T = 0 leave the speed of e / 16 newtons in both directions
(0.03 N for e = 0.5 N). With e = 0 the roots are exact and a thrust of zero has slope 0.

Edge of a cone. A sharp edge makes D jump when a point crosses it; the flux through the moving edge (12-15 % of the
gradient in the median) is missing from the derivatives. A smooth edge contains it: give cones an edge of about 3 deg
where gradients are used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import one_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import WakeModel
from wakewise.core.jit.njit import njit
from wakewise.wake.advected_jets import CrossFlow, add_advected_wall_jets, plumes
from wakewise.wake.finite_difference import FiniteDifferenceWake
from wakewise.wake.gram import dot, gram_slope_sum, gram_sum, stage_sum
from wakewise.wake.jets import FAST, AxialJet
from wakewise.wake.learned import free_jet
from wakewise.wake.wall_jet import ImpingingJet, bed_gram_sum, bed_stage_sum


def same_sizes(points: Array, weights: Array, origins: Array, axes: Array, areas: Array) -> None:
    """Refuse arrays whose shapes do not belong together.

    Raises InputError: naming the array, its shape and the one it should have.
    """
    m = len(areas)
    if points.ndim == 2 and points.shape[1] == 3 and weights.shape == points.shape[:1] and areas.ndim == 1:
        if origins.shape == axes.shape == (m, 3):
            return
    elif areas.ndim != 1:
        raise InputError(f"thrusters' areas: shape {areas.shape}, allowed {(m,)}")
    elif points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"region's points: shape {points.shape}, allowed (n, 3)")
    else:
        raise InputError(f"region's weights: shape {weights.shape}, allowed {points.shape[:1]}")
    what, got = ("thrusters' places", origins.shape) if origins.shape != (m, 3) else ("thrusters' axes", axes.shape)
    raise InputError(f"{what}: shape {got}, allowed {(m, 3)}")


def explain(points: Array, weights: Array, origins: Array, axes: Array, areas: Array) -> InputError:
    """Error that says what a sum over points could not use."""
    for what, value in (
        ("region's points", points),
        ("region's weights", weights),
        ("thrusters' places", origins),
        ("thrusters' axes", axes),
        ("thrusters' areas", areas),
    ):
        if not np.all(np.isfinite(value)):
            row = int(np.argwhere(~np.isfinite(value))[0][0])
            return InputError(f"{what}: row {row} holds NaN or infinity, every element must be finite")
    if np.any(weights < 0.0):
        return InputError(f"region's weights: {np.min(weights):g}, a weight must not be negative")
    if np.any(areas <= 0.0):
        return InputError(f"thrusters' areas: {np.min(areas):g} m2, a disk's area must be more than 0")
    return InputError("disturbance: numbers too large to be summed")


Superposition = Literal["coherent", "incoherent"]
SUPERPOSITIONS: tuple[Superposition, ...] = get_args(Superposition)
"""Superpositions of jets."""


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

    - `model`: one of this room, or one from outside, whose derivatives are central differences
      (`wakewise.wake.finite_difference`).
    - `positions_B_m`, `axes_B`, shape (m, 3): centres of the thrusters' disks and unit force axes (for T > 0), on the
      body.
    - Shapes: `region_points_W` (n, 3); `weights` (n,); `areas_m2` (m,).

    Raises InputError if shapes do not belong together, something is not finite, a weight is negative or an area not
    positive.
    """
    one_of(superposition, SUPERPOSITIONS, "superposition")
    same_sizes(region_points_W, weights, positions_B_m, axes_B, areas_m2)
    place = (region_points_W, weights, X_WB.p_m, X_WB.q, positions_B_m, axes_B, areas_m2)
    if isinstance(model, AxialJet):
        G, dG, check = gram_slope_sum(*place, *model.law)
    elif isinstance(model, ImpingingJet):
        G, dG, check = bed_gram_sum(*place, *model.jet.law, model.numbers, True)
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
        D, gradient, H, check = bed_stage_sum(*place, *model.jet.law, model.numbers, *how)
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


_ORIGIN, _LEVEL = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])


def gram(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    origins_W: Array,
    axes_W: Array,
    areas_m2: Array,
    superposition: Superposition = "coherent",
    flow: CrossFlow | None = None,
) -> Array:
    """Matrix G of D = s' G s at given thruster places, symmetric and positive semidefinite.

    - `origins_W`, `axes_W`, shape (m, 3): centres of the thrusters' disks and unit *force* axes (for T > 0), in the
      world.
    - `superposition`: incoherent keeps the diagonal only.
    - `flow`: current that advects the jets (`advected_jets`); still water if not given, and for models of plug-ins.
    - Shapes: `region_points_W` (n, 3); `weights` (n,); `areas_m2` (m,).

    Returns shape (2 m, 2 m), in (m/s)^2/N: row i is thruster i with T > 0 (jet along -axis), row m + i the same
    thruster with T < 0 (jet along +axis). Raises InputError if shapes do not belong together, something is not finite,
    a weight is negative or an area not positive.
    """
    if str(superposition) not in SUPERPOSITIONS:
        one_of(superposition, SUPERPOSITIONS, "superposition")
    same_sizes(region_points_W, weights, origins_W, axes_W, areas_m2)
    place = (region_points_W, weights, origins_W, axes_W, areas_m2)
    if flow is not None and isinstance(free_jet(model), AxialJet):
        check = float(np.min(weights, initial=0.0) < 0.0 or np.min(areas_m2) <= 0.0)
        if check == 0.0:
            twice, directions = np.concatenate([origins_W, origins_W]), np.concatenate([-axes_W, axes_W])
            jets = (twice, directions, np.concatenate([areas_m2, areas_m2]))
            G = velocity_gram(advected_velocity(model, region_points_W, *jets, flow.nominal_thrusts_N, flow), weights)
    elif isinstance(model, AxialJet):
        G, check = gram_sum(*place, *model.law)
    elif isinstance(model, ImpingingJet):
        in_world = (region_points_W, weights, _ORIGIN, _LEVEL, origins_W, axes_W, areas_m2)
        G, _, check = bed_gram_sum(*in_world, *model.jet.law, model.numbers, False)
    else:
        velocity = unit_velocity(
            model,
            region_points_W,
            np.concatenate([origins_W, origins_W]),
            np.concatenate([-axes_W, axes_W]),
            np.concatenate([areas_m2, areas_m2]),
        )
        G, check = np.asarray(np.einsum("n,inx,jnx->ij", weights, velocity, velocity)), 0.0
    if check != 0.0:
        raise explain(*place)
    return incoherent(G) if superposition == "incoherent" else G


def unit_velocity(
    model: WakeModel, points_W_m: Array, origins_W_m: Array, directions_W: Array, areas_m2: Array
) -> Array:
    """Checked `WakeModel.unit_velocity`, shape (m, n, 3).

    NaN passes, because a controller ignores a Gram matrix that is not finite and the flight continues.

    Raises InputError if it is no array of numbers of that shape.
    """
    answer = model.unit_velocity(points_W_m, origins_W_m, directions_W, areas_m2)
    shape = (len(origins_W_m), len(points_W_m), 3)
    if not isinstance(answer, np.ndarray) or answer.dtype.kind not in "fiu" or answer.shape != shape:
        raise InputError(f"{_called(model)}: must be an array of numbers of shape {shape}, is {quoted(answer)}")
    return np.asarray(answer, dtype=np.float64)


def _called(model: WakeModel) -> str:
    return f"wake model {getattr(model, 'name', type(model).__name__)}: unit_velocity"


def velocity(
    model: WakeModel, points_W_m: Array, origins_W_m: Array, axes_W: Array, areas_m2: Array, thrusts_N: Array
) -> Array:
    """Velocity of the water in m/s, shape (n, 3), at points, shape (n, 3): that of all jets, added up.

    Arguments as for `gram`; thrusts, shape (m,). Where squares are summed over points with their weights it is the
    coherent D.
    """
    jets = -np.sign(thrusts_N)[:, None] * axes_W
    alone = frozen(unit_velocity(model, points_W_m, origins_W_m, jets, areas_m2), (None, None, 3), _called(model))
    return np.asarray(np.einsum("i,inx->nx", np.sqrt(np.abs(thrusts_N)), alone))


@njit(fastmath=FAST)
def velocity_gram(velocity: Array, weights: Array) -> Array:
    """G, shape (k, k), of velocities per square root of newton, shape (k, n, 3), at points of weights, shape (n,)."""
    k, n = velocity.shape[0], velocity.shape[1]
    G, rows, here = np.zeros((k, k)), np.empty((k, 3 * n)), np.empty(k, np.bool_)
    for i in range(k):
        largest = 0.0
        for j in range(n):
            root = np.sqrt(weights[j])
            for x in range(3):
                rows[i, 3 * j + x] = root * velocity[i, j, x]
                largest += abs(velocity[i, j, x])
        # Most jets miss; NaN must stay visible.
        here[i] = largest != 0.0
    for i in range(k):
        for c in range(i + 1):
            if here[i] and here[c]:
                G[i, c] = dot(rows[i], rows[c], 3 * n)
                G[c, i] = G[i, c]
    return G


@njit
def _along(speeds: Array, directions: Array) -> Array:
    """Velocities, shape (m, n, 3), of speeds, shape (m, n), along directions, shape (m, 3)."""
    m, n = speeds.shape
    velocity = np.empty((m, n, 3))
    for i in range(m):
        for j in range(n):
            for x in range(3):
                velocity[i, j, x] = speeds[i, j] * directions[i, x]
    return velocity


def advected_velocity(
    model: WakeModel,
    points_W_m: Array,
    origins_W_m: Array,
    directions_W: Array,
    areas_m2: Array,
    thrusts_N: Array,
    flow: CrossFlow,
    ends: Array | None = None,
) -> Array:
    """Velocity per square root of newton, shape (m, n, 3), that jets of these thrusts have in excess of a current.

    Arguments as for `WakeModel.unit_velocity`; `thrusts_N`, shape (m,), more than 0, sets how far each jet gets.
    `ends`, shape (m, 2): distance at which a jet merges, and its share that continues. The model must be an `AxialJet`,
    with or without a bed.
    """
    jet = free_jet(model)
    if not isinstance(jet, AxialJet):
        raise InputError(f"wake model {model.name}: has no jet law that a current could advect")
    if ends is None:
        ends = np.tile([np.inf, 1.0], (len(origins_W_m), 1))
    directions_W = np.ascontiguousarray(directions_W)
    speeds, curves = plumes(points_W_m, origins_W_m, directions_W, areas_m2, jet.law, thrusts_N, flow, ends)
    velocity = _along(speeds, directions_W)
    if isinstance(model, ImpingingJet):
        walls = (directions_W, areas_m2, model.numbers, thrusts_N)
        add_advected_wall_jets(points_W_m, curves, *walls, flow.current_W_m_s, flow.current_std_m_s, ends, velocity)
    return np.asarray(velocity)


def incoherent(gram: Array) -> Array:
    """Matrix of the incoherent sum, shape (2 m, 2 m): the diagonal of a coherent G; D = diag(G) . (T+, T-)."""
    return np.diag(np.diag(gram))


def split_roots(thrusts_N: ArrayLike) -> Array:
    """Vector s = (sqrt(T+), sqrt(T-)), shape (2 m,), of thrusts, shape (m,), T+ = max(T, 0) and T- = max(-T, 0)."""
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    return np.sqrt(np.concatenate([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)]))


def disturbance(gram: Array, thrusts_N: ArrayLike) -> float:
    """D = s' G s in (m/s)^2, of G, shape (2 m, 2 m), and thrusts, shape (m,)."""
    s = split_roots(thrusts_N)
    if s.shape != gram.shape[:1]:
        raise InputError(f"thrusts_N: {len(s) // 2} thrusts, allowed {len(gram) // 2}, one per thruster of the matrix")
    return float(s @ gram @ s)


def point_disturbance(
    model: WakeModel,
    region_points_W: Array,
    weights: Array,
    origins_W: Array,
    axes_W: Array,
    areas_m2: Array,
    thrusts_N: ArrayLike,
    superposition: Superposition = "coherent",
) -> float:
    """D in (m/s)^2, point by point as the definition reads; slow, and the check on `gram`. Arguments as there."""
    one_of(superposition, SUPERPOSITIONS, "superposition")
    same_sizes(region_points_W, weights, origins_W, axes_W, areas_m2)
    thrusts = np.asarray(thrusts_N, dtype=np.float64)
    jets = -np.sign(thrusts)[:, None] * axes_W
    velocity = np.sqrt(np.abs(thrusts))[:, None, None] * model.unit_velocity(region_points_W, origins_W, jets, areas_m2)
    if superposition == "coherent":
        velocity = np.sum(velocity, axis=0, keepdims=True)
    return float(np.sum(weights * np.sum(velocity**2, axis=(0, 2))))
