"""Mean field of one jet, averaged over time and around its axis: the table that ships, and its file."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.simulation.lattice.cases import case_hash, find_case

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
    """Mean field of a case by name, from the package's own data unless told otherwise.

    Raises InputError if there is no such case or file, or if the file was computed for other parameters or by another
    solver.
    """
    wanted = find_case(case)
    table = read_mean_field(folder / f"{case}.npz")
    if table.hash != case_hash(wanted):
        raise InputError(
            f"{folder / f'{case}.npz'}: computed for {table.hash}, the case is now {case_hash(wanted)}; "
            "compute it anew with tools/compute_lattice_fields.py"
        )
    return table
