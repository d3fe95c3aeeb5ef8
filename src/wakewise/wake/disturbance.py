"""The disturbance D of a target: the weighted sum of squared water speeds at the points of its region.

Coherent, as in the paper: velocities of jets that meet add up, D = sum_j w_j |sum_i v_i(p_j)|^2. With v_i proportional
to sqrt(|T_i|) that is D = s' G s, s = (sqrt(T+), sqrt(T-)): the matrix G depends on where the thrusters are and not on
how hard they push.

Incoherent: squares add up, D = sum_j w_j sum_i |v_i(p_j)|^2, which keeps only the diagonal of G. It is linear in the
split thrusts (T+, T-) >= 0, hence convex, and no optimiser can make jets cancel that in water would only spread
sideways.

Astray: nobody knows where the jets go, only about where they were sent. A jet lives for seconds, in water that has
gusts, a bed, a hull and other jets in it, so what it does to the target is known less surely than its law: of single
pushes sent beside a target the belief has the order right to .73 (docs/research-log/0048). Here its direction is
scattered about the way it was sent as by von Mises and Fisher, f(theta) = kappa exp(kappa cos theta) / (4 pi sinh
kappa), and the speed that is met at a distance r off the disk is that of its section there, U(r) exp(-(r theta')^2 /
w(r)^2) with w the width. Of a jet narrower than the scatter the mean square of the speed at an angle theta is then

    U(r)^2 (pi / 2) (w(r) / r)^2 f(theta).

Momentum stays what it is, whichever way it goes. Jets go astray each by itself, so squares add up here, too, and the
least shares send nothing ahead that can be sent elsewhere, without a word of where a vehicle has its bow.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, frozen
from wakewise.core.checks import one_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.interfaces import WakeModel
from wakewise.core.jit.njit import njit
from wakewise.wake.advected_jets import CrossFlow, plumes
from wakewise.wake.advected_wall_jet import add_carried_walls
from wakewise.wake.bed_depth import free_jet
from wakewise.wake.disturbance_derivatives import SUPERPOSITIONS, Superposition
from wakewise.wake.gram import FAST, dot, gram_sum
from wakewise.wake.input_checks import explain, same_sizes
from wakewise.wake.jets import AxialJet
from wakewise.wake.kernels import as_tuple, own_constants, section_of
from wakewise.wake.wall_jet import ImpingingJet
from wakewise.wake.wall_jet_gram import floor_gram_sum

SCATTER_RAD = float(np.radians(45.0))
"""Root mean square of the angle between where a jet was sent and where it goes, taken small: kappa = 2 / angle^2."""
NEAREST_M = 0.1
"""A jet is not scattered nearer to its disk: about a diameter, within which it has not begun to spread."""
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

    Parameters
    ----------
    model : WakeModel
    region_points_W : ndarray, shape (n, 3)
    weights : ndarray, shape (n,)
    origins_W, axes_W : ndarray, shape (m, 3)
        Centres of the thrusters' disks and unit *force* axes (for T > 0), in the world.
    areas_m2 : ndarray, shape (m,)
    superposition : "coherent" or "incoherent"
        How jets that meet add up; incoherent leaves the diagonal alone.
    flow : Flow, optional
        What carries the jets, at the thrusts of its guess (see `carried`); still water where it is not given, and for
        models from outside.

    Returns
    -------
    ndarray, shape (2 m, 2 m), in (m/s)^2/N
        Row i is thruster i with T > 0 (jet along -axis), row m + i the same thruster with T < 0 (jet along +axis).

    Raises
    ------
    InputError
        If shapes do not belong together, something is not finite, a weight is negative or an area not positive.
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
            G = velocity_gram(carried_velocity(model, region_points_W, *jets, flow.guessed, flow), weights)
    elif isinstance(model, AxialJet):
        G, check = gram_sum(*place, *model.law)
    elif isinstance(model, ImpingingJet):
        in_world = (region_points_W, weights, _ORIGIN, _LEVEL, origins_W, axes_W, areas_m2)
        G, _, check = floor_gram_sum(*in_world, *model.jet.law, model.numbers, False)
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
    """What a wake model answers, shape (m, n, 3), held against what it must be (see `WakeModel.unit_velocity`).

    NaN passes: a controller whose Gram matrix is not finite does without, and a flight goes on.

    Raises
    ------
    InputError
        If it is no array of numbers of that shape.
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
def velocity_gram(velocity, weights):  # type: ignore[no-untyped-def]
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
        # Most jets miss; what is not finite must show.
        here[i] = largest != 0.0
    for i in range(k):
        for c in range(i + 1):
            if here[i] and here[c]:
                G[i, c] = dot(rows[i], rows[c], 3 * n)
                G[c, i] = G[i, c]
    return G


