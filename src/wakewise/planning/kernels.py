"""Compiled roll-out of a plan: its states, its cost, and the cost's derivatives stage by stage.

Commands are the only unknowns (single shooting), so every set of commands within limits is a plan that the vehicle's
model can fly. Errors of state are (position in W, rotation vector in B, twist in B), as in
`wakewise.robot.vehicles.jacobians`.

Thruster lag, tau T' = u - T, is exact per stage: with a = exp(-h / tau) and b = (1 - a) tau / h,

    T_k+1 = a T_k + (1 - a) u_k,    mean over the stage = b T_k + (1 - b) u_k,

and the mean is what pushes and what blows during the stage.

Obstacle penalty: clearance h of the hull, a box, to planes and spheres, as a log barrier with its tangent removed,

    phi(h) = -ln(h / h0) + h / h0 - 1   for h < h0, else 0,

It is zero beyond the reach h0, with a continuous first derivative. Below `least` (delta) it goes on as the parabola of
same value, slope and curvature, so that a start that is too close still has a way out (relaxed log barrier: C. Feller
and C. Ebenbauer, IEEE Trans. Automatic Control 62 (2017) 1223, doi 10.1109/TAC.2016.2582040).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import assign, njit
from wakewise.robot.vehicles.kernels import rk4_jacobian_kernel, rk4_kernel
from wakewise.wake.plan_disturbance import PackedWakeModel, WakeScratch, stage_disturbance

ROUNDED = 0.05
"""Sine of the tilt below which |c| is rounded to c^2 (2 r - |c|) / r^2, since the corner nearest to a plane changes at
0. A level hull over a level floor would otherwise sit on a kink that no gradient can leave. The clearance is exact for
a level hull and beyond 2.9 deg; in between it is too large by at most 0.0074 of the half size."""


@njit(inline="always")
def barrier_value(h: float, reach: float, least: float) -> tuple[float, float, float]:
    """Phi and its first two derivatives at clearance h."""
    if h >= reach:
        return 0.0, 0.0, 0.0
    near = max(h, least)
    value = -np.log(near / reach) + near / reach - 1.0
    slope = 1.0 / reach - 1.0 / near
    curvature = 1.0 / (near * near)
    if h < least:
        gap = h - least
        value += slope * gap + 0.5 * curvature * gap * gap
        slope += curvature * gap
    return value, slope, curvature


@njit(apart=True)
def plane_gap(p: Array, R: Array, half: Array, plane: Array, slope: Array) -> float:
    """Distance of the box's nearest corner to a plane; `slope`, (6,), by position in W and rotation vector in B.

    Near level the corners are rounded off, see `ROUNDED`.
    """
    n0, n1, n2 = plane[0], plane[1], plane[2]
    gap = n0 * p[0] + n1 * p[1] + n2 * p[2] - plane[3]
    slope[0], slope[1], slope[2] = n0, n1, n2
    c = np.empty(3)
    s = np.empty(3)
    for i in range(3):
        # The normal in B; the corner that is nearest lies against it.
        c[i] = R[0, i] * n0 + R[1, i] * n1 + R[2, i] * n2
        size = abs(c[i])
        rate = 1.0 if c[i] > 0.0 else -1.0
        if size < ROUNDED:
            rate = c[i] * (4.0 * ROUNDED - 3.0 * size) / (ROUNDED * ROUNDED)
            size = c[i] * c[i] * (2.0 * ROUNDED - size) / (ROUNDED * ROUNDED)
        gap -= half[i] * size
        s[i] = -half[i] * rate
    # The gap changes by s . dc with dc = -theta x c, so the slope is s x c.
    slope[3] = s[1] * c[2] - s[2] * c[1]
    slope[4] = s[2] * c[0] - s[0] * c[2]
    slope[5] = s[0] * c[1] - s[1] * c[0]
    return gap


@njit(apart=True)
def sphere_gap(p: Array, R: Array, half: Array, sphere: Array, slope: Array) -> float:
    """Distance of the box to a sphere, negative when they meet; `slope` as in `plane_gap`."""
    d0, d1, d2 = sphere[0] - p[0], sphere[1] - p[1], sphere[2] - p[2]
    c = np.empty(3)
    out = np.empty(3)
    square, deepest, axis = 0.0, -np.inf, 0
    for i in range(3):
        c[i] = R[0, i] * d0 + R[1, i] * d1 + R[2, i] * d2
        over = abs(c[i]) - half[i]
        out[i] = max(over, 0.0)
        square += out[i] * out[i]
        if over > deepest:
            deepest, axis = over, i
    n = np.zeros(3)
    if square > 0.0:
        distance = np.sqrt(square)
        for i in range(3):
            n[i] = (out[i] if c[i] > 0.0 else -out[i]) / distance
    else:
        distance = deepest
        n[axis] = 1.0 if c[axis] > 0.0 else -1.0
    for i in range(3):
        slope[i] = -(R[i, 0] * n[0] + R[i, 1] * n[1] + R[i, 2] * n[2])
    # c = R'(centre - p) turns by -theta x c.
    slope[3] = n[1] * c[2] - n[2] * c[1]
    slope[4] = n[2] * c[0] - n[0] * c[2]
    slope[5] = n[0] * c[1] - n[1] * c[0]
    return distance - sphere[3]


@njit(apart=True)
def add_barrier(
    p: Array, R: Array, half: Array, planes: Array, spheres: Array, reach: float, least: float, weight: float,
    gradient: Array, hessian: Array,
) -> tuple[float, float]:  # fmt: skip
    """Add weight phi of every clearance to the first six of `gradient` and `hessian` (Gauss-Newton).

    Returns the weighted sum of phi and the least clearance.
    """
    total, closest = 0.0, np.inf
    slope = np.empty(6)
    for i in range(planes.shape[0] + spheres.shape[0]):
        if i < planes.shape[0]:
            h = plane_gap(p, R, half, planes[i], slope)
        else:
            h = sphere_gap(p, R, half, spheres[i - planes.shape[0]], slope)
        closest = min(closest, h)
        if h < reach:
            value, first, second = barrier_value(h, reach, least)
            total += weight * value
            for r in range(6):
                gradient[r] += weight * first * slope[r]
                for c in range(6):
                    hessian[r, c] += weight * second * slope[r] * slope[c]
    return total, closest


@njit(apart=True)
def least_gap(p: Array, R: Array, half: Array, planes: Array, spheres: Array) -> float:
    """Least clearance to planes and spheres; infinite where there are none."""
    closest, slope = np.inf, np.empty(6)
    for i in range(planes.shape[0]):
        closest = min(closest, plane_gap(p, R, half, planes[i], slope))
    for i in range(spheres.shape[0]):
        closest = min(closest, sphere_gap(p, R, half, spheres[i], slope))
    return closest


class PlanTable(NamedTuple):
    """What stays the same from plan to plan.

    packed : (20, 6) vehicle; allocation : (6, n); keep, mean : (n,), a and b of the lag; mean_map : (N, N n), mean
    thrusts by commands; half_size : (3,); planes, spheres : (p, 4), (s, 4); weights : (12,), see
    `planner.compile_plan`.
    """

    packed: Array
    allocation: Array
    lower: Array
    upper: Array
    keep: Array
    mean: Array
    mean_map: Array
    half_size: Array
    planes: Array
    spheres: Array
    weights: Array
    stage_s: float
    majorise: float


class PlanCase(NamedTuple):
    """One question, in writable arrays: see `PlanProblem`; barrier (2,) is mu and reach."""

    state: Array
    thrusts: Array
    command: Array
    force_W: Array
    moment_B: Array
    current_W: Array
    reference: Array
    barrier: Array


class PlanWork(NamedTuple):
    """Results of `horizon`, and room to work in.

    X : (N + 1, 13); T : (N, n), mean thrusts; A : (N, 12, 12), B : (N, 12, n), step by error state and mean thrusts;
    Q : (N + 1, 6, 6) by pose, S : (N, n, 6), R : (N, n, n), gx : (N + 1, 12), gT : (N, n) of the cost.
    """

    X: Array
    T: Array
    A: Array
    B: Array
    Q: Array
    S: Array
    R: Array
    gx: Array
    gT: Array
    D: Array
    parts: Array


W_EFFORT, W_CHANGE, W_TRACK, W_PATH, W_ATTITUDE, W_TWIST, TOLERANCE, RATE_N, RHO, REACH, LEAST, W_DISTURBANCE = range(
    12
)
"""Places in `PlanTable.weights`."""


CLOSEST = 6
"""Place in `PlanWork.parts` of the least clearance; before it: D, path, attitude, twist, barrier, commands."""


def plan_work(stages: int, thrusters: int) -> PlanWork:
    """Room for a horizon."""
    N, n = stages, thrusters
    return PlanWork(
        X=np.zeros((N + 1, 13)),
        T=np.zeros((N, n)),
        A=np.zeros((N, 12, 12)),
        B=np.zeros((N, 12, n)),
        Q=np.zeros((N + 1, 6, 6)),
        S=np.zeros((N, n, 6)),
        R=np.zeros((N, n, n)),
        gx=np.zeros((N + 1, 12)),
        gT=np.zeros((N, n)),
        D=np.zeros(N),
        parts=np.zeros(8),
    )


@njit
def rotation(state: Array, R: Array) -> None:
    """R_WB of a state's quaternion."""
    w, x, y, z = state[3], state[4], state[5], state[6]
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


