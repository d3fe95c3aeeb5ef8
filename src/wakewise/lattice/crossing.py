"""What two jets that cross at right angles become: speed and width along the bisector behind the crossing.

Momentum alone says: twice cos 45 deg, sqrt 2 times that of one jet, along the bisector, and nothing sideways.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from wakewise.arrays import Array, freeze
from wakewise.errors import InputError
from wakewise.files import whole_file
from wakewise.lattice.cases import case_hash, find_case
from wakewise.lattice.meanfield import DATA
from wakewise.lattice.run import LatticeRun

AWAY_D = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Distances behind the crossing at which the mean flow is looked at."""

_REACH_D = 4.0
_STEP_D = 0.05
_ALONG = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
_ACROSS = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
_UP = np.array([0.0, 0.0, 1.0])


def crossing_figures(run: LatticeRun) -> dict[str, Any]:
    """Mean flow on the bisector of a jet along +x and one along +y, at `AWAY_D` from where their axes cross.

    Returns
    -------
    dict
        speed: along the bisector, over U0. half_height_D and half_width_D: how far out of the jets' plane and in it
        half of that speed is found; None where it is not within 4 D or the box. rise: fastest speed out of the plane
        within 2 D of the crossing, over U0.

    Raises
    ------
    InputError
        If the run's case is not such a pair.
    """
    centre, means = _crossing_of(run), run.means()[1:4]
    out = np.arange(0.0, _REACH_D, _STEP_D)
    found: dict[str, list[float | None]] = {"speed": [], "half_height_D": [], "half_width_D": []}
    for away in AWAY_D:
        here = centre + away * _ALONG
        found["speed"].append(float(_speeds(run, means, here[None], _ALONG)[0]))
        for name, side in (("half_height_D", _UP), ("half_width_D", _ACROSS)):
            sides = [_speeds(run, means, here + sign * out[:, None] * side, _ALONG) for sign in (1, -1)]
            profile = np.mean(sides, axis=0)
            below = np.flatnonzero(profile < 0.5 * profile[0])
            found[name].append(float(out[below[0]]) if len(below) else None)
    x, y, z = (np.abs(c - m) for c, m in zip(run.cell_centres_D(), centre, strict=True))
    near = np.ix_(x < 2.0, y < 2.0, z < 2.0)
    return {"away_D": list(AWAY_D), **found, "rise": float(np.abs(means[2][near]).max())}


@dataclass(frozen=True, kw_only=True, eq=False)
class CrossingField:
    """Mean flow behind a crossing, in units of D and U0, averaged over both sides of the planes of symmetry.

    Parameters
    ----------
    hash : str
        `case_hash` of what was computed.
    cells_per_D : int
    away_D, out_D : ndarray, shapes (n,) and (m,)
        Distance behind the crossing along the bisector, and from the bisector.
    along_above, out_above : ndarray, shape (n, m)
        Speed along the bisector and out of the jets' plane, `out_D` above it.
    along_beside : ndarray, shape (n, m)
        Speed along the bisector, in the jets' plane, `out_D` beside it.
    """

    hash: str
    cells_per_D: int
    away_D: Array
    out_D: Array
    along_above: Array
    out_above: Array
    along_beside: Array

    def __post_init__(self) -> None:
        shape = len(self.away_D), len(self.out_D)
        freeze(self, away_D=(None,), out_D=(None,))
        freeze(self, along_above=shape, out_above=shape, along_beside=shape)

    def points_D(self) -> tuple[Array, Array]:
        """Where the flow is told, above the bisector and beside it, shapes (n, m, 3), from the crossing.

        The jets blow along +x and +y.
        """
        along, out = self.away_D[:, None, None] * _ALONG, self.out_D[None, :, None]
        return along + out * _UP, along + out * _ACROSS


def crossing_field(run: LatticeRun) -> CrossingField:
    """Mean flow behind the crossing of a run, which is as `crossing_figures` needs it."""
    centre, means = _crossing_of(run), run.means()[1:4]
    away, out = np.arange(0.5, 7.01, 0.5), np.arange(0.0, _REACH_D + 0.01, 0.25)
    shape = len(away), len(out)
    field = CrossingField(
        hash=case_hash(run.case),
        cells_per_D=run.case.cells_per_D,
        away_D=away,
        out_D=out,
        **dict.fromkeys(("along_above", "out_above", "along_beside"), np.zeros(shape)),
    )
    above, beside = (p.reshape(-1, 3) for p in field.points_D())
    down, flip, swap = above * [1, 1, -1], np.array([1.0, 1.0, -1.0]), beside[:, [1, 0, 2]]

    def mean(one: Array, other: Array, way: Array, way_there: Array) -> Array:
        both = _speeds(run, means, centre + one, way), _speeds(run, means, centre + other, way_there)
        return 0.5 * np.asarray(both[0] + both[1]).reshape(shape)

    return CrossingField(
        hash=field.hash,
        cells_per_D=field.cells_per_D,
        away_D=away,
        out_D=out,
        along_above=mean(above, down, _ALONG, _ALONG),
        out_above=mean(above, down, _UP, flip * _UP),
        along_beside=mean(beside, swap, _ALONG, _ALONG),
    )


def save_crossing(path: Path, field: CrossingField) -> None:
    """Write a field in float32, whole or not at all."""
    names = ("away_D", "out_D", "along_above", "out_above", "along_beside")
    with whole_file(path) as temporary:
        np.savez_compressed(
            temporary,
            hash=field.hash,
            cells_per_D=field.cells_per_D,
            **{name: getattr(field, name).astype(np.float32) for name in names},
        )


def load_crossing(path: Path = DATA / "crossing.npz") -> CrossingField:
    """The field that ships with the package, or another.

    Raises
    ------
    InputError
        If it was computed for another case or by another solver.
    """
    with np.load(path, allow_pickle=False) as data:
        arrays = {name: data[name] for name in data.files if name not in ("hash", "cells_per_D")}
        field = CrossingField(hash=str(data["hash"]), cells_per_D=int(data["cells_per_D"]), **arrays)
    now = case_hash(find_case("crossing").resolved(field.cells_per_D))
    if field.hash != now:
        raise InputError(
            f"{path}: computed for {field.hash}, the case is now {now}; "
            "compute it anew with tools/compute_lattice_fields.py crossing"
        )
    return field


def _crossing_of(run: LatticeRun) -> Array:
    """Where the axes of a jet along +x and one along +y cross, shape (3,)."""
    jets = run.case.jets
    if [(jet.axis, jet.along) for jet in jets] != [("x", 1), ("y", 1)]:
        raise InputError(f"lattice case {run.case.name!r}: not a jet along +x and one along +y, as the figures need")
    return np.array([jets[1].position_D[0], jets[0].position_D[1], jets[0].position_D[2]])


def _speeds(run: LatticeRun, means: Array, points_D: Array, direction: Array) -> Array:
    """Mean speed in a direction at points, shape (k,)."""
    cells = ((points_D - run.case.low_D) * run.case.cells_per_D - 0.5).T
    parts = [map_coordinates(mean, cells, order=1, cval=np.nan) for mean in means]
    return np.asarray(direction @ np.stack(parts))
