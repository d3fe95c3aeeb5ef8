"""The equations of motion as compiled scalar code, and how they change with attitude and velocity.

What `packed`, shape (20, 6), holds by rows: mass matrix M (0-5), its inverse (6-11), linear damping (12-17), diagonal
of quadratic damping (18), and (W - B, a_x, a_y, a_z, 0, 0) with weight W, buoyancy B and a = W p_BG - B p_BB (19).
`state`, shape (13,), is position, quaternion, twist; `inputs`, shape (9,), is wrench and current. Small vectors are
tuples, so that nothing is allocated. No reordering of sums is allowed (no fastmath): one input, one result, anywhere.

Runge-Kutta step, alone and with its derivatives: these are by the error state (position, rotation vector, twist) and by
the wrench: 12 + 6 columns, of which those of position are known beforehand. They are carried through the stages side by
side in a block of sixteen columns (rotation vector 0-2, twist 3-8, wrench 9-14, the last one spare) by the exact chain
rule of the step as coded.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import njit

Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]

INVERSE, LINEAR, QUADRATIC, STATIC = 6, 12, 18, 19
"""First row of each block in `packed`; the mass matrix starts at 0."""


@njit
def rotate(w: float, x: float, y: float, z: float, a: float, b: float, c: float) -> Three:
    """R(q) (a, b, c); with -w in place of w it is the inverse turn."""
    return (
        (1.0 - 2.0 * (y * y + z * z)) * a + 2.0 * (x * y - w * z) * b + 2.0 * (x * z + w * y) * c,
        2.0 * (x * y + w * z) * a + (1.0 - 2.0 * (x * x + z * z)) * b + 2.0 * (y * z - w * x) * c,
        2.0 * (x * z - w * y) * a + 2.0 * (y * z + w * x) * b + (1.0 - 2.0 * (x * x + y * y)) * c,
    )


@njit
def rotate_by_quat(
    w: float, x: float, y: float, z: float, a: float, b: float, c: float
) -> tuple[Three, Three, Three, Three]:
    """Derivatives of `rotate` by w, x, y and z, exact also off the unit sphere, where Runge-Kutta stages lie."""
    return (
        (2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)),
        (2.0 * (y * b + z * c), 2.0 * (y * a - 2.0 * x * b - w * c), 2.0 * (z * a + w * b - 2.0 * x * c)),
        (2.0 * (x * b - 2.0 * y * a + w * c), 2.0 * (x * a + z * c), 2.0 * (z * b - w * a - 2.0 * y * c)),
        (2.0 * (x * c - 2.0 * z * a - w * b), 2.0 * (w * a - 2.0 * z * b + y * c), 2.0 * (x * a + y * b)),
    )


@njit
def times(packed: Array, row: int, n: Six) -> Six:
    """Product of the symmetric matrix at `row` (M or its inverse) with a vector."""
    a, b, c, d, e, f = n
    # Column by column: the columns are the rows, so that neighbours in memory are worked on together.
    m, i = packed, row
    return (
        m[i, 0] * a + m[i + 1, 0] * b + m[i + 2, 0] * c + m[i + 3, 0] * d + m[i + 4, 0] * e + m[i + 5, 0] * f,
        m[i, 1] * a + m[i + 1, 1] * b + m[i + 2, 1] * c + m[i + 3, 1] * d + m[i + 4, 1] * e + m[i + 5, 1] * f,
        m[i, 2] * a + m[i + 1, 2] * b + m[i + 2, 2] * c + m[i + 3, 2] * d + m[i + 4, 2] * e + m[i + 5, 2] * f,
        m[i, 3] * a + m[i + 1, 3] * b + m[i + 2, 3] * c + m[i + 3, 3] * d + m[i + 4, 3] * e + m[i + 5, 3] * f,
        m[i, 4] * a + m[i + 1, 4] * b + m[i + 2, 4] * c + m[i + 3, 4] * d + m[i + 4, 4] * e + m[i + 5, 4] * f,
        m[i, 5] * a + m[i + 1, 5] * b + m[i + 2, 5] * c + m[i + 3, 5] * d + m[i + 4, 5] * e + m[i + 5, 5] * f,
    )  # fmt: skip


@njit
def _drag(packed: Array, i: int, n: Six) -> float:
    m = packed[LINEAR + i]
    linear = m[0] * n[0] + m[1] * n[1] + m[2] * n[2] + m[3] * n[3] + m[4] * n[4] + m[5] * n[5]
    return linear + packed[QUADRATIC, i] * abs(n[i]) * n[i]


@njit
def damping(packed: Array, n: Six) -> Six:
    """D(nu_r) nu_r at nu_r = n."""
    return (
        _drag(packed, 0, n),
        _drag(packed, 1, n),
        _drag(packed, 2, n),
        _drag(packed, 3, n),
        _drag(packed, 4, n),
        _drag(packed, 5, n),
    )


@njit
def coriolis(packed: Array, n: Six) -> Six:
    """C(nu_r) nu_r at nu_r = n, through the momentum h = M n: (omega x h_v, omega x h_w + v x h_v)."""
    a, b, c, d, e, f = times(packed, 0, n)
    u, v, w, p, q, r = n
    return (
        q * c - r * b,
        r * a - p * c,
        p * b - q * a,
        q * f - r * e + v * c - w * b,
        r * d - p * f + w * a - u * c,
        p * e - q * d + u * b - v * a,
    )


@njit
def restoring(packed: Array, down: Three) -> Six:
    """Wrench of weight and buoyancy, `down` being the world's z axis in B: ((W - B) down, a x down)."""
    x, y, z = down
    net, a, b, c = packed[STATIC, 0], packed[STATIC, 1], packed[STATIC, 2], packed[STATIC, 3]
    return net * x, net * y, net * z, b * z - c * y, c * x - a * z, a * y - b * x


