"""One step of a D3Q19 lattice-Boltzmann fluid: regularised collision, Smagorinsky's eddies, and streaming.

The lattice holds g_i = f_i - w_i, the deviation of each population from fluid at rest, in float32: rest is exactly
zero, so slow water keeps its digits. Its shape is (19, nx + 2, (ny + 2) (nz + 2)): one layer of halo cells on every
face, and each plane of constant x in one row, so that the kernel runs through long, contiguous memory.

Collision (Latt and Chopard 2006, doi:10.1016/j.matcom.2006.05.017): of what deviates from equilibrium only the stress
Pi survives, with the share 1 - 1/tau. The relaxation time follows from the stress itself (Smagorinsky 1963 in the
closed form of Hou et al. 1996, arXiv:comp-gas/9401004): tau = [tau0 + sqrt(tau0^2 + 18 sqrt(2) Cs^2 |Pi| / rho)] / 2,
where the filter is one cell.

Populations are made of density, momentum j and second moments alone,
f_i = w_i [rho + 3 c_i.j + H_i : rho u u + (1 - 1/tau) 4.5 Q_i : Pi] with Q_i = c_i c_i - 1/3. The usual H_i = 4.5 Q_i
gives the nineteen velocities a fourth moment <cx cx cy cy> that depends on the motion along z; round jets then grow
four arms along the lattice's diagonals. `SHAPES` holds the H_i of Bauer and Ruede (2018, arXiv:1803.04937) without that
fault. The stress keeps the usual Q_i: with H_i in its place the scheme is unstable at small viscosity.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float32
from numpy.typing import NDArray

from wakewise.arrays import Array, IntArray
from wakewise.compiled import njit, prange

Lattice = NDArray[np.float32]


OPEN, WALL, PERIODIC = 0, 1, 2
"""What a face of the box may be."""

PIECE = 128
"""Cells that collide together: nineteen rows of them fill a fifth of a first-level cache."""

VELOCITIES = np.array(
    [
        (0, 0, 0),
        *[(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)],
        *[(1, 1, 0), (-1, -1, 0), (1, -1, 0), (-1, 1, 0)],
        *[(1, 0, 1), (-1, 0, -1), (1, 0, -1), (-1, 0, 1)],
        *[(0, 1, 1), (0, -1, -1), (0, 1, -1), (0, -1, 1)],
    ],
    dtype=np.int64,
)
"""The nineteen velocities in cells per step, shape (19, 3); after the first, each is followed by its opposite."""

OPPOSITE = np.array([0, *[i + 1 if i % 2 else i - 1 for i in range(1, 19)]], dtype=np.int64)
"""Index of the opposite velocity, shape (19,)."""

WEIGHTS = np.array([1 / 3] + [1 / 18] * 6 + [1 / 36] * 12)
"""Equilibrium populations of fluid at rest, shape (19,)."""


def _shapes() -> Array:
    """3 on the diagonal of H along each nonzero component and 9/2 between two of them; see the module's text."""
    out = np.zeros((19, 3, 3))
    for H, c in zip(out, VELOCITIES, strict=True):
        moving = np.count_nonzero(c)
        H[:] = 4.5 * np.outer(c, c)
        np.fill_diagonal(H, [3.0 if component else (-1.0, -3.0, 0.0)[moving] for component in c])
    return out


SHAPES = _shapes()
"""What rho u u adds to each population over its weight, shape (19, 3, 3)."""

HERMITE = 4.5 * (np.einsum("ia,ib->iab", VELOCITIES, VELOCITIES) - np.eye(3) / 3)
"""What the stress adds, shape (19, 3, 3)."""

_W0, _W1, _W2 = float32(1 / 3), float32(1 / 18), float32(1 / 36)
_ONE, _HALF, _THIRD = float32(1.0), float32(0.5), float32(1 / 3)
_TWO, _THREE = float32(2.0), float32(3.0)
_1_5, _4_5, _SIX, _NINE = float32(1.5), float32(4.5), float32(6.0), float32(9.0)


