"""The lattice against laser Doppler measurements round a cube on the floor of a channel.

A cube of height H stands on the floor of a channel of height 2 H, Reynolds number 40,000 with H and the bulk velocity
(Martinuzzi and Tropea 1993, J. Fluids Eng. 115, 85; ERCOFTAC classic collection, case 6.3). In the measurements x runs
from the cube's front face downstream, y up from the floor and z across from the middle of the cube. In the lattice the
order of axes is x, z, y: along, across, up. All results are in units of H and of the bulk velocity.

The bulk velocity is the mean over the channel's height of the measured profile at x/H = -3, z/H = 0, zero on both
walls. That profile is also what flows in. The floor, the ceiling and the cube take the stress of the law of the wall;
the sides are periodic.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, BoolArray
from wakewise.core.errors import InputError, StageError
from wakewise.simulation.lattice.kernel import step, velocity, wrap
from wakewise.simulation.lattice.stencil import (
    OPEN,
    PERIODIC,
    SHAPES,
    VELOCITIES,
    WALL,
    WEIGHTS,
    Lattice,
    box,
    plane_row,
    smagorinsky_factor,
    still_water,
)
from wakewise_paper.lattice_reference.engines import MOMENTS, BounceBackLinks, accumulate
from wakewise_paper.lattice_reference.wall_model import WallModel, law_of_the_wall, wall_stress

HEIGHT_MM = 25.0
"""Height of the measured cube, H."""

REATTACHMENT_H = 1.61
"""Measured distance from the cube's rear face to where the flow on the floor turns downstream."""

REYNOLDS = 40_000.0
"""Of the measurement, with H and the bulk velocity."""

OFF_WALLS_H = 0.2
"""Distance from walls beyond which `u_rms_rel_off_walls` counts points."""

_X_H = {1: -3.0, 2: -1.0, 3: 0.0, 4: 0.5, 5: 1.0, 6: 1.5, 7: 2.0, 8: 2.5, 9: 4.0, 10: 8.0}
_Z_H = {1: 0.0, 2: 1.0}


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """One measured profile: places in H, values in m/s or m2/s2."""

    quantity: str  # "mu_", "mv_", "mw_": mean velocities along, up, across; "fuu" and so on: Reynolds stresses
    x_H: float
    z_H: float
    y_H: Array  # shape (n,): height over the floor
    values: Array  # shape (n,)


