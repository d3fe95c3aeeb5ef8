"""Actuator-disk jets in a current: bent and stopped by it, spread where it is uncertain; their wall jets on the bed.

A jet keeps its direction e relative to the water, and the current c advects it:

    dX/dt = chi U e + c,    ds/dt = chi U

X is the position of a cross-section of age t, s its distance through the water, U the greatest speed in excess of the
current, chi U the mean speed of the momentum: momentum flux over mass flux of the profile, 1 at the disk and 1/2 for a
Gaussian. A steady jet fills the curve X(t), the plume. In still water U is the jet's centreline speed U_0(s).

- *Momentum* in excess of the current through a section equals the thrust: U |chi U e + c| q^2 = chi U_0(s)^2, q the
  width over that of the same jet in still water (integral method: J. H. W. Lee and V. H. Chu, Turbulent Jets and
  Plumes, Kluwer 2003).
- *Width.* Along its own path a jet grows by the same share of s as in still water (Chu, Lee and Chu, J. Hydraul. Eng.
  125 (1999) 1060), bent over twice as fast, like a line puff (0.34 against 0.17 for top-hat profiles, Lee and Chu
  2003). Between the two by the angle of the path against e: cos + 2 sin.
- *Opposing current.* A section has one solution if the opposing component counts by at most sqrt(8) / 3, and it counts
  by that. Fronts then stop at 2.2 to 2.3 D U_j / |c|; 2.4 to 2.8 are published (Koenig and Fiedler, Exp. Fluids 10
  (1991) 212; Yoda and Fiedler, Exp. Fluids 21 (1996) 427).
- *Cross-current.* The path is within 30 % of z / rD = 2.05 (x / rD)^0.28, r = U_j / |c| (B. D. Pratte and W. D. Baines,
  J. Hydraul. Div. ASCE 93 (1967) 53), for x from rD to 5 rD and r from 5 on.
- *Uncertain current.* A standard deviation sigma_c displaces a section by sigma_c t. The mean square speed of a
  Gaussian at a normally distributed place is a wider and lower Gaussian: width^2 grows by (2 sigma_c t)^2, the root
  mean square of the greatest speed falls as one over the width.

Speeds are per square root of newton at a nominal thrust, so that D stays a quadratic form. Where several parts of a
plume pass a point, the fastest counts. Not modelled: the vortex pair of a bent jet, a current that varies on the way,
walls other than the bed.

*Wall jets* (see `wall_jet`) start where the plume meets the bed. Water at d from the strike point left it tau ago and
travelled |d - c tau| along its ray:

    |d - c tau|^2 = 2 chi a tau,   u_max r = a sqrt(T),   chi = 1 / sqrt(2) for the half Gaussian over the bed.

The first root of this quadratic is the outward-bound water; there is none beyond a parabola with its focus at the
strike point, where the front stops (straight upstream: chi u_max = 2 |c|). No measurements of this front were found.
The speed in excess of the current follows from the momentum through a section, as for the free jet.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.jit.njit import njit
from wakewise.wake.jets import ROUND_JET, Numbers, as_tuple, own_constants, section_of, speed_and_slope
from wakewise.wake.wall_jet import HALF_THICKNESS, LEAST_SINE, ROUND_DECAY, WALL_SPEED

MAX_AGE_S = 40.0
"""Greatest age of a section. Bent over, its speed falls as t^(-2/3) and its width grows as t^(1/3), so its
contribution falls to a hundredth of that after one second."""
SECTIONS = 40
"""Sections of a curve, at times as the squares of whole numbers: the first after .025 s, a centimetre; the last 2 s
apart, when a plume is half a metre wide."""
OPPOSING_SHARE = float(np.sqrt(8.0) / 3.0)
"""Share of an opposing current that counts in a section's speed; above it there are three roots."""
LINE_PUFF_GROWTH = 2.0
"""Growth of a bent-over jet over that of a straight one, per distance through the water."""
LEAST_GUESS_N = 0.02
"""Least nominal thrust: below it thrusts are noise."""
GUESS_SHARE = 0.5
"""Nominal thrust of an idle thruster, as a share of the mean thrust."""
_TINY = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class CrossFlow:
    """Current and thrusts that advect the jets."""

    current_W_m_s: Array  # shape (3,)
    current_std_m_s: float  # standard deviation of each component of the current
    thrusts_N: Array  # shape (m,): thrusts of the last step, see `nominal_thrusts_N`

    def __post_init__(self) -> None:
        freeze(self, current_W_m_s=(3,), thrusts_N=(None,))

    @property
    def nominal_thrusts_N(self) -> Array:
        """Magnitudes of T > 0 and T < 0 of each thruster, shape (2 m,), in N, none far below the mean."""
        return cast(Array, nominal_thrusts(self.thrusts_N))


