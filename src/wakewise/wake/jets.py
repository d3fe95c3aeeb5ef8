"""Wake models of a turbulent round jet in free water, and the compiled speeds that all models of a single jet share.

The velocity is along the jet's axis and grows with the square root of thrust, so a model is a speed per square root of
newton. The jet leaves opposite to the force on the vehicle: T > 0 along -axis, T < 0 along +axis.

Kernels. At a point with offset e from the disk's centre, x = e . d along the jet's unit direction d and r2 = e . e, the
speed per square root of newton is f(x, r2), zero unless x > 0. Its gradient is alpha d + beta e; every derivative by
position or attitude follows from the pair (alpha, beta). A law is `(kind, parameters)`, see `cone_parameters` and
`jet_parameters`; `own_constants` adds the constants of each thruster's disk. SI units.

The module is long because each law stands beside its kernels: they must give the same speeds.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from wakewise.core.arrays import Array, IntArray
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit

FAST = {"reassoc", "contract", "nsz", "arcp"}
Numbers = tuple[float, float, float, float, float, float, float]
"""Constants of a law as values, see `cone_parameters` and `jet_parameters`."""
PRINTED_CONE, POWER_CONE, ROUND_JET = 0, 1, 2
"""Kinds of kernel: the paper's cone (fixed powers), the cone with any powers, and the turbulent round jet."""

TAIL_WIDTHS = 4.3
"""Widths at which a Gaussian profile is cut off: exp(-4.3^2) < 1e-8 of its centre value."""

_NOTHING = 1e-300
"""Added to a divisor that is zero only where the dividend is zero, too."""


def cone_parameters(
    gain: float,
    reference_distance_m: float,
    decay_power: float,
    cosine_power: float,
    soft_radius_m: float,
    half_angle_rad: float,
    edge_width_rad: float,
    water_density_kg_m3: float,
) -> Array:
    """Numbers of a cone kernel: v = G sqrt(1/(2 pi rho A)) (r_ref^2 / (r^2 + r_s^2))^(p/2) cos^m(theta) s(theta).

    s is 1 inside, 0 outside, and between half an edge width before and after the half angle the cubic 3 t^2 - 2 t^3,
    with t linear in cos(theta): a continuous first derivative. Width 0 is the sharp edge, which counts as inside.
    """
    return np.array(
        [
            gain * reference_distance_m**decay_power / np.sqrt(2.0 * np.pi * water_density_kg_m3),
            decay_power,
            cosine_power,
            soft_radius_m**2,
            np.cos(half_angle_rad + 0.5 * edge_width_rad),
            np.cos(half_angle_rad - 0.5 * edge_width_rad),
            # cos^2 of 45 deg is 1/2 exactly; rounding of the cosine must not shift the printed edge.
            0.5
            if half_angle_rad == np.pi / 4 and edge_width_rad == 0.0
            else np.cos(half_angle_rad + 0.5 * edge_width_rad) ** 2,
        ]
    )


def jet_parameters(
    decay: float,
    virtual_origin_diameters: float,
    start_width_diameters: float,
    width_slope: float,
    core: bool,
    water_density_kg_m3: float,
) -> Array:
    """Numbers of the round jet kernel.

    Centreline U = K sqrt(M) / ((x + x0)^6 + L^6)^(1/6) and width b = b0 + s x (1/e), M = T / rho. With `core` the exit
    speed limits U (L = K sqrt(A)) and the profile has a flat core whose radius a makes the momentum flux
    pi U^2 (a^2 + sqrt(pi/2) a b + b^2/2) equal to M; without, L = a = 0.
    """
    return np.array(
        [
            decay / np.sqrt(water_density_kg_m3),
            1.0 / (np.pi * water_density_kg_m3),
            virtual_origin_diameters,
            start_width_diameters,
            width_slope,
            1.0 if core else 0.0,
            decay,
        ]
    )


