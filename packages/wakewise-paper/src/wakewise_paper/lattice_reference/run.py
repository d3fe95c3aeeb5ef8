"""One lattice run: a box of water in which disks push, advanced step by step, with time averages."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.ndimage import map_coordinates

from wakewise.core.arrays import Array, IntArray, frozen
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_file
from wakewise.simulation.lattice.cases import AXES, DiskJet, LatticeCase, case_hash
from wakewise.simulation.lattice.stencil import OPEN, WALL, smagorinsky_factor
from wakewise_paper.lattice_reference.engines import make_engine, solid_cells

DISK_THICKNESS_D = 0.2
"""Thickness of the layer that the disk's force is spread over, the same on every grid."""

_SPONGE_VISCOSITY = 0.05
"""Viscosity at the end of the sponge over U0 D: three times a round jet's own eddy viscosity, 0.0135 U0 D."""


def _ramp(cells: int, low: float, high: float) -> Array:
    """From 0 to 1, as a square, over so many cells before either end of a line of cells with halo."""
    at = np.arange(cells + 2.0)
    out = np.zeros(cells + 2)
    for depth, gone in ((low, at), (high, at[::-1])):
        if depth:
            out = np.maximum(out, np.maximum(1 - gone / depth, 0) ** 2)
    return out


_PATCHES = 24
_PATCH_LIFE = 0.5  # D / U0
_RATIO = math.sqrt(2.0)  # disk over exit diameter


