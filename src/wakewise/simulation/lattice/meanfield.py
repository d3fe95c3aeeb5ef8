"""The mean field of one jet, averaged over time and around its axis: the table that ships, and its file."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.simulation.lattice.averages import around_axis
from wakewise.simulation.lattice.cases import case_hash, find_case
from wakewise.simulation.lattice.run import LatticeRun

DATA = Path(__file__).parent / "data"
"""Where the tables that ship with the package lie."""

SHIPPED: dict[str, int | None] = {"free": 7, "swirl": 7, "floor": None}
"""Cases whose tables ship, and the cells per diameter of the coarser grid that each is compared with."""

_STEP_D = 0.1  # of the stored tables, along x and r
_TABLES = ("pressure", "axial", "radial", "swirl", "axial_rms", "radial_rms", "swirl_rms")


@dataclass(frozen=True, kw_only=True, eq=False)
class MeanField:
    """Mean flow of a case about the axis of its first jet, in units of D, U0 = sqrt(T / (rho A)) and rho U0^2.

    Parameters
    ----------
    case : str
    hash : str
        `case_hash` of what was computed.
    cells_per_D : int
    x_D, r_D : ndarray, shapes (nx,) and (nr,)
        Evenly spaced; x = 0 is the disk, r = 0 the axis.
    pressure, axial, radial, swirl, axial_rms, radial_rms, swirl_rms : ndarray, shape (nx, nr)
        Means over time and angle, and root mean squares of what fluctuates about them. Swirl turns y into z, that is,
        right-handed about the jet.
    axis_times, axis_speeds : ndarray, shapes (nt,) and (nt, nx)
        The speed on the axis while the jet starts (and stops), at times in D / U0.
    floor_D : float
        Distance from the disk to a solid floor; infinite without one.
    figures : dict
        What was measured on the run: see `wakewise.simulation.lattice.laws`.
    """

    case: str
    hash: str
    cells_per_D: int
    x_D: Array
    r_D: Array
    pressure: Array
    axial: Array
    radial: Array
    swirl: Array
    axial_rms: Array
    radial_rms: Array
    swirl_rms: Array
    axis_times: Array
    axis_speeds: Array
    floor_D: float = math.inf
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


def mean_field(run: LatticeRun) -> MeanField:
    """Table of a run about the axis of its first jet, as far as the sponges."""
    case = run.case
    x, y, z = run.cell_centres_D()
    _, y0, z0 = case.jets[0].position_D
    last = case.high_D[0] - (0.0 if case.floor else case.sponge_D)
    first, end = round((case.low_D[0] + 1) / _STEP_D), round(last / _STEP_D)
    grid_x: Array = np.linspace(first * _STEP_D, end * _STEP_D, end - first + 1)
    grid_x = grid_x[(grid_x >= x[0]) & (grid_x <= x[-1])]
    reach = min(case.high_D[1] - y0, y0 - case.low_D[1], case.high_D[2] - z0, z0 - case.low_D[2])
    grid_r: Array = np.arange(int((reach - 0.5 / case.cells_per_D) / _STEP_D + 1e-9) + 1.0) * _STEP_D
    tables: dict[str, Any] = {}
    around = around_axis(run.means(), y - y0, z - z0, grid_r)

    def along(values: Array) -> Array:
        return np.stack([np.interp(grid_x, x, column) for column in values.T], axis=1)

    tables.update({name: along(values) for name, values in around.items()})
    times = np.array(run.axis_times)
    # One line per D / U0 tells the start; what comes after the flow has developed is turbulence.
    kept = np.searchsorted(times, np.arange(1.0, min(case.develop, times[-1]) + 20.0))
    kept = np.unique(kept[kept < len(times)])
    return MeanField(
        case=case.name,
        hash=case_hash(case),
        cells_per_D=case.cells_per_D,
        x_D=grid_x,
        r_D=grid_r,
        floor_D=case.high_D[0] if case.floor else math.inf,
        axis_times=times[kept],
        axis_speeds=along(np.array(run.axis_speeds)[kept].T).T,
        **tables,
    )


def save_mean_field(path: Path, table: MeanField) -> None:
    """Write a table in float32, in steps of 2^-16 so that it packs well, whole or not at all."""
    arrays: dict[str, Any] = {
        f.name: (np.round(getattr(table, f.name) * 65536) / 65536).astype(np.float32)
        for f in fields(table)
        if isinstance(getattr(table, f.name), np.ndarray)
    }
    plain = ("case", "hash", "cells_per_D", "figures")
    words: dict[str, Any] = {name: getattr(table, name) for name in plain}
    if math.isfinite(table.floor_D):
        words["floor_D"] = table.floor_D
    with whole_file(path) as temporary:
        np.savez_compressed(temporary, words=json.dumps(words, sort_keys=True), **arrays)


def read_mean_field(path: Path) -> MeanField:
    """Read what `save_mean_field` wrote.

    Raises
    ------
    InputError
        If the file is missing or no such table.
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
    """Mean field of a case by name, from the package's own data unless told otherwise.

    Raises
    ------
    InputError
        If there is no such case or file, or if the file was computed for other parameters or by another solver.
    """
    wanted = find_case(case)
    table = read_mean_field(folder / f"{case}.npz")
    if table.hash != case_hash(wanted):
        raise InputError(
            f"{folder / f'{case}.npz'}: computed for {table.hash}, the case is now {case_hash(wanted)}; "
            "compute it anew with tools/compute_lattice_fields.py"
        )
    return table
