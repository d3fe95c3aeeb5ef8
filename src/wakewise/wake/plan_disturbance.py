"""Compiled disturbance D of one MPC stage with its gradient and Gauss-Newton matrix, in body axes.

Same values as `wakewise.wake.disturbance.gauss_newton`, faster: points are stored as rows of coordinates, the paper's
cone has no branches, and jets that miss the region are skipped. |v|^2 does not depend on the axes, so the sums are done
in B; only the slopes by position are turned to W at the end.

`PackedWakeModel` holds the wake model and the region for these kernels. `with_smooth_edge` gives a sharp cone an edge
that has a gradient. The module is long because one stage's kernels share their scratch memory.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wakewise.core.arrays import Array, IntArray, frozen
from wakewise.core.errors import InputError
from wakewise.core.interfaces import WakeModel
from wakewise.core.jit.njit import assign, njit
from wakewise.wake.cones import PaperJet, PowerJet
from wakewise.wake.gram import dot, smooth_root
from wakewise.wake.jets import (
    FAST,
    PRINTED_CONE,
    ROUND_JET,
    AxialJet,
    Numbers,
    as_tuple,
    fill_cored_jet,
    own_constants,
    speed_and_slope,
)
from wakewise.wake.wall_jet import ImpingingJet, bed_stage_sum

PLAIN_CONE = 10
"""Kind of the cone with the paper's powers and any gain and edge: no logarithm, no branch."""


class PackedWakeModel(NamedTuple):
    """Wake model over a region of P points for n thrusters, as the kernels take it."""

    points: Array  # (3, P), in W
    rows: Array  # (P, 3), in W
    weights: Array  # (P,), their sum is 1
    roots: Array  # (P,), square roots of the weights
    middle: Array  # (3,), centre of a sphere round the points, in W
    radius: float  # of that sphere
    positions: Array  # (n, 3), in B
    axes: Array  # (n, 3), in B
    areas: Array  # (n,)
    own: Array  # (n, 6), see `wakewise.wake.jets`
    kind: int
    numbers: Array  # (7,), see `wakewise.wake.jets`
    walls: bool
    floor: Array  # (2,), used if `walls`
    coherent: bool
    smooth_N: float


def wake_table(
    wake: WakeModel,
    points_W_m: Array,
    weights: Array,
    positions_B_m: Array,
    axes_B: Array,
    areas_m2: Array,
    *,
    superposition: str,
    smooth_N: float,
) -> PackedWakeModel:
    """Table of a wake model over weighted points; arguments as for `wakewise.wake.gram_with_derivatives`.

    Raises InputError if the model is not one of `wakewise.wake`, or there are no points with weight.
    """
    floor = wake if isinstance(wake, ImpingingJet) else None
    jet = floor.jet if floor is not None else wake
    if not isinstance(jet, AxialJet):
        raise InputError(f"wake model {wake.name}: has no derivatives, allowed: the models of wakewise.wake")
    law = jet.law
    numbers = np.array(law.parameters)
    plain = law.kind == PRINTED_CONE or (law.kind != ROUND_JET and tuple(numbers[1:4]) == (2.0, 4.0, 0.0))
    points = np.array(points_W_m, dtype=np.float64)
    total = float(np.sum(weights)) if len(weights) else 0.0
    if not (np.isfinite(total) and total > 0.0 and np.all(np.asarray(weights) >= 0.0)):
        raise InputError("region: needs points with weights that are not negative, and at least one more than 0")
    share = np.array(weights, dtype=np.float64) / total
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    # Read-only like a vehicle's, so that kernels are compiled for one kind of array.
    areas = frozen(areas_m2, (None,), "areas")
    return PackedWakeModel(
        points=np.ascontiguousarray(points.T),
        rows=points,
        weights=share,
        roots=np.sqrt(share),
        middle=middle,
        radius=float(np.linalg.norm(points - middle, axis=1).max()),
        positions=np.array(positions_B_m),
        axes=np.array(axes_B),
        areas=areas,
        own=own_constants(law.kind, numbers, areas),
        kind=PLAIN_CONE if plain and floor is None else int(law.kind),
        numbers=numbers,
        walls=floor is not None,
        floor=np.array(floor.numbers) if floor is not None else np.zeros(2),
        coherent=superposition == "coherent",
        smooth_N=float(smooth_N),
    )


