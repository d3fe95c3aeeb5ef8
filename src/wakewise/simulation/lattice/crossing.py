"""What two jets that cross become: speed and width along the bisector behind the crossing.

Momentum alone says: twice the cosine of half the angle, at right angles sqrt 2, times that of one jet, along the
bisector, and nothing sideways.

What a jet becomes that passes a solid box: how fast it is beside and behind it, and how far it is drawn to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.simulation.lattice.cases import LatticeCase, case_hash, find_case
from wakewise.simulation.lattice.meanfield import DATA
from wakewise.simulation.lattice.run import LatticeRun

AWAY_D = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""Distances behind the crossing at which the mean flow is looked at."""

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


_X_D = np.arange(1.0, 11.01, 0.5)
_Y_D = np.arange(0.0, 4.01, 0.25)
_Z_D = np.arange(-3.0, 5.51, 0.25)
_TABLES = ("along", "down", "beside")


@dataclass(frozen=True, kw_only=True, eq=False)
class DeflectedJetField:
    """Mean flow of a jet along x past a box below it, in units of D and U0; z is down and 0 on the jet's axis.

    Parameters
    ----------
    case, hash : str
        Name, and `case_hash` of what was computed.
    cells_per_D : int
    x_D, y_D, z_D : ndarray, shapes (n,), (k,) and (m,)
    along, down : ndarray, shape (n, m)
        Velocity along x and z in the plane y = 0; nothing inside the box.
    beside : ndarray, shape (n, k)
        Velocity along x in the plane z = 0, averaged over both sides.
    flux : ndarray, shape (n,)
        Of the mean flow's momentum along x through all that the tables reach, over the jet's thrust.
    """

    case: str
    hash: str
    cells_per_D: int
    x_D: Array
    y_D: Array
    z_D: Array
    along: Array
    down: Array
    beside: Array
    flux: Array

    def __post_init__(self) -> None:
        n, k, m = len(self.x_D), len(self.y_D), len(self.z_D)
        freeze(self, x_D=(None,), y_D=(None,), z_D=(None,), along=(n, m), down=(n, m), beside=(n, k), flux=(n,))

    def points_D(self) -> tuple[Array, Array]:
        """Where `along` and `beside` are told, from the middle of the disk, shapes (n, m, 3) and (n, k, 3)."""
        x = self.x_D[:, None, None]
        upright = x * [1, 0, 0] + self.z_D[:, None] * [0, 0, 1]
        return upright, x * [1, 0, 0] + self.y_D[:, None] * [0, 1, 0]

    def planes_D(self) -> Array:
        """Where the flux is summed, a quarter of a diameter apart, shape (n, 2 k - 1, m, 3)."""
        return _planes(self.x_D, self.y_D, self.z_D)

    def wet(self, points_D: Array) -> BoolArray:
        """Which of the points, shape (..., 3), are in the water and not in the box."""
        low, high = (np.array(corner) for corner in find_case(self.case).boxes_D[0])
        return np.asarray(np.any((points_D <= low) | (points_D >= high), axis=-1))


def past_field(run: LatticeRun) -> DeflectedJetField:
    """Mean flow of a run of one jet along x past one box below it.

    Raises
    ------
    InputError
        If the run's case is not such a jet.
    """
    if not is_past_box(run.case):
        raise InputError(f"lattice case {run.case.name!r}: not a jet past one box, as the figures need")
    means = run.means()[1:4]

    def seen(points_D: Array, way: tuple[int, int, int]) -> Array:
        found = speeds_at(run, means, points_D.reshape(-1, 3), np.array(way, dtype=float))
        return found.reshape(points_D.shape[:-1])

    upright = _X_D[:, None, None] * [1.0, 0, 0] + _Z_D[:, None] * [0, 0, 1.0]
    level = _X_D[:, None, None] * [1.0, 0, 0] + _Y_D[:, None] * [0, 1.0, 0]
    both = seen(level, (1, 0, 0)), seen(level * [1, -1, 1], (1, 0, 0))
    return DeflectedJetField(
        case=run.case.name,
        hash=case_hash(run.case),
        cells_per_D=run.case.cells_per_D,
        x_D=_X_D,
        y_D=_Y_D,
        z_D=_Z_D,
        along=seen(upright, (1, 0, 0)),
        down=seen(upright, (0, 0, 1)),
        beside=0.5 * (both[0] + both[1]),
        flux=momentum(seen(_planes(_X_D, _Y_D, _Z_D), (1, 0, 0)), _Y_D, _Z_D),
    )


