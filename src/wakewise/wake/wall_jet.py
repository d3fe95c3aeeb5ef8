"""Wall jets: a round jet that strikes the bed spreads along it from the point where its axis meets the bed.

At normal incidence u_max = 1.16 sqrt(M) / r and the half thickness is 0.09 r, M = T / rho, r from the strike point (N.
Rajaratnam, Turbulent Jets, Elsevier 1976: 1.03 U0 D / r). The speed goes with sqrt(T) like the free jet's, so D stays a
quadratic form; the direction differs from point to point. Three closures:

- *Oblique incidence.* The flux of momentum per angle phi from the forward direction is
  M / (2 pi) sin^3(psi) / (1 - cos(psi) cos(phi))^2, psi the angle between jet and bed: the inviscid sheet of D. Hasson
  and R. E. Peck, AIChE J. 10 (1964) 752. Its integral is M and its component along the bed M cos(psi). Speed goes with
  its root. Jets within 3 deg of level do not strike.
- *Near the strike point* r / (r^2 + r0^2) replaces 1 / r: the speed is greatest at r0 and zero at the strike point.
  r0 = 1.16 / (2 K) (H^6 + L^6)^(1/6) makes the greatest speed the centreline speed of a round jet at the distance H
  (`RoundJet`: K = 6.9, L = K sqrt(A)).
- *Across the layer* the speed is a Gaussian of the height, 1/2 at the half thickness. The viscous layer is left out.

The free jet is not stopped at the bed: within the last decimetre both terms are present. Not modelled: a target in the
way of a wall jet, colliding wall jets, friction, time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import assign, njit
from wakewise.wake.gram import (
    BLOCK,
    check_jets,
    dot,
    fill_rows,
    load_block,
    place,
    pose_slopes,
    thrust_roots,
    turn_gradient,
    turn_hessian,
)
from wakewise.wake.jets import FAST, AxialJet, Numbers, RoundJet, as_tuple, own_constants

WALL_SPEED = 1.16
"""u_max r / sqrt(M) of a wall jet (Rajaratnam 1976)."""
HALF_THICKNESS = 0.09
"""Height of half the greatest speed over the distance from the strike point (Rajaratnam 1976)."""
LEAST_SINE = 0.05
"""Sine of the angle to the bed under which a jet is taken as never landing."""
ROUND_DECAY = RoundJet().decay


@dataclass(frozen=True, kw_only=True)
class ImpingingJet:
    """A free jet and the wall jet that it becomes on the bed; implements `wakewise.core.interfaces.WakeModel`."""

    jet: AxialJet  # what the jet does on its way
    bed_z_m: float  # the bed is the plane z = bed_z_m of the world (z down). Points below it are taken as on it.
    water_density_kg_m3: float = FRESH_WATER_KG_M3

    def __post_init__(self) -> None:
        if not np.isfinite(self.bed_z_m):
            raise InputError(f"floor of wake model {self.jet.name}: bed_z_m {self.bed_z_m:g}, must be finite")
        if not 900.0 <= self.water_density_kg_m3 <= 1100.0:
            raise InputError(
                f"floor of wake model {self.jet.name}: water_density_kg_m3 {self.water_density_kg_m3:g}, "
                "allowed 900 to 1100"
            )

    @property
    def name(self) -> str:
        """Name used in tables: that of the free jet with `+floor`."""
        return f"{self.jet.name}+floor"

    @property
    def numbers(self) -> Array:
        """Bed and strength for the kernels: z in m, u_max r in m2/s per square root of newton."""
        return np.array([self.bed_z_m, WALL_SPEED / np.sqrt(self.water_density_kg_m3)])

    def unit_velocity(self, points_W_m: Array, origins_W_m: Array, directions_W: Array, area_m2: Array) -> Array:
        """Velocity per square root of newton, shape (m, n, 3): see `wakewise.core.interfaces.WakeModel`."""
        velocity = self.jet.unit_velocity(points_W_m, origins_W_m, directions_W, area_m2)
        directions = np.ascontiguousarray(directions_W, dtype=np.float64)
        return np.asarray(velocity + wall_velocity(points_W_m, origins_W_m, directions, area_m2, self.numbers))


@njit
def _strike(
    origin: Array, dx: float, dy: float, dz: float, area: float, bed_z: float
) -> tuple[bool, float, float, float, float, float]:
    """(lands, H, strike x, strike y, r0, d r0 / d H) of one jet: how far it goes, and where it meets the bed."""
    if dz < LEAST_SINE or origin[2] >= bed_z:
        return False, 0.0, 0.0, 0.0, 0.0, 0.0
    H = (bed_z - origin[2]) / dz
    L = ROUND_DECAY * np.sqrt(area)
    far = (H**6 + L**6) ** (1.0 / 6.0)
    share = 0.5 * WALL_SPEED / ROUND_DECAY
    return True, H, origin[0] + H * dx, origin[1] + H * dy, share * far, share * (H / far) ** 5


@njit
def wall_velocity(points: Array, origins: Array, directions: Array, areas: Array, floor: Array) -> Array:
    """Velocity of the wall jets per square root of newton, shape (m, n, 3), of jets along `directions`, (m, 3)."""
    n, m = points.shape[0], origins.shape[0]
    velocity = np.zeros((m, n, 3))
    for i in range(m):
        d = directions[i]
        lands, _, strike_x, strike_y, r0, _ = _strike(origins[i], d[0], d[1], d[2], areas[i], floor[0])
        if lands:
            strength = floor[1] * d[2] * np.sqrt(d[2])
            for j in range(n):
                x, y = points[j, 0] - strike_x, points[j, 1] - strike_y
                height = max(floor[0] - points[j, 2], 0.0)
                square = x * x + y * y + r0 * r0
                forward = (x * d[0] + y * d[1]) / np.sqrt(square)
                layer = np.exp(-np.log(2.0) * height * height / (HALF_THICKNESS**2 * square))
                factor = strength * layer / (square * (1.0 - forward))
                velocity[i, j, 0] = factor * x
                velocity[i, j, 1] = factor * y
    return velocity


@njit(apart=True)
def add_wall(
    block: Array, count: int, p: Array, origin: Array, dx: float, dy: float, dz: float, area: float, floor: Array,
    V: Array, dV: Array,
) -> None:  # fmt: skip
    """Add sqrt(w) u of the wall jet of a jet along (dx, dy, dz) to `V`, (3, BLOCK).

    Its slopes by the body's shift and turn, both in W, go to `dV`, (6, 3, BLOCK).
    """
    lands, H, strike_x, strike_y, r0, r0_slope = _strike(origin, dx, dy, dz, area, floor[0])
    if not lands:
        return
    strength = floor[1] * dz * np.sqrt(dz)
    # What shift and turn do to the direction, to the strike point and to r0: none of it depends on the point.
    moved = np.zeros((6, 6))
    arm_x, arm_y, arm_z = origin[0] - p[0], origin[1] - p[1], origin[2] - p[2]
    for r in range(6):
        # A shift moves the disk; a turn about axis k moves it by e_k x arm and the direction by e_k x d.
        ux, uy, uz = 1.0 if r % 3 == 0 else 0.0, 1.0 if r % 3 == 1 else 0.0, 1.0 if r % 3 == 2 else 0.0
        sx, sy, sz, tx, ty, tz = ux, uy, uz, 0.0, 0.0, 0.0
        if r >= 3:
            sx, sy, sz = uy * arm_z - uz * arm_y, uz * arm_x - ux * arm_z, ux * arm_y - uy * arm_x
            tx, ty, tz = uy * dz - uz * dy, uz * dx - ux * dz, ux * dy - uy * dx
        longer = (-sz - H * tz) / dz
        moved[r, 0], moved[r, 1], moved[r, 2] = tx, ty, tz
        moved[r, 3] = sx + longer * dx + H * tx
        moved[r, 4] = sy + longer * dy + H * ty
        moved[r, 5] = r0_slope * longer
    for j in range(count):
        x, y = block[0, j] - strike_x, block[1, j] - strike_y
        height = max(floor[0] - block[2, j], 0.0)
        square = x * x + y * y + r0 * r0
        root = np.sqrt(square)
        forward = (x * dx + y * dy) / root
        fade = np.log(2.0) * height * height / (HALF_THICKNESS**2 * square)
        factor = block[3, j] * strength * np.exp(-fade) / (square * (1.0 - forward))
        V[0, j] += factor * x
        V[1, j] += factor * y
        for r in range(6):
            x_moved, y_moved = -moved[r, 3], -moved[r, 4]
            square_moved = 2.0 * (x * x_moved + y * y_moved + r0 * moved[r, 5])
            forward_moved = (
                x_moved * dx + y_moved * dy + x * moved[r, 0] + y * moved[r, 1]
            ) / root - 0.5 * forward * square_moved / square
            grown = 1.5 * moved[r, 2] / dz + (fade - 1.0) * square_moved / square + forward_moved / (1.0 - forward)
            dV[r, 0, j] += factor * (grown * x + x_moved)
            dV[r, 1, j] += factor * (grown * y + y_moved)


@njit(apart=True, fastmath=FAST)
def fill_velocities(
    block: Array, count: int, p: Array, origins: Array, axes: Array, areas: Array, own: Array, kind: int,
    numbers: Numbers, floor: Array, scratch: Array, hits: IntArray, rows: Array, column: IntArray, slope: Array,
    V: Array, dV: Array,
) -> None:  # fmt: skip
    """Velocities of all 2 m jets, free and wall, into `V`, (2 m, 3, BLOCK), slopes into `dV`, (2 m, 6, 3, BLOCK)."""
    m = origins.shape[0]
    for k in range(2 * m):
        for x in range(3):
            for j in range(count):
                V[k, x, j] = 0.0
            for r in range(6):
                for j in range(count):
                    dV[k, r, x, j] = 0.0
    filled = fill_rows(block, count, origins, axes, own, kind, numbers, True, scratch, hits, rows, column)
    for a in range(filled):
        k = column[a]
        i = k if k < m else k - m
        sign = 1.0 if k >= m else -1.0
        pose_slopes(block, count, p, origins[i], axes[i], sign, rows[1, a], rows[2, a], slope)
        for x in range(3):
            d = sign * axes[i, x]
            for j in range(count):
                V[k, x, j] = d * rows[0, a, j]
            for r in range(6):
                for j in range(count):
                    dV[k, r, x, j] = d * slope[r, j]
        # The direction turns with the body: a turn about axis r moves it by e_r x d.
        for r in range(3):
            y, z = (r + 1) % 3, (r + 2) % 3
            dy, dz = sign * axes[i, y], sign * axes[i, z]
            for j in range(count):
                dV[k, 3 + r, y, j] -= dz * rows[0, a, j]
                dV[k, 3 + r, z, j] += dy * rows[0, a, j]
    for k in range(2 * m):
        i = k if k < m else k - m
        sign = 1.0 if k >= m else -1.0
        add_wall(
            block,
            count,
            p,
            origins[i],
            sign * axes[i, 0],
            sign * axes[i, 1],
            sign * axes[i, 2],
            areas[i],
            floor,
            V[k],
            dV[k],
        )


@njit(fastmath=FAST)
def bed_gram_sum(
    points: Array, weights: Array, p: Array, q: Array, positions_B: Array, axes_B: Array, areas: Array, kind: int,
    parameters: Array, floor: Array, slopes: bool,
) -> tuple[Array, Array, float]:  # fmt: skip
    """G, (2 m, 2 m), dG by position in W and rotation vector in B, (6, 2 m, 2 m) (zeros unless `slopes`), the check."""
    n, m = points.shape[0], positions_B.shape[0]
    R, origins, axes = place(p, q, positions_B, axes_B)
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column, slope = np.empty((3, 2 * m, BLOCK)), np.empty(2 * m, np.int64), np.empty((6, BLOCK))
    V, dV = np.empty((2 * m, 3, BLOCK)), np.empty((2 * m, 6, 3, BLOCK))
    G, dG = np.zeros((2 * m, 2 * m)), np.zeros((6, 2 * m, 2 * m))
    check = check_jets(p, q, origins, axes, areas)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        fill_velocities(
            block, count, p, origins, axes, areas, own, kind, numbers, floor, scratch, hits, rows, column, slope, V, dV
        )
        for a in range(2 * m):
            for c in range(a + 1):
                for x in range(3):
                    G[a, c] += dot(V[a, x], V[c, x], count)
                    if slopes:
                        for r in range(6):
                            dG[r, a, c] += dot(dV[a, r, x], V[c, x], count) + dot(V[a, x], dV[c, r, x], count)
    for a in range(2 * m):
        for c in range(a + 1):
            turn = np.zeros(3)
            for r in range(3):
                for row in range(3):
                    turn[r] += R[row, r] * dG[3 + row, a, c]
            assign(dG[3:, a, c], turn)
            G[c, a] = G[a, c]
            assign(dG[:, c, a], dG[:, a, c])
    return G, dG, check


@njit(apart=True, fastmath=FAST)
def bed_stage_sum(
    points: Array, weights: Array, p: Array, q: Array, positions_B: Array, axes_B: Array, areas: Array, kind: int,
    parameters: Array, floor: Array, thrusts: Array, smooth: float, coherent: bool, hessian: bool,
) -> tuple[float, Array, Array, float]:  # fmt: skip
    """D, gradient (6 + m,), Gauss-Newton matrix (6 + m, 6 + m) (zeros unless `hessian`), and the check."""
    n, m = points.shape[0], positions_B.shape[0]
    R, origins, axes = place(p, q, positions_B, axes_B)
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    root, root_slope = thrust_roots(thrusts, smooth)
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column, slope = np.empty((3, 2 * m, BLOCK)), np.empty(2 * m, np.int64), np.empty((6, BLOCK))
    V, dV = np.empty((2 * m, 3, BLOCK)), np.empty((2 * m, 6, 3, BLOCK))
    # One residual vector for the coherent sum, one for every jet for the incoherent.
    J = np.empty((7 + m, 3, BLOCK))
    D, gradient, H = 0.0, np.zeros(6 + m), np.zeros((6 + m, 6 + m))
    check = check_jets(p, q, origins, axes, areas)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        fill_velocities(
            block, count, p, origins, axes, areas, own, kind, numbers, floor, scratch, hits, rows, column, slope, V, dV
        )
        J[:, :, :count] = 0.0
        for k in range(2 * m):
            i = k if k < m else k - m
            s, ds = root[k], root_slope[k]
            if s == 0.0 and ds == 0.0:
                continue
            if not coherent:
                J[:, :, :count] = 0.0
            for x in range(3):
                for j in range(count):
                    J[6 + m, x, j] += s * V[k, x, j]
                    J[6 + i, x, j] += ds * V[k, x, j]
                for r in range(6):
                    for j in range(count):
                        J[r, x, j] += s * dV[k, r, x, j]
            if not coherent:
                D += _add_products(J, m, count, gradient, H, hessian)
        if coherent:
            D += _add_products(J, m, count, gradient, H, hessian)
    if hessian:
        turn_hessian(R, H)
    turn_gradient(R, gradient)
    return D, gradient, H, check


@njit(apart=True, fastmath=FAST)
def _add_products(J: Array, m: int, count: int, gradient: Array, H: Array, hessian: bool) -> float:
    """Add 2 J'r to the gradient and 2 J'J to the lower triangle of H, r being the last row of J; returns r'r."""
    square = 0.0
    for x in range(3):
        square += dot(J[6 + m, x], J[6 + m, x], count)
        for r in range(6 + m):
            gradient[r] += 2.0 * dot(J[r, x], J[6 + m, x], count)
            if hessian:
                for t in range(r + 1):
                    H[r, t] += 2.0 * dot(J[r, x], J[t, x], count)
    return square