@njit(apart=True)
def attitude_cost(state: Array, desired: Array, weight: float, tolerance: float, g: Array, H: Array) -> float:
    """Add weight max(0, |e| - tolerance)^2, e = 2 vec(q_ref^-1 q), to gradient g and Gauss-Newton H by the turn."""
    w, x, y, z = state[3], state[4], state[5], state[6]
    a, b, c, d = desired[3], -desired[4], -desired[5], -desired[6]
    ew = a * w - b * x - c * y - d * z
    sign = 1.0 if ew >= 0.0 else -1.0
    ew *= sign
    e = np.empty(3)
    e[0] = sign * (a * x + b * w + c * z - d * y)
    e[1] = sign * (a * y - b * z + c * w + d * x)
    e[2] = sign * (a * z + b * y - c * x + d * w)
    # With e = vec here, 2 de = (ew I + [e]) dtheta.
    J = np.empty((3, 3))
    J[0, 0], J[0, 1], J[0, 2] = ew, -e[2], e[1]
    J[1, 0], J[1, 1], J[1, 2] = e[2], ew, -e[0]
    J[2, 0], J[2, 1], J[2, 2] = -e[1], e[0], ew
    size = 2.0 * np.sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
    over = size - tolerance
    if over <= 0.0:
        return 0.0
    if tolerance == 0.0:
        for r in range(3):
            for k in range(3):
                g[3 + r] += 4.0 * weight * J[k, r] * e[k]
                for t in range(3):
                    H[3 + r, 3 + t] += 2.0 * weight * J[k, r] * J[k, t]
    else:
        slope = np.empty(3)
        for r in range(3):
            slope[r] = 2.0 * (J[0, r] * e[0] + J[1, r] * e[1] + J[2, r] * e[2]) / size
        for r in range(3):
            g[3 + r] += 2.0 * weight * over * slope[r]
            for t in range(3):
                H[3 + r, 3 + t] += 2.0 * weight * slope[r] * slope[t]
    return weight * over * over


