"""Mean flow of two jets that cross: speed and width along the bisector behind the crossing.

Conservation of momentum along the bisector gives 2 cos(angle / 2) times the momentum of one jet (sqrt 2 at right
angles), and none across it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.simulation.lattice.cases import LatticeCase, case_hash
from wakewise_paper.lattice_reference.reference_cases import find_case
from wakewise_paper.lattice_reference.run import LatticeRun

DATA = Path(__file__).parent / "data"
"""Folder of the fields that ship with the package."""

AWAY_D = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Distances behind the crossing at which the mean flow is evaluated."""

_REACH_D = 4.0
_STEP_D = 0.05
_UP = np.array([0.0, 0.0, 1.0])


def _bisector(case: LatticeCase) -> tuple[Array, Array]:
    """Unit vectors along the bisector of a case's two jets and across it in their plane, from the first's side."""
    first, second = (np.array(jet.direction) for jet in case.jets)
    along, across = first + second, second - first
    return along / np.linalg.norm(along), across / np.linalg.norm(across)


def crossing_figures(run: LatticeRun) -> dict[str, Any]:
    """Mean flow on the bisector of two jets in a plane of constant z, at `AWAY_D` from where their axes cross.

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
    centre, means = crossing_place(run.case), run.means()[1:4]
    along, across = _bisector(run.case)
    out = np.arange(0.0, _REACH_D, _STEP_D)
    found: dict[str, list[float | None]] = {"speed": [], "half_height_D": [], "half_width_D": []}
    for away in AWAY_D:
        here = centre + away * along
        found["speed"].append(float(speeds_at(run, means, here[None], along)[0]))
        for name, side in (("half_height_D", _UP), ("half_width_D", across)):
            sides = [speeds_at(run, means, here + sign * out[:, None] * side, along) for sign in (1, -1)]
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
    case : str
    """

    hash: str
    cells_per_D: int
    away_D: Array
    out_D: Array
    along_above: Array
    out_above: Array
    along_beside: Array
    case: str = "crossing"

    def __post_init__(self) -> None:
        shape = len(self.away_D), len(self.out_D)
        freeze(self, away_D=(None,), out_D=(None,))
        freeze(self, along_above=shape, out_above=shape, along_beside=shape)

    def points_D(self) -> tuple[Array, Array]:
        """Where the flow is told, above the bisector and beside it, shapes (n, m, 3), from the crossing.

        In the axes of the case: those of `crossing` blow along +x and +y, the others have their bisector along x.
        """
        along, across = _bisector(find_case(self.case))
        on, out = self.away_D[:, None, None] * along, self.out_D[None, :, None]
        return on + out * _UP, on + out * across


def crossing_field(run: LatticeRun) -> CrossingField:
    """Mean flow behind the crossing of a run, which is as `crossing_figures` needs it."""
    centre, means = crossing_place(run.case), run.means()[1:4]
    along, across = _bisector(run.case)
    away, out = np.arange(0.5, 7.01, 0.5), np.arange(0.0, _REACH_D + 0.01, 0.25)
    shape = len(away), len(out)
    field = CrossingField(
        hash=case_hash(run.case),
        case=run.case.name,
        cells_per_D=run.case.cells_per_D,
        away_D=away,
        out_D=out,
        **dict.fromkeys(("along_above", "out_above", "along_beside"), np.zeros(shape)),
    )
    above, beside = (p.reshape(-1, 3) for p in field.points_D())
    down, swap = above * [1, 1, -1], beside - 2.0 * (beside @ across)[:, None] * across

    def mean(one: Array, other: Array, way: Array, way_there: Array) -> Array:
        both = speeds_at(run, means, centre + one, way), speeds_at(run, means, centre + other, way_there)
        return 0.5 * np.asarray(both[0] + both[1]).reshape(shape)

    return replace(
        field,
        along_above=mean(above, down, along, along),
        out_above=mean(above, down, _UP, -_UP),
        along_beside=mean(beside, swap, along, along),
    )


def save_crossing(path: Path, field: CrossingField) -> None:
    """Write a field in float32, whole or not at all."""
    names = ("away_D", "out_D", "along_above", "out_above", "along_beside")
    with whole_file(path) as temporary:
        np.savez_compressed(
            temporary,
            hash=field.hash,
            case=field.case,
            cells_per_D=field.cells_per_D,
            **{name: getattr(field, name).astype(np.float32) for name in names},
        )


def load_crossing(path: Path = DATA / "crossing.npz") -> CrossingField:
    """The field at right angles that ships with the package, or another: crossing-40.npz and crossing-110.npz ship too.

    Raises
    ------
    InputError
        If it was computed for another case or by another solver.
    """
    with np.load(path, allow_pickle=False) as data:
        arrays = {name: data[name] for name in data.files if name not in ("case", "hash", "cells_per_D")}
        case = str(data["case"]) if "case" in data.files else "crossing"  # which says no name
        field = CrossingField(case=case, hash=str(data["hash"]), cells_per_D=int(data["cells_per_D"]), **arrays)
    now = case_hash(find_case(field.case).resolved(field.cells_per_D))
    if field.hash != now:
        raise InputError(
            f"{path}: computed for {field.hash}, the case is now {now}; "
            f"compute it anew with tools/compute_lattice_fields.py {field.case}"
        )
    return field


def is_crossing(case: LatticeCase) -> bool:
    """Whether a case is two jets that cross in a plane of constant z."""
    if len(case.jets) != 2:
        return False
    one, two = (jet.direction for jet in case.jets)
    level = case.jets[0].position_D[2] == case.jets[1].position_D[2] and abs(one[2]) + abs(two[2]) == 0.0
    return level and abs(one[0] * two[1] - one[1] * two[0]) > 1e-6


def crossing_place(case: LatticeCase) -> Array:
    """Where the axes of a case's two jets cross, shape (3,)."""
    if not is_crossing(case):
        raise InputError(f"lattice case {case.name!r}: not two jets that cross in a plane, as the figures need")
    (x, y, z), (dx, dy) = case.jets[0].position_D, case.jets[0].direction[:2]
    (a, b, _), (ex, ey) = case.jets[1].position_D, case.jets[1].direction[:2]
    run = ((a - x) * ey - (b - y) * ex) / (dx * ey - dy * ex)
    return np.array([x + run * dx, y + run * dy, z])


def speeds_at(run: LatticeRun, means: Array, points_D: Array, direction: Array) -> Array:
    """Mean speed in a direction at points, shape (k,)."""
    cells = ((points_D - run.case.low_D) * run.case.cells_per_D - 0.5).T
    parts = [map_coordinates(mean, cells, order=1, cval=np.nan) for mean in means]
    return np.asarray(direction @ np.stack(parts))
