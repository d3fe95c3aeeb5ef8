"""The simulated water: jets of impulse parcels, wall jets where they strike, a solid target, and the water's motion.

Every thruster sends parcels of impulse (thrust x time / density) along its jet, from its disk; `wakewise.water.closure`
says how they grow and travel. Travel time, merging of neighbouring jets, bending in a current and wakes that
linger follow from the parcels' motion; nothing is prescribed for them. Bed, surface and walls mirror the jets
(`faces`), turn what strikes them into wall jets (`bedjets`), jets that meet head-on turn aside (`meeting`), and the
target turns water aside (`blockage`).

What it does not hold: swirl shows in the width of a jet only; wall jets carry no turbulence of their own and do not
collide (those on the same ground add their momentum); there is no boundary layer nor wake of hull and target; the bed
right below a jet is struck in pulses (mean stress right, fluctuation about half of the mean). After a thruster has
stopped, its wake dies sooner than the lattice's: the speed lasts 16 to 22 % less, the volume flux 10 to 14 %, the
half-time at six diameters is 29 % and the energy's life 34 to 46 % shorter. Jets that meet head-on run out 1.2 to 1.5
times as fast as the lattice's within two diameters, and twice as fast at 20 cm (tests/tank/test_water_laws.py).
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace

import numpy as np

from wakewise.arrays import Array
from wakewise.interfaces import Current
from wakewise.water.bedjets import STRIKE_HEIGHT, Rings, rings_from_strikes
from wakewise.water.blockage import Blockage
from wakewise.water.closure import PLAIN, Spreading, disk_share, first_sigma_m, travel
from wakewise.water.drift import EMISSION_SPACING, drifted, due, gust_memory, slugs
from wakewise.water.faces import Face, Room
from wakewise.water.instant import Instant
from wakewise.water.meeting import Meetings
from wakewise.water.parcels import GUST_PER_TURBULENCE, MERGE_SPACING, Parcels, merged, merged_across
from wakewise.water.walljets import WallJets

_MANY = 800  # parcels; with more, old ones of different jets merge over distances that grow in proportion
_ACROSS_EVERY = 2  # steps after which different jets and rings are looked through for what may become one
_ANSWER_EVERY = 2  # steps after which the body's answer to what carries parcels is found anew
_STEEPEST_GRAZE = math.sin(math.radians(10))  # parcels that come in flatter than this slide along the face

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class WaterCounts:
    """How much water the model carries, and what it has let go of, in N s."""

    parcels: int
    rings: int
    retired_N_s: float
    struck_N_s: float
    met_N_s: float
    forced_merges: int


@dataclass(frozen=True)
class _Uniform:
    velocity_W_m_s: Array

    def velocity(self, points_W_m: Array, time_s: float) -> Array:  # noqa: ARG002
        return np.tile(self.velocity_W_m_s, (len(points_W_m), 1))


class Water:
    """Flow of a tank with a bed: `velocity` gives the water at this instant, `step` moves it on.

    Parameters
    ----------
    disk_areas_m2 : ndarray, shape (n,)
        One per thruster.
    density_kg_m3 : float
    bed_z_m : float
        Depth of the bed below the surface, z = 0; infinite for open water, without a surface.
    rng : numpy Generator
        Source of the turbulence.
    current_W_m_s : ndarray, shape (3,), or None
        Steady and uniform; instead of `ambient`.
    ambient : Current or None
        The water's own motion.
    half_size_m : tuple of two floats
        Walls at |x| and |y| of this; infinite for none.
    turbulence : float
        Root mean square of the fluctuating part on a jet's axis over the mean speed, beyond the core.
    rest_speed_m_s : float
        Parcels are retired once neither they nor their neighbours move water faster than this at their centre.
    max_parcels : int
        Above this, rows are made coarser until they fit, which is logged.
    spreading : Spreading
        `closure.PLAIN`, or `closure.SWIRLING` for a propeller's wide jet.
    body : Blockage or None
        A solid body on the bed.
    """

    def __init__(
        self,
        disk_areas_m2: Array,
        *,
        density_kg_m3: float,
        bed_z_m: float,
        rng: np.random.Generator,
        current_W_m_s: Array | None = None,
        ambient: Current | None = None,
        half_size_m: tuple[float, float] = (math.inf, math.inf),
        turbulence: float = 0.0,
        rest_speed_m_s: float = 1e-3,
        max_parcels: int = 4096,
        spreading: Spreading = PLAIN,
        body: Blockage | None = None,
    ) -> None:
        self._areas = np.array(disk_areas_m2, dtype=np.float64)
        self._diameters = np.sqrt(4 * self._areas / math.pi)
        self._density = density_kg_m3
        self._bed = bed_z_m
        self._ambient = ambient or _Uniform(np.zeros(3) if current_W_m_s is None else np.array(current_W_m_s, float))
        self._room = Room.of(bed_z_m, half_size_m, surface=math.isfinite(bed_z_m))
        self._gust_scale = turbulence * GUST_PER_TURBULENCE
        self._rest_speed = rest_speed_m_s
        self._max_parcels = max_parcels
        self._spreading = spreading
        self._body = body
        self._rng = rng
        self._time = 0.0
        self._parcels = Parcels.none()
        self._walls = WallJets(self._room)
        self._meetings = Meetings()
        streams = (len(self._areas), 2)
        self._waiting_impulse = np.zeros(streams)  # m4/s, not yet sent as a parcel
        self._waiting_slug_m = np.zeros(streams)  # length of the jet's core that it stands for
        self._retired = self._struck = self._met = 0.0
        self._forced_merges = 0
        self._now: Instant | None = None
        self._held_answer: Array | None = None  # of the body, to what carries parcels
        self._steps = 0

    @property
    def bed_z_m(self) -> float:
        """Depth of the bed."""
        return self._bed

    @property
    def time_s(self) -> float:
        """Sum of the steps."""
        return self._time

    @property
    def parcels(self) -> Parcels:
        """The free jets at this instant."""
        return self._parcels

    @property
    def rings(self) -> Rings:
        """The wall jets on the bed at this instant."""
        return self._walls.on_bed()

    @property
    def counts(self) -> WaterCounts:
        """Sizes and the impulse that has gone."""
        return WaterCounts(
            parcels=self._parcels.count,
            rings=self._walls.count,
            retired_N_s=self._retired * self._density,
            struck_N_s=self._struck * self._density,
            met_N_s=self._met * self._density,
            forced_merges=self._forced_merges,
        )

    @property
    def now(self) -> Instant:
        """The flow at this instant; it stays as it is when the water moves on."""
        if self._now is None:
            self._now = self._instant(self._gust_scale)
        return self._now

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity of the water in m/s, shape (n, 3), at points, shape (n, 3)."""
        return self.now.velocity(points_W_m)

    def ambient_velocity(self, points_W_m: Array) -> Array:
        """Velocity of the same water without thrusters, shape (n, 3), at points, shape (n, 3)."""
        return self.now.ambient_velocity(points_W_m)

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity less that of the same water without thrusters, shape (n, 3), at points, shape (n, 3)."""
        return self.now.excess_velocity(points_W_m)

    def step(self, dt_s: float, origins_before_m: Array, origins_m: Array, axes_W: Array, impulses_N_s: Array) -> None:
        """Move the water on by dt_s and send what the thrusters pushed meanwhile.

        Parameters
        ----------
        dt_s : float
        origins_before_m, origins_m : ndarray, shape (n, 3)
            Where the disks were at the start and are at the end of the step.
        axes_W : ndarray, shape (n, 3)
            Force axes: forward thrust sends its jet along the negative axis.
        impulses_N_s : ndarray, shape (n, 2)
            Integral over the step of forward and of reverse thrust, both positive.
        """
        self._drift(dt_s)
        self._emit(dt_s, origins_before_m, origins_m, axes_W, impulses_N_s)
        self._meet()
        self._strike()
        self._thin()
        self._time += dt_s
        self._now = None
        self._steps += 1
        if self._steps % _ANSWER_EVERY == 0:
            self._held_answer = None

    def _instant(self, gust_scale: float) -> Instant:
        return Instant(
            time_s=self._time,
            parcels=self._parcels,
            rings=self._walls.on_bed(),
            rows=self._walls.rows(),
            room=self._room,
            bed_z_m=self._bed,
            ambient=self._ambient,
            body=self._body,
            gust_scale=gust_scale,
        )

    def _carrying(self, mean: Instant, points: Array) -> Array:
        """Velocity of the jets' water, shape (n, 3); the body's answer to them is found anew every second step."""
        u = mean.jets(points)
        body = self._body
        if body is not None and len(near := body.near(points)):
            if self._held_answer is None:
                self._held_answer = mean.answer_to_jets()
            body.add_velocity(points, near, self._held_answer, u)
        return u

    def _drift(self, dt_s: float) -> None:
        """Carry parcels and rings, let them grow, and retire what has come to rest."""
        parcels = self._parcels
        mean = self.now if self._gust_scale == 0.0 else self._instant(0.0)
        if parcels.count:
            # Gusts are heard everywhere but do not carry parcels: the growth of sigma stands for that mixing already.
            X, u, held = parcels.position_m, parcels.flow_m_s.copy(), parcels.held_s.copy()
            look = due(u, held, parcels.sigma_m, dt_s)
            if len(look):
                u[look] = self._carrying(mean, X[look])
            position, sigma, share, speed = drifted(
                parcels, u, mean.ambient_velocity(X), dt_s, self._spreading, self._room.faces
            )
            gust = parcels.gust
            if self._gust_scale > 0.0:
                memory = gust_memory(parcels.sigma_m, speed, dt_s)
                gust = memory * gust + np.sqrt(1 - memory**2) * self._rng.standard_normal(gust.shape)
            moved = replace(
                parcels, position_m=position, sigma_m=sigma, gust=gust, share=share, flow_m_s=u, held_s=held
            )
            resting = speed < self._rest_speed
            if resting.any():
                self._retired += float(parcels.size_m4_s[resting].sum())
                moved = moved.take(~resting)
            self._parcels = moved
        self._walls.grow(dt_s, self._rest_speed, mean.ambient_velocity)

    def _emit(self, dt_s: float, before: Array, after: Array, axes_W: Array, impulses_N_s: Array) -> None:
        """Send parcels at equal spacing along the slug of water that passed each disk, wherever the disk then was."""
        if not np.any(impulses_N_s > 0.0):
            return
        disk_m_s = (after - before) / dt_s
        spacing = EMISSION_SPACING * first_sigma_m(self._diameters)
        thruster, reversed_, age, exits, sent = slugs(
            impulses_N_s / self._density, dt_s, self._areas, spacing, self._waiting_impulse, self._waiting_slug_m
        )
        if len(age):
            D, ages = self._diameters[thruster], age[:, None]
            path, sigma = travel(first_sigma_m(D), D, exits, age, self._spreading)
            jet_W = axes_W[thruster] * np.where(reversed_ == 1, 1.0, -1.0)[:, None]
            ambient, disk = self._ambient.velocity(after, self._time)[thruster], disk_m_s[thruster]
            carried = ambient + disk_share(sigma, D)[:, None] * (disk - ambient)
            position = after[thruster] + (carried - disk) * ages + path[:, None] * jet_W
            for face in self._room.faces:
                position[:, face.axis] -= face.side * np.maximum(-face.gap_m(position), 0.0)
            gusts = self._rng.standard_normal if self._gust_scale > 0.0 else np.zeros
            impulses = sent[:, None] * jet_W
            stream = 2 * thruster + reversed_
            self._parcels = self._parcels.joined(
                Parcels.sent(position, impulses, sigma, D, stream, gusts((len(D), 3)), disk)
            )

    def _meet(self) -> None:
        """Let parcels that meet head-on turn aside."""
        self._parcels, born, taken = self._meetings.turn_aside(self._parcels)
        self._met += taken
        for sheet, rings in born:
            self._walls.start(sheet, rings)

    def _strike(self) -> None:
        """Hand parcels that come up to a face over to wall jets."""
        for face in self._room.faces:
            parcels = self._parcels
            hit = self._hits(face, parcels)
            if not hit.any():
                continue
            gone = parcels.take(hit)
            self._struck += float(gone.size_m4_s.sum())
            self._parcels = parcels.take(~hit)
            position, impulse = face.local(gone.position_m), face.local(gone.impulse_m4_s)
            self._walls.start(face, rings_from_strikes(position, impulse, gone.sigma_m))

    @staticmethod
    def _hits(face: Face, parcels: Parcels) -> np.ndarray:
        towards = face.side * parcels.impulse_m4_s[:, face.axis] > _STEEPEST_GRAZE * parcels.size_m4_s
        hits: np.ndarray = towards & (face.gap_m(parcels.position_m) < STRIKE_HEIGHT * parcels.sigma_m)
        return hits

    def _thin(self) -> None:
        """Keep rows no finer than their parcels need, and the number of parcels bounded."""
        self._parcels = merged(self._parcels, MERGE_SPACING)
        if self._steps % _ACROSS_EVERY == 0:
            self._parcels = merged_across(self._parcels, MERGE_SPACING * max(1.0, self._parcels.count / _MANY))
            self._walls.thin()
        spacing = MERGE_SPACING
        while self._parcels.count > self._max_parcels:
            spacing *= 1.5
            if spacing > 50.0:
                # Nothing more to merge: let the weakest go, most of them long past mattering.
                size = self._parcels.size_m4_s
                strength = size / self._parcels.sigma_m**3
                keep = np.sort(np.argsort(-strength, kind="stable")[: self._max_parcels])
                self._retired += float(size.sum() - size[keep].sum())
                self._parcels = self._parcels.take(keep)
            else:
                self._parcels = merged_across(merged(self._parcels, spacing), spacing)
            self._forced_merges += 1
            log.warning("more than %d parcels: rows made coarser (%.2f sigma apart)", self._max_parcels, spacing)