@njit
def rate_kernel(packed: Array, state: Array, inputs: Array, rate: Array) -> None:
    """Write the time derivative of `state` to `rate`, shape (13,)."""
    w, x, y, z = state[3], state[4], state[5], state[6]
    u, v, s, p, q, r = state[7], state[8], state[9], state[10], state[11], state[12]
    rate[0], rate[1], rate[2] = rotate(w, x, y, z, u, v, s)
    rate[3] = 0.5 * (-x * p - y * q - z * r)
    rate[4] = 0.5 * (w * p + y * r - z * q)
    rate[5] = 0.5 * (w * q - x * r + z * p)
    rate[6] = 0.5 * (w * r + x * q - y * p)
    bx, by, bz = rotate(-w, x, y, z, inputs[6], inputs[7], inputs[8])
    n = (u - bx, v - by, s - bz, p, q, r)
    g = restoring(packed, rotate(-w, x, y, z, 0.0, 0.0, 1.0))
    c, d = coriolis(packed, n), damping(packed, n)
    total = (
        inputs[0] + g[0] - c[0] - d[0],
        inputs[1] + g[1] - c[1] - d[1],
        inputs[2] + g[2] - c[2] - d[2],
        inputs[3] + g[3] - c[3] - d[3],
        inputs[4] + g[4] - c[4] - d[4],
        inputs[5] + g[5] - c[5] - d[5],
    )
    a = times(packed, INVERSE, total)
    # The current is constant in the world, so in B it turns against the body.
    rate[7] = a[0] - (q * bz - r * by)
    rate[8] = a[1] - (r * bx - p * bz)
    rate[9] = a[2] - (p * by - q * bx)
    rate[10], rate[11], rate[12] = a[3], a[4], a[5]


@njit
def quasi_linear(packed: Array, n: Six, scale: float, N: Array, column: int) -> None:
    """Write scale (C(n) + D(n)), Fossen's matrices with C skew, to the six columns of N from `column` on."""
    a, b, c, d, e, f = times(packed, 0, n)
    for i in range(6):
        for j in range(6):
            N[i, column + j] = scale * packed[LINEAR + i, j]
        N[i, column + i] += scale * packed[QUADRATIC, i] * abs(n[i])
    # C = [[0, -S(h_v)], [-S(h_v), -S(h_w)]].
    _add_skew(N, 0, column + 3, -scale, a, b, c)
    _add_skew(N, 3, column, -scale, a, b, c)
    _add_skew(N, 3, column + 3, -scale, d, e, f)


