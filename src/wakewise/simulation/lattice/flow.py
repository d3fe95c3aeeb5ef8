"""Jets of given thrusters, looked up in a mean field of the lattice: a steady `Flow` for models to be held against."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.errors import InputError
from wakewise.simulation.lattice.meanfield import MeanField


@dataclass(frozen=True, kw_only=True, eq=False)
class LatticeFlow:
    """Steady jets in still water, each the scaled mean field of one.

    One jet is an exact look-up of the lattice's table. Several are joined by momentum, as parallel jets join far away
    (two equal ones give sqrt 2 times the speed of one, not twice): with w = sum_j |u_j| u_j the velocity is
    w / sqrt(|w|). What the lattice shows of jets that meet head-on or cross, the flow sideways, this sum does not have;
    there, compute the case itself.

    Raises InputError if shapes disagree, a thrust is negative, an area is not positive or a direction has no length.
    """

    table: MeanField
    # origins_W_m, directions_W: shape (m, 3): centre of each disk, and where its jet blows (opposite to the force on
    # the vehicle); scaled to unit length.
    origins_W_m: Array
    directions_W: Array
    thrusts_N: Array  # shape (m,): magnitudes; a thruster in reverse has its direction turned
    areas_m2: Array  # shape (m,): disk areas, which are the areas of the ducted exits
    # Shape (m,): +1 where the table's swirl is as it is, right-handed about the jet, -1 where the screw turns the other
    # way.
    turns: Array | None = None
    density_kg_m3: float = FRESH_WATER_KG_M3

    def __post_init__(self) -> None:
        if self.turns is None:
            object.__setattr__(self, "turns", np.ones(len(self.thrusts_N)))
        m = len(self.thrusts_N)
        freeze(self, origins_W_m=(m, 3), directions_W=(m, 3), thrusts_N=(m,), areas_m2=(m,), turns=(m,))
        if np.any(self.thrusts_N < 0):
            raise InputError(f"thrusts_N: {self.thrusts_N.min():g}, allowed 0 or more; turn the direction for reverse")
        if np.any(self.areas_m2 <= 0):
            raise InputError(f"areas_m2: {self.areas_m2.min():g}, allowed above 0")
        length = np.linalg.norm(self.directions_W, axis=1)
        if np.any(length < 1e-9):
            raise InputError("directions_W: a direction has no length, every jet needs one")
        unit = self.directions_W / length[:, None]
        unit.setflags(write=False)
        object.__setattr__(self, "directions_W", unit)

    @property
    def exit_speeds_m_s(self) -> Array:
        """U0 = sqrt(T / (rho A)) of each jet, shape (m,)."""
        return np.sqrt(self.thrusts_N / (self.density_kg_m3 * self.areas_m2))

    def _cylinder(self, points_W_m: Array, j: int) -> tuple[Array, Array, Array, Array]:
        """Distance along and across the jet in diameters, and unit vectors outwards and around, of each point."""
        diameter = np.sqrt(4 * self.areas_m2[j] / np.pi)
        away = (points_W_m - self.origins_W_m[j]) / diameter
        axis = self.directions_W[j]
        x = away @ axis
        across = away - x[:, None] * axis
        r = np.linalg.norm(across, axis=1)
        outwards = across / np.maximum(r, 1e-12)[:, None]
        return x, r, outwards, np.cross(axis, outwards)

    def jet_velocities(self, points_W_m: Array) -> Array:
        """Velocity of each jet alone in m/s, shape (m, n, 3), at points, shape (n, 3)."""
        turns = np.asarray(self.turns)
        out = np.zeros((len(self.thrusts_N), len(points_W_m), 3))
        for j, speed in enumerate(self.exit_speeds_m_s):
            x, r, outwards, around = self._cylinder(points_W_m, j)
            axial, radial, swirl = self.table.at(x, r)
            out[j] = speed * (
                axial[:, None] * self.directions_W[j] + radial[:, None] * outwards + turns[j] * swirl[:, None] * around
            )
        return out

    def velocity(self, points_W_m: Array) -> Array:
        """Velocity in m/s at points, both shape (n, 3)."""
        u = self.jet_velocities(points_W_m)
        if len(u) == 1:
            return u[0]
        momentum = np.sum(np.linalg.norm(u, axis=2, keepdims=True) * u, axis=0)
        return momentum / np.sqrt(np.maximum(np.linalg.norm(momentum, axis=1, keepdims=True), 1e-30))

    def fluctuation_m_s(self, points_W_m: Array) -> Array:
        """Rms of the turbulent velocity in m/s, each component's share taken equal, shape (n,) at points (n, 3).

        Variances of several jets add. For particle images: add a random velocity of this size to `velocity`.
        """
        variance = np.zeros(len(points_W_m))
        for j, speed in enumerate(self.exit_speeds_m_s):
            x, r, _, _ = self._cylinder(points_W_m, j)
            rms = self.table.at(x, r, ("axial_rms", "radial_rms", "swirl_rms"))
            variance += speed**2 * np.mean(rms**2, axis=0)
        return np.sqrt(variance)