@njit(apart=True)
def own_constants(kind: int, parameters: Array, areas: Array) -> Array:
    """Constants of each disk, shape (m, 6): three of the law and three of its reach.

    Cones: speed at 1 m, two unused. Jets: x0, b0, L^6 in m, m, m^6. A jet reaches only points with
    r2 <= reach0 + reach1 x + reach2 x^2; this test needs no square root.
    """
    own = np.zeros((areas.shape[0], 6))
    for i in range(areas.shape[0]):
        if kind == ROUND_JET:
            diameter = np.sqrt(4.0 * areas[i] / np.pi)
            own[i, 0] = parameters[2] * diameter
            own[i, 1] = parameters[3] * diameter
            own[i, 2] = parameters[5] * parameters[6] ** 6 * areas[i] ** 3
            # A conserved momentum keeps the core no wider than the disk.
            start = parameters[5] * 0.5 * diameter + TAIL_WIDTHS * own[i, 1]
            slope = TAIL_WIDTHS * parameters[4]
            own[i, 3], own[i, 4], own[i, 5] = start * start, 2.0 * start * slope, 1.0 + slope * slope
        else:
            own[i, 0] = parameters[0] / np.sqrt(areas[i])
            own[i, 5] = 1.0 / parameters[6]
    return own


@njit
def speed_and_slope(
    kind: int, numbers: Numbers, c0: float, c1: float, c2: float, x: float, r2: float
) -> tuple[float, float, float]:
    """(f, alpha, beta) at a point within reach, x > 0 along the jet and squared distance r2 from the disk's centre."""
    if kind == ROUND_JET:
        return _jet(numbers, c0, c1, c2, x, r2)
    if kind == PRINTED_CONE:
        # f = c x^4 / r^6, so grad f = 4 f / x d - 6 f / r^2 e.
        inverse = 1.0 / r2
        cos2 = x * x * inverse
        f = c0 * inverse * cos2 * cos2
        return f, 4.0 * f / x, -6.0 * f * inverse
    return _cone(numbers, c0, x, r2)


@njit
def _cone(numbers: Numbers, c0: float, x: float, r2: float) -> tuple[float, float, float]:
    p, m, low, high = numbers[1], numbers[2], numbers[4], numbers[5]
    inverse = 1.0 / r2
    soft = r2 + numbers[3]
    plain = c0 * np.exp(0.5 * (m * np.log(x * x * inverse) - p * np.log(soft)))
    inverse_r = np.sqrt(inverse)
    cosine = x * inverse_r
    edge, edge_slope = 1.0, 0.0
    if low < high and cosine < high:
        t = max((cosine - low) / (high - low), 0.0)
        edge = t * t * (3.0 - 2.0 * t)
        edge_slope = 6.0 * t * (1.0 - t) / (high - low)
    f = plain * edge
    # grad cos = d / r - cos e / r^2
    by_cosine = f * m / cosine + plain * edge_slope
    return f, by_cosine * inverse_r, -f * p / soft - by_cosine * cosine * inverse


@njit
def _jet(numbers: Numbers, x0: float, b0: float, limit6: float, x: float, r2: float) -> tuple[float, float, float]:
    slope = numbers[4]
    b = b0 + slope * x
    across2 = max(r2 - x * x, 0.0)
    from_origin = x + x0
    if numbers[5] == 0.0:
        # No core: a Gaussian from the disk on. One division serves both.
        inverse = 1.0 / (b * from_origin)
        by_b, by_origin = inverse * from_origin, inverse * b
        out2 = across2 * by_b * by_b
        f = numbers[0] * by_origin * np.exp(-out2)
        beta = -2.0 * f * by_b * by_b
        return f, f * (2.0 * out2 * slope * by_b - by_origin) - beta * x, beta
    square = from_origin * from_origin
    sixth = square * square * square
    total = sixth + limit6
    centre = numbers[0] / np.sqrt(np.cbrt(total))
    shrink = -sixth / (total * from_origin)
    # pi/8 - 1/2 < 0; with the decay that conserves momentum the root is real at every distance.
    carried = numbers[1] / (centre * centre)
    root = np.sqrt(max(carried + (np.pi / 8.0 - 0.5) * b * b, 0.0))
    a = max(root - np.sqrt(np.pi / 8.0) * b, 0.0)
    across = np.sqrt(across2)
    outside = across - a
    if outside <= 0.0:
        return centre, centre * shrink, 0.0
    a_slope = (-carried * shrink + (np.pi / 8.0 - 0.5) * b * slope) / root - np.sqrt(np.pi / 8.0) * slope
    out = outside / b
    f = centre * np.exp(-out * out)
    by_x = f * (shrink + 2.0 * out * (a_slope + out * slope) / b)
    beta = -2.0 * f * out / (b * across)
    return f, by_x - beta * x, beta


