"""Collision of the D3Q19 lattice Boltzmann fluid: regularised, with a Smagorinsky eddy viscosity.

Of the non-equilibrium only the stress Pi is kept, with the share 1 - 1/tau (Latt and Chopard 2006,
doi:10.1016/j.matcom.2006.05.017). The relaxation time follows from the stress (Smagorinsky 1963 in the closed form of
Hou et al. 1996, arXiv:comp-gas/9401004): tau = [tau0 + sqrt(tau0^2 + 18 sqrt(2) Cs^2 |Pi| / rho)] / 2, filter width one
cell.

f_i = w_i [rho + 3 c_i.j + H_i : rho u u + (1 - 1/tau) 4.5 Q_i : Pi] with Q_i = c_i c_i - 1/3. The usual H_i = 4.5 Q_i
gives a fourth moment <cx cx cy cy> that depends on the motion along z, and round jets then grow four arms along the
lattice's diagonals. `SHAPES` holds the H_i of Bauer and Ruede (2018, arXiv:1803.04937) without that fault. The stress
keeps the usual Q_i, because with H_i the scheme is unstable at small viscosity.
"""

from __future__ import annotations

import math

from numba import float32

from wakewise.core.arrays import Array
from wakewise.simulation.lattice.stencil import HERMITE, SHAPES, VELOCITIES, WEIGHTS

_W0, _W1, _W2 = float32(1 / 3), float32(1 / 18), float32(1 / 36)
_ONE, _HALF, _THIRD = float32(1.0), float32(0.5), float32(1 / 3)
_TWO, _THREE = float32(2.0), float32(3.0)
_NOTHING, _STILL = float32(0.0), float32(1e-15)
_1_5, _4_5, _SIX, _NINE = float32(1.5), float32(4.5), float32(6.0), float32(9.0)

Populations = tuple[float, ...]
"""Nineteen, in the order of `VELOCITIES`."""


def collide(f: Populations, tau0: float, eddies: float) -> Populations:
    """Populations of one cell after collision, from those that came; deviations from rest.

    Plain Python, so that one text is compiled for processors (`kernel`) and for graphics cards (`cuda_kernel`).

    `tau0`: relaxation time of the water itself. `eddies`: `smagorinsky_factor`.
    """
    f0, f1, f2, f3, f4, f5, f6, f7, f8, f9, f10, f11, f12, f13, f14, f15, f16, f17, f18 = f
    xy_same, xy_cross = f7 + f8, f9 + f10
    xz_same, xz_cross = f11 + f12, f13 + f14
    yz_same, yz_cross = f15 + f16, f17 + f18
    on_x, on_y, on_z = f1 + f2, f3 + f4, f5 + f6
    xy, xz, yz = xy_same + xy_cross, xz_same + xz_cross, yz_same + yz_cross
    excess = f0 + on_x + on_y + on_z + xy + xz + yz
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
    tau = _HALF * (tau0 + math.sqrt(tau0 * tau0 + eddies * stress * inverse))
    # Ahead of the first sound wave populations fall below what float32 holds with full digits, and arithmetic with such
    # numbers is slow: a cell that deviates from rest by less than a millionth of float32's own rounding is put to rest.
    activity = abs(excess) + abs(jx) + abs(jy) + abs(jz) + stress
    alive = _ONE if activity > _STILL else _NOTHING
    w0, w1, w2 = _W0 * alive, _W1 * alive, _W2 * alive
    keep = _ONE - _ONE / tau
    pxx, pyy, pzz, pxy, pxz, pyz = keep * pxx, keep * pyy, keep * pzz, keep * pxy, keep * pxz, keep * pyz
    rxx, ryy, rzz = jx * ux, jy * uy, jz * uz
    # Pairs of opposite velocities share their even part.
    trace = _1_5 * (pxx + pyy + pzz)
    kinetic = rxx + ryy + rzz
    g0 = w0 * (excess - kinetic - trace)
    base = excess - _THREE * kinetic - trace
    even, odd = w1 * (base + _SIX * rxx + _4_5 * pxx), w1 * _THREE * jx
    g1, g2 = even + odd, even - odd
    even, odd = w1 * (base + _SIX * ryy + _4_5 * pyy), w1 * _THREE * jy
    g3, g4 = even + odd, even - odd
    even, odd = w1 * (base + _SIX * rzz + _4_5 * pzz), w1 * _THREE * jz
    g5, g6 = even + odd, even - odd
    base, mixed = excess - trace + _THREE * (rxx + ryy) + _4_5 * (pxx + pyy), _NINE * (jx * uy + pxy)
    even, odd = w2 * (base + mixed), w2 * _THREE * (jx + jy)
    g7, g8 = even + odd, even - odd
    even, odd = w2 * (base - mixed), w2 * _THREE * (jx - jy)
    g9, g10 = even + odd, even - odd
    base, mixed = excess - trace + _THREE * (rxx + rzz) + _4_5 * (pxx + pzz), _NINE * (jx * uz + pxz)
    even, odd = w2 * (base + mixed), w2 * _THREE * (jx + jz)
    g11, g12 = even + odd, even - odd
    even, odd = w2 * (base - mixed), w2 * _THREE * (jx - jz)
    g13, g14 = even + odd, even - odd
    base, mixed = excess - trace + _THREE * (ryy + rzz) + _4_5 * (pyy + pzz), _NINE * (jy * uz + pyz)
    even, odd = w2 * (base + mixed), w2 * _THREE * (jy + jz)
    g15, g16 = even + odd, even - odd
    even, odd = w2 * (base - mixed), w2 * _THREE * (jy - jz)
    g17, g18 = even + odd, even - odd
    return g0, g1, g2, g3, g4, g5, g6, g7, g8, g9, g10, g11, g12, g13, g14, g15, g16, g17, g18