def is_compiled(wake: WakeModel) -> bool:
    """Whether the kernels implement a model: those of this package, with or without a bed."""
    return isinstance(wake.jet if isinstance(wake, ImpingingJet) else wake, AxialJet)


def with_smooth_edge(wake: WakeModel, edge_width_rad: float) -> WakeModel:
    """The same model; a cone with a sharp edge, which has no gradient, gets an edge of that width."""
    if isinstance(wake, ImpingingJet):
        jet = with_smooth_edge(wake.jet, edge_width_rad)
        return replace(wake, jet=jet) if isinstance(jet, AxialJet) else wake
    if isinstance(wake, PaperJet):
        return PowerJet(label=wake.name, water_density_kg_m3=wake.water_density_kg_m3, edge_width_rad=edge_width_rad)
    if isinstance(wake, PowerJet) and wake.edge_width_rad == 0.0:
        return replace(wake, edge_width_rad=edge_width_rad)
    return wake


class WakeScratch(NamedTuple):
    """Work arrays for P points and n thrusters."""

    q: Array
    sums: Array
    slopes: Array
    jets: Array
    pose: Array
    active: Array
    near: Array


def wake_scratch(points: int, thrusters: int) -> WakeScratch:
    """Work arrays for a region of so many points and so many thrusters."""
    return WakeScratch(
        q=np.empty((3, points)),
        sums=np.empty((3, points)),
        slopes=np.empty((9, points)),
        jets=np.empty((thrusters, points)),
        pose=np.empty((6, 3, points)),
        active=np.empty(thrusters, np.int64),
        near=np.empty(points, np.int64),
    )


@njit(inline="always")
def may_reach(
    own: Array, tx: float, ty: float, tz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
    radius: float,
) -> bool:  # fmt: skip
    """False if neither jet of a thruster at t can reach any point of a sphere round m, all in B."""
    ex, ey, ez = mx - tx, my - ty, mz - tz
    along = abs(ex * ax + ey * ay + ez * az)
    across = np.sqrt(max(ex * ex + ey * ey + ez * ez - along * along, 0.0))
    far = along + radius
    widest = own[3] + own[4] * far + (own[5] - 1.0) * far * far
    return across - radius <= np.sqrt(max(widest, 0.0))


@njit(inline="always", fastmath=FAST)
def _plain_cone(
    q: Array, roots: Array, count: int, tx: float, ty: float, tz: float, ax: float, ay: float, az: float, c0: float,
    low: float, high: float, f_row: Array, g: Array,
) -> None:  # fmt: skip
    """Signed speed by the force axis (negative astern of T > 0) into `f_row`, the gradient of |f| into `g`, (3, P)."""
    narrow = 1.0 / (high - low) if high > low else 1e12
    for j in range(count):
        ex, ey, ez = q[0, j] - tx, q[1, j] - ty, q[2, j] - tz
        r2 = ex * ex + ey * ey + ez * ez
        inverse2 = 1.0 / r2
        inverse = np.sqrt(inverse2)
        along = (ax * ex + ay * ey + az * ez) * inverse
        cosine = abs(along)
        sign = 1.0 if along > 0.0 else -1.0
        t = (cosine - low) * narrow
        t = t if t > 0.0 else 0.0
        t = t if t < 1.0 else 1.0
        edge, edge_slope = t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * narrow
        c2 = cosine * cosine
        scale = c0 * inverse2 * roots[j]
        f = scale * c2 * c2 * edge
        by_cosine = scale * c2 * (4.0 * cosine * edge + c2 * edge_slope)
        a = by_cosine * sign * inverse
        b = -a * along * inverse - 2.0 * f * inverse2
        f_row[j] = sign * f
        g[0, j] = a * ax + b * ex
        g[1, j] = a * ay + b * ey
        g[2, j] = a * az + b * ez


