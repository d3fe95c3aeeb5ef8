"""Mean flow of a jet that passes a solid box: its speed beside and behind the box, and its deflection towards it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.simulation.lattice.cases import LatticeCase, case_hash
from wakewise_paper.lattice_reference.crossing_jets import DATA, speeds_at
from wakewise_paper.lattice_reference.reference_cases import find_case
from wakewise_paper.lattice_reference.run import LatticeRun

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
