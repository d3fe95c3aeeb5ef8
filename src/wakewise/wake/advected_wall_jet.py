"""Wall jets in water that moves: where the bent jet strikes, and how far its spreading water gets against a current.

The wall jet is that of `floor`, from where the plume of `carried` meets the bed. Its water leaves the strike point on
rays and the current takes each ray along: what is at d from the strike point left it tau ago in the direction of
d - c tau, and was |d - c tau| on its way when it had gone as far as its own speed takes it,

    |d - c tau|^2 = 2 chi a tau,   u_max r = a sqrt(T),   chi = 1 / sqrt(2) for the half Gaussian over the bed,

a quadratic in tau whose first root is the water that is outward bound. It has none beyond a parabola with its focus at
the strike point: there the front stops. Straight upstream this is where chi u_max = 2 |c|. (The free jet's front, for
which there are measurements, gets half as far again as this reckoning has it, `carried`; for wall jets none were found,
and the shorter law is kept. What is unsure of the current makes the edge soft.) Along the ray the speed in excess of
the current follows from the momentum that crosses a section, as for the free jet.

In still water it is the wall jet of `floor` to the last digits that the speed's search leaves, 1e-11.
"""

from __future__ import annotations

import numpy as np

from wakewise.core.jit.njit import njit
from wakewise.wake.advected_jets import FOLLOWED_S, OPPOSED, SECTIONS, excess_speed
from wakewise.wake.wall_jet import HALF_THICKNESS, LEAST_SINE, ROUND_DECAY, WALL_SPEED

CHI = float(np.sqrt(0.5))
"""Momentum flux over mass flux and greatest speed, of a half Gaussian."""
SOFT = 0.1
"""Thickness of a front over its distance where the current is known exactly: that of the layer."""
FADED = 32.0
"""Exponent of layer and edge together beyond which nothing is counted: less than 1.3e-14 of the speed in the layer."""
TURNS = 3
"""Times that the direction of a ray is set right by the time that its water was on its way."""
_TINY = 1e-12


@njit
def bed_intersection(curve, bed_z):  # type: ignore[no-untyped-def]
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
def add_carried_walls(points, curves, directions, areas, floor, thrusts, current, unsure, ends, velocity):  # type: ignore[no-untyped-def]
    """Add wall jets' velocity per square root of newton to `velocity`, shape (m, n, 3); `floor` as of `FloorJet`.

    `ends`, shape (m, 2), as for `carried.fill_plume`: of what joins others on its way only a share strikes as itself.
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
            if tau + before > FOLLOWED_S:
                continue
            blur = 2.0 * unsure * (before + tau)
            square = rx * rx + ry * ry + r0 * r0
            height = max(floor[0] - points[j, 2], 0.0)
            soft = max(blur, SOFT * away) + _TINY
            faded = np.log(2.0) * height * height / (HALF_THICKNESS**2 * square) + (beyond / soft) ** 2
            # Most points are above the layer, and the speed there is long to find.
            if faded > FADED:
                continue
            size = np.sqrt(square)
            still = strength / (square * (1.0 - (rx * dx + ry * dy) / size))
            r = np.sqrt(rx * rx + ry * ry) + _TINY
            speed = still * r * root
            if c > 0.0:
                with_it = (rx * cx + ry * cy) / r
                speed = excess_speed(CHI * speed * speed, CHI, with_it * (OPPOSED if with_it < 0.0 else 1.0), c2, speed)
            share = left * speed / root * np.exp(-faded) * np.sqrt(square / (square + blur * blur)) / r
            velocity[i, j, 0] += share * rx
            velocity[i, j, 1] += share * ry
