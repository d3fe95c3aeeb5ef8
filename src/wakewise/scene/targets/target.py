"""Target on the bed of the world, by name: a procedural coral, a mesh file, or one of a plug-in."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import finite_number, instance_of, path_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.plugins import make, offered
from wakewise.core.settings import guess, seed_number
from wakewise.scene.targets.corals import coral, coral_kinds
from wakewise.scene.targets.mesh import Mesh, load_mesh
from wakewise.scene.targets.reef import REEF, reef_patch


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """What must be photographed and stay undisturbed."""

    name: str
    mesh: Mesh  # in the world (NED, z down)
    centre_W_m: Array  # shape (3,): middle of the box round the part that stands above the bed
    radius_m: float  # of the smallest sphere about `centre_W_m` that holds the part above the bed
    bed_z_m: float  # depth of the bed; what of the mesh lies deeper is buried

    def __post_init__(self) -> None:
        freeze(self, centre_W_m=(3,))

    def moved(self, shift_W_m: Array) -> Target:
        """The same shape elsewhere, by a shift of shape (3,), on the same bed."""
        if not np.any(shift_W_m):
            return self
        mesh = Mesh(self.mesh.vertices_m + shift_W_m, self.mesh.faces)
        return replace(self, mesh=mesh, centre_W_m=self.centre_W_m + shift_W_m)


def place_on_bed(name: str, mesh_up: Mesh, bed_z_m: float, xy_m: Sequence[float] | Array = (0.0, 0.0)) -> Target:
    """Stand a mesh given in a z-up frame (bed at its z = 0) on the bed of the world.

    The frame is turned by pi about x, (x, y, z) to (x, -y, -z), which is a rotation and so mirrors nothing.

    - `mesh_up`: in a local z-up frame; its z = 0 is laid on the bed.
    - `bed_z_m`: depth of the bed in the world.
    - `xy_m`, shape (2,): where the local origin goes.

    Raises InputError if nothing of the mesh stands above the bed.
    """
    north, east = (float(v) for v in xy_m)
    vertices_W = mesh_up.vertices_m * np.array([1.0, -1.0, -1.0]) + np.array([north, east, bed_z_m])
    above = vertices_W[vertices_W[:, 2] < bed_z_m]
    if len(above) == 0:
        raise InputError(f"target {name}: no vertex stands above the bed at {bed_z_m:g} m depth")
    low = above.min(axis=0)
    high = np.append(above[:, :2].max(axis=0), bed_z_m)
    centre = 0.5 * (low + high)
    return Target(
        name=name,
        mesh=Mesh(vertices_W, mesh_up.faces),
        centre_W_m=centre,
        radius_m=float(np.max(np.linalg.norm(above - centre, axis=1))),
        bed_z_m=float(bed_z_m),
    )


def find_target(kind: str | Path, bed_z_m: float, seed: int = 0, size_m: float | None = None) -> Target:
    """The target of that name, standing on the bed.

    - `kind`: a procedural coral, the path of a mesh file, a name that an installed package offers (entry points
      `wakewise.targets`), or ``package.module:make``. The last two stand for what makes a `Mesh` from a seed, with z
      up, in metres, and its bed at z = 0.
    - `bed_z_m`: depth of the bed, more than 0.
    - `seed`: which individual of a procedural one, 0 to 2^63 - 1.
    - `size_m`: scale a mesh file's largest extent to this; a procedural one has its own size.

    Raises InputError if there is no such target, its file is not usable, or a number is none that it can have.
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
        if kind in procedural_kinds():
            return kind, reef_patch(individual) if kind == REEF else coral(kind, individual)
        mesh = make("target", kind, {}, individual, checked=lambda made: instance_of(made, Mesh, "what it gave"))
        return kind.rpartition(":")[2], mesh
    if not path.exists() and path.name == kind and not path.suffix:
        known = [*procedural_kinds(), *offered("target")]
        raise InputError(
            f"target '{kind}': unknown, {guess(kind, known)}allowed are {', '.join(known)}, or a mesh file"
        )
    return path.stem, load_mesh(path, size_m)


def procedural_kinds() -> list[str]:
    """Kinds that are made and not read from a file: corals, and a patch of reef."""
    return [*coral_kinds(), REEF]


def is_mesh_file(kind: str | Path) -> bool:
    """Whether a target's name is taken as that of a mesh file, not of a procedural target or one from outside."""
    kind, path = _place(kind)
    if kind in procedural_kinds():
        return False
    return path.exists() or not (kind in offered("target") or ":" in kind)


def _place(kind: str | Path) -> tuple[str, Path]:
    """A target's name as text, and the path that it is if it is one."""
    path = expanded = path_of(kind, "target")
    with contextlib.suppress(RuntimeError):  # a user without a home keeps the tilde
        expanded = path.expanduser()
    return kind if isinstance(kind, str) else str(path), expanded