@njit
def _along(speeds, directions):  # type: ignore[no-untyped-def]
    """Velocities, shape (m, n, 3), of speeds, shape (m, n), along directions, shape (m, 3)."""
    m, n = speeds.shape
    velocity = np.empty((m, n, 3))
    for i in range(m):
        for j in range(n):
            for x in range(3):
                velocity[i, j, x] = speeds[i, j] * directions[i, x]
    return velocity


def carried_velocity(
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

    Arguments as for `WakeModel.unit_velocity`; `thrusts_N`, shape (m,), more than 0, sets how far each jet gets. Of
    jets that join others `ends`, shape (m, 2), says after what way, and what share goes on as itself. The model must be
    one of ours (an `AxialJet`, with a floor or without).
    """
    jet = free_jet(model)
    if not isinstance(jet, AxialJet):
        raise InputError(f"wake model {model.name}: brings no law of a jet that a current could carry")
    if ends is None:
        ends = np.tile([np.inf, 1.0], (len(origins_W_m), 1))
    directions_W = np.ascontiguousarray(directions_W)
    speeds, curves = plumes(points_W_m, origins_W_m, directions_W, areas_m2, jet.law, thrusts_N, flow, ends)
    velocity = _along(speeds, directions_W)
    if isinstance(model, ImpingingJet):
        walls = (directions_W, areas_m2, model.numbers, thrusts_N)
        add_carried_walls(points_W_m, curves, *walls, flow.current_W_m_s, flow.unsure_m_s, ends, velocity)
    return np.asarray(velocity)


@njit
def scattered_jet_gram(points, weights, origins, axes, areas, kind, parameters):  # type: ignore[no-untyped-def]
    """Mean of D per newton of each jet if it goes astray, shape (2 m,), in (m/s)^2/N.

    Parameters
    ----------
    points, weights : ndarray, shape (n, 3) and (n,)
        Of a region, in the world.
    origins, axes, areas : ndarray, shape (m, 3), (m, 3) and (m,)
        Centres of the disks, unit force axes (for T > 0) and areas.
    kind, parameters
        The jet's law (`AxialJet.law`).

    Returns
    -------
    ndarray, shape (2 m,)
        Slot i is thruster i with T > 0 (jet along -axis), slot m + i the same with T < 0. As a diagonal matrix it is G
        of D = s' G s, as in `wakewise.wake.disturbance.gram`.
    """
    m, n = origins.shape[0], points.shape[0]
    own, numbers, d = own_constants(kind, parameters, areas), as_tuple(parameters), np.zeros(2 * m)
    kappa = 2.0 / SCATTER_RAD**2
    even = kappa / (4.0 * np.pi * np.sinh(kappa))
    for i in range(m):
        for j in range(n):
            r2, along = 0.0, 0.0
            for x in range(3):
                offset = points[j, x] - origins[i, x]
                r2 += offset * offset
                along -= offset * axes[i, x]
            r = max(np.sqrt(r2), NEAREST_M)
            speed, _, width = section_of(kind, numbers, own[i], r)
            square = weights[j] * speed * speed * 0.5 * np.pi * (width / r) ** 2 * even
            d[i] += square * np.exp(kappa * along / r)
            d[m + i] += square * np.exp(-kappa * along / r)
    return d


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