def collide_forced(
    g: Array, tau0: float, eddies: float, force: Array, u: Array, stress: Array, drift: Array, went: Array
) -> None:
    """The collision written plainly, with a body force in the cell (Guo et al. 2002), in float64.

    The velocity includes half the force, u = (sum f c + F/2) / rho, and the source (1 - 1/(2 tau)) w [3 c.F + 4.5 Q :
    (u F + F u)] joins the collision (doi:10.1103/PhysRevE.65.046308); with F = 0 this is `collide`.

    - `g`, shape (19,): populations that came.
    - `tau0`, `eddies`: as in `collide`.
    - `force`, shape (3,): over the density of rest, cells per step squared.
    - `u`, `stress`, `drift`, shapes (3,), (3, 3) and (3, 3): work arrays.
    - `went`, shape (19,): the result.
    """
    excess = 0.0
    for a in range(3):
        u[a] = 0.5 * force[a]
    for i in range(19):
        excess += g[i]
        for a in range(3):
            u[a] += g[i] * VELOCITIES[i, a]
    rho = 1.0 + excess
    for a in range(3):
        u[a] /= rho
    norm = 0.0
    for a in range(3):
        for b in range(3):
            stress[a, b] = -rho * u[a] * u[b] - (excess / 3 if a == b else 0.0)
            for i in range(19):
                stress[a, b] += g[i] * VELOCITIES[i, a] * VELOCITIES[i, b]
            drift[a, b] = u[a] * force[b] + force[a] * u[b]
            norm += (stress[a, b] + 0.5 * drift[a, b]) ** 2
    tau = 0.5 * (tau0 + math.sqrt(tau0**2 + eddies * math.sqrt(norm) / rho))
    for i in range(19):
        value = excess
        for a in range(3):
            value += 3 * VELOCITIES[i, a] * (rho * u[a] + 0.5 * force[a])
            for b in range(3):
                kept = (1 - 1 / tau) * stress[a, b] + (1 - 0.5 / tau) * drift[a, b]
                value += SHAPES[i, a, b] * rho * u[a] * u[b] + HERMITE[i, a, b] * kept
        went[i] = WEIGHTS[i] * value