@njit
def nominal_thrusts(thrusts: Array) -> Array:
    """`CrossFlow.nominal_thrusts_N` of thrusts, shape (m,)."""
    m = thrusts.size
    mean = 0.0
    for i in range(m):
        mean += abs(thrusts[i]) / m
    least, sizes = max(GUESS_SHARE * mean, LEAST_GUESS_N), np.empty(2 * m)
    for i in range(m):
        sizes[i], sizes[m + i] = max(thrusts[i], least), max(-thrusts[i], least)
    return sizes


@njit
def excess_speed(strength: float, chi: float, along: float, current2: float, near: float) -> float:
    """U of U |chi U e + c| = strength, `along` = c . e with what opposes already lessened, `current2` = c . c.

    The search begins at `near`.
    """
    low, high = 0.0, np.sqrt(strength / chi) + 2.0 * np.sqrt(current2) / chi
    U = min(near, high)
    for _ in range(60):
        own = chi * U
        over = U * U * (own * own + 2.0 * own * along + current2) - strength * strength
        if over < 0.0:
            low = U
        else:
            high = U
        # Halley's step, halving where it leaves the bracket. It leaves the cube of the error that it takes away.
        slope = U * (4.0 * own * own + 6.0 * own * along + 2.0 * current2)
        bend = 12.0 * own * (own + along) + 2.0 * current2
        after = U - 2.0 * over * slope / (2.0 * slope * slope - over * bend)
        if not low < after < high:
            after = 0.5 * (low + high)
        if abs(after - U) <= 1e-9 * U:
            return after
        U = after
    return U


