"""Worlds whose water answers thrust at once, everywhere: the paper's own, and the lattice's steady jets.

Water without memory: at each instant the velocity follows from the true thrusts at the true pose. Vehicle and sensors
are those of the tank.

- `paper`: v = sum of v_i by the paper's wake model. A planner that weighs the same model is judged by its own belief,
  so figures from here are *circular*. They tell what a method does with its freedom, not what water does. The gain is
  that of `paper-calibrated`: 0.036 of the printed one, which at 1 N is 85 cm/s at 0.1 m and 3.4 cm/s at 0.5 m on the
  axis, the published 60 and 5 cm/s in the geometric mean (the law falls by a factor of 25 over that range, the
  published speeds by 12).
- `lattice-jets`: each jet is the mean field that the lattice computed for it, several are joined by their momentum (see
  `wakewise.simulation.lattice.LatticeFlow`). It shares no law with tank or planner, but knows neither bed nor travel
  time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import (
    BodyState,
    Measurement,
    Plant,
    ScalarGrid,
    Truth,
    TruthProvider,
    WakeModel,
    WaterTruth,
)
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.lattice import LatticeFlow, MeanField, load_mean_field
from wakewise.simulation.tank import Sensors, TankSettings, VehiclePlant, build_ambient
from wakewise.simulation.tank.sensors import CameraJoint
from wakewise.simulation.tank.settings import PLANT_STEP_S
from wakewise.simulation.tank.water_truth import surface_points
from wakewise.wake import wake_model

_TOLERANCE_S = 1e-9
_PROBES = 300

Jets = Callable[[Array, Array, Array, Array, Array], Array]
"""`(points_W_m, origins_W_m, axes_W, thrusts_N, areas_m2) -> velocity`, shape (n, 3), of all jets together."""


def jets_of(wake: WakeModel) -> Jets:
    """Water that is what a wake model says: the sum of its jets."""

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


class QuasiSteadyWater:
    """A `Plant` and its own `TruthProvider`: plant and sensors of the tank, water without memory.

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
        self.settings = settings
        self._plant = VehiclePlant(
            vehicle,
            start,
            density_kg_m3=settings.density_kg_m3,
            ambient=build_ambient(settings, current_rng),
            size_m=settings.size_m,
            target_W_m=target.mesh.vertices_m,
        )
        self._sensors = Sensors(settings.sensors, sensor_rng)
        self._joint = CameraJoint(vehicle.tilt, tilt_rad, settings.sensors, sensor_rng.spawn(1)[0])
        self._jets = jets
        self._surface_W_m = surface_points(target, _PROBES, probe_rng)
        self._time = 0.0

    @property
    def state(self) -> BodyState:
        """True pose and twist."""
        return self._plant.state

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """Hold commanded thrusts, shape (n,), for dt_s; return what the sensors handed over."""
        end = self._time + dt_s
        while end - self._time > _TOLERANCE_S:
            stop = min(self._time + PLANT_STEP_S, end, self._sensors.next_due_s())
            self._plant.step(thrusts_N, max(stop - self._time, 0.0))
            self._time = max(stop, self._time)
            if self._sensors.next_due_s() - self._time < _TOLERANCE_S:
                self._sensors.sample(self._time, self._plant.vector, self._plant.force_B_m_s2)
        return self._sensors.collect(self._time) + self._joint.turn(self._time, dt_s)

    def push(self, wrench_B: Array) -> None:
        """A wrench from outside the water that acts until the next call; see `wakewise.core.interfaces.Plant`."""
        self._plant.push_B = np.array(wrench_B, dtype=np.float64)

    def aim(self, tilt_rad: float) -> None:
        """Wish an angle of the camera's joint; a fixed camera does not mind."""
        self._joint.aim(tilt_rad)

    def speeds_m_s(self, points_W_m: Array) -> Array:
        """Speed of the jets' water, shape (n,), at points, shape (n, 3)."""
        return np.asarray(np.linalg.norm(self.excess_velocity(points_W_m), axis=1))

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity of the jets' water at points, both shape (n, 3)."""
        origins, axes = self._plant.disks()
        return self._jets(points_W_m, origins, axes, self._plant.thrusts_N, self._plant.vehicle.disk_areas_m2)

    def observe(self) -> Truth:
        """Vehicle, thrusters and collisions now."""
        plant, thrusts = self._plant, self._plant.thrusts_N
        power = electrical_power_W(
            thrusts, plant.vehicle.disk_areas_m2, water_density_kg_m3=self.settings.density_kg_m3
        )
        return Truth(
            state=plant.state,
            thrusts_N=thrusts,
            power_W=float(power.sum()),
            collision=bool(plant.contact),
            tilt_rad=self._joint.tilt_rad,
        )

    def water(self) -> WaterTruth:
        """Water at the target's surface now."""
        speed = self.speeds_m_s(self._surface_W_m)
        return WaterTruth(
            target_speed_mean_m_s=float(speed.mean()),
            target_speed_p95_m_s=float(np.percentile(speed, 95)),
            bed_speed_p95_m_s=float("nan"),
            turbidity_per_m=0.0,
        )

    def silt(self) -> ScalarGrid:
        """None: the water is clear."""
        return ScalarGrid(origin_W_m=np.zeros(3), spacing_m=1.0, values=np.zeros((1, 1, 1)))


@dataclass(frozen=True, kw_only=True, eq=False)
class QuasiSteadyWorld:
    """`QuasiSteadyWater` that begins alike each time; implements `wakewise.core.interfaces.World`.

    Parameters as of `wakewise.simulation.tank.TankWorld`, and `jets`.
    """

    name: str
    jets: Jets
    vehicle: Vehicle
    target: Target
    settings: TankSettings
    start: BodyState
    draw: Callable[[], np.random.Generator]
    tilt_rad: float = 0.0

    def begin(self) -> tuple[Plant, TruthProvider | None]:
        """A fresh world at its start, which is plant and witness in one."""
        water = QuasiSteadyWater(
            self.jets, self.vehicle, self.target, self.settings, self.start, self.draw(), self.tilt_rad
        )
        return water, water


def paper_jets() -> Jets:
    """Water of the paper's own wake model, calibrated to its published speeds."""
    return jets_of(wake_model("paper-calibrated"))


@lru_cache(maxsize=1)
def free_jet_field() -> MeanField:
    """The lattice's mean field of a free jet."""
    return load_mean_field("free")