def smagorinsky_factor(constant: float) -> float:
    """18 sqrt(2) Cs^2 of the module's formula, for Smagorinsky's constant Cs."""
    return 18 * math.sqrt(2) * constant**2


@njit(fastmath=True, boundscheck=False)
def _collide(f: Lattice, tau_x: float, tau_yz: Lattice, e2: float) -> None:
    """Collide `PIECE` cells in place; population i of cell p is f[i * PIECE + p].

    All rows lie in one array at distances that the compiler knows, so it needs no proof that they do not overlap and
    works on sixteen cells at once.
    """
    for p in range(PIECE):
        f1, f2, f3, f4, f5, f6 = (
            f[PIECE + p],
            f[2 * PIECE + p],
            f[3 * PIECE + p],
            f[4 * PIECE + p],
            f[5 * PIECE + p],
            f[6 * PIECE + p],
        )
        f7, f8, f9, f10, f11, f12 = (
            f[7 * PIECE + p],
            f[8 * PIECE + p],
            f[9 * PIECE + p],
            f[10 * PIECE + p],
            f[11 * PIECE + p],
            f[12 * PIECE + p],
        )
        f13, f14, f15, f16, f17, f18 = (
            f[13 * PIECE + p],
            f[14 * PIECE + p],
            f[15 * PIECE + p],
            f[16 * PIECE + p],
            f[17 * PIECE + p],
            f[18 * PIECE + p],
        )
        xy_same, xy_cross = f7 + f8, f9 + f10
        xz_same, xz_cross = f11 + f12, f13 + f14
        yz_same, yz_cross = f15 + f16, f17 + f18
        on_x, on_y, on_z = f1 + f2, f3 + f4, f5 + f6
        xy, xz, yz = xy_same + xy_cross, xz_same + xz_cross, yz_same + yz_cross
        excess = f[p] + on_x + on_y + on_z + xy + xz + yz
        rho = _ONE + excess
        inverse = _ONE / rho
        jx = (f1 - f2) + (f7 - f8) + (f9 - f10) + (f11 - f12) + (f13 - f14)
        jy = (f3 - f4) + (f7 - f8) - (f9 - f10) + (f15 - f16) + (f17 - f18)
        jz = (f5 - f6) + (f11 - f12) - (f13 - f14) + (f15 - f16) - (f17 - f18)
        ux, uy, uz = jx * inverse, jy * inverse, jz * inverse
        third = _THIRD * excess
        pxx = on_x + xy + xz - jx * ux - third
        pyy = on_y + xy + yz - jy * uy - third
        pzz = on_z + xz + yz - jz * uz - third
        pxy = xy_same - xy_cross - jx * uy
        pxz = xz_same - xz_cross - jx * uz
        pyz = yz_same - yz_cross - jy * uz
        stress = math.sqrt(pxx * pxx + pyy * pyy + pzz * pzz + _TWO * (pxy * pxy + pxz * pxz + pyz * pyz))
        t0 = tau_x + tau_yz[p]
        tau = _HALF * (t0 + math.sqrt(t0 * t0 + e2 * stress * inverse))
        keep = _ONE - _ONE / tau
        pxx, pyy, pzz, pxy, pxz, pyz = keep * pxx, keep * pyy, keep * pzz, keep * pxy, keep * pxz, keep * pyz
        rxx, ryy, rzz = jx * ux, jy * uy, jz * uz
        # Pairs of opposite velocities share their even part.
        trace = _1_5 * (pxx + pyy + pzz)
        kinetic = rxx + ryy + rzz
        f[p] = _W0 * (excess - kinetic - trace)
        base = excess - _THREE * kinetic - trace
        even, odd = _W1 * (base + _SIX * rxx + _4_5 * pxx), _W1 * _THREE * jx
        f[PIECE + p], f[2 * PIECE + p] = even + odd, even - odd
        even, odd = _W1 * (base + _SIX * ryy + _4_5 * pyy), _W1 * _THREE * jy
        f[3 * PIECE + p], f[4 * PIECE + p] = even + odd, even - odd
        even, odd = _W1 * (base + _SIX * rzz + _4_5 * pzz), _W1 * _THREE * jz
        f[5 * PIECE + p], f[6 * PIECE + p] = even + odd, even - odd
        base, mixed = excess - trace + _THREE * (rxx + ryy) + _4_5 * (pxx + pyy), _NINE * (jx * uy + pxy)
        even, odd = _W2 * (base + mixed), _W2 * _THREE * (jx + jy)
        f[7 * PIECE + p], f[8 * PIECE + p] = even + odd, even - odd
        even, odd = _W2 * (base - mixed), _W2 * _THREE * (jx - jy)
        f[9 * PIECE + p], f[10 * PIECE + p] = even + odd, even - odd
        base, mixed = excess - trace + _THREE * (rxx + rzz) + _4_5 * (pxx + pzz), _NINE * (jx * uz + pxz)
        even, odd = _W2 * (base + mixed), _W2 * _THREE * (jx + jz)
        f[11 * PIECE + p], f[12 * PIECE + p] = even + odd, even - odd
        even, odd = _W2 * (base - mixed), _W2 * _THREE * (jx - jz)
        f[13 * PIECE + p], f[14 * PIECE + p] = even + odd, even - odd
        base, mixed = excess - trace + _THREE * (ryy + rzz) + _4_5 * (pyy + pzz), _NINE * (jy * uz + pyz)
        even, odd = _W2 * (base + mixed), _W2 * _THREE * (jy + jz)
        f[15 * PIECE + p], f[16 * PIECE + p] = even + odd, even - odd
        even, odd = _W2 * (base - mixed), _W2 * _THREE * (jy - jz)
        f[17 * PIECE + p], f[18 * PIECE + p] = even + odd, even - odd