@njit(inline="always", fastmath=FAST)
def _any_jet(
    q: Array, roots: Array, count: int, tx: float, ty: float, tz: float, ax: float, ay: float, az: float, own: Array,
    kind: int, numbers: Numbers, f_row: Array, g: Array,
) -> None:  # fmt: skip
    """As `_plain_cone`, for every kind of jet."""
    for j in range(count):
        ex, ey, ez = q[0, j] - tx, q[1, j] - ty, q[2, j] - tz
        along = ax * ex + ay * ey + az * ez
        r2 = ex * ex + ey * ey + ez * ez
        x = abs(along)
        if x > 0.0 and r2 <= own[3] + own[4] * x + own[5] * x * x:
            f, alpha, beta = speed_and_slope(kind, numbers, own[0], own[1], own[2], x, r2)
            sign = 1.0 if along > 0.0 else -1.0
            a, b = sign * alpha * roots[j], beta * roots[j]
            f_row[j] = sign * f * roots[j]
            g[0, j] = a * ax + b * ex
            g[1, j] = a * ay + b * ey
            g[2, j] = a * az + b * ez
        else:
            f_row[j] = 0.0
            g[0, j] = 0.0
            g[1, j] = 0.0
            g[2, j] = 0.0


@njit(apart=True, fastmath=FAST)
def stage_disturbance(
    table: PackedWakeModel, scratch: WakeScratch, p: Array, quat: Array, R: Array, thrusts: Array, slopes: bool,
    gradient: Array, H: Array,
) -> float:  # fmt: skip
    """D; with `slopes` also its gradient, (6 + n,), and 2 J'J, (6 + n, 6 + n), both overwritten.

    Rows: position in W, rotation vector in B, thrusts.
    """
    if table.walls:
        kind = table.kind
        D, first, second, _ = bed_stage_sum(
            table.rows,
            table.weights,
            p,
            quat,
            table.positions,
            table.axes,
            table.areas,
            kind,
            table.numbers,
            table.floor,
            thrusts,
            table.smooth_N,
            table.coherent,
            slopes,
        )
        if slopes:
            assign(gradient, first)
            for i in range(len(H)):
                assign(H[i], second[i])
        return D
    return _free_jets(table, scratch, p, R, thrusts, slopes, gradient, H)