@njit(apart=True, fastmath=FAST)
def fill_cored_jet(
    q: Array, roots: Array, t: Array, axis: Array, own: Array, numbers: Array, slopes: bool, near: IntArray,
    pose: Array,
) -> None:  # fmt: skip
    """A round jet with a core at many points: signed speed by the force axis (negative astern of T > 0) into
    pose[0, 0], (P,); with `slopes` the gradient of |f| into pose[1], (3, P).

    The law is that of `_jet`. Each step is a loop of its own over the points within reach, so that all but the cube
    root and the exponential compile to vector instructions: close to a target a plan evaluates 1e5 points.

    `q` (3, P): points; `t` (3,): centre of the disk; `axis` (3,): its force axis; `own` (6,), `numbers` (7,): see
    `own_constants`. `near` (P,) and the rest of `pose`, (6, 3, P), are work arrays.
    """
    count = q.shape[1]
    f_row, g = pose[0, 0], pose[1]
    along, r2 = pose[2, 0], pose[2, 1]
    tx, ty, tz, ax, ay, az = t[0], t[1], t[2], axis[0], axis[1], axis[2]
    for j in range(count):
        ex, ey, ez = q[0, j] - tx, q[1, j] - ty, q[2, j] - tz
        along[j] = ax * ex + ay * ey + az * ez
        r2[j] = ex * ex + ey * ey + ez * ez
        f_row[j] = 0.0
    if slopes:
        for x in range(3):
            row = g[x]
            for j in range(count):
                row[j] = 0.0
    found, reach0, reach1, reach2 = 0, own[3], own[4], own[5]
    for j in range(count):
        # Without a branch, because branch prediction fails here.
        x = abs(along[j])
        near[found] = j
        found += (x > 0.0) & (r2[j] <= reach0 + reach1 * x + reach2 * x * x)
    _cored_law(numbers, own, near, found, slopes, pose)
    f, alpha, beta = pose[3, 0], pose[4, 0], pose[4, 1]
    for k in range(found):
        j = near[k]
        root = roots[j] if along[j] > 0.0 else -roots[j]
        f_row[j] = root * f[k]
    if slopes:
        for k in range(found):
            j = near[k]
            root = roots[j]
            a, b = root * alpha[k] if along[j] > 0.0 else -root * alpha[k], root * beta[k]
            g[0, j] = a * ax + b * (q[0, j] - tx)
            g[1, j] = a * ay + b * (q[1, j] - ty)
            g[2, j] = a * az + b * (q[2, j] - tz)


@njit(fastmath=FAST)
def _cored_law(numbers: Array, own: Array, near: IntArray, found: int, slopes: bool, pose: Array) -> None:
    """(f, alpha, beta) of `speed_and_slope` at the first `found` points of `near` into pose[3, 0], [4, 0], [4, 1]."""
    x0, b0, limit6, spread = own[0], own[1], own[2], numbers[4]
    decay, momentum, flat = numbers[0], numbers[1] / (numbers[0] * numbers[0]), np.sqrt(np.pi / 8.0)
    along, r2 = pose[2, 0], pose[2, 1]
    x, across, third = pose[3, 1], pose[3, 2], pose[2, 2]
    f, out, decrease, widening = pose[3, 0], pose[5, 0], pose[4, 0], pose[4, 1]
    for k in range(found):
        j = near[k]
        x[k] = abs(along[j])
        across[k] = r2[j]
    for k in range(found):
        square = (x[k] + x0) * (x[k] + x0)
        third[k] = np.cbrt(square * square * square + limit6)
    for k in range(found):
        b = b0 + spread * x[k]
        carried = momentum * third[k]
        root = np.sqrt(max(carried + (np.pi / 8.0 - 0.5) * b * b, 0.0))
        across[k] = np.sqrt(max(across[k] - x[k] * x[k], 0.0))
        # Within the core `out` is zero, and with it all that the profile adds.
        out[k] = max(across[k] - max(root - flat * b, 0.0), 0.0) / b
        f[k] = out[k] * out[k]
        if slopes:
            origin = x[k] + x0
            square = origin * origin
            decrease[k] = -square * square * origin / (square * square * square + limit6)
            widening[k] = (-carried * decrease[k] + (np.pi / 8.0 - 0.5) * b * spread) / root - flat * spread
    for k in range(found):
        f[k] = np.exp(-f[k])
    for k in range(found):
        f[k] *= decay / np.sqrt(third[k])
        if slopes:
            b = b0 + spread * x[k]
            by_x = f[k] * (decrease[k] + 2.0 * out[k] * (widening[k] + out[k] * spread) / b)
            by_across2 = -2.0 * f[k] * out[k] / (b * across[k] + _NOTHING)
            decrease[k] = by_x - by_across2 * x[k]
            widening[k] = by_across2


