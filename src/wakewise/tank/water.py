"""The simulated water: jets of impulse parcels, wall jets where they strike the bed, and a steady current.

Every thruster sends parcels of impulse (thrust x time / density) along its jet, from its disk. A parcel grows with the
path that it has travelled and is carried at a share eta of the water's speed at its centre:

    core      sigma from D/(2 sqrt 2) to D/2 over the first 6.27 D,   eta = (D/(2 sqrt 2) / sigma)^2
    beyond    sigma = 0.0798 x path,                                   eta = 1/2

With these a row of parcels carries the thrust's momentum at every distance: on the axis it has the exit speed
sqrt(T/(rho A)) in the core (Albertson et al. 1950: 6.2 D long) and 7.07 sqrt(T/rho)/x beyond, with a half width of
0.094 x (Hussein, Capp and George 1994, doi 10.1017/S002211209400323X, give 0.094). Travel time, merging of
neighbouring jets and wakes that linger follow from the parcels' motion; nothing is prescribed for them.

What it does not hold: walls and the surface absorb what reaches them; target and hull do not block the flow; there is
no swirl; wall jets carry no turbulence of their own and do not collide; head-on jets stall where they meet instead of
turning aside; the bed right below a jet is struck in pulses (mean stress right, fluctuation about half of the mean);
and a wake outlives its thruster by up to twice the real time.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from wakewise.arrays import Array, IntArray
from wakewise.tank.bedjets import STRIKE_HEIGHT, Rings, coarsened, grown, layer_speed, ring_velocity, rings_from_strikes
from wakewise.tank.parcels import Parcels, parcel_velocity

SPREAD = 0.094 / math.sqrt(2 * math.log(2))  # dsigma/dpath beyond the core, for a half width of 0.094 x
_CORE_SPREAD = SPREAD * (1 - 1 / math.sqrt(2))  # so that sigma reaches D/2 where SPREAD x path does
_CORE_PATH = 1 / (2 * SPREAD)  # 6.27 diameters
_EMISSION_SPACING = 0.6  # of the first sigma: Gaussians this close add up to a smooth row (ripple below 1e-6)
_MERGE_SPACING = 0.7  # of sigma: a closer pair becomes one, so rows are no coarser than 1.4 sigma (ripple 1e-4)
_STEEPEST_GRAZE = math.sin(math.radians(10))  # parcels that come down flatter than this slide along the bed
_GUST_MEMORY = 1.0  # integral time of the turbulence, in sigma over speed at the parcel

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class WaterCounts:
    """How much water the model carries, and what it has let go of, in N s."""

    parcels: int
    rings: int
    retired_N_s: float
    struck_N_s: float
    left_N_s: float
    forced_merges: int


class Water:
    """Flow of a tank with a bed: `velocity` gives the water at this instant, `step` moves it on.

    Parameters
    ----------
    disk_areas_m2 : ndarray, shape (n,)
        One per thruster.
    density_kg_m3 : float
    bed_z_m : float
        Depth of the bed; infinite for open water.
    current_W_m_s : ndarray, shape (3,)
        Steady and uniform.
    half_size_m : tuple of two floats
        Parcels that pass |x| or |y| beyond this, or rise above z = 0, have left; infinite for open water.
    turbulence : float
        Root mean square of the fluctuating part on a jet's axis over the mean speed, beyond the core.
    rest_speed_m_s : float
        Parcels are retired once neither they nor their neighbours move water faster than this at their centre.
    max_parcels : int
        Above this, rows are made coarser until they fit, which is logged.
    rng : numpy Generator
        Source of the turbulence.
    """

    def __init__(
        self,
        disk_areas_m2: Array,
        *,
        density_kg_m3: float,
        bed_z_m: float,
        rng: np.random.Generator,
        current_W_m_s: Array | None = None,
        half_size_m: tuple[float, float] = (math.inf, math.inf),
        turbulence: float = 0.0,
        rest_speed_m_s: float = 1e-3,
        max_parcels: int = 4096,
    ) -> None:
        self._areas = np.array(disk_areas_m2, dtype=np.float64)
        self._density = density_kg_m3
        self._bed = bed_z_m
        self._current = np.zeros(3) if current_W_m_s is None else np.array(current_W_m_s, dtype=np.float64)
        self._half_size = half_size_m
        self._gust_scale = turbulence * _GUST_PER_TURBULENCE
        self._rest_speed = rest_speed_m_s
        self._max_parcels = max_parcels
        self._rng = rng
        self._parcels = Parcels.none()
        self._rings = Rings.none()
        streams = (len(self._areas), 2)
        self._waiting_impulse = np.zeros(streams)  # m4/s, not yet sent as a parcel
        self._waiting_slug_m = np.zeros(streams)  # length of the jet's core that it stands for
        self._retired = self._struck = self._left = 0.0
        self._forced_merges = 0

    @property
    def bed_z_m(self) -> float:
        """Depth of the bed."""
        return self._bed

    @property
    def current_W_m_s(self) -> Array:
        """The steady current, shape (3,)."""
        return self._current.copy()

    @property
    def parcels(self) -> Parcels:
        """The free jets at this instant."""
        return self._parcels

    @property
    def rings(self) -> Rings:
        """The wall jets at this instant."""
        return self._rings

    @property
    def counts(self) -> WaterCounts:
        """Sizes and the impulse that has gone."""
        return WaterCounts(
            parcels=self._parcels.count,
            rings=self._rings.count,
            retired_N_s=self._retired * self._density,
            struck_N_s=self._struck * self._density,
            left_N_s=self._left * self._density,
            forced_merges=self._forced_merges,
        )

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity of the water in m/s, shape (n, 3), at points, shape (n, 3)."""
        return self.excess_velocity(points_W_m) + self._current

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity less that of the same water without thrusters, shape (n, 3), at points, shape (n, 3)."""
        points = np.atleast_2d(np.asarray(points_W_m, dtype=np.float64))
        moved = self._parcels
        free = parcel_velocity(points, moved.position_m, self._gusty_impulse(moved), moved.sigma_m, self._bed)
        return free + ring_velocity(points, self._rings, self._bed)

    def stirred_bed(self, least_speed_m_s: float) -> Array:
        """Circles (x, y, radius), shape (n, 3), round the bed where jets may be faster than a speed."""
        rings = self._rings.take(layer_speed(self._rings) > least_speed_m_s)
        # A leaning wall jet reaches w^(1/4) times farther ahead, at most 2.1 times at the steepest lean allowed.
        reach = rings.radius_m * np.where(rings.kappa > 0.0, 2.1, 1.0) * 1.3
        near = self._bed - self._parcels.position_m[:, 2] < 4 * self._parcels.sigma_m
        low = self._parcels.take(near)
        circles: Array = np.concatenate(
            [
                np.column_stack([rings.centre_m, reach]),
                np.column_stack([low.position_m[:, :2], 4 * low.sigma_m]),
            ]
        )
        return circles

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
        self._strike()
        self._thin()

    def _gusty_impulse(self, parcels: Parcels) -> Array:
        """Impulse with its turbulent part, which grows along the core and is full beyond it, shape (n, 3)."""
        if self._gust_scale == 0.0 or parcels.count == 0:
            return parcels.impulse_m4_s
        first = parcels.diameter_m / math.sqrt(8)
        grown_share = np.clip((parcels.sigma_m - first) / (parcels.diameter_m / 2 - first), 0.0, 1.0)
        size = np.linalg.norm(parcels.impulse_m4_s, axis=1)
        gusty: Array = parcels.impulse_m4_s + (self._gust_scale * grown_share * size)[:, None] * parcels.gust
        return gusty

    def _drift(self, dt_s: float) -> None:
        """Carry parcels and rings, let them grow, and retire what has come to rest."""
        parcels = self._parcels
        if parcels.count:
            # Gusts are heard everywhere but do not carry parcels: the growth of sigma stands for that mixing already.
            u = parcel_velocity(
                parcels.position_m, parcels.position_m, parcels.impulse_m4_s, parcels.sigma_m, self._bed
            ) + ring_velocity(parcels.position_m, self._rings, self._bed)
            speed = np.linalg.norm(u, axis=1)
            path, sigma = travel(parcels.sigma_m, parcels.diameter_m, speed, dt_s)
            direction = u / np.maximum(speed, 1e-12)[:, None]
            position = parcels.position_m + path[:, None] * direction + self._current * dt_s
            # A mirrored world is mirrored again: nothing ends up below the bed.
            position[:, 2] = np.minimum(position[:, 2], 2 * self._bed - position[:, 2])
            gust = parcels.gust
            if self._gust_scale > 0.0:
                memory = np.exp(-dt_s * np.maximum(speed, 1e-3) / (_GUST_MEMORY * parcels.sigma_m))[:, None]
                gust = memory * gust + np.sqrt(1 - memory**2) * self._rng.standard_normal(gust.shape)
            moved = Parcels(position, parcels.impulse_m4_s, sigma, parcels.diameter_m, parcels.stream, gust)
            resting = speed < self._rest_speed
            outside = (position[:, 2] < 0) if math.isfinite(self._bed) else np.zeros(parcels.count, dtype=np.bool_)
            outside |= (np.abs(position[:, 0]) > self._half_size[0]) | (np.abs(position[:, 1]) > self._half_size[1])
            size = np.linalg.norm(parcels.impulse_m4_s, axis=1)
            self._retired += float(size[resting & ~outside].sum())
            self._left += float(size[outside].sum())
            self._parcels = moved.take(~(resting | outside))
        if self._rings.count:
            rings, layer = grown(self._rings, self._current, dt_s)
            reach = 2 * max(self._half_size)
            self._rings = rings.take((layer >= self._rest_speed) & (rings.radius_m < reach))

    def _emit(self, dt_s: float, before: Array, after: Array, axes_W: Array, impulses_N_s: Array) -> None:
        """Send parcels at equal spacing along the slug of water that passed each disk, wherever the disk then was."""
        born = [self._parcels]
        for i, area in enumerate(self._areas):
            diameter = math.sqrt(4 * area / math.pi)
            first_sigma = diameter / math.sqrt(8)
            spacing = _EMISSION_SPACING * first_sigma
            for reverse in (0, 1):
                impulse = float(impulses_N_s[i, reverse]) / self._density
                if impulse <= 0.0:
                    continue
                exit_speed = math.sqrt(impulse / (dt_s * area))
                self._waiting_impulse[i, reverse] += impulse
                self._waiting_slug_m[i, reverse] += exit_speed * dt_s
                slug = self._waiting_slug_m[i, reverse]
                n = int(slug / spacing)
                if n == 0:
                    continue
                sent = self._waiting_impulse[i, reverse] * (n * spacing / slug)
                self._waiting_impulse[i, reverse] -= sent
                self._waiting_slug_m[i, reverse] -= n * spacing
                ages = np.clip((slug - spacing * (np.arange(n) + 0.5)) / exit_speed, 0.0, dt_s)
                sigma0, D = np.full(n, first_sigma), np.full(n, diameter)
                path, sigma = travel(sigma0, D, np.full(n, exit_speed), ages)
                jet_W = axes_W[i] * (1.0 if reverse else -1.0)
                share = (ages / dt_s)[:, None]
                origin = after[i] * (1 - share) + before[i] * share + self._current * ages[:, None]
                position = origin + path[:, None] * jet_W
                if math.isfinite(self._bed):
                    position[:, 2] = np.minimum(position[:, 2], self._bed)
                impulses = np.tile(jet_W * (sent / n), (n, 1))
                stream = np.full(n, 2 * i + reverse, dtype=np.int64)
                gust = self._rng.standard_normal((n, 3)) if self._gust_scale > 0.0 else np.zeros((n, 3))
                born.append(Parcels(position, impulses, sigma, D, stream, gust))
        for group in born[1:]:
            self._parcels = self._parcels.joined(group)

    def _strike(self) -> None:
        """Hand parcels that come down on the bed over to wall jets."""
        parcels = self._parcels
        if not math.isfinite(self._bed) or parcels.count == 0:
            return
        size = np.linalg.norm(parcels.impulse_m4_s, axis=1)
        down = parcels.impulse_m4_s[:, 2] > _STEEPEST_GRAZE * size
        hit = down & (self._bed - parcels.position_m[:, 2] < STRIKE_HEIGHT * parcels.sigma_m)
        if not hit.any():
            return
        gone = parcels.take(hit)
        self._struck += float(size[hit].sum())
        self._parcels = parcels.take(~hit)
        new = rings_from_strikes(gone.position_m, gone.impulse_m4_s, gone.sigma_m, gone.stream)
        self._rings = self._rings.joined(new)

    def _thin(self) -> None:
        """Keep rows no finer than their parcels need, and the number of parcels bounded."""
        self._parcels = merged(self._parcels, _MERGE_SPACING)
        self._rings = coarsened(self._rings)
        spacing = _MERGE_SPACING
        while self._parcels.count > self._max_parcels:
            spacing *= 1.5
            if spacing > 50.0:
                # Nothing more to merge: let the weakest go, most of them long past mattering.
                size = np.linalg.norm(self._parcels.impulse_m4_s, axis=1)
                strength = size / self._parcels.sigma_m**3
                keep = np.sort(np.argsort(-strength, kind="stable")[: self._max_parcels])
                self._retired += float(size.sum() - size[keep].sum())
                self._parcels = self._parcels.take(keep)
            else:
                self._parcels = merged(self._parcels, spacing)
            self._forced_merges += 1
            log.warning("more than %d parcels: rows made coarser (%.2f sigma apart)", self._max_parcels, spacing)


def travel(sigma_m: Array, diameter_m: Array, speed_m_s: Array, dt_s: float | Array) -> tuple[Array, Array]:
    """Path that parcels cover in dt_s and their size after it, shapes (n,), given the water's speed at their centres.

    Within the step the speed is taken to fall with growth as it does along a steady jet (constant in the core, as
    1/sigma beyond), which can be integrated exactly; so steps of a good part of a diameter stay accurate.
    """
    D = diameter_m
    first = D / math.sqrt(8)
    core = sigma_m < D / 2
    # Core: dsigma/dt = c u (first/sigma)^2, so sigma^3 grows linearly, up to the core's end.
    rate = 3 * _CORE_SPREAD * speed_m_s * first**2
    cubed = sigma_m**3 + rate * dt_s
    end = (D / 2) ** 3
    beyond = core & (cubed > end)
    in_core = np.cbrt(np.minimum(cubed, end))
    left_s = np.where(beyond, (cubed - end) / np.maximum(rate, 1e-30), np.where(core, 0.0, dt_s))
    start = np.where(core, in_core, sigma_m)
    # Beyond: dsigma/dt = k u/2 with u falling as 1/sigma, so sigma^2 grows linearly.
    after = np.sqrt(start**2 + SPREAD * start * speed_m_s * left_s)
    path = np.where(core, (start - sigma_m) / _CORE_SPREAD, 0.0) + (after - start) / SPREAD
    return path, after


def merged(parcels: Parcels, spacing: float) -> Parcels:
    """Pairs of successive parcels of one jet closer than `spacing` sigma made one; their impulse is conserved.

    Sizes are averaged, not widened by the distance: in a row the distance lies along the jet, and widening would
    spread the jet sideways as well.
    """
    if parcels.count < 2:
        return parcels
    position, impulse = parcels.position_m.copy(), parcels.impulse_m4_s.copy()
    sigma, gust = parcels.sigma_m.copy(), parcels.gust.copy()
    keep = np.ones(parcels.count, dtype=np.bool_)
    streams = int(parcels.stream.max()) + 1
    _merge_pairs(position, impulse, sigma, gust, parcels.stream, streams, spacing, keep)
    return Parcels(position, impulse, sigma, parcels.diameter_m, parcels.stream, gust).take(keep)


@njit(cache=True)
def _merge_pairs(
    X: Array, m: Array, sigma: Array, gust: Array, stream: IntArray, streams: int, spacing: float, keep: np.ndarray
) -> None:
    last = np.full(streams, -1)
    for j in range(sigma.shape[0]):
        i = last[stream[j]]
        last[stream[j]] = j
        if i < 0:
            continue
        reach = spacing * min(sigma[i], sigma[j])
        if np.sum((X[i] - X[j]) ** 2) > reach * reach:
            continue
        a, b = np.sqrt(np.sum(m[i] ** 2)), np.sqrt(np.sum(m[j] ** 2))
        # Only rows that run nearly the same way: opposite ones would cancel instead of stirring each other.
        if np.sum(m[i] * m[j]) < 0.9 * a * b:
            continue
        p = a / (a + b)
        X[j] = p * X[i] + (1 - p) * X[j]
        sigma[j] = p * sigma[i] + (1 - p) * sigma[j]
        gust[j] = (p * gust[i] + (1 - p) * gust[j]) / np.sqrt(p * p + (1 - p) * (1 - p))
        m[j] += m[i]
        keep[i] = False
        # A merged parcel waits for the next step, so that rows thin evenly.
        last[stream[j]] = -1


def _gust_per_turbulence() -> float:
    """Impulse fluctuation per parcel for a given relative fluctuation on the axis of a row of parcels.

    Parcels d = 1.05 sigma apart (rows lie between 0.7 and 1.4) fluctuate independently; on the axis one adds 2 A, so
    u'/u = a sqrt(sum (2A)^2) / sum 2A.
    """
    x = 1.05 * np.arange(-200, 201)[:, None] * np.array([0.0, 0.0, 1.0]) + np.array([0.0, 0.0, 0.2])
    one = np.array([[0.0, 0.0, 1.0]])
    along = parcel_velocity(x, np.zeros((1, 3)), one, np.ones(1), math.inf)[:, 2]
    return float(along.sum() / np.sqrt((along**2).sum()))


_GUST_PER_TURBULENCE = _gust_per_turbulence()
