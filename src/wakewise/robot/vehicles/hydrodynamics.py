"""What the water adds to a moving body: added mass and damping, and other sets of damping that it may have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.checks import instance_of
from wakewise.core.errors import InputError

NOMINAL, RANDOM = "nominal", "random"
"""What a true vehicle's drag is called besides its cases by name: the controller's set, and one of all, drawn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Hydrodynamics:
    """Added mass and damping about the body origin, as positive magnitudes in Fossen's order.

    Order of rows and columns: surge, sway, heave, roll, pitch, yaw. The damping wrench on the vehicle is
    `-(linear_damping @ nu + quadratic_damping @ (abs(nu) * nu))` with the velocity relative to the water.

    `added_mass`, shape (6, 6): M_A in kg, kg m and kg m2; symmetric, positive semidefinite. `linear_damping`, shape (6,
    6): d_l in N s/m, N s and N m s; its symmetric part is positive semidefinite. `quadratic_damping`, shape (6, 6): d_q
    in N s2/m2 and N m s2; diagonal, since coupled quadratic terms may feed energy to the vehicle. Raises InputError if
    a matrix is not of the kind above, so that the water could do work on the vehicle.

    Source: T. I. Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley 2021, chapters 6, 8.
    """

    added_mass: Array
    linear_damping: Array
    quadratic_damping: Array

    def __post_init__(self) -> None:
        freeze(self, added_mass=(6, 6), linear_damping=(6, 6), quadratic_damping=(6, 6))
        require_added_mass(self.added_mass)
        require_linear_damping(self.linear_damping)
        require_quadratic_damping(self.quadratic_damping)

    @classmethod
    def diagonal(cls, *, added_mass: Array, linear_damping: Array, quadratic_damping: Array) -> Hydrodynamics:
        """Build from the three diagonals, each of shape (6,)."""
        return cls(
            added_mass=np.diag(added_mass),
            linear_damping=np.diag(linear_damping),
            quadratic_damping=np.diag(quadratic_damping),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class DragCase:
    """Another set of damping for a vehicle.

    `linear_damping`, `quadratic_damping`, shape (6, 6): as in `Hydrodynamics`. Raises InputError if the name is one
    that means something else, or a matrix could feed energy to the vehicle.
    """

    name: str
    source: str
    estimate: bool
    linear_damping: Array
    quadratic_damping: Array

    def __post_init__(self) -> None:
        instance_of(self.name, str, "drag_cases: name")
        instance_of(self.source, str, f"drag_cases.{self.name}: source")
        if self.name in (NOMINAL, RANDOM):
            raise InputError(f"drag_cases: {self.name} is not a name for a case, choose another")
        freeze(self, linear_damping=(6, 6), quadratic_damping=(6, 6))
        require_linear_damping(self.linear_damping)
        require_quadratic_damping(self.quadratic_damping)


def require_added_mass(matrix: Array) -> None:
    """Refuse an added mass, shape (6, 6), that is not symmetric and positive semidefinite."""
    scale = float(np.abs(matrix).max())
    if not np.allclose(matrix, matrix.T, rtol=0.0, atol=1e-9 * scale):
        raise InputError("added_mass: not symmetric, it must equal its transpose")
    _require_semidefinite("added_mass", matrix)


def require_linear_damping(matrix: Array) -> None:
    """Refuse a linear damping, shape (6, 6), that could feed energy to the vehicle."""
    _require_semidefinite("linear_damping", 0.5 * (matrix + matrix.T))


def require_quadratic_damping(matrix: Array) -> None:
    """Refuse a quadratic damping, shape (6, 6), that is not diagonal or has a negative entry."""
    diagonal = np.diag(matrix)
    if np.any(matrix != np.diag(diagonal)) or np.any(diagonal < 0.0):
        raise InputError(f"quadratic_damping: diagonal {diagonal.tolist()}, must be diagonal and at least 0")


def _require_semidefinite(name: str, matrix: Array) -> None:
    lowest = float(np.linalg.eigvalsh(matrix)[0])
    if lowest < -1e-9 * max(1.0, float(np.abs(matrix).max())):
        raise InputError(f"{name}: smallest eigenvalue {lowest:g}, all must be at least 0")