@njit
def add_quasi_linear_change(packed: Array, n: Six, x: Six, scale: float, N: Array, column: int) -> None:
    """Add scale Q to six columns of N, where Q delta is the change of (C(n) + D(n)) x when n changes by delta.

    C is linear in n, so its part is [[S(x_w) M_v], [S(x_w) M_w + S(x_v) M_v]] with the upper and lower rows of M.
    """
    u, v, w, p, q, r = x
    m = packed
    for j in range(6):
        N[0, column + j] += scale * (q * m[2, j] - r * m[1, j])
        N[1, column + j] += scale * (r * m[0, j] - p * m[2, j])
        N[2, column + j] += scale * (p * m[1, j] - q * m[0, j])
        N[3, column + j] += scale * (q * m[5, j] - r * m[4, j] + v * m[2, j] - w * m[1, j])
        N[4, column + j] += scale * (r * m[3, j] - p * m[5, j] + w * m[0, j] - u * m[2, j])
        N[5, column + j] += scale * (p * m[4, j] - q * m[3, j] + u * m[1, j] - v * m[0, j])
    for i in range(6):
        N[i, column + i] += scale * packed[QUADRATIC, i] * np.sign(n[i]) * x[i]


@njit
def _add_skew(N: Array, row: int, column: int, scale: float, a: float, b: float, c: float) -> None:
    N[row, column + 1] -= scale * c
    N[row, column + 2] += scale * b
    N[row + 1, column] += scale * c
    N[row + 1, column + 2] -= scale * a
    N[row + 2, column] -= scale * b
    N[row + 2, column + 1] += scale * a


@njit(apart=True)
def rate_jacobian_kernel(packed: Array, state: Array, inputs: Array, F: Array, W: Array) -> None:
    """Write d rate / d (quaternion, twist) to F, shape (13, 12), and d wrench / d (...) to W, shape (6, 12).

    The last two columns only fill the row. They must be zero on entry, as must F where nothing is written.
    """
    w, x, y, z = state[3], state[4], state[5], state[6]
    u, v, s, p, q, r = state[7], state[8], state[9], state[10], state[11], state[12]
    by_w, by_x, by_y, by_z = rotate_by_quat(w, x, y, z, u, v, s)
    F[0, 0], F[0, 1], F[0, 2], F[0, 3] = by_w[0], by_x[0], by_y[0], by_z[0]
    F[1, 0], F[1, 1], F[1, 2], F[1, 3] = by_w[1], by_x[1], by_y[1], by_z[1]
    F[2, 0], F[2, 1], F[2, 2], F[2, 3] = by_w[2], by_x[2], by_y[2], by_z[2]
    F[0, 4], F[1, 4], F[2, 4] = rotate(w, x, y, z, 1.0, 0.0, 0.0)
    F[0, 5], F[1, 5], F[2, 5] = rotate(w, x, y, z, 0.0, 1.0, 0.0)
    F[0, 6], F[1, 6], F[2, 6] = rotate(w, x, y, z, 0.0, 0.0, 1.0)
    p2, q2, r2 = 0.5 * p, 0.5 * q, 0.5 * r
    F[3, 1], F[3, 2], F[3, 3] = -p2, -q2, -r2
    F[4, 0], F[4, 2], F[4, 3] = p2, r2, -q2
    F[5, 0], F[5, 1], F[5, 3] = q2, -r2, p2
    F[6, 0], F[6, 1], F[6, 2] = r2, q2, -p2
    F[3, 7], F[3, 8], F[3, 9] = -0.5 * x, -0.5 * y, -0.5 * z
    F[4, 7], F[4, 8], F[4, 9] = 0.5 * w, -0.5 * z, 0.5 * y
    F[5, 7], F[5, 8], F[5, 9] = 0.5 * z, 0.5 * w, -0.5 * x
    F[6, 7], F[6, 8], F[6, 9] = -0.5 * y, 0.5 * x, 0.5 * w

    cx, cy, cz = inputs[6], inputs[7], inputs[8]
    bx, by, bz = rotate(-w, x, y, z, cx, cy, cz)
    n = (u - bx, v - by, s - bz, p, q, r)
    quasi_linear(packed, n, -1.0, W, 4)
    add_quasi_linear_change(packed, n, n, -1.0, W, 4)
    # The inverse turn has -w in place of w, hence the sign of the derivative by w.
    b_by_w, b_by_x, b_by_y, b_by_z = rotate_by_quat(-w, x, y, z, cx, cy, cz)
    b_by_w = (-b_by_w[0], -b_by_w[1], -b_by_w[2])
    down_by_w, down_by_x, down_by_y, down_by_z = rotate_by_quat(-w, x, y, z, 0.0, 0.0, 1.0)
    down_by_w = (-down_by_w[0], -down_by_w[1], -down_by_w[2])
    _attitude_column(packed, W, 0, b_by_w, down_by_w)
    _attitude_column(packed, W, 1, b_by_x, down_by_x)
    _attitude_column(packed, W, 2, b_by_y, down_by_y)
    _attitude_column(packed, W, 3, b_by_z, down_by_z)
    for i in range(6):
        m = packed[INVERSE + i]
        for k in range(12):
            F[7 + i, k] = (
                m[0] * W[0, k] + m[1] * W[1, k] + m[2] * W[2, k] + m[3] * W[3, k] + m[4] * W[4, k] + m[5] * W[5, k]
            )
    # The current turns against the body, by -omega x b.
    _subtract_cross(F, 0, (p, q, r), b_by_w)
    _subtract_cross(F, 1, (p, q, r), b_by_x)
    _subtract_cross(F, 2, (p, q, r), b_by_y)
    _subtract_cross(F, 3, (p, q, r), b_by_z)
    _add_skew(F, 7, 7, 1.0, bx, by, bz)


