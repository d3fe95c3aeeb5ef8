"""Simulated water: jets of impulse parcels, wall jets, solid target, hull wake and ambient flow.

Every thruster emits parcels of impulse (thrust x time / density) at its disk (`round_jet_closure`). Travel time,
merging of neighbouring jets, bending in a current and lingering wakes follow from the parcels' motion. Faces mirror the
jets (`faces`) and turn them into wall jets (`bedjets`); opposed and crossing jets turn aside (`colliding_jets`); the
target turns water and jets (`blockage`); a hull leaves a wake (`hullwake`).

Limits: swirl appears only in the width of a jet; wall jets have no turbulence of their own and do not collide; no
boundary layer of hull and target, no wake of the target; the bed below a jet is struck in pulses (mean stress right,
fluctuation half of the mean). After a thruster stops, its wake decays sooner than the lattice's: speed lasts 16 to 22 %
less, volume flux 10 to 14 %, the half-time at six diameters is 29 % and the energy's life 34 to 46 % shorter. All laws:
`wakewise.simulation.tank.validation_limits`.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Current
from wakewise.simulation.water.bedjets import JetPlanes, PackedRings, RingBuffers, WallJetRings, wall_rows
from wakewise.simulation.water.blockage import Blockage, PackedBlockage
from wakewise.simulation.water.colliding_jets import RAYS
from wakewise.simulation.water.currents import SteadyCurrent
from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.hullwake import HullPush, HullWake
from wakewise.simulation.water.induction import SINGLE, curve
from wakewise.simulation.water.parcel_advection import EMISSION_SPACING, count_sent
from wakewise.simulation.water.parcels import GUST_PER_TURBULENCE, MERGE_SPACING, Parcels, merged, merged_across
from wakewise.simulation.water.round_jet_closure import PLAIN, PUFF_SPREAD, JetSpreading, first_sigma_m
from wakewise.simulation.water.stepping import JetSources, StepCounters, WaterConstants, advance, places_of
from wakewise.simulation.water.water_snapshot import WaterSnapshot

_ROOM = 512  # parcels and rings to begin with; there is always room for a ring of each parcel

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class WaterCounts:
    """Counts and impulses of the model's elements, and the impulse removed, in N s."""

    parcels: int
    rings: int
    retired_N_s: float
    struck_N_s: float
    met_N_s: float
    forced_merges: int