def momentum(along: Array, y_D: Array, z_D: Array) -> Array:
    """Flux of momentum over thrust, shape (n,), of speeds over U0 on planes, shape (n, 2 k - 1, m)."""
    cell = (y_D[1] - y_D[0]) * (z_D[1] - z_D[0])
    return np.asarray((along * np.abs(along)).sum((1, 2)) * cell / (math.pi / 4))


def past_figures(field: DeflectedJetField, along: Array | None = None) -> dict[str, Any]:
    """Speed and place of the fastest water in the plane y = 0, at every whole diameter down the jet.

    Parameters
    ----------
    field : DeflectedJetField
    along : ndarray, shape (n, m), or None
        Speeds of another water at the field's places; None for the field's own. What it has in the box is left out.

    Returns
    -------
    dict
        x_D; fastest: over U0; drawn_D: how far below the jet's own axis it is; middle_D: how far below it the middle
        of the momentum in that plane is.
    """
    u = np.where(field.wet(field.points_D()[0]), np.maximum(field.along if along is None else along, 0.0), 0.0)
    whole = np.flatnonzero(np.abs(field.x_D - np.round(field.x_D)) < 1e-9)
    top = np.argmax(u, axis=1)[whole]
    # The vertex of the parabola through the fastest three: places are finer than the table.
    inner = np.clip(top, 1, u.shape[1] - 2)
    a, b, c = (u[whole, inner + k] for k in (-1, 0, 1))
    bend = a - 2 * b + c
    shift = np.where(np.abs(bend) > 1e-12, 0.5 * (a - c) / np.where(bend == 0, 1.0, bend), 0.0)
    step = field.z_D[1] - field.z_D[0]
    middle = (u[whole] ** 2 @ field.z_D) / (u[whole] ** 2).sum(1)
    return {
        "x_D": field.x_D[whole].tolist(),
        "fastest": u[whole].max(1).tolist(),
        "drawn_D": (field.z_D[inner] + step * np.clip(shift, -1, 1)).tolist(),
        "middle_D": middle.tolist(),
    }


def is_past_box(case: LatticeCase) -> bool:
    """Whether a case is one jet along x past one box."""
    return len(case.boxes_D) == 1 and [jet.direction for jet in case.jets] == [(1.0, 0.0, 0.0)]


def save_past_box(path: Path, field: DeflectedJetField) -> None:
    """Write a field in steps of 2^-14, so that it packs well, whole or not at all."""
    with whole_file(path) as temporary:
        np.savez_compressed(
            temporary,
            case=field.case,
            hash=field.hash,
            cells_per_D=field.cells_per_D,
            **{name: getattr(field, name).astype(np.float32) for name in ("x_D", "y_D", "z_D", "flux")},
            **{name: (np.round(getattr(field, name) * 16384) / 16384).astype(np.float32) for name in _TABLES},
        )


def load_past_box(name: str = "past-box", folder: Path = DATA) -> DeflectedJetField:
    """A field by the name of its case, `past-box` or `grazing-box`.

    Raises
    ------
    InputError
        If it was computed for another case or by another solver.
    """
    path = folder / f"{name}.npz"
    with np.load(path, allow_pickle=False) as data:
        arrays = {key: data[key] for key in data.files if key not in ("case", "hash", "cells_per_D")}
        field = DeflectedJetField(
            case=str(data["case"]), hash=str(data["hash"]), cells_per_D=int(data["cells_per_D"]), **arrays
        )
    now = case_hash(find_case(name).resolved(field.cells_per_D))
    if field.hash != now:
        raise InputError(
            f"{path}: computed for {field.hash}, the case is now {now}; "
            f"compute it anew with tools/compute_lattice_fields.py {name}"
        )
    return field


def _planes(x_D: Array, y_D: Array, z_D: Array) -> Array:
    """Points of planes across x, on both sides of y = 0, shape (n, 2 k - 1, m, 3)."""
    y = np.concatenate([-y_D[:0:-1], y_D])
    return np.stack(np.meshgrid(x_D, y, z_D, indexing="ij"), axis=-1)
