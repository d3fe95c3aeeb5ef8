"""Flows of one thruster that wake models are held against: tables of the lattice, the tank's parcels, propeller laws.

All are given in the jet's own frame J: origin at the middle of the disk, x along the jet. None of them is a wake model,
and none has been adjusted to one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3 as WATER_DENSITY_KG_M3
from wakewise.core.interfaces import Flow
from wakewise.simulation.water import Water

DISK_DIAMETER_M = 0.06
"""Disk of the paper's vehicle."""


def exit_speed_m_s(thrust_N: float, diameter_m: float) -> float:
    """Speed sqrt(T / (rho A)) of water that leaves a ducted disk with thrust T."""
    return math.sqrt(thrust_N / (WATER_DENSITY_KG_M3 * 0.25 * math.pi * diameter_m**2))


class JetFlow(Protocol):
    """One thruster's jet in open water that has been running for long."""

    @property
    def name(self) -> str:
        """Key in tables."""
        ...

    @property
    def title(self) -> str:
        """What it is, in a few words."""
        ...

    @property
    def note(self) -> str:
        """Where it comes from and what it does not hold."""
        ...

    @property
    def disk_diameter_m(self) -> float:
        """Diameter of the disk."""
        ...

    @property
    def reach_m(self) -> float:
        """Farthest distance from the disk at which it is known."""
        ...

    def mean_velocity(self, points_J_m: Array, thrust_N: float) -> Array:
        """Velocity in the jet frame averaged over time, shape (n, 3), at points, shape (n, 3)."""
        ...

    def instants(self, thrust_N: float, count: int, rng: np.random.Generator) -> list[Flow]:
        """Flows at independent instants, fluctuations included, in the jet frame; for virtual PIV."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class TableJet:
    """Azimuthal means of a jet on a grid of x and r, in units of U0 = sqrt(T / (rho A)) and the disk's diameter D.

    `axial`, `radial`, `swirl` and `rms`, shape (n, m), at `x_D`, shape (n,), and `r_D`, shape (m,). `swirl` is positive
    from y to z; `rms` is the fluctuation along the jet. One run is scaled to every thrust: sqrt(T) holds exactly.
    """

    name: str
    title: str
    note: str
    x_D: Array
    r_D: Array
    axial: Array
    radial: Array
    swirl: Array
    rms: Array
    disk_diameter_m: float = DISK_DIAMETER_M

    @property
    def reach_m(self) -> float:
        """Farthest distance from the disk at which it is known."""
        return float(self.x_D[-1]) * self.disk_diameter_m

    def mean_velocity(self, points_J_m: Array, thrust_N: float) -> Array:
        """Velocity in the jet frame averaged over time, shape (n, 3); NaN outside the table."""
        return self._table(points_J_m, thrust_N)[:, :3]

    def instants(self, thrust_N: float, count: int, rng: np.random.Generator) -> list[Flow]:
        """The mean with gusts of the tabulated strength: a sum of random solenoidal waves, new for every instant."""
        return [_GustyTable(self, thrust_N, Gusts.drawn(0.5 * self.disk_diameter_m, rng)) for _ in range(count)]

    def _table(self, points: Array, thrust_N: float) -> Array:
        """Velocity and fluctuation, shape (n, 4)."""
        D = self.disk_diameter_m
        radius = np.hypot(points[:, 1], points[:, 2])
        grid = np.stack([self.axial, self.radial, self.swirl, self.rms], axis=-1)
        read = RegularGridInterpolator((self.x_D, self.r_D), grid, bounds_error=False, fill_value=np.nan)
        axial, radial, swirl, rms = exit_speed_m_s(thrust_N, D) * read(np.column_stack([points[:, 0], radius]) / D).T
        safe = np.maximum(radius, 1e-9)
        cos, sin = points[:, 1] / safe, points[:, 2] / safe
        return np.column_stack([axial, cos * radial - sin * swirl, sin * radial + cos * swirl, rms])


@dataclass(frozen=True, eq=False)
class Gusts:
    """A frozen random field with unit variance per component: sum of `k` plane waves whose motion is across their way.

    wave_per_m, motion : ndarray, shape (k, 3); phase_rad : ndarray, shape (k,).
    """

    wave_per_m: Array
    motion: Array
    phase_rad: Array

    @classmethod
    def drawn(cls, size_m: float, rng: np.random.Generator, waves: int = 24) -> Gusts:
        """Waves of about `size_m` (wavelength over 2 pi times 2) in all directions."""
        wave = rng.standard_normal((waves, 3)) * (2.0 / size_m)
        motion = np.cross(wave, rng.standard_normal((waves, 3)))
        motion /= np.linalg.norm(motion, axis=1, keepdims=True)
        # Unit vectors hold a third of their square in each component, cosines a half.
        return cls(wave, motion * math.sqrt(6.0 / waves), rng.uniform(0.0, 2.0 * math.pi, waves))

    def at(self, points_m: Array) -> Array:
        """Gusts, shape (n, 3)."""
        return np.asarray(np.cos(points_m @ self.wave_per_m.T + self.phase_rad) @ self.motion)


@dataclass(frozen=True, eq=False)
class _GustyTable:
    jet: TableJet
    thrust_N: float
    gusts: Gusts

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity of the water; still outside the table."""
        known = np.nan_to_num(self.jet._table(points_W_m, self.thrust_N))
        return np.asarray(known[:, :3] + known[:, 3:] * self.gusts.at(points_W_m))


