"""Silt on the bed and in the water: erosion, advection, diffusion, settling, with exact mass balance.

The bed is a grid of cells with a load in kg/m2. Above the grains' threshold stress they leave their cell at
Partheniades' rate (silt) or van Rijn's (sand) as particles, each of many grains. Particles move with the water, settle,
and walk at random with the eddy diffusivity K = K0 + 0.40 u* min(h, H), h the height above the bed and u* the friction
velocity below (mixing length theory), with the drift grad K that keeps a uniform suspension uniform (Visser 1997, doi
10.3354/meps158275).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Flow, ScalarGrid
from wakewise.simulation.tank.grains import (
    SAND_M,
    VON_KARMAN,
    Swell,
    erosion_rates_kg_m2_s,
    friction_table_m_s,
    least_mean,
    mean_pickup_rates_kg_m2_s,
    settling_speed_m_s,
    threshold_stress_Pa,
)
from wakewise.simulation.tank.sediment_motion import (
    LEAST_LOOSE_KG_M2,
    advect_particles,
    cells_to_look_at,
    deposit,
    entrain,
    mix,
    moved_cells,
    particles_to_sample,
    shared_among_nodes,
    stirred_cells,
    update_friction,
)

CELL_M = 0.05
SHEAR_HEIGHT_M = 0.01  # where the log law takes the water's speed from; the wall jets' slip speed stands for it
BACKGROUND_DIFFUSIVITY_M2_S = 1e-5  # still tank water, low end of 1e-5..1e-4
MIXING_HEIGHT_M = 0.065  # 0.40 u* h reaches a jet's 0.022 sqrt(T/rho) about here, and grows no more
SUSPENDED_NEAR_M = 0.8  # particles of grains suspended from the start are finer within this of the target
_MIXING = np.array([VON_KARMAN, MIXING_HEIGHT_M, BACKGROUND_DIFFUSIVITY_M2_S])
# A particle keeps the water's velocity until it has gone this far or this long, whichever is sooner.
_HELD_M, _HELD_S, _NEVER_S = 0.015, 0.3, 1e9
_FIRST_HEIGHT_M = 0.005  # silt that leaves the bed starts evenly spread below this
_FIRMER = 10.0  # threshold of a firm layer over that of the fluff on it (see `wakewise.simulation.tank.settings`)
_FINEST_LOAD_KG_M2 = 0.1  # thicker beds give up particles as fine as those of this load: they are never stripped whole


@dataclass(frozen=True, kw_only=True)
class SiltProperties:
    """What the silt, or sand, is made of; `sand` says that van Rijn's pickup lifts it and not Partheniades' rate.

    `stress_intensity` is the rms of the bed's stress over its mean. Of the load on the bed, `firm_kg_m2` lies lowest
    and has a threshold of its own.
    """

    grain_m: float
    grain_density_kg_m3: float
    water_density_kg_m3: float
    erosion_kg_m2_s: float
    threshold_Pa: float
    settling_m_s: float
    sand: bool = False
    stress_intensity: float = 0.0
    firm_kg_m2: float = 0.0
    firm_threshold_Pa: float = math.inf

    @classmethod
    def of(
        cls,
        grain_m: float,
        grain_density_kg_m3: float,
        water_density_kg_m3: float,
        erosion_kg_m2_s: float,
        threshold_Pa: float | None = None,
        pickup: str = "auto",
        *,
        settling_m_s: float | None = None,
        stress_intensity: float = 0.0,
        firm_kg_m2: float = 0.0,
    ) -> SiltProperties:
        """Laws of a grain: its own threshold and settling speed unless given, ten times that threshold where firm.

        `pickup` is auto, partheniades or van-rijn.
        """
        own = threshold_stress_Pa(grain_m, grain_density_kg_m3, water_density_kg_m3)
        least = own if threshold_Pa is None else threshold_Pa
        sinks = settling_speed_m_s(grain_m, grain_density_kg_m3, water_density_kg_m3)
        return cls(
            grain_m=grain_m,
            grain_density_kg_m3=grain_density_kg_m3,
            water_density_kg_m3=water_density_kg_m3,
            erosion_kg_m2_s=erosion_kg_m2_s,
            threshold_Pa=least,
            settling_m_s=sinks if settling_m_s is None else settling_m_s,
            sand=pickup == "van-rijn" or (pickup == "auto" and grain_m >= SAND_M),
            stress_intensity=stress_intensity,
            firm_kg_m2=firm_kg_m2,
            firm_threshold_Pa=_FIRMER * least,
        )

    def lifted_kg_m2_s(self, stress_Pa: Array, load_kg_m2: Array) -> Array:
        """Mean rate at which a bed under mean stresses, shape (n,), gives up grains of its loads, shape (n,)."""
        threshold = np.where(self.loose_kg_m2(load_kg_m2) > 0.0, self.threshold_Pa, self.firm_threshold_Pa)
        if self.sand:
            grain = self.grain_m, self.grain_density_kg_m3, self.water_density_kg_m3
            return mean_pickup_rates_kg_m2_s(stress_Pa, threshold, *grain, self.stress_intensity)
        rates: Array = erosion_rates_kg_m2_s(stress_Pa, threshold, self.erosion_kg_m2_s, self.stress_intensity)
        return rates

    def loose_kg_m2(self, load_kg_m2: Array) -> Array:
        """What of loads, shape (n,), lies above the firm layer, same shape; 0 where only that is left."""
        above = load_kg_m2 - self.firm_kg_m2
        return np.where(above > LEAST_LOOSE_KG_M2, above, 0.0)

    @cached_property
    def stirring_Pa(self) -> float:
        """Mean stress below which nothing is lifted."""
        return self.threshold_Pa * least_mean(self.stress_intensity)


class Silt:
    """Silt of one tank.

    - `load_kg_m2`: on every part of the bed at the start.
    - `size_m`: length, width and depth of the tank, whose bed is at z = depth and whose middle is at x = y = 0.
    - `max_particles`: above this, pairs of neighbouring particles become one: the mass adds up, the place is that of
      one of the two, drawn with their masses as odds, which keeps the expected distribution.
    - `swell`: the wave that is part of the flow, whose thin boundary layer drags on the bed more than its speed lets
      expect.
    """

    def __init__(
        self,
        laws: SiltProperties,
        load_kg_m2: float,
        size_m: tuple[float, float, float],
        max_particles: int,
        rng: np.random.Generator,
        swell: Swell | None = None,
    ) -> None:
        self.laws = laws
        self._swell = swell
        self._size = np.array(size_m)
        self._shape = (math.ceil(size_m[0] / CELL_M), math.ceil(size_m[1] / CELL_M))
        # Cells are stretched a little so that a whole number of them covers the bed.
        self._cell = self._size[:2] / np.array(self._shape)
        self._low = -self._size[:2] / 2
        self.bed_kg_m2: Array = np.full(self._shape, load_kg_m2)
        self._star_m_s: Array = np.zeros(self._shape)
        self._stream_m_s: Array = self._star_m_s  # of it, what the water without the swell makes
        self._friction = friction_table_m_s(SHEAR_HEIGHT_M, laws.grain_m)
        self.position_m: Array = np.zeros((0, 3))
        self.mass_kg: Array = np.zeros(0)
        self._u_m_s: Array = np.zeros((0, 3))  # of the water at each particle when last looked at
        self._age_s: Array = np.zeros(0)  # and how long ago that was
        self._looked: np.ndarray = np.zeros(self._shape, dtype=np.bool_)  # cells whose water was looked at last
        self._odd = 0
        self._max = max_particles
        self._rng = rng
        # A full set of new particles stands for the load of 0.01 m2; every pairing doubles the mass of the next ones.
        loose_kg_m2 = max(load_kg_m2 - laws.firm_kg_m2, 0.0) or load_kg_m2
        self._birth_kg = max(0.01 * min(loose_kg_m2, _FINEST_LOAD_KG_M2) / max_particles, 1e-12)
        self.lifted_kg = 0.0
        """What the bed has given up since the start, whether it has settled again or not."""
        self.pairings = 0
        self._start_kg = self.total_kg

    def suspend(self, concentration_kg_m3: float, centre_W_m: Array) -> None:
        """Add grains, evenly spread in all the water, before the first step.

        A share of the particles stands for the water within 0.8 m of a place, finer there than elsewhere, where
        fewer and heavier ones do; within each part they are stratified in height and all alike.
        """
        if concentration_kg_m3 <= 0.0:
            return
        n = self._max // 2
        low, high = np.array([*self._low, 0.0]), np.array([*-self._low, self._size[2]])
        inner_low = np.maximum(low[:2], centre_W_m[:2] - SUSPENDED_NEAR_M)
        inner_high = np.minimum(high[:2], centre_W_m[:2] + SUSPENDED_NEAR_M)
        near_m2 = float(np.prod(np.maximum(inner_high - inner_low, 0.0)))
        far_m2 = float(np.prod(high[:2] - low[:2])) - near_m2
        near = n * 3 // 4 if far_m2 > 1e-9 else n
        inner = self._rng.uniform(inner_low, inner_high, (near, 2))
        outer = np.zeros((0, 2))
        while len(outer) < n - near:
            drawn = self._rng.uniform(low[:2], high[:2], (n, 2))
            outside = np.any((drawn < inner_low) | (drawn > inner_high), axis=1)
            outer = np.concatenate([outer, drawn[outside]])[: n - near]
        for xy, area in ((inner, near_m2), (outer, far_m2)):
            if not len(xy):
                continue
            z = (self._rng.permutation(len(xy)) + self._rng.uniform(size=len(xy))) / len(xy) * self._size[2]
            self.position_m = np.concatenate([self.position_m, np.column_stack([xy, z])])
            share = concentration_kg_m3 * area * float(self._size[2]) / len(xy)
            self.mass_kg = np.concatenate([self.mass_kg, np.full(len(xy), share)])
        self._start_kg = self.total_kg
        # Grains that settle may be lifted again: as particles no heavier than those near the target, and no lighter.
        self._birth_kg = max(self._birth_kg, float(self.mass_kg.min()) / 100)

    @property
    def mass_error_rel(self) -> float:
        """Mass gained or lost since the start over that at the start; 0 of nothing."""
        return abs(self.total_kg - self._start_kg) / self._start_kg if self._start_kg > 0.0 else self.total_kg

    @property
    def total_kg(self) -> float:
        """Bed and water together."""
        return math.fsum(self.bed_kg_m2.ravel()) * float(self._cell.prod()) + math.fsum(self.mass_kg)

    @property
    def suspended_kg(self) -> float:
        """In the water."""
        return float(self.mass_kg.sum())

    def step(self, flow: Flow, stirred_W_m: Array, dt_s: float) -> None:
        """Erode, carry, mix and settle over dt_s.

        `flow`: water at this instant. `stirred_W_m`, shape (n, 3): circles on the bed, (x, y, radius), outside which no
        jet stirs it; only the current acts there.
        """
        self._shear(flow, stirred_W_m)
        self._erode(dt_s)
        if len(self.mass_kg):
            self._carry(flow, dt_s)
            self._mix(dt_s)
            self._pair()

    def concentration(
        self, origin_W_m: Array, spacing_m: float, shape: tuple[int, int, int], outer: ScalarGrid | None = None
    ) -> ScalarGrid:
        """Silt in kg/m3 on a grid; each particle is shared among the eight nodes round it (cloud in cell).

        `outer` is the coarser grid that holds outside it.
        """
        values = np.zeros(shape)
        if len(self.mass_kg):
            # The lowest layer of nodes may lie on the bed: what is below it is counted there, not lost.
            origin = np.array(origin_W_m, dtype=np.float64)
            shared_among_nodes(self.position_m, self.mass_kg / spacing_m**3, origin, float(spacing_m), values)
        (x, y), depth = self._low.tolist(), float(self._size[2])
        at = np.asarray(origin_W_m, dtype=np.float64).tolist()
        # A node on the bed has water only on its upper side, one on a wall only before it.
        for axis, face in ((2, depth), (0, x), (0, -x), (1, y), (1, -y)):
            node = (face - at[axis]) / spacing_m
            if 0 <= round(node) < shape[axis] and abs(node - round(node)) < 1e-6:
                values[(slice(None),) * axis + (round(node),)] *= 2.0
        return ScalarGrid(origin_W_m=origin_W_m, spacing_m=spacing_m, values=values, outer=outer)

    def _shear(self, flow: Flow, stirred_W_m: Array) -> None:
        """Friction velocity of every cell: from the water over it where jets reach, from the current elsewhere."""
        near = np.zeros(self._shape, dtype=np.bool_)
        stirred_cells(np.ascontiguousarray(stirred_W_m, dtype=np.float64), self._low, self._cell, CELL_M, near)
        # A cell that stays stirred is looked at every second time, its neighbours in between.
        self._odd = 1 - self._odd
        kept, cells, places = cells_to_look_at(
            near, self._looked, self._odd, self._low, self._cell, float(self._size[2])
        )
        self._looked = near
        # Away from the jets the water moves as it does in the farthest corner.
        u = flow.velocity(places)
        if self._swell is None:
            update_friction(self._star_m_s, kept, cells, u, self._friction)
            return
        if self._stream_m_s is self._star_m_s:
            self._stream_m_s = self._star_m_s.copy()
            x, y = (self._low[k] + (np.arange(self._shape[k]) + 0.5) * self._cell[k] for k in range(2))
            self._middles = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        time_s = float(getattr(flow, "time_s", 0.0))
        u[:, :2] -= self._swell.speed_m_s(places[:, :2], time_s)[:, None] * self._swell.ahead
        update_friction(self._stream_m_s, kept, cells, u, self._friction)
        swell = self._swell.stress_Pa(self._middles, time_s).reshape(self._shape) / self.laws.water_density_kg_m3
        # Stream and swell cross at any angle: the root of the sum of squares is right in the mean over a wave.
        self._star_m_s = np.hypot(self._stream_m_s**2, swell) ** 0.5

    def _erode(self, dt_s: float) -> None:
        """Lift whole particles, drawn so that on average each cell loses what the law says, at once."""
        laws = self.laws
        least = math.sqrt(laws.stirring_Pa / laws.water_density_kg_m3)
        area = float(self._cell.prod())
        cells, star, load = moved_cells(self._star_m_s, self.bed_kg_m2, least)
        if not len(cells):
            return
        rates = laws.lifted_kg_m2_s(laws.water_density_kg_m3 * star**2, load)
        drawn = rates * area * dt_s / self._birth_kg + self._rng.uniform(size=len(cells))
        lifted = entrain(cells, drawn, self._birth_kg, area, laws.firm_kg_m2, self.bed_kg_m2)
        new, mass = len(lifted), lifted[:, 2]
        self.lifted_kg += math.fsum(mass)
        place = self._rng.uniform(size=(new, 3))
        position = np.empty((new, 3))
        position[:, :2] = self._low + (lifted[:, :2] + place[:, :2]) * self._cell
        position[:, 2] = self._size[2] - _FIRST_HEIGHT_M * place[:, 2]
        self.position_m = np.concatenate([self.position_m, position])
        self.mass_kg = np.concatenate([self.mass_kg, mass])
        self._u_m_s = np.concatenate([self._u_m_s, np.zeros((new, 3))])
        self._age_s = np.concatenate([self._age_s, np.full(new, _NEVER_S)])

    def _carry(self, flow: Flow, dt_s: float) -> None:
        """Move with the water and sink; what sinks onto the bed stays there."""
        position, mass = self.position_m.copy(), self.mass_kg.copy()
        if len(self._age_s) != len(position):
            self._u_m_s, self._age_s = np.zeros_like(position), np.full(len(position), _NEVER_S)
        u, age, depth = self._u_m_s, self._age_s, float(self._size[2])
        look = particles_to_sample(u, age, dt_s, _HELD_M, _HELD_S)
        if len(look):
            u[look] = flow.velocity(position[look])
        landed = advect_particles(position, u, self.laws.settling_m_s, dt_s, self._low, depth)
        left = deposit(landed, position, mass, u, age, self.bed_kg_m2, self._low, self._cell)
        self.position_m, self.mass_kg, self._u_m_s, self._age_s = position[:left], mass[:left], u[:left], age[:left]

    def _mix(self, dt_s: float) -> None:
        """Random walk with drift; the bed turns it back, since only sinking deposits (flux w_s C, Krone 1962)."""
        kicks = self._rng.standard_normal(self.position_m.shape)
        position = self.position_m.copy()
        mix(position, kicks, self._star_m_s, self._low, self._cell, float(self._size[2]), dt_s, _MIXING)
        self.position_m = position

    def _pair(self) -> None:
        while len(self.mass_kg) > self._max:
            box = np.floor((self.position_m - np.array([*self._low, 0.0])) / (2 * CELL_M)).astype(np.int64)
            order = np.lexsort((self.mass_kg, box[:, 2], box[:, 1], box[:, 0]))
            n = len(order) // 2
            a, b = order[: 2 * n : 2], order[1 : 2 * n : 2]
            total = self.mass_kg[a] + self.mass_kg[b]
            first = self._rng.uniform(size=n) * total < self.mass_kg[a]
            chosen = np.where(first[:, None], self.position_m[a], self.position_m[b])
            rest = order[2 * n :]
            self.position_m = np.concatenate([chosen, self.position_m[rest]])
            self.mass_kg = np.concatenate([total, self.mass_kg[rest]])
            self._age_s = np.zeros(0)
            self._birth_kg *= 2
            self.pairings += 1