@njit(fastmath=True, boundscheck=False)
def _fill_missing(f: Lattice, x: int, y: int, z: int, ny: int, nz: int, faces: IntArray) -> None:
    """Write what the cell beside a face will pull from beyond it into the halo, from the cell's own populations.

    Beyond a wall lies the population that left, turned back half-way (the wall is on the face itself); beyond an open
    face lies equilibrium with the cell's own velocity: at the pressure of rest where water leaves, and where it comes
    in, at right angles to the face, at the pressure that water from rest has at that speed, -rho u^2 / 2 (Bernoulli;
    at the pressure of rest an inflow would have nothing to stop its growth). Every slot of the halo is written by one
    cell only.
    """
    nx = f.shape[1] - 2
    mz = nz + 2
    at = y * mz + z
    ux = uy = uz = 0.0
    rho = 1.0
    for i in range(19):
        g = f[i, x, at]
        rho += g
        ux += g * VELOCITIES[i, 0]
        uy += g * VELOCITIES[i, 1]
        uz += g * VELOCITIES[i, 2]
    ux /= rho
    uy /= rho
    uz /= rho
    x_open = (x == 1 and faces[0] == OPEN and ux > 0) or (x == nx and faces[1] == OPEN and ux < 0)
    y_open = (y == 1 and faces[2] == OPEN and uy > 0) or (y == ny and faces[3] == OPEN and uy < 0)
    z_open = (z == 1 and faces[4] == OPEN and uz > 0) or (z == nz and faces[5] == OPEN and uz < 0)
    v = (
        0.0 if y_open or z_open else ux,
        0.0 if x_open or z_open else uy,
        0.0 if x_open or y_open else uz,
    )
    inflow = x_open or y_open or z_open
    excess = -1.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) if inflow else 0.0
    for i in range(1, 19):
        a, b, c = x - VELOCITIES[i, 0], y - VELOCITIES[i, 1], z - VELOCITIES[i, 2]
        if 1 <= a <= nx and 1 <= b <= ny and 1 <= c <= nz:
            continue
        wall = opened = False
        for beyond, face in ((a < 1, 0), (a > nx, 1), (b < 1, 2), (b > ny, 3), (c < 1, 4), (c > nz, 5)):
            wall = wall or (beyond and faces[face] == WALL)
            opened = opened or (beyond and faces[face] == OPEN)
        if wall:
            f[i, a, b * mz + c] = f[OPPOSITE[i], x, at]
        elif opened:
            value = excess
            for m in range(3):
                value += 3 * VELOCITIES[i, m] * v[m]
                for n in range(3):
                    value += SHAPES[i, m, n] * v[m] * v[n]
            f[i, a, b * mz + c] = WEIGHTS[i] * value


