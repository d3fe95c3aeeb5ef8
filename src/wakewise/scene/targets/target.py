"""A target standing on the bed of the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError
from wakewise.scene.targets.mesh import Mesh


@dataclass(frozen=True, kw_only=True, eq=False)
class Target:
    """What must be photographed and stay undisturbed.

    Parameters
    ----------
    name : str
    mesh : Mesh
        In the world (NED, z down).
    centre_W_m : ndarray, shape (3,)
        Middle of the box round the part that stands above the bed.
    radius_m : float
        Of the smallest sphere about `centre_W_m` that holds the part above the bed.
    bed_z_m : float
        Depth of the bed; what of the mesh lies deeper is buried.
    """

    name: str
    mesh: Mesh
    centre_W_m: Array
    radius_m: float
    bed_z_m: float

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

    Parameters
    ----------
    name : str
    mesh_up : Mesh
        In a local z-up frame; its z = 0 is laid on the bed.
    bed_z_m : float
        Depth of the bed in the world.
    xy_m : array_like, shape (2,)
        Where the local origin goes.

    Raises
    ------
    InputError
        If nothing of the mesh stands above the bed.
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
