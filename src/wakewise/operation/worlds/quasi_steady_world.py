"""Worlds with quasi-steady water: the paper's wake model, and steady jets of the lattice.

The velocity follows at each instant from the true thrusts at the true pose. Vehicle and sensors are those of the tank.

- `paper`: v = sum of v_i by the paper's wake model. A planner with the same model is evaluated by its own
  model, so these figures are *circular*: they show the method, not the water. The gain is
  that of `paper-calibrated`: 0.036 of the printed one, which at 1 N is 85 cm/s at 0.1 m and 3.4 cm/s at 0.5 m on the
  axis, the published 60 and 5 cm/s in the geometric mean (the law falls by a factor of 25 over that range, the
  published speeds by 12).
- `lattice-jets`: each jet is the mean field that the lattice computed for it, several are joined by their momentum (see
  `wakewise.simulation.lattice.LatticeFlow`). It shares no law with tank or planner, but knows neither bed nor travel
  time.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import (
    BodyState,
    WakeModel,
    WaterTruth,
)
from wakewise.operation.worlds.vehicle_in_water import VehicleInWater
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.lattice import LatticeFlow, MeanField, load_mean_field
from wakewise.simulation.tank import TankSettings, build_ambient
from wakewise.simulation.tank.water_truth import surface_points
from wakewise.wake import wake_model

_TOLERANCE_S = 1e-9
_PROBES = 300

Jets = Callable[[Array, Array, Array, Array, Array], Array]
"""`(points_W_m, origins_W_m, axes_W, thrusts_N, areas_m2) -> velocity`, shape (n, 3), of all jets together."""


def jets_of(wake: WakeModel) -> Jets:
    """Water by a wake model: the sum of its jets."""

    def velocity(points_W_m: Array, origins_W_m: Array, axes_W: Array, thrusts_N: Array, areas_m2: Array) -> Array:
        jets = -np.sign(thrusts_N)[:, None] * axes_W
        unit = wake.unit_velocity(points_W_m, origins_W_m, jets, areas_m2)
        return np.asarray(np.einsum("i,inx->nx", np.sqrt(np.abs(thrusts_N)), unit))

    return velocity


def lattice_jets(table: MeanField, density_kg_m3: float) -> Jets:
    """Water of the lattice's mean field of one jet, scaled and joined."""

    def velocity(points_W_m: Array, origins_W_m: Array, axes_W: Array, thrusts_N: Array, areas_m2: Array) -> Array:
        on = np.abs(thrusts_N) > 0.0
        if not on.any():
            return np.zeros((len(points_W_m), 3))
        flow = LatticeFlow(
            table=table,
            origins_W_m=origins_W_m[on],
            directions_W=-np.sign(thrusts_N[on])[:, None] * axes_W[on],
            thrusts_N=np.abs(thrusts_N[on]),
            areas_m2=areas_m2[on],
            density_kg_m3=density_kg_m3,
        )
        return flow.velocity(points_W_m)

    return velocity


class QuasiSteadyWater(VehicleInWater):
    """Plant and sensors of the tank, water without memory.

    `vehicle`: true parameters. `settings`: of which water and silt are not used. `rng`: its children serve sensors,
    probes and ambient water. `tilt_rad`: where the joint of the camera, if it has one, stands at the start.
    """

    def __init__(
        self,
        jets: Jets,
        vehicle: Vehicle,
        target: Target,
        settings: TankSettings,
        start: BodyState,
        rng: np.random.Generator,
        tilt_rad: float = 0.0,
    ) -> None:
        sensor_rng, probe_rng, current_rng = rng.spawn(3)
        super().__init__(vehicle, target, settings, start, sensor_rng, build_ambient(settings, current_rng), tilt_rad)
        self._jets = jets
        self._surface_W_m = surface_points(target, _PROBES, probe_rng)

    def speeds_m_s(self, points_W_m: Array) -> Array:
        """Speed of the jets' water, shape (n,), at points, shape (n, 3)."""
        return np.asarray(np.linalg.norm(self.excess_velocity(points_W_m), axis=1))

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity of the jets' water at points, both shape (n, 3)."""
        origins, axes = self._plant.disks()
        return self._jets(points_W_m, origins, axes, self._plant.thrusts_N, self._plant.vehicle.disk_areas_m2)

    def _advance_water(self) -> None:
        """Water without memory has nothing to advance."""

    def water(self) -> WaterTruth:
        """Water at the target's surface now."""
        speed = self.speeds_m_s(self._surface_W_m)
        return WaterTruth(
            target_speed_mean_m_s=float(speed.mean()),
            target_speed_p95_m_s=float(np.percentile(speed, 95)),
            bed_speed_p95_m_s=float("nan"),
            turbidity_per_m=0.0,
        )


def paper_jets() -> Jets:
    """Water of the paper's own wake model, calibrated to its published speeds."""
    return jets_of(wake_model("paper-calibrated"))


@lru_cache(maxsize=1)
def free_jet_field() -> MeanField:
    """The lattice's mean field of a free jet."""
    return load_mean_field("free")