@njit(parallel=True, fastmath=True, boundscheck=False)
def fill_halo(f: Lattice, ny: int, nz: int, faces: IntArray) -> None:
    """Fill what the cells beside open faces and walls will pull; at rest the halo is zero, as is all else."""
    nx = f.shape[1] - 2
    for k in prange(nx):
        x = np.int64(k) + 1
        end = x in (1, nx)
        for y in range(1, ny + 1):
            if end or y in (1, ny):
                for z in range(1, nz + 1):
                    _fill_missing(f, x, y, z, ny, nz, faces)
            else:
                _fill_missing(f, x, y, 1, ny, nz, faces)
                _fill_missing(f, x, y, nz, ny, nz, faces)


@njit(parallel=True, fastmath=True, boundscheck=False)
def step(
    src: Lattice, dst: Lattice, ny: int, nz: int, tau_x: Lattice, tau_yz: Lattice, eddies: float, faces: IntArray
) -> None:
    """Pull populations from neighbours in `src`, collide, write `dst` and fill its halo.

    Parameters
    ----------
    src, dst : ndarray of float32, shape (19, nx + 2, (ny + 2) (nz + 2))
        Deviations from rest; the halo of `src` must be filled.
    ny, nz : int
        Cells inside, without halo; a plane must hold at least `PIECE` of them.
    tau_x, tau_yz : ndarray of float32, shapes (nx + 2,) and ((ny + 2) (nz + 2),)
        Their sum is the relaxation time of the water itself in each cell: 1/2 + 3 nu, larger in a sponge.
    eddies : float
        `smagorinsky_factor`.
    faces : ndarray of int, shape (6,)
        OPEN, WALL or PERIODIC for low x, high x, low y, ... ; periodic halos are left to `wrap`.
    """
    mz = nz + 2
    first = mz + 1
    count = (ny + 2) * mz - 2 * first
    for k in prange(src.shape[1] - 2):
        x = np.int64(k) + 1
        f = np.empty(19 * PIECE, np.float32)
        for piece in range((count + PIECE - 1) // PIECE):
            # The last piece steps back to stay in the plane; what overlaps is computed twice, with the same result.
            p = first + min(piece * PIECE, count - PIECE)
            for i in range(19):
                row = src[i, x - VELOCITIES[i, 0]]
                q = p - VELOCITIES[i, 1] * mz - VELOCITIES[i, 2]
                for n in range(PIECE):
                    f[i * PIECE + n] = row[q + n]
            _collide(f, tau_x[x], tau_yz[p : p + PIECE], float32(eddies))
            for i in range(19):
                row = dst[i, x]
                for n in range(PIECE):
                    row[p + n] = f[i * PIECE + n]
    fill_halo(dst, ny, nz, faces)


def wrap(f: Lattice, ny: int, nz: int, faces: IntArray) -> None:
    """Fill the halo beside periodic faces from the cells of the opposite face; call it after `fill_halo`."""
    box = f.reshape(19, f.shape[1], ny + 2, nz + 2)
    # Edges of the halo belong to the other face unless that is periodic too.
    y = slice(None) if faces[2] == PERIODIC else slice(1, -1)
    z = slice(None) if faces[4] == PERIODIC else slice(1, -1)
    if faces[0] == PERIODIC:
        box[:, 0, y, z], box[:, -1, y, z] = box[:, -2, y, z], box[:, 1, y, z]
    if faces[2] == PERIODIC:
        box[:, :, 0, z], box[:, :, -1, z] = box[:, :, -2, z], box[:, :, 1, z]
    if faces[4] == PERIODIC:
        box[..., 0], box[..., -1] = box[..., -2], box[..., 1]


@njit(boundscheck=False)
def push(
    src: Lattice,
    dst: Lattice,
    nz: int,
    tau_x: Lattice,
    tau_yz: Lattice,
    eddies: float,
    cells: IntArray,
    forces: Array,
) -> None:
    """Collide again the few cells that a body force acts on, with the force in them (Guo et al. 2002).

    The velocity includes half the force, u = (sum f c + F/2) / rho, and the source (1 - 1/(2 tau)) w [3 c.F + 4.5 Q :
    (u F + F u)] joins the collision (doi:10.1103/PhysRevE.65.046308); with F = 0 this is the collision of `step`,
    written plainly. Call it between `step` and the next, and `fill_halo` after it if a cell lies beside a face.

    Parameters
    ----------
    cells : ndarray of int, shape (k, 3)
        Indices with halo.
    forces : ndarray, shape (k, 3)
        Force per cell over the density of rest, cells per step squared.
    """
    mz = nz + 2
    c = VELOCITIES
    g = np.empty(19)
    u, F, drift = np.empty(3), np.empty(3), np.empty((3, 3))
    for k in range(cells.shape[0]):
        x, at = cells[k, 0], cells[k, 1] * mz + cells[k, 2]
        excess = 0.0
        u[:] = 0.0
        for i in range(19):
            g[i] = src[i, x - c[i, 0], at - c[i, 1] * mz - c[i, 2]]
            excess += g[i]
            for a in range(3):
                u[a] += g[i] * c[i, a]
        rho = 1.0 + excess
        for a in range(3):
            F[a] = forces[k, a]
            u[a] = (u[a] + 0.5 * F[a]) / rho
        norm = 0.0
        stress = np.zeros((3, 3))
        for a in range(3):
            for b in range(3):
                for i in range(19):
                    stress[a, b] += g[i] * c[i, a] * c[i, b]
                stress[a, b] -= rho * u[a] * u[b] + (excess / 3 if a == b else 0.0)
                drift[a, b] = u[a] * F[b] + F[a] * u[b]
                norm += (stress[a, b] + 0.5 * drift[a, b]) ** 2
        tau0 = tau_x[x] + tau_yz[at]
        tau = 0.5 * (tau0 + math.sqrt(tau0**2 + eddies * math.sqrt(norm) / rho))
        for i in range(19):
            value = excess
            for a in range(3):
                value += 3 * c[i, a] * (rho * u[a] + 0.5 * F[a])
                for b in range(3):
                    kept = (1 - 1 / tau) * stress[a, b] + (1 - 0.5 / tau) * drift[a, b]
                    value += SHAPES[i, a, b] * rho * u[a] * u[b] + HERMITE[i, a, b] * kept
            dst[i, x, at] = WEIGHTS[i] * value


@njit(parallel=True, fastmath=True, boundscheck=False)
def velocity(f: Lattice, ny: int, nz: int, out: Lattice) -> None:
    """Density and velocity of all cells inside: `out`, shape (4, nx, ny, nz), gets rho - 1, ux, uy, uz."""
    mz = nz + 2
    for k in prange(f.shape[1] - 2):
        x = np.int64(k)
        for y in range(ny):
            rho, ux, uy, uz = out[0, x, y], out[1, x, y], out[2, x, y], out[3, x, y]
            rho[:] = 0.0
            ux[:] = 0.0
            uy[:] = 0.0
            uz[:] = 0.0
            for i in range(19):
                row = f[i, x + 1, (y + 1) * mz + 1 : (y + 1) * mz + 1 + nz]
                cx, cy, cz = float32(VELOCITIES[i, 0]), float32(VELOCITIES[i, 1]), float32(VELOCITIES[i, 2])
                for z in range(nz):
                    rho[z] += row[z]
                    ux[z] += cx * row[z]
                    uy[z] += cy * row[z]
                    uz[z] += cz * row[z]
            for z in range(nz):
                over = _ONE / (_ONE + rho[z])
                ux[z] *= over
                uy[z] *= over
                uz[z] *= over