@njit(apart=True, fastmath=FAST)
def _free_jets(
    table: PackedWakeModel, scratch: WakeScratch, p: Array, R: Array, thrusts: Array, slopes: bool, gradient: Array,
    H: Array,
) -> float:  # fmt: skip
    q, sums, S, jets, pose, active, near = scratch
    count, n = q.shape[1], thrusts.shape[0]
    if slopes:
        gradient[:] = 0.0
        H[:, :] = 0.0
    D = 0.0
    dx, dy, dz = table.middle[0] - p[0], table.middle[1] - p[1], table.middle[2] - p[2]
    mx = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
    my = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
    mz = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
    active_count = 0
    for i in range(n):
        t, a = table.positions[i], table.axes[i]
        if may_reach(table.own[i], t[0], t[1], t[2], a[0], a[1], a[2], mx, my, mz, table.radius):
            active[active_count] = i
            active_count += 1
    if active_count == 0:
        return 0.0
    for r in range(3):
        r0, r1, r2 = R[0, r], R[1, r], R[2, r]
        for j in range(count):
            q[r, j] = (
                r0 * (table.points[0, j] - p[0]) + r1 * (table.points[1, j] - p[1]) + r2 * (table.points[2, j] - p[2])
            )
    sums[:, :] = 0.0
    if slopes:
        S[:, :] = 0.0
    numbers = as_tuple(table.numbers)
    f_row, g = pose[0, 0], pose[1]
    for index in range(active_count):
        i = active[index]
        tx, ty, tz = table.positions[i, 0], table.positions[i, 1], table.positions[i, 2]
        ax, ay, az = table.axes[i, 0], table.axes[i, 1], table.axes[i, 2]
        if table.kind == PLAIN_CONE:
            _plain_cone(
                q,
                table.roots,
                count,
                tx,
                ty,
                tz,
                ax,
                ay,
                az,
                table.own[i, 0],
                table.numbers[4],
                table.numbers[5],
                f_row,
                g,
            )
        elif table.kind == ROUND_JET and table.numbers[5] != 0.0:
            t, a = table.positions[i], table.axes[i]
            fill_cored_jet(q, table.roots, t, a, table.own[i], table.numbers, slopes, near, pose)
        else:
            _any_jet(q, table.roots, count, tx, ty, tz, ax, ay, az, table.own[i], table.kind, numbers, f_row, g)
        # A point ahead of the disk (along the force) is blown at by T < 0, along the axis; one astern by T > 0.
        ahead, ahead_slope = smooth_root(-thrusts[i], table.smooth_N)
        astern, astern_slope = smooth_root(thrusts[i], table.smooth_N)
        if not table.coherent:
            D += _alone(i, count, q, f_row, g, ahead, ahead_slope, astern, astern_slope, slopes, gradient, H)
            continue
        h = jets[i]
        for x in range(3):
            axis = table.axes[i, x]
            if axis != 0.0:
                for j in range(count):
                    sums[x, j] += axis * f_row[j] * (ahead if f_row[j] > 0.0 else astern)
        if slopes:
            for j in range(count):
                h[j] = -f_row[j] * ahead_slope if f_row[j] > 0.0 else f_row[j] * astern_slope
            for x in range(3):
                axis = table.axes[i, x]
                if axis != 0.0:
                    for j in range(count):
                        s = axis * ahead if f_row[j] > 0.0 else -axis * astern
                        S[3 * x, j] += s * g[0, j]
                        S[3 * x + 1, j] += s * g[1, j]
                        S[3 * x + 2, j] += s * g[2, j]
    if table.coherent:
        for x in range(3):
            D += dot(sums[x], sums[x], count)
        if slopes:
            _products(table.axes, active, active_count, count, q, sums, S, jets, pose, gradient, H)
    if slopes:
        _to_world(R, gradient, H)
    return D


@njit(inline="always", fastmath=FAST)
def _pose_rows(count: int, q: Array, gx: Array, gy: Array, gz: Array, out: Array, x: int) -> None:
    """Rows by position (in B) and rotation vector of a quantity with gradient (gx, gy, gz) by the point in B."""
    for j in range(count):
        a, b, c = gx[j], gy[j], gz[j]
        qx, qy, qz = q[0, j], q[1, j], q[2, j]
        out[0, x, j] = -a
        out[1, x, j] = -b
        out[2, x, j] = -c
        # The point as seen from B moves by -theta x q, and g . (-theta x q) = theta . (g x q).
        out[3, x, j] = b * qz - c * qy
        out[4, x, j] = c * qx - a * qz
        out[5, x, j] = a * qy - b * qx


@njit(apart=True, fastmath=FAST)
def _products(
    axes: Array, active: IntArray, active_count: int, count: int, q: Array, sums: Array, S: Array, jets: Array,
    pose: Array, gradient: Array, H: Array,
) -> None:  # fmt: skip
    for x in range(3):
        used = False
        for index in range(active_count):
            used = used or axes[active[index], x] != 0.0
        if not used:
            continue
        _pose_rows(count, q, S[3 * x], S[3 * x + 1], S[3 * x + 2], pose, x)
        p0, p1, p2 = pose[0, x], pose[1, x], pose[2, x]
        p3, p4, p5 = pose[3, x], pose[4, x], pose[5, x]
        for r in range(7):
            row = pose[r, x] if r < 6 else sums[x]
            s0, s1, s2, s3, s4, s5 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(count):
                v = row[j]
                s0 += v * p0[j]
                s1 += v * p1[j]
                s2 += v * p2[j]
                s3 += v * p3[j]
                s4 += v * p4[j]
                s5 += v * p5[j]
            _add_six(gradient if r == 6 else H[r], s0, s1, s2, s3, s4, s5, 2.0)
        for index in range(active_count):
            i = active[index]
            axis = axes[i, x]
            if axis != 0.0:
                h = jets[i]
                s0, s1, s2, s3, s4, s5, s6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                for j in range(count):
                    v = h[j]
                    s0 += v * p0[j]
                    s1 += v * p1[j]
                    s2 += v * p2[j]
                    s3 += v * p3[j]
                    s4 += v * p4[j]
                    s5 += v * p5[j]
                    s6 += v * sums[x, j]
                _add_six(H[6 + i], s0, s1, s2, s3, s4, s5, 2.0 * axis)
                gradient[6 + i] += 2.0 * axis * s6
    for index in range(active_count):
        i = active[index]
        for other in range(index + 1):
            k = active[other]
            cosine = axes[i, 0] * axes[k, 0] + axes[i, 1] * axes[k, 1] + axes[i, 2] * axes[k, 2]
            if abs(cosine) > 1e-14:
                H[6 + i, 6 + k] = 2.0 * cosine * dot(jets[i], jets[k], count)


