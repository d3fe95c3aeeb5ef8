"""Stored mean field of one lattice Boltzmann jet, and the steady flow of several thrusters' jets made from it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.simulation.lattice.cases import SHIPPED_CASES, case_hash

DATA = Path(__file__).parent / "data"
"""Where the tables that ship with the package lie."""

_TABLES = ("pressure", "axial", "radial", "swirl", "axial_rms", "radial_rms", "swirl_rms")


@dataclass(frozen=True, kw_only=True, eq=False)
class MeanField:
    """Mean flow of a case about the axis of its first jet, in units of D, U0 = sqrt(T / (rho A)) and rho U0^2."""

    case: str
    hash: str  # `case_hash` of what was computed
    cells_per_D: int
    # x_D, r_D: shapes (nx,) and (nr,): evenly spaced; x = 0 is the disk, r = 0 the axis.
    x_D: Array
    r_D: Array
    # pressure, axial, radial, swirl, axial_rms, radial_rms, swirl_rms: shape (nx, nr): means over time and angle, and
    # root mean squares of what fluctuates about them. Swirl turns y into z, that is, right-handed about the jet.
    pressure: Array
    axial: Array
    radial: Array
    swirl: Array
    axial_rms: Array
    radial_rms: Array
    swirl_rms: Array
    # axis_times, axis_speeds: shapes (nt,) and (nt, nx): the speed on the axis while the jet starts (and stops), at
    # times in D / U0.
    axis_times: Array
    axis_speeds: Array
    floor_D: float = math.inf  # distance from the disk to a solid floor; infinite without one
    # What was measured on the run: see `wakewise.simulation.lattice.meanfield`.
    figures: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        nx, nr = len(self.x_D), len(self.r_D)
        freeze(self, x_D=(None,), r_D=(None,), axis_times=(None,), axis_speeds=(None, nx))
        freeze(self, **dict.fromkeys(_TABLES, (nx, nr)))

    def at(self, x_D: Array, r_D: Array, names: tuple[str, ...] = ("axial", "radial", "swirl")) -> Array:
        """Values at points, shape (len(names), n), bilinear in the table.

        Behind the table and outside it in r the water is taken to rest. Farther along than the table reaches, the jet
        spreads like itself: u(x, r) = (x1 / x) u(x1, r x1 / x) from the table's last plane x1. On a floor the water
        rests, and from the last plane before it speeds fall linearly.
        """
        x, r = np.asarray(x_D, dtype=float), np.asarray(r_D, dtype=float)
        last = self.x_D[-1]
        ahead = np.maximum(x, last)
        if math.isinf(self.floor_D):
            widen = shrink = last / ahead
        else:
            widen, shrink = np.ones_like(x), np.maximum(self.floor_D - ahead, 0) / (self.floor_D - last)
        i = (np.minimum(x, last) - self.x_D[0]) * ((len(self.x_D) - 1) / (last - self.x_D[0]))
        j = (r * widen - self.r_D[0]) * ((len(self.r_D) - 1) / (self.r_D[-1] - self.r_D[0]))
        inside = (i >= 0) & (j <= len(self.r_D) - 1)
        i0 = np.clip(i.astype(int), 0, len(self.x_D) - 2)
        j0 = np.clip(j.astype(int), 0, len(self.r_D) - 2)
        fi, fj = i - i0, j - j0
        out = np.empty((len(names), len(x)))
        for k, name in enumerate(names):
            table = getattr(self, name)
            out[k] = (1 - fi) * ((1 - fj) * table[i0, j0] + fj * table[i0, j0 + 1]) + fi * (
                (1 - fj) * table[i0 + 1, j0] + fj * table[i0 + 1, j0 + 1]
            )
        return np.where(inside, shrink * out, 0.0)


def read_mean_field(path: Path) -> MeanField:
    """Read what `save_mean_field` wrote.

    Raises InputError if the file is missing or no such table.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            words = json.loads(str(data["words"]))
            return MeanField(**words, **{name: data[name] for name in data.files if name != "words"})
    except FileNotFoundError:
        raise InputError(f"{path}: no such mean field, compute it with tools/compute_lattice_fields.py") from None
    except (KeyError, ValueError, TypeError, OSError) as fault:
        raise InputError(f"{path}: not a mean field of the lattice ({fault})") from None