@njit
def _attitude_column(packed: Array, W: Array, k: int, b: Three, down: Three) -> None:
    g = restoring(packed, down)
    W[0, k] = g[0] - (W[0, 4] * b[0] + W[0, 5] * b[1] + W[0, 6] * b[2])
    W[1, k] = g[1] - (W[1, 4] * b[0] + W[1, 5] * b[1] + W[1, 6] * b[2])
    W[2, k] = g[2] - (W[2, 4] * b[0] + W[2, 5] * b[1] + W[2, 6] * b[2])
    W[3, k] = g[3] - (W[3, 4] * b[0] + W[3, 5] * b[1] + W[3, 6] * b[2])
    W[4, k] = g[4] - (W[4, 4] * b[0] + W[4, 5] * b[1] + W[4, 6] * b[2])
    W[5, k] = g[5] - (W[5, 4] * b[0] + W[5, 5] * b[1] + W[5, 6] * b[2])


@njit
def _subtract_cross(F: Array, k: int, omega: Three, b: Three) -> None:
    F[7, k] -= omega[1] * b[2] - omega[2] * b[1]
    F[8, k] -= omega[2] * b[0] - omega[0] * b[2]
    F[9, k] -= omega[0] * b[1] - omega[1] * b[0]


COLUMNS = 16
"""Columns of a block of derivatives (see the top of the file)."""


@njit(apart=True)
def rk4_kernel(packed: Array, state: Array, inputs: Array, dt_s: float) -> None:
    """Advance `state`, shape (13,), in place by one classical Runge-Kutta step."""
    rk4_stages(packed, state, inputs, dt_s, np.empty((5, 13)))


@njit
def rk4_stages(packed: Array, state: Array, inputs: Array, dt_s: float, k: Array) -> None:
    """`rk4_kernel` with its work space, shape (5, 13), given: what steps many vehicles makes one for all of them."""
    rate_kernel(packed, state, inputs, k[0])
    for stage in range(1, 4):
        reach = dt_s if stage == 3 else 0.5 * dt_s
        for i in range(13):
            k[4, i] = state[i] + reach * k[stage - 1, i]
        rate_kernel(packed, k[4], inputs, k[stage])
    for i in range(13):
        state[i] += dt_s / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
    normalise(state)


@njit(error_model="python")  # a quaternion of no length is an error, not NaN
def normalise(state: Array) -> float:
    """Give the quaternion of a state unit length and return the length that it had."""
    length = np.sqrt(state[3] ** 2 + state[4] ** 2 + state[5] ** 2 + state[6] ** 2)
    for i in range(3, 7):
        state[i] /= length
    return length