def _turned_frame(turn_deg: float) -> Array:
    """Rows: a disk's own axes, its jet's first, in the box's."""
    c, s = math.cos(math.radians(turn_deg)), math.sin(math.radians(turn_deg))
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def _shares(lines: list[Array], half: float, radius: float, frame: Array | None) -> Array:
    """Share of each cell that lies in a disk, from 8 x 8 x 8 points in it.

    `lines` are the points' places from the disk's middle along each axis of the box, `half` its half thickness.
    """
    if frame is None:
        inside_x = (np.abs(lines[0]) < half).reshape(-1, 8).mean(1)
        round_ = (lines[1][:, None] ** 2 + lines[2] ** 2 < radius**2).astype(float)
        face = round_.reshape(len(lines[1]) // 8, 8, len(lines[2]) // 8, 8).mean((1, 3))
        return np.asarray(inside_x[:, None, None] * face)
    along, one, two = np.einsum("ij,jxyz->ixyz", frame, np.stack(np.meshgrid(*lines, indexing="ij")))
    inside = (np.abs(along) < half) & (one**2 + two**2 < radius**2)
    shape = [k for line in lines for k in (len(line) // 8, 8)]
    return np.asarray(inside.reshape(shape).mean((1, 3, 5)))


class Disk:
    """The cells of one disk, their share of its force, and the slowly changing patches of its load."""

    def __init__(self, case: LatticeCase, jet: DiskJet, rng: np.random.Generator) -> None:
        n = case.cells_per_D
        # The jet's own axes, its own first; a turn of the box's, so that what is right-handed stays so.
        turn = np.roll(np.arange(3), -AXES.index(jet.axis))
        self._back = np.argsort(turn)
        self._frame = _turned_frame(jet.turn_deg)
        centre = ((np.array(jet.position_D) - case.low_D) * n)[turn]  # in cells from the low corner
        cells = np.array(case.cells)[turn]
        half = 0.5 * DISK_THICKNESS_D * n
        radius = 0.5 * _RATIO * n
        fine = (np.arange(8) + 0.5) / 8
        lines = []
        for axis, reach in enumerate(np.abs(self._frame.T) @ (half, radius, radius)):
            first, last = math.floor(centre[axis] - reach), math.ceil(centre[axis] + reach)
            if first < 1 or last > cells[axis] - 1:
                raise InputError(f"lattice case {case.name!r}: a disk reaches the box's edge, allowed inside only")
            lines.append((np.arange(first, last)[:, None] + fine).ravel() - centre[axis])
        share = _shares(lines, half, radius, self._frame if jet.turn_deg else None)
        where = np.argwhere(share > 0)
        self.jet = jet
        self.share = share[share > 0] / share.sum()
        start = np.array([round(line[0] + c - fine[0]) for line, c in zip(lines, centre, strict=True)])
        self.cells: IntArray = np.ascontiguousarray((where + start + 1)[:, self._back])  # with halo
        gaps = where + start + 0.5 - centre
        across = (gaps @ self._frame.T if jet.turn_deg else gaps)[:, 1:]
        # On a slant the cells' middle is not quite the disk's, and a twist about another place would push.
        about = across - self.share @ across if jet.turn_deg else across
        lever = np.sum(self.share * np.sum(about**2, axis=1))
        # Solid-body swirl: the force across grows with the radius and its moment is the torque.
        self.twist = jet.torque * n * about[:, ::-1] * (-1.0, 1.0) / lever * self.share[:, None]
        # Patches on a sunflower, so that they cover the disk evenly on every grid alike.
        k = np.arange(_PATCHES) + 0.5
        spots = (
            radius
            * np.sqrt(k / _PATCHES)[:, None]
            * np.stack([np.cos(k * math.pi * (3 - math.sqrt(5))), np.sin(k * math.pi * (3 - math.sqrt(5)))], axis=1)
        )
        gap = np.sum((across[:, None] - spots) ** 2, axis=2)
        patches = np.exp(-gap / (2 * (0.12 * n) ** 2))
        patches -= self.share @ patches  # the thrust itself stays as it is
        self.patches = patches / math.sqrt(float(self.share @ np.sum(patches**2, axis=1)))
        self.load = rng.standard_normal((_PATCHES, 3))

    def forces(self, total: float, unsteadiness: float, rng: np.random.Generator, age: float) -> Array:
        """Force on each cell, shape (k, 3), after the load has changed for `age` in D / U0."""
        keep = math.exp(-age / _PATCH_LIFE)
        self.load = keep * self.load + math.sqrt(1 - keep**2) * rng.standard_normal(self.load.shape)
        out = unsteadiness * (self.patches @ self.load) * self.share[:, None]
        out[:, 0] += self.jet.along * self.share
        out[:, 1:] += self.twist
        pushed = total * self.jet.strength * out
        return np.ascontiguousarray(pushed @ self._frame if self.jet.turn_deg else pushed[:, self._back])


class LatticeRun:
    """State of one run; `advance` moves it on and everything else looks at it.

    Speeds are given in U0, lengths in D and times in D / U0, as in the case.

    Parameters
    ----------
    case : LatticeCase
    device : str
        "cpu", "cuda" (a graphics card, which needs the extra `gpu`) or "auto": the card if there is one.
    """

    def __init__(self, case: LatticeCase, device: str = "cpu") -> None:
        self.case = case
        n, s = case.cells_per_D, case.lattice_speed / math.sqrt(max(jet.strength for jet in case.jets))
        self.speed = s
        """U0 in cells per step."""
        self.steps_done = 0
        self.samples = 0
        nx, ny, nz = case.cells
        along = _ramp(nx, n, 0.0 if case.floor else case.sponge_D * n)
        across = _ramp(ny, n, n)[:, None] + _ramp(nz, n, n)
        unit = 3 * _SPONGE_VISCOSITY * s * n
        tau_x = 0.5 + 3 * s * n / case.reynolds + unit * along
        faces = np.array([OPEN, WALL if case.floor else OPEN, OPEN, OPEN, OPEN, OPEN])
        solid = solid_cells(case)
        self._water = make_engine(device, tau_x, unit * across, smagorinsky_factor(case.smagorinsky), faces, solid)
        self._rng = np.random.default_rng(case.seed)
        self._disks = [Disk(case, jet, self._rng) for jet in case.jets]
        if any(solid[tuple((disk.cells - 1).T)].any() for disk in self._disks):
            raise InputError(f"lattice case {case.name!r}: a disk inside a solid box, allowed outside only")
        self.axis_times: list[float] = []
        self.axis_speeds: list[Array] = []

    @property
    def time(self) -> float:
        """Time since the start, in D / U0."""
        return self.steps_done * self.speed / self.case.cells_per_D

    @property
    def steps_total(self) -> int:
        """Steps until the end of averaging."""
        return self.steps_at(self.case.develop + self.case.average)

    def steps_at(self, time: float) -> int:
        """Step at which a time, in D / U0, is reached."""
        return math.ceil(time * self.case.cells_per_D / self.speed)

    def advance(self, steps: int) -> None:
        """Move on by so many steps.

        Raises
        ------
        StageError
            If the flow has blown up.
        """
        n = self.case.cells_per_D
        unit = math.pi / 4 * n**2 * self.speed**2  # T / rho in lattice units
        for _ in range(steps):
            pushes = [
                (disk.cells, disk.forces(unit, self.case.unsteadiness, self._rng, self.speed / n))
                for disk in self._disks
                if disk.jet.start <= self.time < disk.jet.stop
            ]
            self._water.advance(pushes)
            self.steps_done += 1
        _, ny, nz = self.case.cells
        if not np.isfinite(self._water.along_x(ny // 2, nz // 2)).all():
            raise StageError(f"lattice case {self.case.name!r}: the flow blew up before step {self.steps_done}")

    def field(self) -> np.ndarray:
        """Pressure over rho U0^2 and velocity over U0 of every cell, float32, shape (4, nx, ny, nz); a view."""
        field = self._water.field()
        field[0] /= 3 * self.speed**2
        field[1:] /= self.speed
        return field

    def cell_centres_D(self) -> tuple[Array, Array, Array]:
        """Where the cells are along x, y and z."""
        x, y, z = (
            low + (np.arange(m) + 0.5) / self.case.cells_per_D
            for low, m in zip(self.case.low_D, self.case.cells, strict=True)
        )
        return x, y, z

    def sample_velocity(self, points_D: Array) -> Array:
        """Velocity over U0 at points, both shape (k, 3), at this instant; linear between cells, still outside."""
        field = self.field()
        at = ((frozen(points_D, (None, 3), "points_D") - self.case.low_D) * self.case.cells_per_D - 0.5).T
        return np.stack([map_coordinates(field[i], at, order=1, cval=0.0) for i in (1, 2, 3)], axis=1)

    def snapshots(self, points_D: Array, every: float, count: int) -> Iterator[tuple[float, Array]]:
        """Time and velocity at points, `count` times at least `every` D / U0 apart; moves the run on.

        What a virtual camera needs: pass the points of a light sheet.
        """
        for _ in range(count):
            self.advance(max(1, self.steps_at(every)))
            yield self.time, self.sample_velocity(points_D)

    def watch(self) -> None:
        """Note the speed on the first jet's axis, and add to the averages once the flow has developed."""
        _, y, z = self.cell_centres_D()
        j, k = (int(np.searchsorted(c, p)) for c, p in zip((y, z), self.case.jets[0].position_D[1:], strict=True))
        self.axis_times.append(self.time)
        self.axis_speeds.append(self._water.along_x(j, k) / self.speed)
        if self.time >= self.case.develop:
            self._water.accumulate()
            self.samples += 1

    def means(self) -> Array:
        """Time averages, shape (8, nx, ny, nz): p, u, v, w, uu, vv, ww, vw in units of U0.

        Raises
        ------
        StageError
            If nothing has been averaged yet.
        """
        if not self.samples:
            raise StageError(f"lattice case {self.case.name!r}: no averages before {self.case.develop:g} D/U0")
        # Pressure, three velocities, four products of two.
        units = self.speed ** np.array([2.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0])
        units[0] *= 3
        return self._water.sums / (self.samples * units[:, None, None, None])

    def save(self, path: Path) -> None:
        """Write everything that `restored` needs, whole or not at all."""
        with whole_file(path) as temporary:
            np.savez(
                temporary,
                hash=case_hash(self.case),
                populations=self._water.populations,
                moments=self._water.sums,
                counts=(self.steps_done, self.samples),
                loads=np.stack([disk.load for disk in self._disks]),
                rng=json.dumps(self._rng.bit_generator.state),
                axis_times=self.axis_times,
                axis_speeds=np.array(self.axis_speeds),
            )

    @classmethod
    def restored(cls, case: LatticeCase, path: Path, device: str = "cpu") -> LatticeRun:
        """A run of `case` from where `save` left it, or from the start if the file is missing or of another case."""
        run = cls(case, device)
        if not path.exists():
            return run
        with np.load(path) as data:
            if str(data["hash"]) != case_hash(case) or "moments" not in data:
                return run
            run._water.restore(data["populations"], data["moments"])
            run.steps_done, run.samples = (int(c) for c in data["counts"])
            for disk, load in zip(run._disks, data["loads"], strict=True):
                disk.load = load
            run._rng.bit_generator.state = json.loads(str(data["rng"]))
            run.axis_times = list(data["axis_times"])
            run.axis_speeds = list(data["axis_speeds"])
        return run