@dataclass(frozen=True, kw_only=True)
class PropellerLaw:
    """Far wash of a free propeller: V = V0 min(1, c D0 / x) exp(-k (r / x)^2).

    V0 = sqrt(2 T / (rho A)) is the slipstream's speed and D0 = D / sqrt 2 its diameter.

    M. Fuehrer and K. Roemisch, 24th International Navigation Congress (PIANC), Leningrad 1977, have c = 2.6, k = 22.2;
    H. G. Blaauw and E. J. van de Kaa, Erosion of bottom and sloping banks caused by the screw race of manoeuvring
    ships, Delft Hydraulics Laboratory publication 202, 1978, have c = 2.8, k = 15.4. Both are fits to ships' propellers
    for the zone of established flow, x > c D0; before it the axis speed is held at V0, which is crude. Axial only.
    """

    name: str
    title: str
    note: str
    decay: float
    narrowness: float
    disk_diameter_m: float = DISK_DIAMETER_M

    @property
    def reach_m(self) -> float:
        """The laws are used to fifty diameters and more."""
        return 50.0 * self.disk_diameter_m

    def mean_velocity(self, points_J_m: Array, thrust_N: float) -> Array:
        """Velocity in the jet frame, shape (n, 3); NaN upstream."""
        x = np.where(points_J_m[:, 0] > 0.0, points_J_m[:, 0], np.nan)
        r = np.hypot(points_J_m[:, 1], points_J_m[:, 2])
        slipstream = math.sqrt(2.0) * exit_speed_m_s(thrust_N, self.disk_diameter_m)
        axis = slipstream * np.minimum(1.0, self.decay * self.disk_diameter_m / math.sqrt(2.0) / x)
        out = np.zeros_like(points_J_m)
        out[:, 0] = axis * np.exp(-self.narrowness * (r / x) ** 2)
        return out

    def instants(self, thrust_N: float, count: int, rng: np.random.Generator) -> list[Flow]:
        """The law itself with gusts of a quarter of the local speed."""
        return [_GustyLaw(self, thrust_N, Gusts.drawn(0.5 * self.disk_diameter_m, rng)) for _ in range(count)]


