"""Compiled Gram matrix G of the disturbance D = s' G s, and the Gauss-Newton blocks of D over pose and thrusts.

Row i of G is thruster i with T > 0, whose jet goes along -axis; row m + i is the same thruster with T < 0.

Variables of the derivatives, in this order: position of the body in W, shape (3,); rotation vector on the body's side
(R_WB exp([theta])), shape (3,); m thrusts. With residuals r = sqrt(w) v (coherent: three components of the summed
velocity at every point; incoherent: the speed of every jet at every point), D = r'r, its gradient is 2 J'r and the
Gauss-Newton matrix 2 J'J. `plan_disturbance` computes the same faster for a planner.

Points are processed in blocks of `BLOCK`, so that a block stays in the first-level cache. Every jet that reaches a
point of a block has a row of speeds (and of slopes), zero where it misses; the sums are products of contiguous rows,
which compile to vector instructions. Reordered addition (`FAST`) changes the last bits only, and reproducibly on one
processor.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.jit.njit import njit
from wakewise.wake.jets import FAST, Numbers, as_tuple, own_constants, speed_and_slope

BLOCK = 256
PERPENDICULAR = 1e-14
"""Cosine under which two jets count as perpendicular: rounding of unit vectors leaves up to some 1e-16."""


@njit(apart=True, fastmath=FAST)
def load_block(points: Array, weights: Array, start: int, count: int, block: Array) -> float:
    """Points x, y, z and roots of weights into rows 0 to 3 of `block`; returns NaN if any of them is not finite."""
    check = 0.0
    for j in range(count):
        x, y, z, w = points[start + j, 0], points[start + j, 1], points[start + j, 2], weights[start + j]
        block[0, j] = x
        block[1, j] = y
        block[2, j] = z
        block[3, j] = np.sqrt(w)
        check += 0.0 * (x + y + z + block[3, j])
    return check


@njit(apart=True)
def check_jets(p: Array, q: Array, origins: Array, axes: Array, areas: Array) -> float:
    """0 for a sound pose and sound thrusters; NaN if anything is not finite or an area is not more than 0."""
    check = 0.0
    for r in range(p.shape[0]):
        check += 0.0 * p[r]
    for r in range(q.shape[0]):
        check += 0.0 * q[r]
    for i in range(areas.shape[0]):
        for r in range(3):
            check += 0.0 * (origins[i, r] + axes[i, r])
        check += 0.0 / np.sqrt(areas[i])
    return check


@njit(fastmath=FAST)
def dot(a: Array, b: Array, count: int) -> float:
    """Sum of products of the first `count` elements."""
    total = 0.0
    for j in range(count):
        total += a[j] * b[j]
    return total


@njit(apart=True)
def fill_rows(
    block: Array, count: int, origins: Array, axes: Array, own: Array, kind: int, numbers: Numbers, slopes: bool,
    scratch: Array, hits: IntArray, rows: Array, column: IntArray,
) -> int:  # fmt: skip
    """Rows of sqrt(w) times f, and if `slopes` alpha and beta, of the jets that reach one of the block's points.

    `rows[0]`, `rows[1]`, `rows[2]`, each of shape (2 m, BLOCK), take f, alpha and beta. Returns how many rows were
    filled; `column[row]` is i for the jet of T_i > 0 and m + i for that of T_i < 0.
    """
    m = origins.shape[0]
    filled = 0
    for i in range(m):
        ox, oy, oz = origins[i, 0], origins[i, 1], origins[i, 2]
        ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
        reach0, reach1, reach2 = own[i, 3], own[i, 4], own[i, 5]
        for j in range(count):
            ex, ey, ez = block[0, j] - ox, block[1, j] - oy, block[2, j] - oz
            along = ex * ax + ey * ay + ez * az
            r2 = ex * ex + ey * ey + ez * ez
            scratch[0, j] = along
            scratch[1, j] = r2
            scratch[2, j] = reach0 + reach1 * abs(along) + reach2 * along * along - r2
        reached = 0
        for j in range(count):
            hits[reached] = j
            reached += scratch[2, j] >= 0.0 and scratch[0, j] != 0.0
        ahead, astern = -1, -1
        for h in range(reached):
            j = hits[h]
            x = scratch[0, j]
            row = ahead if x < 0.0 else astern
            if row < 0:
                row = filled
                filled += 1
                rows[0, row, :count] = 0.0
                if slopes:
                    rows[1, row, :count] = 0.0
                    rows[2, row, :count] = 0.0
                if x < 0.0:
                    ahead = row
                    column[row] = i
                else:
                    astern = row
                    column[row] = m + i
            f, by_axis, by_offset = speed_and_slope(
                kind, numbers, own[i, 0], own[i, 1], own[i, 2], abs(x), scratch[1, j]
            )
            rows[0, row, j] = f * block[3, j]
            if slopes:
                rows[1, row, j] = by_axis * block[3, j]
                rows[2, row, j] = by_offset * block[3, j]
    return filled


@njit
def cosines(axes: Array) -> Array:
    """d_i . d_k of the 2 m jets' directions, shape (2 m, 2 m); zero for what is perpendicular but for rounding."""
    m = axes.shape[0]
    table = np.zeros((2 * m, 2 * m))
    for i in range(m):
        for k in range(m):
            dot = axes[i, 0] * axes[k, 0] + axes[i, 1] * axes[k, 1] + axes[i, 2] * axes[k, 2]
            if abs(dot) > PERPENDICULAR:
                table[i, k] = dot
                table[m + i, m + k] = dot
                # No point is downstream of both jets of one thruster.
                if i != k:
                    table[i, m + k] = -dot
                    table[m + i, k] = -dot
    return table


