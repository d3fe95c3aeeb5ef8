"""Rings of wall jets one plane at a time, from records instead of buffers."""

from __future__ import annotations

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.simulation.water.bedjets import STRENGTH, STRIKE_HEIGHT, WallJetRings, fill_row, grow_layers, merge_layers
from wakewise.simulation.water.bedjets_sums import (
    COLUMNS,
    finish_rows,
    sum_planes,
)
from wakewise.simulation.water.induction import over_points


def rings_from_strikes(position_m: Array, impulse_m4_s: Array, sigma_m: Array) -> WallJetRings:
    """Rings that take over from parcels (arrays as in `Parcels`, in the plane's frame) which have come down to it."""
    size = np.linalg.norm(impulse_m4_s, axis=1)
    lean = impulse_m4_s[:, :2] / np.where(size > 0, size, 1.0)[:, None]
    return WallJetRings(position_m[:, :2].copy(), STRIKE_HEIGHT * sigma_m, size, lean)


def ring_velocity(
    points_W_m: Array, rings: WallJetRings, bed_z_m: float, least_m: float = 0.0, *, exact: bool = False
) -> Array:
    """Velocity of the rings, shape (n, 3), at points, shape (n, 3); zero if there are none.

    `least_m` is the least thickness delta of a layer, whose momentum stays; see `packed_rings`. `exact` sums in double
    precision.
    """
    return packed_velocity(points_W_m, packed_rings(rings, least_m), bed_z_m, exact=exact)


def packed_rings(rings: WallJetRings, least_m: float = 0.0, per_height: float = 0.0, stretch: float = 1.0) -> Array:
    """One row per ring, as the kernel reads it, for several calls of `packed_velocity`, shape (n, 15).

    A layer has the thickness hypot(0.093 R, least_m), or `stretch` times 0.093 R in that. It is slower in proportion to
    what that is more than the law's: each ring then carries its impulse, and the jet of many its momentum, which makes
    the whole slower by the square root. `per_height` is one over the distance to the opposite face, where F ends with a
    factor 1 - h per_height; 0 for none.
    """
    heading, kappa = rings.heading_kappa
    rows = np.empty((rings.count, COLUMNS))
    for j in range(rings.count):
        sizes = rings.radius_m[j], rings.impulse_m4_s[j]
        fill_row(rows[j], rings.centre_m[j], *sizes, heading[j], kappa[j], least_m, per_height, stretch)
    finish_rows(rows)
    return rows


def packed_velocity(points_W_m: Array, packed: Array, bed_z_m: float, *, exact: bool = False) -> Array:
    """Velocity of packed rings, shape (n, 3), at points, shape (n, 3)."""
    flat = np.concatenate([np.zeros(3), np.eye(3).ravel(), [bed_z_m, 0.0]])
    return planes_velocity(points_W_m, flat[None], np.array([0, len(packed)]), packed, exact=exact)


def planes_velocity(points_W_m: Array, planes: Array, starts: IntArray, packed: Array, *, exact: bool = False) -> Array:
    """Velocity of packed rings on several planes, shape (n, 3), at points, shape (n, 3).

    - `planes`, shape (k, 14): of each: origin, the three rows of the turn from the world into its frame, depth there,
      and 0 if its rings are those of a wall jet; if it has the same rings on both sides, how many times higher than a
      wall jet's they are.
    - `starts`, shape (k + 1,): plane i has the rings from starts[i] to starts[i + 1].
    - `packed`, shape (m, 15): see `packed_rings`; each in its plane's frame.
    - `exact`: sum in double precision.
    - Shapes: `points_W_m` (n, 3).
    """
    out = np.zeros((len(points_W_m), 3))
    if len(packed) and len(points_W_m):
        points = np.ascontiguousarray(points_W_m, dtype=np.float64)
        cost = 4 * len(points) * len(packed)  # a ring takes as long as four parcels
        kind = np.zeros(0, np.float64 if exact else np.float32)
        over_points(lambda some, result: sum_planes(some, planes, starts, packed, kind, result), points, out, cost)
    return out


def ring_strength(rings: WallJetRings) -> Array:
    """A of each ring in m2/s, shape (n,): such that rings sent at a steady rate add up to u_max = 1.16 sqrt(M) / r."""
    strength: Array = STRENGTH * rings.impulse_m4_s / rings.radius_m**2
    return strength


def grown(
    rings: WallJetRings, current_m_s: Array, dt_s: float, least_m: float = 0.0, stretch: float = 1.0
) -> tuple[WallJetRings, Array]:
    """Rings of one plane after dt_s, and the layer speed they had, shape (n,); see `grow_layers`.

    The current is a velocity in the plane's frame, shape (3,) or (n, 3).
    """
    layers, speed = rings.layers(), np.empty(rings.count)
    current = np.ascontiguousarray(np.broadcast_to(current_m_s, (rings.count, 3)))
    grow_layers(layers, rings.count, current, np.array([least_m]), np.array([stretch]), dt_s, speed)
    return WallJetRings.of(layers, rings.count, 0), speed


def merged_rings(rings: WallJetRings) -> WallJetRings:
    """Rings of one plane that are near each other made one; see `merge_layers`."""
    layers = rings.layers()
    return WallJetRings.of(layers, merge_layers(layers, rings.count), 0)