class Water:
    """Flow of a tank with a bed: `velocity` gives the water at this instant, `step` moves it on.

    - `disk_areas_m2`, shape (n,): one per thruster.
    - `bed_z_m`: depth of the bed below the surface, z = 0; infinite for open water, without a surface.
    - `rng`: source of the turbulence.
    - `current_W_m_s`, shape (3,): steady and uniform; instead of `ambient`.
    - `ambient`: the water's own motion.
    - `half_size_m`: walls at |x| and |y| of this; infinite for none.
    - `turbulence`: root mean square of the fluctuating part on a jet's axis over the mean speed, beyond the core.
    - `rest_speed_m_s`: parcels are retired once neither they nor their neighbours move water faster than this at their
      centre.
    - `max_parcels`: above this, rows are made coarser until they fit, which is logged.
    - `spreading`: `PLAIN`, or `SWIRLING` for a propeller's wide jet.
    - `body`: a solid body on the bed.
    - `wake_life`: lifetime factor of a jet that is no longer fed, see `round_jet_closure`, *Life*.
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
        spreading: JetSpreading = PLAIN,
        body: Blockage | None = None,
        wake_life: float = 1.0,
    ) -> None:
        areas = np.array(disk_areas_m2, dtype=np.float64)
        self._density = density_kg_m3
        self._bed = bed_z_m
        steady = np.zeros(3) if current_W_m_s is None else np.array(current_W_m_s, float)
        self._ambient = ambient or SteadyCurrent(velocity_W_m_s=steady)
        self._room = TankFaces.of(bed_z_m, half_size_m, surface=math.isfinite(bed_z_m))
        self._gust_scale = turbulence * GUST_PER_TURBULENCE
        self._rest_speed = rest_speed_m_s
        self._max_parcels = max_parcels
        self._spreading = spreading
        self._wake_life = wake_life
        self._body = body
        self._body_rows = PackedBlockage.none() if body is None else body.rows
        self._rng = rng
        self._time = 0.0
        self._jets = Parcels.none().with_room(_ROOM)
        self._layers = RingBuffers(*(_with_room(column, 2 * _ROOM) for column in WallJetRings.none().layers()))
        self._planes = JetPlanes.of(self._room)
        spacing = EMISSION_SPACING * first_sigma_m(np.sqrt(4 * areas / math.pi))
        streams = (len(areas), 2)
        self._thrusters = JetSources(areas, spacing, np.zeros(streams), np.zeros(streams))
        self._hull = HullWake(2 * len(areas), density_kg_m3)
        sources = self._body_rows.answers.shape[1]
        self._tally = StepCounters(np.zeros(2, np.int64), np.array([0, -1, 0]), np.zeros(sources), np.zeros(3))
        self._forced_merges = 0
        self._now: WaterSnapshot | None = None
        self._answer_to_steady: Array | None = None

    @property
    def bed_z_m(self) -> float:
        """Depth of the bed."""
        return self._bed

    @property
    def steady(self) -> bool:
        """Whether the water without thrusters never changes."""
        return bool(getattr(self._ambient, "steady", False))

    @property
    def time_s(self) -> float:
        """Sum of the steps."""
        return self._time

    @property
    def parcels(self) -> Parcels:
        """The free jets at this instant."""
        return self.now.parcels

    @property
    def rings(self) -> WallJetRings:
        """The wall jets on the bed at this instant."""
        return self.now.rings

    @property
    def counts(self) -> WaterCounts:
        """Sizes and the impulse that has gone."""
        parcels, rings = self._tally.rows.tolist()
        retired, struck, met = (self._tally.gone * self._density).tolist()
        return WaterCounts(
            parcels=parcels,
            rings=rings,
            retired_N_s=retired,
            struck_N_s=struck,
            met_N_s=met,
            forced_merges=self._forced_merges,
        )

    @property
    def now(self) -> WaterSnapshot:
        """The flow at this instant; it stays as it is when the water moves on."""
        if self._now is None:
            parcels, rings = self._tally.rows.tolist()
            self._now = WaterSnapshot(
                time_s=self._time,
                parcels=Parcels.of(self._jets, parcels),
                rings=WallJetRings.of(self._layers, rings, 0) if math.isfinite(self._bed) else WallJetRings.none(),
                rows=PackedRings(*wall_rows(self._layers, rings, self._planes)),
                room=self._room,
                bed_z_m=self._bed,
                ambient=self._ambient,
                body=self._body,
                gust_scale=self._gust_scale,
                answer_to_ambient=self._answer_to_steady,
            )
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

    def step(
        self,
        dt_s: float,
        origins_before_m: Array,
        origins_m: Array,
        axes_W: Array,
        impulses_N_s: Array,
        hull: HullPush | None = None,
    ) -> None:
        """Move the water on by dt_s and send what the thrusters pushed meanwhile.

        - `origins_before_m`, `origins_m`, shape (n, 3): where the disks were at the start and are at the end of the
          step.
        - `axes_W`, shape (n, 3): force axes: forward thrust sends its jet along the negative axis.
        - `impulses_N_s`, shape (n, 2): integral over the step of forward and of reverse thrust, both positive.
        - `hull`: what the hull did to the water meanwhile; None for no hull.
        """
        forward, back = np.asarray(origins_m, dtype=np.float64), np.asarray(origins_before_m, dtype=np.float64)
        disks = np.stack([forward, (forward - back) / dt_s, axes_W])
        impulses = np.ascontiguousarray(impulses_N_s, dtype=np.float64) / self._density
        thrusters = self._thrusters
        sent = count_sent(impulses, dt_s, thrusters.areas, thrusters.spacing, thrusters.waiting_slug)
        known = int(self._tally.rows[0]) + sent
        self._make_room(known * (1 + RAYS // 2))
        places = places_of(self._jets, self._layers, self._planes, self._tally.rows, disks[0])
        ambient = self._ambient_velocity(places)
        noise = self._rng.standard_normal((known, 3)) if self._gust_scale > 0.0 else np.zeros((known, 3))
        advance(
            self._jets,
            self._layers,
            self._planes,
            self._body_rows,
            self._laws(dt_s),
            thrusters,
            self._tally,
            places,
            ambient,
            self._answer_to_ambient(),
            disks,
            impulses,
            noise,
        )
        if hull is not None:
            self._append(self._hull.sent(dt_s, hull, self._rng))
        if self._tally.rows[0] > self._max_parcels:
            self._coarsen()
        self._time += dt_s
        self._now = None

    def _laws(self, dt_s: float) -> WaterConstants:
        spread = self._spreading
        puff, wake_stream = max(PUFF_SPREAD, spread.spread), 2 * len(self._thrusters.areas)
        drift = np.array([spread.core_spread, spread.spread, puff, dt_s, self._wake_life])
        return WaterConstants(drift, wake_stream, self._rest_speed, self._gust_scale > 0.0, self._bed, curve(), SINGLE)

    def _ambient_velocity(self, places_W_m: Array) -> Array:
        """Velocity of the ambient water at places, both shape (n, 3)."""
        if getattr(self._ambient, "uniform", False) and len(places_W_m):
            even = np.empty((len(places_W_m), 3))
            even[:] = self._ambient.velocity(places_W_m[:1], self._time)
            return even
        return np.array(self._ambient.velocity(places_W_m, self._time), dtype=np.float64)

    def _answer_to_ambient(self) -> Array:
        """Strengths in m3/s of the body's sources against the ambient water, shape (s,)."""
        if self._body is None:
            return np.zeros(0)
        if self._answer_to_steady is not None:
            return self._answer_to_steady
        strengths = self._body.strengths_m3_s(self._ambient.velocity(self._body.points_m, self._time))
        if self.steady:
            self._answer_to_steady = strengths
        return strengths

    def _make_room(self, parcels: int) -> None:
        """Let there be room for so many parcels, and for a ring of each besides those there are."""
        if parcels > len(self._jets.sigma):
            self._jets = Parcels.of(self._jets, int(self._tally.rows[0])).with_room(2 * parcels)
        if int(self._tally.rows[1]) + parcels > len(self._layers.radius):
            room = 2 * (int(self._tally.rows[1]) + parcels)
            self._layers = RingBuffers(*(_with_room(column, room) for column in self._layers))

    def _append(self, parcels: Parcels) -> None:
        """Add parcels behind those there are; those behind a face are set on it."""
        if parcels.count == 0:
            return
        have = int(self._tally.rows[0])
        self._make_room(have + parcels.count)
        columns = parcels.with_room(parcels.count)
        for axis, at, side in self._planes.walls[:, :3]:
            beyond = side * (columns.position[:, int(axis)] - at) > 0.0
            columns.position[beyond, int(axis)] = at
        for column, new in zip(self._jets, columns, strict=True):
            column[have : have + parcels.count] = new
        self._tally.rows[0] += parcels.count

    def _coarsen(self) -> None:
        """Make rows coarser until there are no more parcels than there may be."""
        parcels, spacing = Parcels.of(self._jets, int(self._tally.rows[0])), MERGE_SPACING
        while parcels.count > self._max_parcels:
            spacing *= 1.5
            if spacing > 50.0:
                # Nothing more to merge: drop the weakest.
                size = parcels.size_m4_s
                strength = size / parcels.sigma_m**3
                keep = np.sort(np.argsort(-strength, kind="stable")[: self._max_parcels])
                self._tally.gone[0] += float(size.sum() - size[keep].sum())
                parcels = parcels.take(keep)
            else:
                parcels = merged_across(merged(parcels, spacing), spacing)
            self._forced_merges += 1
            log.warning("more than %d parcels: rows made coarser (%.2f sigma apart)", self._max_parcels, spacing)
        self._jets = parcels.with_room(len(self._jets.sigma))
        self._tally.rows[0] = parcels.count


def _with_room(column: np.ndarray, room: int) -> np.ndarray:
    out = np.zeros((room, *column.shape[1:]), column.dtype)
    out[: len(column)] = column
    return out
