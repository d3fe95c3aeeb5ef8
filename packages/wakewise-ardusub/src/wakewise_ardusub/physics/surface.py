"""The water's surface for a vehicle behind a firmware: what rises above it is not carried, and pushes no water.

The hull is its box. The share of its height that is above z = 0 has lost its buoyancy, which acts at the centre of
buoyancy; a thruster gives the share of its disk's height that is below. An estimate: no waves, no splash, and drag and
added mass stay those of the whole hull.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.constants import GRAVITY_M_S2, TRIM_WATER_KG_M3
from wakewise.core.geometry import Pose
from wakewise.robot.vehicles import Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class WaterSurface:
    """The surface at z = 0 for one vehicle of n thrusters.

    Parameters
    ----------
    half_m : ndarray, shape (3,)
        Half of the hull's box.
    buoyancy_N : float
        Of the whole hull, at `p_BB_m`, shape (3,).
    p_BB_m : ndarray, shape (3,)
    disks_B_m : ndarray, shape (n, 3)
        Middles of the thrusters' disks, and their radii in `radii_m`, shape (n,).
    radii_m : ndarray, shape (n,)
    """

    half_m: Array
    buoyancy_N: float
    p_BB_m: Array
    disks_B_m: Array
    radii_m: Array

    def __post_init__(self) -> None:
        freeze(self, half_m=(3,), p_BB_m=(3,), disks_B_m=(len(self.radii_m), 3), radii_m=(len(self.radii_m),))

    @classmethod
    def of(cls, vehicle: Vehicle, density_kg_m3: float = TRIM_WATER_KG_M3) -> WaterSurface:
        """Of a vehicle in water of a density."""
        return cls(
            half_m=0.5 * np.asarray(vehicle.size_m),
            buoyancy_N=density_kg_m3 * GRAVITY_M_S2 * vehicle.displaced_volume_m3,
            p_BB_m=vehicle.p_BB_m,
            disks_B_m=vehicle.thruster_positions_B_m,
            radii_m=np.sqrt(vehicle.disk_areas_m2 / np.pi),
        )

    def emerged(self, X_WB: Pose) -> float:
        """Share of the hull's height that is above the water, 0 to 1."""
        reach = float(np.abs(X_WB.R[2]) @ self.half_m)
        return min(max((reach - float(X_WB.p_m[2])) / (2.0 * reach), 0.0), 1.0)

    def wrench_B(self, X_WB: Pose) -> Array:
        """Wrench of the buoyancy that is lost, in the body frame, shape (6,)."""
        force_B = self.emerged(X_WB) * self.buoyancy_N * X_WB.R[2]
        return np.concatenate([force_B, np.cross(self.p_BB_m, force_B)])

    def thrusts(self, thrusts_N: Array, X_WB: Pose) -> Array:
        """What thrusters that are partly above the water make of thrusts, both shape (n,)."""
        depths = float(X_WB.p_m[2]) + self.disks_B_m @ X_WB.R[2]
        return thrusts_N * np.clip((depths + self.radii_m) / (2.0 * self.radii_m), 0.0, 1.0)