@njit
def section_of(kind: int, numbers: Numbers, own: Array, s: float) -> tuple[float, float, float]:
    """(U_0 per square root of newton, chi, width) of the jet in still water at a distance s from the disk."""
    if kind != ROUND_JET:
        speed, _, _ = speed_and_slope(kind, numbers, own[0], own[1], own[2], s, s * s)
        # cos^m of the angle is a Gaussian of the radius with this width.
        power = 4.0 if kind == PRINTED_CONE else max(numbers[2], 2.0)
        return speed, 0.5, s * np.sqrt(2.0 / power)
    # The centreline of `_jet`; one root serves speed and core.
    b, x = own[1] + numbers[4] * s, s + own[0]
    if numbers[5] == 0.0:
        return numbers[0] / x, 0.5, b
    square = x * x
    third = np.cbrt(square * square * square + own[2])
    root = np.sqrt(max(numbers[1] / (numbers[0] * numbers[0]) * third + (np.pi / 8.0 - 0.5) * b * b, 0.0))
    a = max(root - np.sqrt(np.pi / 8.0) * b, 0.0)
    momentum = a * a + np.sqrt(0.5 * np.pi) * a * b + 0.5 * b * b
    return numbers[0] / np.sqrt(third), momentum / (a * a + np.sqrt(np.pi) * a * b + b * b), a + b


@njit
def as_tuple(p: Array) -> Numbers:
    """Constants as values, which the compiler can keep in registers."""
    return (p[0], p[1], p[2], p[3], p[4], p[5], p[6])


@njit
def fill_split_speed(
    points: Array, origins: Array, axes: Array, areas: Array, kind: int, parameters: Array, speed: Array
) -> None:
    """Speeds at points, shape (n, 3), for either sign of m thrusts, into `speed`, zeros of shape (n, 2 m).

    A point lies downstream of one of a thruster's two possible jets and upstream of the other, so one pass fills both
    columns: the sign of the coordinate along the force axis says which.
    """
    m = origins.shape[0]
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    for j in range(points.shape[0]):
        for i in range(m):
            ex, ey, ez = points[j, 0] - origins[i, 0], points[j, 1] - origins[i, 1], points[j, 2] - origins[i, 2]
            along = ex * axes[i, 0] + ey * axes[i, 1] + ez * axes[i, 2]
            x, r2 = abs(along), ex * ex + ey * ey + ez * ez
            if x > 0.0 and r2 <= own[i, 3] + own[i, 4] * x + own[i, 5] * x * x:
                f, _, _ = speed_and_slope(kind, numbers, own[i, 0], own[i, 1], own[i, 2], x, r2)
                speed[j, i if along < 0.0 else m + i] = f


@njit
def fill_speed(along: Array, across: Array, areas: Array, kind: int, parameters: Array, speed: Array) -> None:
    """Speed per square root of newton at `along` and `across` the axis of single jets, all arrays of shape (n,)."""
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    for j in range(along.shape[0]):
        x = along[j]
        r2 = x * x + across[j] * across[j]
        speed[j] = 0.0
        if x > 0.0 and r2 <= own[j, 3] + own[j, 4] * x + own[j, 5] * x * x:
            speed[j], _, _ = speed_and_slope(kind, numbers, own[j, 0], own[j, 1], own[j, 2], x, r2)


class JetLaw(NamedTuple):
    """What the compiled kernels need to know of a jet: which kernel, and its numbers (see the top of the file)."""

    kind: int
    parameters: Array