def read_profile(path: Path) -> Profile:
    """Read one file of the collection; its name says what it holds and where.

    Raises InputError if the name is not of this kind, a line is not two numbers, or the heights do not rise inside the
    channel.
    """
    named = re.fullmatch(r"([mf][uvw][uvw_])_(\d\d)(\d\d)\.dat", path.name)
    if not named or int(named[2]) not in _X_H or int(named[3]) not in _Z_H:
        raise InputError(f"{path}: not a name of a profile, allowed such as mu__0302.dat")
    rows = []
    for number, line in enumerate(path.read_text(encoding="ascii").splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            try:
                y_mm, value = (float(word) for word in line.split())
            except ValueError:
                raise InputError(f"{path}: line {number} is {line.strip()!r}, needs a height and a value") from None
            rows.append((y_mm, value))
    table = np.array(rows)
    if len(table) < 2 or np.any(np.diff(table[:, 0]) <= 0) or table[0, 0] <= 0 or table[-1, 0] >= 2 * HEIGHT_MM:
        raise InputError(f"{path}: heights must rise between 0 and {2 * HEIGHT_MM:g} mm")
    return Profile(
        quantity=named[1],
        x_H=_X_H[int(named[2])],
        z_H=_Z_H[int(named[3])],
        y_H=table[:, 0] / HEIGHT_MM,
        values=table[:, 1],
    )


def read_profiles(folder: Path) -> list[Profile]:
    """All profiles of a folder, ordered by name.

    Raises InputError if the one at x/H = -3 is not among them.
    """
    profiles = [read_profile(path) for path in sorted(folder.glob("*_[01][0-9]0[12].dat"))]
    inflow_of(profiles)
    return profiles


def inflow_of(profiles: list[Profile]) -> Profile:
    """The mean velocity measured at x/H = -3; InputError if it is missing."""
    for profile in profiles:
        if (profile.quantity, profile.x_H, profile.z_H) == ("mu_", -3.0, 0.0):
            return profile
    raise InputError("cube_channel: the profile mu__0101.dat at x/H = -3 is missing, which the inflow is made of")


def bulk_velocity(inflow: Profile) -> float:
    """Mean over the channel's height of a profile in m/s, which is zero on both walls; trapezoids."""
    y = np.concatenate([[0.0], inflow.y_H, [2.0]])
    u = np.concatenate([[0.0], inflow.values, [0.0]])
    return float(np.sum(0.5 * (u[1:] + u[:-1]) * np.diff(y)) / 2.0)


Flow = Callable[[str, float, float, Array], Array]
"""Values of a quantity at x/H, z/H and heights y/H, shape (n,), over the bulk velocity (its square for a stress)."""


def differences(flow: Flow, profiles: list[Profile], quantity: str, bulk_m_s: float) -> Array:
    """Flow minus measurement at every measured point of a quantity, over the bulk velocity or its square."""
    unit = bulk_m_s ** (2 if quantity.startswith("f") else 1)
    gaps = [flow(p.quantity, p.x_H, p.z_H, p.y_H) - p.values / unit for p in profiles if p.quantity == quantity]
    return np.concatenate(gaps)


def off_walls(profiles: list[Profile], least_H: float) -> list[Profile]:
    """Points of profiles at least so far over the floor, under the ceiling and over the cube's roof where it is."""
    kept = []
    for p in profiles:
        floor = 1.0 if 0.0 <= p.x_H <= 1.0 and abs(p.z_H) <= 0.5 else 0.0
        far = (p.y_H >= floor + least_H) & (p.y_H <= 2.0 - least_H)
        kept.append(replace(p, y_H=p.y_H[far], values=p.values[far]))
    return kept


def rms(values: Array) -> float:
    """Root mean square, every value with the same weight."""
    return float(np.sqrt(np.mean(np.square(values))))


@dataclass(frozen=True, kw_only=True)
class ChannelCase:
    """What decides a run. Lengths in H, times in H over bulk velocity."""

    cells_per_H: int = 20
    low_x: float = -3.5
    high_x: float = 9.0
    width: float = 7.0
    develop: float = 15.0
    average: float = 50.0
    reynolds: float = REYNOLDS  # of the molecular viscosity
    smagorinsky: float = 0.12  # the package's own, as in `LatticeCase`
    speed: float = 0.14  # bulk velocity in cells per step; the fastest water has 0.2, as in `forced_lattice`
    entry: float = 0.5  # behind the inflow, in which viscosity falls: without it noise of single cells grows there
    sponge: float = 1.0  # before the open end, in which viscosity grows
    every: int = 10  # steps between samples of the average
    wall_law: bool = True  # whether walls take the stress of the law of the wall (`WallModel`), else without slip


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelMeans:
    """Time averages of a run, in units of H and of the bulk velocity."""

    case: ChannelCase
    bulk: float  # what went through the channel over what was asked to flow in
    # Shapes (8, nx, nz, ny): p, u, w, v, uu, ww, vv, and w v; folded about z = 0.
    moments: Array
    solid: BoolArray
    eddy_viscosity: float  # mean over the water from one H before the cube to three behind, over bulk velocity and H

    def at(self, quantity: str, x_H: float, z_H: float, y_H: Array) -> Array:
        """A mean velocity ("mu_", "mv_", "mw_") or a resolved normal stress ("fuu", "fvv", "fww") at heights y_H.

        Linear between the middles of cells. From the cell beside a wall to zero on the wall, velocities along it follow
        the law of the wall if the run has one; else, and other quantities, linear.

        Raises InputError for another quantity.
        """
        firsts = {"mu_": 1, "mw_": 2, "mv_": 3}
        seconds = {"fuu": (4, 1), "fww": (5, 2), "fvv": (6, 3)}
        if quantity not in (*firsts, *seconds):
            raise InputError(f"cube_channel: {quantity!r} is not averaged, allowed {', '.join((*firsts, *seconds))}")
        n, case = self.case.cells_per_H, self.case
        i, j = (x_H - case.low_x) * n - 0.5, (z_H + 0.5 * case.width) * n - 0.5
        out = np.zeros(len(y_H))
        for a in (math.floor(i), math.floor(i) + 1):
            for b in (math.floor(j), math.floor(j) + 1):
                column = self.moments[:, a, b]
                if quantity in firsts:
                    values = column[firsts[quantity]] / self.bulk
                else:
                    square, mean = seconds[quantity]
                    values = (column[square] - column[mean] ** 2) / self.bulk**2
                law = case.reynolds if case.wall_law and quantity in ("mu_", "mw_") else None
                part = _along_column(values, self.solid[a, b], n, y_H, law)
                out += (1 - abs(i - a)) * (1 - abs(j - b)) * part
        return out

    def reattachment_H(self) -> float | None:
        """Distance from the rear face to where the lowest cells of the middle flow downstream for good.

        None if they do so nowhere, or nowhere not.
        """
        n = self.case.cells_per_H
        middle = self.moments.shape[2] // 2
        first = round((1.0 - self.case.low_x) * n)
        last = round((self.case.high_x - self.case.sponge - self.case.low_x) * n)
        u = self.moments[1, first:last, middle - 1 : middle + 1, 0].mean(1)
        back = np.flatnonzero(u < 0.0)
        if not len(back) or back[-1] == len(u) - 1:
            return None
        k = int(back[-1])
        return float((k + 0.5 + u[k] / (u[k] - u[k + 1])) / n)


def _along_column(values: Array, solid: BoolArray, n: int, y_H: Array, reynolds: float | None) -> Array:
    """Values of a column of cells at heights, zero on the walls and in the cube, shape (k,).

    `reynolds`: for a velocity along walls that follows the law of the wall from the cell beside them on.
    """
    first = int(np.count_nonzero(solid))  # the cube stands on the floor
    top = len(values) / n
    nodes = np.concatenate([[first / n], (np.arange(first, len(values)) + 0.5) / n, [top]])
    out = np.interp(y_H, nodes, np.concatenate([[0.0], values[first:], [0.0]]), left=0.0)
    if reynolds is not None:
        for height, value in ((y_H - first / n, values[first]), (top - y_H, values[-1])):
            beside = (height > 0.0) & (height < 0.5 / n)
            friction = math.sqrt(wall_stress(abs(value), 1 / reynolds, 1 / n))
            if friction > 0.0:
                lengths = reynolds * friction
                law = law_of_the_wall(lengths * np.append(height[beside], 0.5 / n))
                out[beside] = value * law[:-1] / law[-1]
    return out


class ChannelRun:
    """State of one run; `advance` moves it on.

    `inflow_y`, `inflow_u`, shape (k,): heights in H and velocities over the bulk velocity, without the walls.
    """

    def __init__(self, case: ChannelCase, inflow_y: Array, inflow_u: Array) -> None:
        n = case.cells_per_H
        self.case = case
        self.cells = round((case.high_x - case.low_x) * n), round(case.width * n), 2 * n
        nx, nz, ny = self.cells
        centres = (np.arange(ny) + 0.5) / n
        profile = np.interp(centres, np.r_[0.0, inflow_y, 2.0], np.r_[0.0, inflow_u, 0.0])
        profile *= case.speed / profile.mean()
        self.solid = np.zeros(self.cells, np.bool_)
        x0, z0 = round(-case.low_x * n), round((0.5 * case.width - 0.5) * n)
        self.solid[x0 : x0 + n, z0 : z0 + n, :n] = True
        self._cube = BounceBackLinks(self.solid)
        self._faces = np.array([PERIODIC, OPEN, PERIODIC, PERIODIC, WALL, WALL])
        self._wall_model = None
        if case.wall_law:
            self._wall_model = WallModel(self.solid, self._faces, case.speed * n / case.reynolds)
        self._wrapped = np.array([OPEN, OPEN, PERIODIC, PERIODIC, WALL, WALL])
        self._eddies = smagorinsky_factor(case.smagorinsky)
        # In the sponges the viscosity rises to that of a mixing layer, as in `wakewise_paper.lattice_reference.run`.
        at = np.arange(nx + 2.0)
        ramp = np.maximum(1 - at / (case.entry * n), 0.0) ** 2 + np.maximum(1 - at[::-1] / (case.sponge * n), 0.0) ** 2
        tau = 0.5 + 3 * case.speed * n / case.reynolds + 3 * 0.05 * case.speed * n * ramp
        self._tau_x, self._tau_yz = tau.astype(np.float32), plane_row(np.zeros((nz + 2, ny + 2)))
        u = np.zeros((ny + 2, 3))
        u[1:-1, 0] = profile
        # Equilibrium of the inflow at rest pressure, shape (19, ny + 2); its pressure follows that of the channel.
        self._enters = WEIGHTS[:, None] * (3.0 * VELOCITIES @ u.T + np.einsum("iab,ya,yb->iy", SHAPES, u, u))
        self._excess = 0.0
        self._now, self._next = still_water(self.cells), still_water(self.cells)
        # Water starts with the inflow everywhere, and with small disturbances, since a symmetric start stays so.
        start = self._enters[:, None, None, :].astype(np.float32)
        box(self._now, nz, ny)[:] = start
        rng = np.random.default_rng(0)
        noise = 0.02 * case.speed * rng.standard_normal((3, nx + 2, nz + 2, ny + 2))
        for i in range(1, 19):
            box(self._now, nz, ny)[i] += (3 * WEIGHTS[i] * np.tensordot(VELOCITIES[i], noise, 1)).astype(np.float32)
        self._cube.empty(self._now)
        self._field: Lattice = np.zeros((4, *self.cells), np.float32)
        self.sums = np.zeros((MOMENTS, *self.cells))
        self.samples = self.steps_done = 0
        self._eddy_sum = 0.0

    @property
    def time(self) -> float:
        """Time in H over bulk velocity."""
        return self.steps_done * self.case.speed / self.case.cells_per_H

    def advance(self, steps: int) -> None:
        """Move on by so many steps.

        Raises StageError if the flow has blown up.
        """
        _, nz, ny = self.cells
        for _ in range(steps):
            water = box(self._now, nz, ny)
            wrap(self._now, nz, ny, self._wrapped)
            # What comes in is fixed but for its pressure, which follows the water's slowly: waves of sound leave.
            self._excess += 0.002 * (float(water[:, 1, 1:-1, 1:-1].sum(0).mean()) - self._excess)
            water[:, 0] = (self._enters + WEIGHTS[:, None] * self._excess)[:, None, :]
            if self._wall_model:
                self._wall_model.impose(self._now)
            self._cube.turn_back(self._now)
            step(self._now, self._next, nz, ny, self._tau_x, self._tau_yz, self._eddies, self._faces)
            self._cube.empty(self._next)
            self._now, self._next = self._next, self._now
            self.steps_done += 1
        if not np.isfinite(self._now[:, :, self._now.shape[2] // 2]).all():
            raise StageError(f"cube in a channel: the flow blew up before step {self.steps_done}")

    def sample(self) -> None:
        """Add this instant to the averages."""
        velocity(self._now, *self.cells[1:], self._field)
        accumulate(self._field, self.sums)
        if self.samples % 50 == 0:
            self._eddy_sum += self._eddy_viscosity()
        self.samples += 1

    def _eddy_viscosity(self) -> float:
        """Mean of (Cs cell)^2 |S| near the cube, over bulk velocity and H; S from central differences."""
        case = self.case
        n = case.cells_per_H
        first, last = round((-1.0 - case.low_x) * n), round((4.0 - case.low_x) * n)
        u = self._field[1:, first:last].astype(np.float64)
        gradient = np.array([[np.gradient(u[a], axis=b) for b in range(3)] for a in range(3)])
        strain = 0.5 * (gradient + gradient.transpose(1, 0, 2, 3, 4))
        size = np.sqrt(2 * np.sum(strain**2, axis=(0, 1)))[~self.solid[first:last]]
        return float(case.smagorinsky**2 * size.mean() / (case.speed * n))

    def means(self) -> ChannelMeans:
        """Averages so far; StageError if there are none."""
        if not self.samples:
            raise StageError("cube in a channel: nothing has been averaged")
        moments = self.sums / self.samples
        moments[1:4] /= self.case.speed
        moments[4:] /= self.case.speed**2
        # The flow is the same on both sides of z = 0, where w and w v change sign.
        other = moments[:, :, ::-1].copy()
        other[[2, 7]] *= -1
        moments = 0.5 * (moments + other)
        entry = round(0.5 * self.case.cells_per_H)
        snapshots = (self.samples - 1) // 50 + 1
        return ChannelMeans(
            case=self.case,
            bulk=float(moments[1, entry].mean()),
            moments=moments,
            solid=self.solid,
            eddy_viscosity=self._eddy_sum / snapshots,
        )


def run_channel(
    case: ChannelCase, profiles: list[Profile], progress: Callable[[int, int, str], None] = lambda *_: None
) -> ChannelMeans:
    """Compute a case with the measured inflow; minutes of a core."""
    inflow = inflow_of(profiles)
    run = ChannelRun(case, inflow.y_H, inflow.values / bulk_velocity(inflow))
    total = math.ceil((case.develop + case.average) * case.cells_per_H / case.speed)
    while run.steps_done < total:
        run.advance(min(case.every, total - run.steps_done))
        if run.time >= case.develop:
            run.sample()
        if run.steps_done % (20 * case.every) == 0:
            progress(run.steps_done, total, "cube in a channel")
    return run.means()


def compared_profiles(means: ChannelMeans, profiles: list[Profile]) -> list[dict[str, Any]]:
    """Measured profiles of U and the lattice's at the same heights, over the bulk velocity, as plain lists."""
    bulk = bulk_velocity(inflow_of(profiles))
    return [
        {
            "x_H": p.x_H,
            "z_H": p.z_H,
            "y_H": p.y_H.tolist(),
            "measured": (p.values / bulk).tolist(),
            "lattice": means.at("mu_", p.x_H, p.z_H, p.y_H).tolist(),
        }
        for p in profiles
        if p.quantity == "mu_"
    ]


def figures(means: ChannelMeans, profiles: list[Profile]) -> dict[str, Any]:
    """Figures of a run against the measurement.

    Returns u_rms_rel, v_rms_rel, w_rms_rel, uu_rms_rel: root mean square over all measured points of the difference,
    over the bulk velocity or its square; u_rms_rel_downstream: without x/H = -3, where the inflow comes from;
    u_rms_rel_off_walls: of points at least `OFF_WALLS_H` from floor, ceiling and roof; reattachment_H,
    reattachment_error_pct; reynolds: of the molecular viscosity; reynolds_effective: with the mean eddy viscosity about
    the cube added; cells_per_H, points, and what the run was.
    """
    bulk = bulk_velocity(inflow_of(profiles))
    downstream = [p for p in profiles if p.x_H > -3.0]
    found = means.reattachment_H()
    case = means.case
    return {
        "u_rms_rel": rms(differences(means.at, profiles, "mu_", bulk)),
        "u_rms_rel_downstream": rms(differences(means.at, downstream, "mu_", bulk)),
        "u_rms_rel_off_walls": rms(differences(means.at, off_walls(profiles, OFF_WALLS_H), "mu_", bulk)),
        "v_rms_rel": rms(differences(means.at, profiles, "mv_", bulk)),
        "w_rms_rel": rms(differences(means.at, profiles, "mw_", bulk)),
        "uu_rms_rel": rms(differences(means.at, profiles, "fuu", bulk)),
        "reattachment_H": found,
        "reattachment_error_pct": None if found is None else 100 * abs(found / REATTACHMENT_H - 1),
        "points": sum(len(p.y_H) for p in profiles if p.quantity == "mu_"),
        "reynolds": case.reynolds,
        "reynolds_effective": 1 / (1 / case.reynolds + means.eddy_viscosity),
        "cells_per_H": case.cells_per_H,
        "bulk_m_s": bulk,
        "flow_through": means.bulk,
        "develop_H_per_U": case.develop,
        "average_H_per_U": case.average,
    }