@njit(fastmath=FAST)
def gram_sum(
    points: Array, weights: Array, origins: Array, axes: Array, areas: Array, kind: int, parameters: Array
) -> tuple[Array, float]:
    """G, shape (2 m, 2 m), and a number that is NaN if a point or weight is not finite or a weight is negative."""
    n, m = points.shape[0], origins.shape[0]
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    table = cosines(axes)
    G = np.zeros((2 * m, 2 * m))
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column = np.empty((1, 2 * m, BLOCK)), np.empty(2 * m, np.int64)
    check = check_jets(areas, areas, origins, axes, areas)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        filled = fill_rows(block, count, origins, axes, own, kind, numbers, False, scratch, hits, rows, column)
        for a in range(filled):
            for c in range(a + 1):
                cosine = table[column[a], column[c]]
                if cosine != 0.0:
                    total = dot(rows[0, a], rows[0, c], count)
                    G[column[a], column[c]] += cosine * total
                    if a != c:
                        G[column[c], column[a]] += cosine * total
    return G, check


@njit(apart=True)
def place(p: Array, q: Array, positions_B: Array, axes_B: Array) -> tuple[Array, Array, Array]:
    """(R_WB, origins in W, axes in W) of thrusters on a body at p with unit quaternion q = (w, x, y, z)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    m = positions_B.shape[0]
    origins, axes = np.empty((m, 3)), np.empty((m, 3))
    for i in range(m):
        for row in range(3):
            origins[i, row] = (
                p[row] + R[row, 0] * positions_B[i, 0] + R[row, 1] * positions_B[i, 1] + R[row, 2] * positions_B[i, 2]
            )
            axes[i, row] = R[row, 0] * axes_B[i, 0] + R[row, 1] * axes_B[i, 1] + R[row, 2] * axes_B[i, 2]
    return R, origins, axes


@njit(apart=True, fastmath=FAST)
def pose_slopes(
    block: Array, count: int, p: Array, origin: Array, axis: Array, sign: float, alpha: Array, beta: Array,
    slope: Array,
) -> None:  # fmt: skip
    """Rows 0 to 5 of `slope`: derivatives of one jet's sqrt(w) f by the vehicle's position and by a turn, both in W.

    A shift of the vehicle moves the point the other way, and a turn theta about the body's origin moves it by
    -theta x (point - p) as the vehicle sees it, so the derivatives are -g and g x (point - p), g = alpha d + beta e.
    `sign` is +1 for the jet along the axis and -1 for the one against it.
    """
    px, py, pz = p[0], p[1], p[2]
    ox, oy, oz = origin[0], origin[1], origin[2]
    dx, dy, dz = sign * axis[0], sign * axis[1], sign * axis[2]
    for j in range(count):
        x, y, z = block[0, j], block[1, j], block[2, j]
        al, be = alpha[j], beta[j]
        gx, gy, gz = al * dx + be * (x - ox), al * dy + be * (y - oy), al * dz + be * (z - oz)
        qx, qy, qz = x - px, y - py, z - pz
        slope[0, j] = -gx
        slope[1, j] = -gy
        slope[2, j] = -gz
        slope[3, j] = gy * qz - gz * qy
        slope[4, j] = gz * qx - gx * qz
        slope[5, j] = gx * qy - gy * qx


@njit(fastmath=FAST)
def gram_slope_sum(
    points: Array, weights: Array, p: Array, q: Array, positions_B: Array, axes_B: Array, areas: Array, kind: int,
    parameters: Array,
) -> tuple[Array, Array, float]:  # fmt: skip
    """G, shape (2 m, 2 m), its derivatives by position in W and rotation vector in B, (6, 2 m, 2 m), and the check."""
    n, m = points.shape[0], positions_B.shape[0]
    R, origins, axes = place(p, q, positions_B, axes_B)
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    table = cosines(axes_B)
    # Sums over points of f_a f_c and of f_a times the six slopes of f_c, before the factor d_a . d_c.
    total = np.zeros((2 * m, 2 * m, 7))
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column, slope = np.empty((3, 2 * m, BLOCK)), np.empty(2 * m, np.int64), np.empty((6, BLOCK))
    check = check_jets(p, q, origins, axes, areas)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        filled = fill_rows(block, count, origins, axes, own, kind, numbers, True, scratch, hits, rows, column)
        for c in range(filled):
            k = column[c]
            i = k if k < m else k - m
            pose_slopes(block, count, p, origins[i], axes[i], 1.0 if k >= m else -1.0, rows[1, c], rows[2, c], slope)
            for a in range(filled):
                if table[column[a], k] != 0.0:
                    s, s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                    for j in range(count):
                        f = rows[0, a, j]
                        s += f * rows[0, c, j]
                        s0 += f * slope[0, j]
                        s1 += f * slope[1, j]
                        s2 += f * slope[2, j]
                        s3 += f * slope[3, j]
                        s4 += f * slope[4, j]
                        s5 += f * slope[5, j]
                    sums = total[column[a], k]
                    sums[0] += s
                    sums[1] += s0
                    sums[2] += s1
                    sums[3] += s2
                    sums[4] += s3
                    sums[5] += s4
                    sums[6] += s5
    G, dG = np.zeros((2 * m, 2 * m)), np.zeros((6, 2 * m, 2 * m))
    for a in range(2 * m):
        for c in range(a + 1):
            cosine = table[a, c]
            if cosine != 0.0:
                # One of the two sums, not each its own, so that G is symmetric to the last bit.
                G[a, c] = G[c, a] = cosine * total[a, c, 0]
                for r in range(3):
                    dG[r, a, c] = dG[r, c, a] = cosine * (total[a, c, 1 + r] + total[c, a, 1 + r])
                    turn = 0.0
                    for row in range(3):
                        turn += R[row, r] * (total[a, c, 4 + row] + total[c, a, 4 + row])
                    dG[3 + r, a, c] = dG[3 + r, c, a] = cosine * turn
    return G, dG, check


@njit
def smooth_root(thrust: float, smooth: float) -> tuple[float, float]:
    """Root of the part of a thrust above zero, and its derivative: see `wakewise.wake.disturbance`."""
    if smooth == 0.0:
        if thrust <= 0.0:
            return 0.0, 0.0
        root = np.sqrt(thrust)
        return root, 0.5 / root
    half = 0.5 * smooth
    length = np.sqrt(thrust * thrust + half * half)
    # For thrust << 0, (T + |T|) / 2 would cancel; this form of the same does not.
    above = 0.5 * (thrust + length) if thrust > 0.0 else 0.5 * half * half / (length - thrust)
    square = thrust * thrust + smooth * smooth
    quarter = np.sqrt(np.sqrt(square))
    root = above / quarter
    return root, (above / length) / quarter - 0.5 * root * thrust / square


@njit(apart=True)
def thrust_roots(thrusts: Array, smooth: float) -> tuple[Array, Array]:
    """Roots s of the 2 m split thrusts, and the derivative of each by its own signed thrust."""
    m = thrusts.shape[0]
    root, slope = np.empty(2 * m), np.empty(2 * m)
    for i in range(m):
        root[i], slope[i] = smooth_root(thrusts[i], smooth)
        root[m + i], against = smooth_root(-thrusts[i], smooth)
        slope[m + i] = -against
    return root, slope


@njit(fastmath=FAST)
def stage_sum(
    points: Array, weights: Array, p: Array, q: Array, positions_B: Array, axes_B: Array, areas: Array, kind: int,
    parameters: Array, thrusts: Array, smooth: float, coherent: bool, hessian: bool,
) -> tuple[float, Array, Array, float]:  # fmt: skip
    """D, gradient (6 + m,), Gauss-Newton matrix (6 + m, 6 + m) (zeros unless `hessian`), and the check."""
    n, m = points.shape[0], positions_B.shape[0]
    R, origins, axes = place(p, q, positions_B, axes_B)
    own, numbers = own_constants(kind, parameters, areas), as_tuple(parameters)
    root, root_slope = thrust_roots(thrusts, smooth)
    D, check = 0.0, check_jets(p, q, origins, axes, areas)
    gradient, H = np.zeros(6 + m), np.zeros((6 + m, 6 + m))
    block, scratch, hits = np.empty((4, BLOCK)), np.empty((3, BLOCK)), np.empty(BLOCK + 1, np.int64)
    rows, column, slope = np.empty((3, 2 * m, BLOCK)), np.empty(2 * m, np.int64), np.empty((6, BLOCK))
    # Rows 0 to 5 pose, then thrusts, last the residual itself; three components for the coherent sum.
    J = np.empty((7 + m, 3, BLOCK))
    active = np.empty(7 + m, np.bool_)
    for start in range(0, n, BLOCK):
        count = min(BLOCK, n - start)
        check += load_block(points, weights, start, count, block)
        filled = fill_rows(block, count, origins, axes, own, kind, numbers, True, scratch, hits, rows, column)
        if coherent:
            active[:] = False
            active[:6] = True
            active[6 + m] = True
            J[:6, :, :count] = 0.0
            J[6 + m, :, :count] = 0.0
        for c in range(filled):
            k = column[c]
            i = k if k < m else k - m
            s, ds = root[k], root_slope[k]
            if s == 0.0 and ds == 0.0:
                continue
            sign = 1.0 if k >= m else -1.0
            pose_slopes(block, count, p, origins[i], axes[i], sign, rows[1, c], rows[2, c], slope)
            speed = rows[0, c]
            if coherent:
                if not active[6 + i]:
                    active[6 + i] = True
                    J[6 + i, :, :count] = 0.0
                for x in range(3):
                    d = sign * axes[i, x]
                    for r in range(6):
                        for j in range(count):
                            J[r, x, j] += s * d * slope[r, j]
                    for j in range(count):
                        J[6 + i, x, j] += ds * d * speed[j]
                        J[6 + m, x, j] += s * d * speed[j]
            else:
                own_square = dot(speed, speed, count)
                D += s * s * own_square
                gradient[6 + i] += 2.0 * s * ds * own_square
                H[6 + i, 6 + i] += 2.0 * ds * ds * own_square
                for r in range(6):
                    mixed = dot(slope[r], speed, count)
                    gradient[r] += 2.0 * s * s * mixed
                    if hessian:
                        H[6 + i, r] += 2.0 * s * ds * mixed
                        for t in range(r + 1):
                            H[r, t] += 2.0 * s * s * dot(slope[r], slope[t], count)
        if coherent:
            last = J[6 + m]
            for x in range(3):
                D += dot(last[x], last[x], count)
            for r in range(6 + m):
                if active[r]:
                    for x in range(3):
                        gradient[r] += 2.0 * dot(J[r, x], last[x], count)
                        if hessian:
                            for t in range(r + 1):
                                if active[t]:
                                    H[r, t] += 2.0 * dot(J[r, x], J[t, x], count)
    if hessian:
        turn_hessian(R, H)
    turn_gradient(R, gradient)
    return D, gradient, H, check


@njit(apart=True)
def turn_gradient(R: Array, gradient: Array) -> None:
    """Take elements 3 to 5 from W to B axes."""
    a, b, c = gradient[3], gradient[4], gradient[5]
    for r in range(3):
        gradient[3 + r] = R[0, r] * a + R[1, r] * b + R[2, r] * c


@njit(apart=True)
def turn_hessian(R: Array, H: Array) -> None:
    """Fill the upper triangle of H from the lower, and take rows and columns 3 to 5 from W to B axes."""
    size = H.shape[0]
    for r in range(size):
        for t in range(r):
            H[t, r] = H[r, t]
    for r in range(size):
        a, b, c = H[r, 3], H[r, 4], H[r, 5]
        for t in range(3):
            H[r, 3 + t] = a * R[0, t] + b * R[1, t] + c * R[2, t]
    for r in range(size):
        a, b, c = H[3, r], H[4, r], H[5, r]
        for t in range(3):
            H[3 + t, r] = a * R[0, t] + b * R[1, t] + c * R[2, t]
    for r in range(size):
        for t in range(r):
            H[t, r] = H[r, t]