@dataclass(frozen=True, eq=False)
class _GustyLaw:
    law: PropellerLaw
    thrust_N: float
    gusts: Gusts

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity of the water; still upstream."""
        mean = np.nan_to_num(self.law.mean_velocity(points_W_m, self.thrust_N))
        return np.asarray(mean + 0.25 * mean[:, :1] * self.gusts.at(points_W_m))


FUEHRER_ROEMISCH = PropellerLaw(
    name="fuehrer-roemisch",
    title="propeller law, Fuehrer and Roemisch",
    note="empirical law of ships' propellers, 1977; thrust law by construction; carries 0.61 of the thrust's momentum",
    decay=2.6,
    narrowness=22.2,
)
BLAAUW_VAN_DE_KAA = PropellerLaw(
    name="blaauw-van-de-kaa",
    title="propeller law, Blaauw and van de Kaa",
    note="empirical law of ships' propellers, 1978; thrust law by construction; carries 1.02 of the thrust's momentum",
    decay=2.8,
    narrowness=15.4,
)


@dataclass(frozen=True, kw_only=True)
class ParcelJet:
    """The tank's own water with a single thruster far from bed and walls, run for each thrust anew and averaged."""

    seed: int = 0
    turbulence: float = 0.25
    snapshots: int = 60
    disk_diameter_m: float = DISK_DIAMETER_M
    name: str = "parcels"
    title: str = "the tank's parcels"
    note: str = "impulse parcels without swirl, turbulence 0.25, simulated anew for every thrust"

    @property
    def reach_m(self) -> float:
        """As far as the jet is let run."""
        return 0.7

    def mean_velocity(self, points_J_m: Array, thrust_N: float) -> Array:
        """Velocity in the jet frame averaged over snapshots one passing time D / U0 apart, shape (n, 3)."""
        total = np.zeros_like(points_J_m)
        passing_s = self.disk_diameter_m / exit_speed_m_s(thrust_N, self.disk_diameter_m)
        water = self._running(thrust_N, np.random.default_rng(self.seed))
        for _ in range(self.snapshots):
            _push(water, thrust_N, passing_s)
            total += water.velocity(points_J_m)
        return np.asarray(total / self.snapshots)

    def instants(self, thrust_N: float, count: int, rng: np.random.Generator) -> list[Flow]:
        """The water of independent runs."""
        return [self._running(thrust_N, child) for child in rng.spawn(count)]

    def _running(self, thrust_N: float, rng: np.random.Generator) -> Water:
        area = 0.25 * math.pi * self.disk_diameter_m**2
        water = Water(
            np.array([area]),
            density_kg_m3=WATER_DENSITY_KG_M3,
            bed_z_m=math.inf,
            rng=rng,
            turbulence=self.turbulence,
        )
        # The front of a starting jet is at 2.57 (T/rho)^(1/4) t^(1/2); three times that time and the jet stands still.
        momentum = thrust_N / WATER_DENSITY_KG_M3
        _push(water, thrust_N, 3.0 * (self.reach_m / 2.57) ** 2 / math.sqrt(momentum))
        return water


def _push(water: Water, thrust_N: float, duration_s: float) -> None:
    """Let one thruster at the origin push, in steps of at most 20 ms, which is the tank's."""
    steps = max(1, math.ceil(duration_s / 0.02))
    dt_s = duration_s / steps
    origin, force_axis = np.zeros((1, 3)), np.array([[-1.0, 0.0, 0.0]])
    impulse = np.array([[thrust_N * dt_s, 0.0]])
    for _ in range(steps):
        water.step(dt_s, origin, origin, force_axis, impulse)


def table_jet(name: str, title: str, note: str, table: Mapping[str, Array]) -> TableJet:
    """A `TableJet` from arrays x_D, r_D, axial, radial, swirl and axial_rms; points nearer than 0.25 D are left out."""
    ahead = table["x_D"] > 0.25
    return TableJet(
        name=name,
        title=title,
        note=note,
        x_D=table["x_D"][ahead],
        r_D=table["r_D"],
        axial=table["axial"][ahead],
        radial=table["radial"][ahead],
        swirl=table["swirl"][ahead],
        rms=table["axial_rms"][ahead],
    )