@njit
def _add_six(row: Array, s0: float, s1: float, s2: float, s3: float, s4: float, s5: float, factor: float) -> None:
    row[0] += factor * s0
    row[1] += factor * s1
    row[2] += factor * s2
    row[3] += factor * s3
    row[4] += factor * s4
    row[5] += factor * s5


@njit(apart=True, fastmath=FAST)
def _alone(
    i: int, count: int, q: Array, f_row: Array, g: Array, ahead: float, ahead_slope: float, astern: float,
    astern_slope: float, slopes: bool, gradient: Array, H: Array,
) -> float:  # fmt: skip
    """One jet of the incoherent sum: its squared speed alone, with slopes; returns its share of D."""
    D, by_thrust, second = 0.0, 0.0, 0.0
    for j in range(count):
        front = f_row[j] > 0.0
        s, ds = (ahead, -ahead_slope) if front else (astern, astern_slope)
        square = f_row[j] * f_row[j]
        D += s * s * square
        by_thrust += s * ds * square
        second += ds * ds * square
    if not slopes:
        return D
    gradient[6 + i] += 2.0 * by_thrust
    H[6 + i, 6 + i] += 2.0 * second
    six, rows = np.zeros(7), np.empty(6)
    for j in range(count):
        front = f_row[j] > 0.0
        s, ds = (ahead, -ahead_slope) if front else (astern, astern_slope)
        f = abs(f_row[j])
        if f == 0.0:
            continue
        a, b, c = g[0, j], g[1, j], g[2, j]
        rows[0], rows[1], rows[2] = -a, -b, -c
        rows[3] = b * q[2, j] - c * q[1, j]
        rows[4] = c * q[0, j] - a * q[2, j]
        rows[5] = a * q[1, j] - b * q[0, j]
        for r in range(6):
            six[r] = s * rows[r]
            gradient[r] += 2.0 * s * f * six[r]
            H[6 + i, r] += 2.0 * ds * f * six[r]
            for t in range(r + 1):
                H[r, t] += 2.0 * six[r] * six[t]
    return D


@njit(apart=True)
def _to_world(R: Array, gradient: Array, H: Array) -> None:
    """Fill the upper triangle from the lower and take rows and columns 0 to 2 from B to W."""
    size = H.shape[0]
    for r in range(size):
        for t in range(r):
            H[t, r] = H[r, t]
    for r in range(size):
        a, b, c = H[r, 0], H[r, 1], H[r, 2]
        for t in range(3):
            H[r, t] = R[t, 0] * a + R[t, 1] * b + R[t, 2] * c
    for r in range(size):
        a, b, c = H[0, r], H[1, r], H[2, r]
        for t in range(3):
            H[t, r] = R[t, 0] * a + R[t, 1] * b + R[t, 2] * c
    a, b, c = gradient[0], gradient[1], gradient[2]
    for t in range(3):
        gradient[t] = R[t, 0] * a + R[t, 1] * b + R[t, 2] * c