@njit
def _rates(
    kind: int, numbers: Numbers, own: Array, s: float, grown: float, root: float, e: Array, current: Array,
    along: float, current2: float, near: float, v: Array,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """(ds/dt, d grown/dt, U, U_0, width in still water) at one section, and dX/dt into `v`; `grown` / s widens it."""
    unit, chi, width = section_of(kind, numbers, own, s)
    still = unit * root
    wider = max(grown / s, 1.0)
    U = excess_speed(chi * still * still / (wider * wider), chi, along, current2, near)
    size2, forward = 0.0, 0.0
    for x in range(3):
        v[x] = chi * U * e[x] + current[x]
        size2 += v[x] * v[x]
        forward += v[x] * e[x]
    cosine = min(max(forward / np.sqrt(size2), 0.0), 1.0) if size2 > 0.0 else 1.0
    rate = chi * U
    return rate, rate * (cosine + LINE_PUFF_GROWTH * np.sqrt(1.0 - cosine * cosine)), U, still, width


@njit(apart=True)
def trace_plume(
    kind: int, parameters: Array, own: Array, origin: Array, e: Array, thrust: float, current: Array,
    current_std: float, curve: Array,
) -> None:  # fmt: skip
    """Sections of one plume into `curve`, (SECTIONS + 1, 7): X, t, s, speed over still water's at s, and width so.

    - `kind`, `parameters`, `own`: the jet's law and its disk's constants (`kernels.own_constants`), shape (6,).
    - `thrust`, `current_std`: in N, more than 0; in m/s.
    - Shapes: `origin`, `e`, `current` (3,).
    """
    numbers = as_tuple(parameters)
    root = np.sqrt(thrust)
    along, current2 = 0.0, 0.0
    for x in range(3):
        along += current[x] * e[x]
        current2 += current[x] * current[x]
    if along < 0.0:
        along *= OPPOSING_SHARE
    # A cone has no speed at its tip.
    s = 1e-6 if kind == ROUND_JET else 0.05
    grown, t = s, 0.0
    X, v = origin.copy(), np.empty(3)
    ds, dg, U, still, width = _rates(kind, numbers, own, s, grown, root, e, current, along, current2, 1e3, v)
    curve[0, :3] = X
    curve[0, 3], curve[0, 4], curve[0, 5], curve[0, 6] = 0.0, 0.0, 1.0, 1.0
    for x in range(3):
        X[x] += s * e[x]
    for k in range(1, SECTIONS + 1):
        then = MAX_AGE_S * (k / SECTIONS) ** 2
        dt = then - t
        # The midpoint rule; the rates at a section's end are those at the next one's beginning.
        half_s, half_grown = s + 0.5 * dt * ds, grown + 0.5 * dt * dg
        ds, dg, U, _, _ = _rates(kind, numbers, own, half_s, half_grown, root, e, current, along, current2, U, v)
        for x in range(3):
            X[x] += dt * v[x]
        s, grown, t = s + dt * ds, grown + dt * dg, then
        ds, dg, U, still, width = _rates(kind, numbers, own, s, grown, root, e, current, along, current2, U, v)
        wider = max(grown / s, 1.0)
        blurred = np.sqrt(1.0 + (2.0 * current_std * t / (wider * width)) ** 2)
        curve[k, :3] = X
        curve[k, 3], curve[k, 4], curve[k, 5], curve[k, 6] = t, s, U / (still * blurred), wider * blurred


@njit
def fill_plume(
    points: Array, ball: Array, kind: int, parameters: Array, own: Array, curve: Array, end: Array, room: Array,
    hits: IntArray, speed: Array,
) -> None:  # fmt: skip
    """Raise `speed`, shape (n,), to the plume's speed per square root of newton at points, shape (3, n), in a ball.

    `end`, shape (2,): how far along itself the jet is whole, and what share of it goes on from there. `room`, shape
    (2, n), and `hits`, shape (n + 1,), are work arrays.
    """
    numbers = as_tuple(parameters)
    count, n = SECTIONS, points.shape[1]
    d, length = np.zeros((count, 3)), np.empty(count)
    for k in range(count):
        total = 0.0
        for x in range(3):
            d[k, x] = curve[k + 1, x] - curve[k, x]
            total += d[k, x] * d[k, x]
        length[k] = np.sqrt(total)
        for x in range(3):
            d[k, x] /= length[k] + _TINY
    for k in range(count):
        a, b, whole = curve[k], curve[k + 1], length[k]
        s, wide = b[4], max(a[6], b[6])
        reach2 = (own[3] + own[4] * s + (own[5] - 1.0) * s * s) * wide * wide
        px, py, pz = a[0] - ball[0], a[1] - ball[1], a[2] - ball[2]
        if px * px + py * py + pz * pz > (ball[3] + whole + np.sqrt(reach2)) ** 2:
            continue
        # A pass without branches, in vector instructions, finds the points within reach.
        ax, ay, az, dx, dy, dz = a[0], a[1], a[2], d[k, 0], d[k, 1], d[k, 2]
        for j in range(n):
            px, py, pz = points[0, j] - ax, points[1, j] - ay, points[2, j] - az
            on = px * dx + py * dy + pz * dz
            nearest = min(on, whole)
            room[0, j] = on
            room[1, j] = px * px + py * py + pz * pz - nearest * (2.0 * on - nearest)
        reached = 0
        for j in range(n):
            hits[reached] = j
            reached += (room[0, j] > 0.0) & (room[1, j] <= reach2)
        for h in range(reached):
            j = hits[h]
            on, share = room[0, j], 1.0
            if on > whole:
                if k + 1 == count:
                    continue
                # Between this section's end and the next one's beginning, outside of the bend.
                px, py, pz = points[0, j] - b[0], points[1, j] - b[1], points[2, j] - b[2]
                if px * d[k + 1, 0] + py * d[k + 1, 1] + pz * d[k + 1, 2] > 0.0:
                    continue
            else:
                share = on / whole
            r2 = max(room[1, j], 0.0)
            along = a[4] + share * (b[4] - a[4])
            stretch = a[6] + share * (b[6] - a[6])
            if r2 > (own[3] + own[4] * along + (own[5] - 1.0) * along * along) * stretch * stretch:
                continue
            f, _, _ = speed_and_slope(
                kind, numbers, own[0], own[1], own[2], along, along * along + r2 / (stretch * stretch)
            )
            left = end[1] if along > end[0] else 1.0
            speed[j] = max(speed[j], left * f * (a[5] + share * (b[5] - a[5])))


@njit
def plume_speeds(
    points: Array, origins: Array, directions: Array, areas: Array, kind: int, parameters: Array, thrusts: Array,
    current: Array, current_std: float, ends: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Speed per square root of newton of m jets at n points, shape (m, n), and their curves, (m, SECTIONS + 1, 7).

    Jets leave along `directions`, shape (m, 3), and move the water in excess of the current along them, too. `ends`,
    shape (m, 2), as for `fill_plume`.
    """
    m, n = origins.shape[0], points.shape[0]
    own = own_constants(kind, parameters, areas)
    speeds, curves = np.zeros((m, n)), np.empty((m, SECTIONS + 1, 7))
    across, ball = np.empty((3, n)), np.zeros(4)
    for x in range(3):
        for j in range(n):
            across[x, j] = points[j, x]
            ball[x] += points[j, x] / n
    for j in range(n):
        r2 = 0.0
        for x in range(3):
            r2 += (points[j, x] - ball[x]) ** 2
        ball[3] = max(ball[3], np.sqrt(r2))
    room, hits = np.empty((2, n)), np.empty(n + 1, np.int64)
    for i in range(m):
        trace_plume(kind, parameters, own[i], origins[i], directions[i], thrusts[i], current, current_std, curves[i])
        fill_plume(across, ball, kind, parameters, own[i], curves[i], ends[i], room, hits, speeds[i])
    return speeds, curves


def plumes(
    points_W_m: Array,
    origins_W_m: Array,
    directions_W: Array,
    areas_m2: Array,
    law: tuple[int, Array],
    thrusts_N: Array,
    flow: CrossFlow,
    ends: Array,
) -> tuple[Array, Array]:
    """`plume_speeds` of jets of a law, of these sizes, in a flow."""
    found = plume_speeds(
        points_W_m,
        np.ascontiguousarray(origins_W_m),
        np.ascontiguousarray(directions_W),
        areas_m2,
        *law,
        thrusts_N,
        flow.current_W_m_s,
        flow.current_std_m_s,
        ends,
    )
    return cast("tuple[Array, Array]", found)


CHI = float(np.sqrt(0.5))
"""Momentum flux over mass flux and greatest speed, of a half Gaussian."""
SOFT = 0.1
"""Thickness of a front over its distance for a known current: that of the layer."""
FADED = 32.0
"""Exponent of layer and edge above which the speed is zero: less than 1.3e-14 of the speed in the layer."""
TURNS = 3
"""Iterations of the direction of a ray for its travel time."""


@njit
def bed_intersection(curve: Array, bed_z: float) -> tuple[bool, float, float, float, float]:
    """(lands, x, y, s, t) of where a plume, shape (SECTIONS + 1, 7), first meets the bed."""
    for k in range(SECTIONS):
        above, below = bed_z - curve[k, 2], bed_z - curve[k + 1, 2]
        if above > 0.0 and below <= 0.0:
            share = above / (above - below)
            x = curve[k, 0] + share * (curve[k + 1, 0] - curve[k, 0])
            y = curve[k, 1] + share * (curve[k + 1, 1] - curve[k, 1])
            t = curve[k, 3] + share * (curve[k + 1, 3] - curve[k, 3])
            return True, x, y, curve[k, 4] + share * (curve[k + 1, 4] - curve[k, 4]), t
    return False, 0.0, 0.0, 0.0, 0.0


@njit(apart=True)
def add_advected_wall_jets(
    points: Array, curves: Array, directions: Array, areas: Array, floor: Array, thrusts: Array, current: Array,
    current_std: float, ends: Array, velocity: Array,
) -> None:  # fmt: skip
    """Add wall jets' velocity per square root of newton to `velocity`, shape (m, n, 3); `floor` as of
    `ImpingingJet.numbers`.

    `ends`, shape (m, 2), as for `fill_plume`: of a merged jet only a share strikes the bed as itself.
    """
    cx, cy = current[0], current[1]
    c2 = cx * cx + cy * cy
    c = np.sqrt(c2)
    for i in range(curves.shape[0]):
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        lands, strike_x, strike_y, H, before = bed_intersection(curves[i], floor[0])
        if not lands or dz < LEAST_SINE:
            continue
        far = (H**6 + (ROUND_DECAY * np.sqrt(areas[i])) ** 6) ** (1.0 / 6.0)
        r0 = 0.5 * WALL_SPEED / ROUND_DECAY * far
        strength, root = floor[1] * dz * np.sqrt(dz), np.sqrt(thrusts[i])
        left = ends[i, 1] if ends[i, 0] < H else 1.0
        for j in range(points.shape[0]):
            x, y = points[j, 0] - strike_x, points[j, 1] - strike_y
            away = np.sqrt(x * x + y * y)
            along, tau, beyond = x * cx + y * cy, 0.0, 0.0
            # Direction of the ray: at first as if the current were nothing.
            rx, ry = x, y
            for _ in range(TURNS if c > 0.0 else 0):
                size = np.sqrt(rx * rx + ry * ry + r0 * r0)
                own = CHI * strength * root / (1.0 - (rx * dx + ry * dy) / size)
                half = along + own
                if half >= c * away:
                    tau, beyond = away * away / (half + np.sqrt(half * half - c2 * away * away)), 0.0
                else:
                    tau, beyond = away / c, 0.5 * (away - half / c)
                rx, ry = x - cx * tau, y - cy * tau
            if tau + before > MAX_AGE_S:
                continue
            blur = 2.0 * current_std * (before + tau)
            square = rx * rx + ry * ry + r0 * r0
            height = max(floor[0] - points[j, 2], 0.0)
            soft = max(blur, SOFT * away) + _TINY
            faded = np.log(2.0) * height * height / (HALF_THICKNESS**2 * square) + (beyond / soft) ** 2
            if faded > FADED:
                continue
            size = np.sqrt(square)
            still = strength / (square * (1.0 - (rx * dx + ry * dy) / size))
            r = np.sqrt(rx * rx + ry * ry) + _TINY
            speed = still * r * root
            if c > 0.0:
                with_it = (rx * cx + ry * cy) / r
                speed = excess_speed(
                    CHI * speed * speed, CHI, with_it * (OPPOSING_SHARE if with_it < 0.0 else 1.0), c2, speed
                )
            share = left * speed / root * np.exp(-faded) * np.sqrt(square / (square + blur * blur)) / r
            velocity[i, j, 0] += share * rx
            velocity[i, j, 1] += share * ry
