"""The water at one instant: its velocity at any points, and where it stirs the bed.

An instant holds arrays that nobody changes, so it stays what it was while the water moves on, and several threads may
look at it at once. What takes long to prepare is prepared when first asked for.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.special import i0

from wakewise.arrays import Array, IntArray
from wakewise.interfaces import Current
from wakewise.water.bedjets import Rings, layer_speed
from wakewise.water.bedjets_sums import LOG_WIDTH, REACH
from wakewise.water.blockage import Blockage
from wakewise.water.chunks import over_points
from wakewise.water.clusters import ImpulseField
from wakewise.water.faces import Room
from wakewise.water.induction import SINGLE
from wakewise.water.parcels import CENTRE_SPEED, Parcels, gusty_impulse_m4_s
from wakewise.water.space_order import in_space
from wakewise.water.stepping import flow_at
from wakewise.water.walljets import WallRows


class Instant:
    """Flow of all jets and of the ambient water, with the answer of a body to both.

    Parameters
    ----------
    time_s : float
    parcels : Parcels
        The free jets.
    rings : Rings
        The wall jets on the bed.
    rows : WallRows
        All wall jets with their images.
    room : Room
    bed_z_m : float
        Infinite for none.
    ambient : Current
    body : Blockage or None
    gust_scale : float
        Of the parcels' turbulence; 0 for the mean flow.
    """

    def __init__(
        self,
        *,
        time_s: float,
        parcels: Parcels,
        rings: Rings,
        rows: WallRows,
        room: Room,
        bed_z_m: float,
        ambient: Current,
        body: Blockage | None,
        gust_scale: float,
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

        order = in_space(points)
        over_points(some, order, order, field.pairs(len(points)) + rows.pairs(len(points)))
        return u

    def stirred_bed(self, least_speed_m_s: float) -> Array:
        """Circles (x, y, radius), shape (n, 3), round the bed where jets may be faster than a speed."""
        speed = layer_speed(self.rings)
        fast = speed > least_speed_m_s
        rings = self.rings.take(fast)
        # Beyond its crest a wall jet's speed falls off as a Gaussian of the logarithm of the distance.
        beyond = np.exp(np.minimum(LOG_WIDTH * np.sqrt(2 * np.log(speed[fast] / least_speed_m_s)), REACH))
        # A leaning one reaches w^(1/4) times farther: a circle round its foremost and its hindmost place.
        heading, kappa = rings.heading_kappa
        widest = beyond * rings.radius_m
        ahead, behind = (widest * (np.exp(s * kappa) / i0(kappa)) ** 0.25 for s in (1.0, -1.0))
        middle, reach = rings.centre_m + (0.5 * (ahead - behind))[:, None] * heading, 0.5 * (ahead + behind)
        parcels = self.parcels
        # On the bed a parcel and its image are at most twice as fast as one at its centre.
        swift = 4 * CENTRE_SPEED * parcels.size_m4_s / parcels.sigma_m**3 > least_speed_m_s
        near = self._bed - parcels.position_m[:, 2] < 4 * parcels.sigma_m
        low, wide = parcels.position_m[near & swift], parcels.sigma_m[near & swift]
        circles: Array = np.concatenate(
            [np.column_stack([middle, reach]), np.column_stack([low[:, :2], 4 * wide])],
        )
        return circles

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
        return body.strengths_m3_s(self._ambient.velocity(body.points_m, self.time_s))

    def _turned_aside(self, points: Array, u: Array, *, jets: bool, ambient: bool) -> Array:
        """Add the body's answer to the jets and to the ambient water, if any point is near enough to feel it."""
        body = self._body
        if body is None or not len(body.near(points)):
            return u
        u = u.copy()
        strengths = [self._answer_to_jets] if jets else []
        strengths += [self._answer_to_ambient] if ambient else []
        body.add_velocity(points, np.add.reduce(strengths), u)
        return u
