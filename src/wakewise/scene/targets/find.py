"""A target by name: a procedural coral, a mesh file, or one from outside."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from wakewise.core.checks import finite_number, path_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.plugins import find, offered
from wakewise.core.settings import guess, seed_number
from wakewise.scene.targets.corals import coral, coral_kinds
from wakewise.scene.targets.mesh import Mesh, load_mesh
from wakewise.scene.targets.target import Target, place_on_bed

MeshMaker = Callable[[int], Mesh]
"""What a target from outside is made by: a seed to a mesh in a z-up frame, in metres, whose bed is at z = 0."""


def find_target(kind: str | Path, bed_z_m: float, seed: int = 0, size_m: float | None = None) -> Target:
    """The target of that name, standing on the bed.

    Parameters
    ----------
    kind : str or Path
        A procedural coral, the path of a mesh file, a name that an installed package offers (entry points
        `wakewise.scene.targets`), or ``package.module:make``; see `MeshMaker`.
    bed_z_m : float
        Depth of the bed, more than 0.
    seed : int
        Which individual of a procedural one, 0 to 2^63 - 1.
    size_m : float, optional
        Scale a mesh file's largest extent to this; a procedural one has its own size.

    Raises
    ------
    InputError
        If there is no such target, its file is not usable, or a number is none that it can have.
    """
    depth_m = finite_number(bed_z_m, "bed_z_m", above=0.0)
    name, mesh = find_mesh(kind, seed, size_m)
    return place_on_bed(name, mesh, depth_m)


def find_mesh(kind: str | Path, seed: int = 0, size_m: float | None = None) -> tuple[str, Mesh]:
    """Name and mesh of the same target, with z up and its bed at z = 0; as `find_target`."""
    individual = seed_number(seed)
    kind, path = _place(kind)
    if size_m is not None and (isinstance(size_m, bool) or not isinstance(size_m, (float, int))):
        raise InputError(f"size_m: {quoted(size_m)}, must be a number of metres")
    if not is_mesh_file(kind):
        if size_m is not None:
            raise InputError(f"target '{kind}': size_m {size_m:g} scales a mesh file, this one has its own size")
        if kind in coral_kinds():
            return kind, coral(kind, individual)
        maker: MeshMaker = find("target", kind, {}).maker
        return kind.rpartition(":")[2], maker(individual)
    if not path.exists() and path.name == kind and not path.suffix:
        known = [*coral_kinds(), *offered("target")]
        raise InputError(
            f"target '{kind}': unknown, {guess(kind, known)}allowed are {', '.join(known)}, or a mesh file"
        )
    return path.stem, load_mesh(path, size_m)


def is_mesh_file(kind: str | Path) -> bool:
    """Whether a target's name is taken as that of a mesh file, not of a procedural target or one from outside."""
    kind, path = _place(kind)
    if kind in coral_kinds():
        return False
    return path.exists() or not (kind in offered("target") or ":" in kind)


def _place(kind: str | Path) -> tuple[str, Path]:
    """A target's name as text, and the path that it is if it is one."""
    path = path_of(kind, "target")
    return kind if isinstance(kind, str) else str(path), Path(os.path.expanduser(path))  # noqa: PTH111  (never raises)