@njit(apart=True)
def rk4_jacobian_kernel(packed: Array, state: Array, inputs: Array, dt_s: float, A: Array, B: Array) -> None:
    """Advance `state` as `rk4_kernel` does; write the derivatives by state, A (12, 12), and by wrench, B (12, 6)."""
    k = np.empty((5, 13))
    F, W = np.zeros((13, 12)), np.zeros((6, 12))
    X, K = np.zeros((2, 10, COLUMNS)), np.empty((4, 13, COLUMNS))
    start, moved = X[0], X[1]
    w, x, y, z = 0.5 * state[3], 0.5 * state[4], 0.5 * state[5], 0.5 * state[6]
    # A turn by the rotation vector delta, expressed in B, changes q by q (0, delta) / 2.
    start[0, 0], start[0, 1], start[0, 2] = -x, -y, -z
    start[1, 0], start[1, 1], start[1, 2] = w, -z, y
    start[2, 0], start[2, 1], start[2, 2] = z, w, -x
    start[3, 0], start[3, 1], start[3, 2] = -y, x, w
    for i in range(6):
        start[4 + i, 3 + i] = 1.0

    rate_kernel(packed, state, inputs, k[0])
    rate_jacobian_kernel(packed, state, inputs, F, W)
    _propagate(packed, F, start, K[0])
    for stage in range(1, 4):
        reach = dt_s if stage == 3 else 0.5 * dt_s
        for i in range(13):
            k[4, i] = state[i] + reach * k[stage - 1, i]
        _move(start, reach, K[stage - 1], moved)
        rate_kernel(packed, k[4], inputs, k[stage])
        rate_jacobian_kernel(packed, k[4], inputs, F, W)
        _propagate(packed, F, moved, K[stage])

    for i in range(13):
        state[i] += dt_s / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])
    total = K[0]
    _combine(K[0], K[1], K[2], K[3], dt_s / 6.0, total)
    for i in range(10):
        for c in range(COLUMNS):
            total[3 + i, c] += start[i, c]
    _to_error_state(state, total, normalise(state), K[1], A, B)


@njit(apart=True)
def _propagate(packed: Array, F: Array, X: Array, K: Array) -> None:
    # Ten products written out: the compiler then works on neighbouring columns together, in a fixed order of sums.
    for i in range(13):
        f0, f1, f2, f3, f4 = F[i, 0], F[i, 1], F[i, 2], F[i, 3], F[i, 4]
        f5, f6, f7, f8, f9 = F[i, 5], F[i, 6], F[i, 7], F[i, 8], F[i, 9]
        for c in range(COLUMNS):
            K[i, c] = (
                f0 * X[0, c]
                + f1 * X[1, c]
                + f2 * X[2, c]
                + f3 * X[3, c]
                + f4 * X[4, c]
                + f5 * X[5, c]
                + f6 * X[6, c]
                + f7 * X[7, c]
                + f8 * X[8, c]
                + f9 * X[9, c]
            )
    for i in range(6):
        for j in range(6):
            K[7 + i, 9 + j] += packed[INVERSE + i, j]


@njit(inline="always")
def _move(start: Array, reach: float, K: Array, moved: Array) -> None:
    for i in range(10):
        for c in range(COLUMNS):
            moved[i, c] = start[i, c] + reach * K[3 + i, c]


@njit(inline="always")
def _combine(a: Array, b: Array, c: Array, d: Array, sixth: float, total: Array) -> None:
    for i in range(13):
        for k in range(COLUMNS):
            total[i, k] = sixth * (a[i, k] + 2.0 * b[i, k] + 2.0 * c[i, k] + d[i, k])


@njit(inline="always")
def _to_error_state(state: Array, total: Array, length: float, turn: Array, A: Array, B: Array) -> None:
    # A change dq of the quaternion before it was normalised turns the body by 2 vec(q^-1 dq) / |q|.
    scale = 2.0 / length
    w, x, y, z = scale * state[3], scale * state[4], scale * state[5], scale * state[6]
    for c in range(COLUMNS):
        a, b, d, e = total[3, c], total[4, c], total[5, c], total[6, c]
        turn[0, c] = w * b - x * a - y * e + z * d
        turn[1, c] = w * d + x * e - y * a - z * b
        turn[2, c] = w * e - x * d + y * b - z * a
    for i in range(12):
        source = total[i] if i < 3 else turn[i - 3] if i < 6 else total[i + 1]
        for c in range(3):
            A[i, c] = 1.0 if i == c else 0.0
        for c in range(9):
            A[i, 3 + c] = source[c]
        for c in range(6):
            B[i, c] = source[9 + c]