class AxialJet(ABC):
    """A jet whose water moves along the jet's direction everywhere downstream of the disk, and is still upstream."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name used in scenario files and tables."""

    @property
    @abstractmethod
    def law(self) -> JetLaw:
        """Kernel and numbers."""

    def speed(self, along_m: ArrayLike, across_m: ArrayLike, thrust_N: ArrayLike, area_m2: ArrayLike) -> Array:
        """Speed in m/s of single jets, one per element; the arguments broadcast against each other.

        - `along_m`, `across_m`: distance from the disk's centre along the jet (negative: upstream, where the water is
          still), and off its axis. The second must not be negative.
        - `thrust_N`: its sign does not matter: the jet points where `along_m` counts.
        - `area_m2`: disk area, more than 0.

        Raises InputError for a negative distance off the axis, a disk without area, or NaN.
        """
        given = (np.asarray(a, dtype=np.float64) for a in (along_m, across_m, thrust_N, area_m2))
        along, across, thrust, area = (np.array(a) for a in np.broadcast_arrays(*given))
        for what, value in (("along_m", along), ("across_m", across), ("thrust_N", thrust), ("area_m2", area)):
            if not np.all(np.isfinite(value)):
                raise InputError(f"wake model {self.name}: {what} holds NaN or infinity, every element must be finite")
        if np.any(across < 0.0):
            raise InputError(f"wake model {self.name}: across_m {np.min(across):g}, a radius must not be negative")
        if np.any(area <= 0.0):
            raise InputError(f"wake model {self.name}: area_m2 {np.min(area):g}, a disk's area must be more than 0")
        unit = np.empty(along.size)
        fill_speed(along.ravel(), across.ravel(), area.ravel(), *self.law, unit)
        return np.asarray(np.sqrt(np.abs(thrust)) * unit.reshape(along.shape))

    def split_speed(self, points_W_m: Array, origins_W_m: Array, axes_W: Array, areas_m2: Array) -> Array:
        """Speed per square root of newton at every point, for either sign of every thrust.

        `origins_W_m`, `axes_W`, shape (m, 3): centre of each thruster's disk and unit axis of its *force* for T > 0.
        Shapes: `points_W_m` (n, 3); `areas_m2` (m,). Returns shape (n, 2 m), in m/s/sqrt(N): column i: thruster i with
        T > 0, whose jet goes along -axis. Column m + i: T < 0, along +axis.
        """
        speed = np.zeros((len(points_W_m), 2 * len(origins_W_m)))
        fill_split_speed(points_W_m, origins_W_m, axes_W, areas_m2, *self.law, speed)
        return speed

    def unit_velocity(self, points_W_m: Array, origins_W_m: Array, directions_W: Array, area_m2: Array) -> Array:
        """Velocity per square root of newton, shape (m, n, 3): see `wakewise.core.interfaces.WakeModel`."""
        directions = np.asarray(directions_W, dtype=np.float64)
        speed = self.split_speed(points_W_m, origins_W_m, -directions, area_m2)[:, : len(directions)]
        return np.asarray(speed.T[:, :, None] * directions[:, None, :])


def check_ranges(record: object, what: str, **ranges: tuple[float, float]) -> None:
    """Refuse a dataclass whose number lies outside its range, or is NaN.

    Raises InputError: naming the model, the field, the value and what is allowed.
    """
    for name, (low, high) in ranges.items():
        value = getattr(record, name)
        if not low <= value <= high:
            raise InputError(f"{what}: {name} {value:g}, allowed {low:g} to {high:g}")


