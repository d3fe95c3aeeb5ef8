"""A target by name: a procedural coral, a mesh file, or one from outside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from wakewise.plugins import find, offered
from wakewise.targets.corals import coral, coral_kinds
from wakewise.targets.mesh import Mesh, load_mesh
from wakewise.targets.target import Target, place_on_bed

MeshMaker = Callable[[int], Mesh]
"""What a target from outside is made by: a seed to a mesh in a z-up frame, in metres, whose bed is at z = 0."""


def find_target(kind: str, bed_z_m: float, seed: int = 0, size_m: float | None = None) -> Target:
    """The target of that name, standing on the bed.

    Parameters
    ----------
    kind : str
        A procedural coral, the path of a mesh file, a name that an installed package offers (entry points
        `wakewise.targets`), or ``package.module:make``; see `MeshMaker`.
    bed_z_m : float
        Depth of the bed.
    seed : int
        Which individual of a procedural one.
    size_m : float, optional
        Scale a mesh file's largest extent to this.

    Raises
    ------
    InputError
        If there is no such target, or its file is not usable.
    """
    if kind in coral_kinds():
        return place_on_bed(kind, coral(kind, seed), bed_z_m)
    path = Path(kind).expanduser()
    if not path.exists() and (kind in offered("target") or ":" in kind):
        maker: MeshMaker = find("target", kind, {}).maker
        return place_on_bed(kind.rpartition(":")[2], maker(seed), bed_z_m)
    return place_on_bed(path.stem, load_mesh(path, size_m), bed_z_m)
