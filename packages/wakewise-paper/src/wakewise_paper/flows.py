"""Flows of one thruster that wake models are held against: tables of the lattice, the tank's parcels, propeller laws.

All are given in the jet's own frame J: origin at the middle of the disk, x along the jet. None of them is a wake model,
and none has been adjusted to one.

The lattice's mean fields as jets that wake models can be held against.

Measured jets of the reference data: velocity fields of an air jet, and image pairs of another.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3 as WATER_DENSITY_KG_M3
from wakewise.core.errors import InputError
from wakewise.core.interfaces import Flow
from wakewise.simulation.lattice import load_mean_field
from wakewise.simulation.water import Water
from wakewise.wake.calibration import DataSplit
from wakewise.wake.samples import CORE, JetSamples, score_speeds

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


_CASES = {
    "oracle-swirl": ("swirl", "lattice, propeller with swirl"),
    "oracle": ("free", "lattice, jet without swirl"),
}


def oracle_jets() -> tuple[list[TableJet], dict[str, str]]:
    """Jets of the lattice with and without swirl, and for what is not there, why."""
    jets, missing = [], {}
    for name, (case, title) in _CASES.items():
        try:
            field = load_mean_field(case)
        except InputError as fault:
            missing[name] = str(fault)
            continue
        note = (
            f"lattice-Boltzmann, {field.cells_per_D} cells per disk diameter, actuator disk in open water, averaged "
            "over time and angle; one run scaled to all thrusts, so the thrust law holds by construction"
        )
        if field.figures.get("preliminary"):
            note += "; preliminary, on a coarser grid than is wanted"
        tables = {key: getattr(field, key) for key in ("x_D", "r_D", "axial", "radial", "swirl", "axial_rms")}
        jets.append(table_jet(name, title, note, tables))
    return jets, missing


def grid_convergence_pct() -> tuple[float | None, str]:
    """Change of the speed on the axis 0.3 m from the disk between two grids, per cent; None with the reason.

    Of the two cases, with swirl and without, the worse.
    """
    found, reasons = [], []
    for case, _ in _CASES.values():
        try:
            value = load_mean_field(case).figures.get("grid_convergence_pct")
        except InputError as fault:
            reasons.append(str(fault))
            continue
        if value is None:
            reasons.append(f"the stored mean field '{case}' of the lattice says nothing of a second grid")
        else:
            found.append(float(value))
    if reasons:
        return None, "; ".join(reasons)
    return max(found), ""


NOZZLE_DIAMETER_M = 0.15
EXIT_SPEED_M_S = 12.0
"""As the data's readme states (F. Moisy, Lab FAST, Univ. Paris-Sud, CNRS)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredJet:
    """Samples of a real jet with the split into snapshots to fit on and snapshots to test on.

    `half_width_m` is half the width at half the peak speed `peak_m_s`, both 0.1 m from the data's edge.
    `snapshots_r2_core` is what the mean of the training snapshots itself scores on the test snapshot in region A:
    with so few snapshots turbulence leaves little to any model of the mean.
    """

    samples: JetSamples
    split: DataSplit
    half_width_m: float
    peak_m_s: float
    snapshots_r2_core: float


def read_air_jet(path: Path) -> MeasuredJet:
    """Three snapshots of a 12 m/s air jet; fit on the first two, test on the third.

    The nozzle's plane is taken at y = 0 of the data and the jet along +y, as the readme has it. The jet's axis is the
    line through the centroids of speed squared of the two snapshots to fit on. Since models know T / (rho A) only, the
    thrust is that which in water gives the same exit speed.

    Raises
    ------
    InputError
        If the file is missing or holds other arrays.
    """
    try:
        with np.load(path) as data:
            across, along, x_mm, y_mm = (np.asarray(data[key], dtype=np.float64) for key in ("u", "v", "x_mm", "y_mm"))
    except (OSError, KeyError, ValueError):
        raise InputError(f"{path}: cannot be read, needs arrays u, v, x_mm and y_mm of the air jet") from None
    x, y = 1e-3 * x_mm, 1e-3 * y_mm
    known_twice = np.isfinite(along[:2]).all(axis=0)
    mean = np.where(known_twice, np.nan_to_num(along[:2]).mean(axis=0), np.nan)
    slope, offset = _axis(mean, x, y)
    Y, X = np.meshgrid(y, x, indexing="ij")
    off = X - (slope * Y + offset)
    rows = []
    for k in range(len(along)):
        known = np.isfinite(along[k]) & np.isfinite(across[k]) & (Y > 0.0)
        n = int(known.sum())
        columns = [Y[known], np.abs(off[known]), along[k][known], np.abs(across[k][known]), np.full(n, float(k))]
        rows.append(np.column_stack(columns))
    table = np.concatenate(rows)
    thrust_N = WATER_DENSITY_KG_M3 * 0.25 * math.pi * NOZZLE_DIAMETER_M**2 * EXIT_SPEED_M_S**2
    samples = JetSamples(
        x_m=table[:, 0],
        r_m=table[:, 1],
        thrust_N=np.full(len(table), thrust_N),
        speed_m_s=table[:, 2],
        across_m_s=table[:, 3],
        disk_diameter_m=NOZZLE_DIAMETER_M,
        title="air jet",
    )
    row = mean[np.argmin(np.abs(y - 0.1))]
    both = samples.take(table[:, 4] == 2)
    known = np.isfinite(along[2]) & np.isfinite(across[2]) & (Y > 0.0)
    inside = CORE.holds(both) & np.isfinite(mean[known])
    explained = score_speeds(mean[known][inside], both.take(inside)).r2_core
    return MeasuredJet(
        samples=samples,
        split=DataSplit(
            train=table[:, 4] < 2,
            test=table[:, 4] == 2,
            words="two snapshots to fit on, the third to test on; one speed",
        ),
        half_width_m=0.5 * float((row > 0.5 * np.nanmax(row)).sum() * abs(x[1] - x[0])),
        peak_m_s=float(np.nanmax(row)),
        snapshots_r2_core=float("nan") if explained is None else explained,
    )


def _axis(speed: Array, x: Array, y: Array) -> tuple[float, float]:
    """Slope and offset of the line x = slope y + offset that the jet runs along; `speed` has a row for each y."""
    weight = np.where(np.isfinite(speed), np.maximum(speed, 0.0), 0.0) ** 2
    whole = np.isfinite(speed).mean(axis=1) > 0.9
    centre = (weight @ x)[whole] / weight.sum(axis=1)[whole]
    slope, offset = np.polyfit(y[whole], centre, 1)
    return float(slope), float(offset)