@dataclass(frozen=True, kw_only=True)
class RoundJet(AxialJet):
    """A turbulent round jet that leaves the disk with speed sqrt(T / (rho A)) and carries T / rho through every plane.

    With R the disk's radius, s the slope of the 1/e width, x the distance along the jet and x_c = sqrt(2) R / s:

        width of the shear layer  b = s x
        centreline                U_c = U_0 (1 + (x / x_c)^6)^(-1/6), U_0 = sqrt(T / (rho A))
        profile                   U_c for r < a, else U_c exp(-(r - a)^2 / b^2)
        core radius a             from a^2 + sqrt(pi/2) a b + b^2 / 2 = R^2 (U_0 / U_c)^2, which is flux = T / rho

    Near the disk this is a top hat whose core dies out at x_c = 6.1 D (Albertson et al. 1950 measured 6.2 D); far away
    it is the Gaussian self-similar jet with U_c = 6.9 sqrt(T / rho) / x. The power 6 of the passage between the two is
    a choice of smoothing, not a measured constant: it leaves 99 % of the exit speed at 4 D and 90 % at 6 D, and meets
    the decay law within 1 % at 10 D. The water is still upstream of the disk; the slow inflow towards the jet's sides
    is left out, and so are walls (see `wakewise.wake.wall_jet`) and the time a jet needs to
    arrive.
    """

    water_density_kg_m3: float = FRESH_WATER_KG_M3
    # Radius of half the centreline speed over distance. 0.096 is N. R. Panchapakesan and J. L. Lumley, J. Fluid Mech.
    # 246 (1993) 197, doi 10.1017/S0022112093000096; H. J. Hussein, S. P. Capp and W. K. George, J. Fluid Mech. 258
    # (1994) 31, doi 10.1017/S002211209400323X, have 0.094 to 0.102. For a propeller's jet see `of_propeller`.
    half_width_slope: float = 0.096

    def __post_init__(self) -> None:
        check_ranges(self, "round jet", water_density_kg_m3=(900.0, 1100.0), half_width_slope=(0.05, 0.4))

    @classmethod
    def of_propeller(cls) -> RoundJet:
        """The jet of a free propeller, which swirl makes about twice as wide: profile exp(-22.2 (r/x)^2).

        M. Fuehrer and K. Roemisch, 24th International Navigation Congress (PIANC), Leningrad 1977. The momentum flux
        along the axis is still taken as T / rho at every distance, which swirl's low pressure makes true only far off.
        """
        return cls(half_width_slope=float(np.sqrt(np.log(2.0) / 22.2)))

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "jet"

    @property
    def width_slope(self) -> float:
        """Slope s of the 1/e width: the half width over sqrt(ln 2)."""
        return float(self.half_width_slope / np.sqrt(np.log(2.0)))

    @property
    def decay(self) -> float:
        """K of U_c = K sqrt(T / rho) / x far away: sqrt(2 / pi) / s, from the momentum of a Gaussian profile."""
        return float(np.sqrt(2.0 / np.pi) / self.width_slope)

    @cached_property
    def law(self) -> JetLaw:
        """Kernel and numbers."""
        numbers = jet_parameters(self.decay, 0.0, 0.0, self.width_slope, True, self.water_density_kg_m3)
        return JetLaw(ROUND_JET, numbers)


@dataclass(frozen=True, kw_only=True)
class GaussianJet(AxialJet):
    """A jet with a virtual origin and a Gaussian profile from the disk on; meant to be fitted to a measured flow.

        U = K sqrt(T / rho) / (x + x0) exp(-r^2 / b^2),   b = b0 + s x,   s = half_width_slope / sqrt(ln 2)

    Lengths at the disk are in disk diameters D, so that a fit made with one disk can be carried to another. Momentum is
    not conserved by construction: `momentum_ratio` tells what the numbers carry.
    """

    decay: float  # K; a round jet has 6.5 to 7.0 (Hussein et al. 1994), one widened by swirl about half of it.
    # virtual_origin_diameters, start_width_diameters: X0 / D and b0 / D.
    virtual_origin_diameters: float
    start_width_diameters: float
    half_width_slope: float  # growth of the radius of half the centreline speed
    water_density_kg_m3: float = FRESH_WATER_KG_M3

    def __post_init__(self) -> None:
        check_ranges(
            self,
            "jet with virtual origin",
            decay=(0.01, 100.0),
            virtual_origin_diameters=(0.01, 100.0),
            start_width_diameters=(0.0, 10.0),
            half_width_slope=(0.001, 1.0),
            water_density_kg_m3=(900.0, 1100.0),
        )

    @property
    def name(self) -> str:
        """Name used in scenario files and tables."""
        return "jet-fitted"

    @property
    def width_slope(self) -> float:
        """Slope s of the 1/e width: the half width over sqrt(ln 2)."""
        return float(self.half_width_slope / np.sqrt(np.log(2.0)))

    def momentum_ratio(self, distance_diameters: ArrayLike) -> Array:
        """Momentum flux through a plane across the jet over T / rho, at distances in disk diameters."""
        x = np.asarray(distance_diameters, dtype=np.float64)
        width = self.start_width_diameters + self.width_slope * x
        return np.asarray(0.5 * np.pi * (self.decay * width / (x + self.virtual_origin_diameters)) ** 2)

    @cached_property
    def law(self) -> JetLaw:
        """Kernel and numbers."""
        numbers = jet_parameters(
            self.decay,
            self.virtual_origin_diameters,
            self.start_width_diameters,
            self.width_slope,
            False,
            self.water_density_kg_m3,
        )
        return JetLaw(ROUND_JET, numbers)