def load_mean_field(case: str = "swirl", folder: Path = DATA) -> MeanField:
    """Mean field of a case by name, by default from the package's own data.

    Raises InputError if there is no such case or file, or if the file was computed for other parameters or by another
    solver.
    """
    if case not in SHIPPED_CASES:
        raise InputError(f"lattice case {case!r}: no such case, allowed {', '.join(SHIPPED_CASES)}")
    wanted = SHIPPED_CASES[case]
    table = read_mean_field(folder / f"{case}.npz")
    if table.hash != case_hash(wanted):
        raise InputError(
            f"{folder / f'{case}.npz'}: computed for {table.hash}, the case is now {case_hash(wanted)}; "
            "compute it anew with tools/compute_lattice_fields.py"
        )
    return table


@dataclass(frozen=True, kw_only=True, eq=False)
class LatticeFlow:
    """Steady jets in still water, each the scaled mean field of one.

    One jet is an exact look-up of the lattice's table. Several are joined by momentum, as parallel jets join far away
    (two equal ones give sqrt 2 times the speed of one, not twice): with w = sum_j |u_j| u_j the velocity is
    w / sqrt(|w|). What the lattice shows of jets that meet head-on or cross, the flow sideways, this sum does not have;
    there, compute the case itself.

    Raises InputError if shapes disagree, a thrust is negative, an area is not positive or a direction has no length.
    """

    table: MeanField
    # origins_W_m, directions_W: shape (m, 3): centre of each disk, and where its jet blows (opposite to the force on
    # the vehicle); scaled to unit length.
    origins_W_m: Array
    directions_W: Array
    thrusts_N: Array  # shape (m,): magnitudes; a thruster in reverse has its direction turned
    areas_m2: Array  # shape (m,): disk areas, which are the areas of the ducted exits
    # Shape (m,): +1 where the table's swirl is as it is, right-handed about the jet, -1 where the screw turns the other
    # way.
    turns: Array | None = None
    density_kg_m3: float = FRESH_WATER_KG_M3

    def __post_init__(self) -> None:
        if self.turns is None:
            object.__setattr__(self, "turns", np.ones(len(self.thrusts_N)))
        m = len(self.thrusts_N)
        freeze(self, origins_W_m=(m, 3), directions_W=(m, 3), thrusts_N=(m,), areas_m2=(m,), turns=(m,))
        if np.any(self.thrusts_N < 0):
            raise InputError(f"thrusts_N: {self.thrusts_N.min():g}, allowed 0 or more; turn the direction for reverse")
        if np.any(self.areas_m2 <= 0):
            raise InputError(f"areas_m2: {self.areas_m2.min():g}, allowed above 0")
        length = np.linalg.norm(self.directions_W, axis=1)
        if np.any(length < 1e-9):
            raise InputError("directions_W: a direction has no length, every jet needs one")
        unit = self.directions_W / length[:, None]
        unit.setflags(write=False)
        object.__setattr__(self, "directions_W", unit)

    @property
    def exit_speeds_m_s(self) -> Array:
        """U0 = sqrt(T / (rho A)) of each jet, shape (m,)."""
        return np.sqrt(self.thrusts_N / (self.density_kg_m3 * self.areas_m2))

    def _cylinder(self, points_W_m: Array, j: int) -> tuple[Array, Array, Array, Array]:
        """Distance along and across the jet in diameters, and unit vectors outwards and around, of each point."""
        diameter = np.sqrt(4 * self.areas_m2[j] / np.pi)
        away = (points_W_m - self.origins_W_m[j]) / diameter
        axis = self.directions_W[j]
        x = away @ axis
        across = away - x[:, None] * axis
        r = np.linalg.norm(across, axis=1)
        outwards = across / np.maximum(r, 1e-12)[:, None]
        return x, r, outwards, np.cross(axis, outwards)

    def jet_velocities(self, points_W_m: Array) -> Array:
        """Velocity of each jet alone in m/s, shape (m, n, 3), at points, shape (n, 3)."""
        turns = np.asarray(self.turns)
        out = np.zeros((len(self.thrusts_N), len(points_W_m), 3))
        for j, speed in enumerate(self.exit_speeds_m_s):
            x, r, outwards, around = self._cylinder(points_W_m, j)
            axial, radial, swirl = self.table.at(x, r)
            out[j] = speed * (
                axial[:, None] * self.directions_W[j] + radial[:, None] * outwards + turns[j] * swirl[:, None] * around
            )
        return out

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s at points, both shape (n, 3)."""
        u = self.jet_velocities(points_W_m)
        if len(u) == 1:
            return u[0]
        momentum = np.sum(np.linalg.norm(u, axis=2, keepdims=True) * u, axis=0)
        return momentum / np.sqrt(np.maximum(np.linalg.norm(momentum, axis=1, keepdims=True), 1e-30))
