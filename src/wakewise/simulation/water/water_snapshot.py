"""Water at one instant: velocity at any points, and stress on the bed.

Its arrays never change, so threads may share a snapshot while the water moves on. Derived tables are made on first use.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from scipy.special import i0

from wakewise.core.arrays import Array, IntArray
from wakewise.core.interfaces import Current
from wakewise.core.jit.njit import njit
from wakewise.simulation.water.bedjets import PackedRings, WallJetRings, layer_speed
from wakewise.simulation.water.bedjets_sums import LOG_WIDTH, REACH
from wakewise.simulation.water.blockage import Blockage
from wakewise.simulation.water.clusters import ImpulseField
from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.induction import SINGLE, over_points, spatial_order
from wakewise.simulation.water.parcels import CENTRE_SPEED, Parcels, gusty_impulse_m4_s
from wakewise.simulation.water.stepping import flow_at


class WaterSnapshot:
    """Flow of all jets and of the ambient water, with the answer of a body to both.

    - `parcels`: the free jets.
    - `rings`: the wall jets on the bed.
    - `rows`: all wall jets with their images.
    - `bed_z_m`: infinite for none.
    - `gust_scale`: of the parcels' turbulence; 0 for the mean flow.
    - `answer_to_ambient`, shape (s,): the body's answer to the ambient water, where that is known already.
    """

    def __init__(
        self,
        *,
        time_s: float,
        parcels: Parcels,
        rings: WallJetRings,
        rows: PackedRings,
        room: TankFaces,
        bed_z_m: float,
        ambient: Current,
        body: Blockage | None,
        gust_scale: float,
        answer_to_ambient: Array | None = None,
    ) -> None:
        self.time_s = time_s
        self.parcels = parcels
        self.rings = rings
        self._rows = rows
        self._room = room
        self._bed = bed_z_m
        self._ambient = ambient
        self._body = body
        self._gust_scale = gust_scale
        self._known_answer = answer_to_ambient

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity of the water in m/s, shape (n, 3), at points, shape (n, 3)."""
        points = np.atleast_2d(np.asarray(points_W_m, dtype=np.float64))
        u = self.jets(points) + self._ambient.velocity(points, self.time_s)
        return self._turned_aside(points, u, jets=True, ambient=True)

    def ambient_velocity(self, points_W_m: Array) -> Array:
        """Velocity of the same water without thrusters, shape (n, 3), at points, shape (n, 3)."""
        points = np.atleast_2d(np.asarray(points_W_m, dtype=np.float64))
        u = self._ambient.velocity(points, self.time_s)
        return self._turned_aside(points, u, jets=False, ambient=True)

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity less that of the same water without thrusters, shape (n, 3), at points, shape (n, 3)."""
        points = np.atleast_2d(np.asarray(points_W_m, dtype=np.float64))
        return self._turned_aside(points, self.jets(points), jets=True, ambient=False)

    def jets(self, points: Array) -> Array:
        """Free jets and wall jets with their images, without the body's answer, shape (n, 3)."""
        field, rows, bed = self._field, self._rows, self._bed
        points = np.ascontiguousarray(points, dtype=np.float64)
        u = np.empty_like(points)

        def some(order: IntArray, _: IntArray) -> None:
            flow_at(points, order, field.rows, field.starts, rows.planes, rows.starts, rows.packed, bed, SINGLE, u)

        order = spatial_order(points)
        over_points(some, order, order, field.pairs(len(points)) + rows.pairs(len(points)))
        return u

    def stirred_bed(self, least_speed_m_s: float) -> Array:
        """Circles (x, y, radius), shape (n, 3), round the bed where jets may be faster than a speed."""
        rings, parcels = self.rings, self.parcels
        heading, kappa = rings.heading_kappa
        under_rings = ring_circles(
            layer_speed(rings), rings.centre_m, rings.radius_m, heading, kappa, i0(kappa), least_speed_m_s
        )
        under_jets = parcel_circles(
            parcels.position_m, parcels.impulse_m4_s, parcels.sigma_m, self._bed, least_speed_m_s
        )
        return np.concatenate([under_rings, under_jets])

    @cached_property
    def _field(self) -> ImpulseField:
        parcels = self.parcels
        impulses = gusty_impulse_m4_s(parcels, self._gust_scale)
        return ImpulseField.of(*self._room.with_images(parcels.position_m, impulses, parcels.sigma_m))

    @cached_property
    def _answer_to_jets(self) -> Array:
        body = self._body
        return np.zeros(0) if body is None else body.strengths_m3_s(self.jets(body.points_m))

    @cached_property
    def _answer_to_ambient(self) -> Array:
        body = self._body
        if body is None:
            return np.zeros(0)
        if self._known_answer is not None:
            return self._known_answer
        return body.strengths_m3_s(self._ambient.velocity(body.points_m, self.time_s))

    def _turned_aside(self, points: Array, u: Array, *, jets: bool, ambient: bool) -> Array:
        """Add the body's answer to the jets and to the ambient water, if any point is near enough to feel it."""
        body = self._body
        if body is None or not body.felt_at(points):
            return u
        u = u.copy()
        strengths = self._answer_to_jets if jets else self._answer_to_ambient
        if jets and ambient:
            strengths = strengths + self._answer_to_ambient
        body.add_velocity(points, strengths, u)
        return u


@njit(nogil=True)
def ring_circles(
    speed: Array, centre: Array, radius: Array, heading: Array, kappa: Array, bessel: Array, least: float
) -> Array:
    """Circles (x, y, radius) round rings faster than the least, shape (n, 3); `bessel` is I0 of their kappa."""
    out, count = np.empty((speed.shape[0], 3)), 0
    for j in range(speed.shape[0]):
        if speed[j] <= least:
            continue
        # Beyond its crest a wall jet's speed falls off as a Gaussian of the logarithm of the distance.
        widest = radius[j] * math.exp(min(LOG_WIDTH * math.sqrt(2.0 * math.log(speed[j] / least)), REACH))
        # A leaning one reaches w^(1/4) times farther: a circle round its foremost and its hindmost place.
        ahead = widest * (math.exp(kappa[j]) / bessel[j]) ** 0.25
        behind = widest * (math.exp(-kappa[j]) / bessel[j]) ** 0.25
        for k in range(2):
            out[count, k] = centre[j, k] + 0.5 * (ahead - behind) * heading[j, k]
        out[count, 2] = 0.5 * (ahead + behind)
        count += 1
    return out[:count]


@njit(nogil=True)
def parcel_circles(position: Array, impulse: Array, sigma: Array, bed_z: float, least: float) -> Array:
    """Circles (x, y, radius), shape (n, 3), round parcels near the bed that may be faster there than the least."""
    out, count = np.empty((sigma.shape[0], 3)), 0
    for j in range(sigma.shape[0]):
        size = math.sqrt(impulse[j, 0] ** 2 + impulse[j, 1] ** 2 + impulse[j, 2] ** 2)
        # On the bed a parcel and its image are at most twice as fast as one at its centre.
        swift = 4.0 * CENTRE_SPEED * size > least * sigma[j] ** 3
        if swift and bed_z - position[j, 2] < 4.0 * sigma[j]:
            out[count, 0], out[count, 1], out[count, 2] = position[j, 0], position[j, 1], 4.0 * sigma[j]
            count += 1
    return out[:count]