@njit
def horizon(
    table: PlanTable, wake: PackedWakeModel, scratch: WakeScratch, case: PlanCase, U: Array, work: PlanWork,
    slopes: bool,
) -> float:  # fmt: skip
    """Cost of commands U, (N, n); fills `work` (derivatives only with `slopes`). For `parts` see `CLOSEST`."""
    N, n = U.shape
    h, weights = table.stage_s, table.weights
    X, parts = work.X, work.parts
    R, inputs, thrust = np.empty((3, 3)), np.empty(9), case.thrusts.copy()
    Bw, force = np.empty((12, 6)), np.empty(3)
    g, H = np.zeros(6 + n), np.zeros((6 + n, 6 + n))
    state = case.state.copy()
    parts[:] = 0.0
    parts[6] = np.inf
    assign(X[0], state)
    assign(inputs[6:], case.current_W)
    mu = case.barrier[0]
    for k in range(N + 1):
        rotation(state, R)
        g[:] = 0.0
        H[:, :] = 0.0
        if k < N:
            for i in range(n):
                work.T[k, i] = table.mean[i] * thrust[i] + (1.0 - table.mean[i]) * U[k, i]
                thrust[i] = table.keep[i] * thrust[i] + (1.0 - table.keep[i]) * U[k, i]
            weight = h * weights[W_DISTURBANCE]
            work.D[k] = 0.0
            if weight > 0.0:
                D = stage_disturbance(wake, scratch, state[:3], state[3:7], R, work.T[k], slopes, g, H)
                work.D[k] = D
                parts[0] += weight * D
                if slopes:
                    for r in range(6 + n):
                        g[r] *= weight
                        for c in range(6 + n):
                            H[r, c] *= weight
            if slopes:
                for r in range(n):
                    work.gT[k, r] = g[6 + r]
                    for c in range(6):
                        work.S[k, r, c] = H[6 + r, c]
                    for c in range(n):
                        work.R[k, r, c] = table.majorise * H[6 + r, 6 + c]
        gx = work.gx[k]
        assign(gx[:6], g[:6])
        gx[6:] = 0.0
        if k > 0:
            desired = case.reference[k]
            along = h * weights[W_PATH] + (weights[W_TRACK] if k == N else 0.0)
            for r in range(3):
                e = state[r] - desired[r]
                parts[1] += along * e * e
                gx[r] += 2.0 * along * e
                H[r, r] += 2.0 * along
            turned = h * weights[W_ATTITUDE] + (weights[W_ATTITUDE] if k == N else 0.0)
            parts[2] += attitude_cost(state, desired, turned, weights[TOLERANCE], gx, H)
            for r in range(6):
                e = state[7 + r] - desired[7 + r]
                parts[3] += h * weights[W_TWIST] * e * e
                gx[6 + r] = 2.0 * h * weights[W_TWIST] * e
            value, closest = add_barrier(
                state[:3],
                R,
                table.half_size,
                table.planes,
                table.spheres,
                case.barrier[1],
                weights[LEAST],
                h * mu,
                gx,
                H,
            )
            parts[4] += value
            parts[6] = min(parts[6], closest)
        if slopes:
            for r in range(6):
                for c in range(6):
                    work.Q[k, r, c] = H[r, c]
        if k == N:
            break
        for r in range(3):
            force[r] = R[0, r] * case.force_W[0] + R[1, r] * case.force_W[1] + R[2, r] * case.force_W[2]
            inputs[r] = force[r]
            inputs[3 + r] = case.moment_B[r]
        for r in range(6):
            for i in range(n):
                inputs[r] += table.allocation[r, i] * work.T[k, i]
        if slopes:
            A = work.A[k]
            rk4_jacobian_kernel(table.packed, state, inputs, h, A, Bw)
            for r in range(12):
                # The force keeps its direction in W: seen from B it turns by -theta x f.
                b0, b1, b2 = Bw[r, 0], Bw[r, 1], Bw[r, 2]
                A[r, 3] += b1 * force[2] - b2 * force[1]
                A[r, 4] += b2 * force[0] - b0 * force[2]
                A[r, 5] += b0 * force[1] - b1 * force[0]
                for i in range(n):
                    total = 0.0
                    for c in range(6):
                        total += Bw[r, c] * table.allocation[c, i]
                    work.B[k, r, i] = total
        else:
            rk4_kernel(table.packed, state, inputs, h)
        assign(X[k + 1], state)
    parts[5] = command_cost(table, case.command, U)
    return parts[0] + parts[1] + parts[2] + parts[3] + parts[4] + parts[5]


@njit(inline="always")
def command_cost(table: PlanTable, before: Array, U: Array) -> float:
    """Effort, change and excess of rate of commands U, (N, n), after `before`, (n,)."""
    N, n = U.shape
    weights, total = table.weights, 0.0
    for k in range(N):
        for i in range(n):
            step = U[k, i] - (before[i] if k == 0 else U[k - 1, i])
            over = max(abs(step) - weights[RATE_N], 0.0)
            total += table.stage_s * weights[W_EFFORT] * U[k, i] ** 2
            total += weights[W_CHANGE] * step * step + weights[RHO] * over * over
    return total


@njit
def set_reach(table: PlanTable, case: PlanCase) -> None:
    """Set the barrier's reach: where the reference itself is nearer than the settings' reach nothing is felt there.

    Otherwise a mission that was checked for clearance would be pushed off its path all along a low orbit. It never
    falls below the clearance that the barrier is there to keep.
    """
    R = np.empty((3, 3))
    reach = table.weights[REACH]
    for k in range(case.reference.shape[0]):
        rotation(case.reference[k], R)
        reach = min(reach, least_gap(case.reference[k, :3], R, table.half_size, table.planes, table.spheres))
    case.barrier[1] = max(reach, table.weights[LEAST])
