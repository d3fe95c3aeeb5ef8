"""A vehicle with the sensors of the tank in clear water: base of the worlds that are not the tank."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, Measurement, ScalarGrid, Truth, WaterTruth
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.tank import Sensors, TankSettings, VehiclePlant
from wakewise.simulation.tank.sensors import CameraJoint
from wakewise.simulation.tank.settings import PLANT_STEP_S
from wakewise.simulation.water import AmbientSum

_TOLERANCE_S = 1e-9


class VehicleInWater(ABC):
    """A `Plant` and its own `TruthProvider`; subclasses add the water.

    `vehicle` has true parameters. Children of `rng` serve the sensors. `tilt_rad` is the initial angle of the camera's
    joint, if it has one.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        target: Target,
        settings: TankSettings,
        start: BodyState,
        rng: np.random.Generator,
        ambient: AmbientSum,
        tilt_rad: float,
    ) -> None:
        self.settings, self.target = settings, target
        self._plant = VehiclePlant(
            vehicle,
            start,
            density_kg_m3=settings.density_kg_m3,
            ambient=ambient,
            size_m=settings.size_m,
            target_W_m=target.mesh.vertices_m,
        )
        self._sensors = Sensors(settings.sensors, rng)
        self._joint = CameraJoint(vehicle.tilt, tilt_rad, settings.sensors, self._sensors.joint_rng)
        self._time = 0.0

    @property
    def state(self) -> BodyState:
        """True pose and twist."""
        return self._plant.state

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """Hold commanded thrusts, shape (n,), for dt_s; return the measurements that the sensors handed over."""
        end = self._time + dt_s
        while end - self._time > _TOLERANCE_S:
            stop = min(self._time + PLANT_STEP_S, end, self._sensors.next_due_s())
            self._plant.step(thrusts_N, max(stop - self._time, 0.0))
            self._time = max(stop, self._time)
            if self._sensors.next_due_s() - self._time < _TOLERANCE_S:
                self._sensors.sample(self._time, self._plant.vector, self._plant.force_B_m_s2)
        self._advance_water()
        return self._sensors.collect(self._time) + self._joint.turn(self._time, dt_s)

    @abstractmethod
    def _advance_water(self) -> None:
        """Advance the water to the time of the vehicle."""

    def push(self, wrench_B: Array) -> None:
        """A wrench from outside the water that acts until the next call; see `wakewise.core.interfaces.Plant`."""
        self._plant.push_B = np.array(wrench_B, dtype=np.float64)

    def aim(self, tilt_rad: float) -> None:
        """Command an angle of the camera's joint; without effect on a fixed camera."""
        self._joint.aim(tilt_rad)

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

    @abstractmethod
    def water(self) -> WaterTruth:
        """Water at the target now."""

    def silt(self) -> ScalarGrid:
        """None: the water is clear."""
        return ScalarGrid(origin_W_m=np.zeros(3), spacing_m=1.0, values=np.zeros((1, 1, 1)))


@dataclass(frozen=True, kw_only=True, eq=False)
class RepeatableWorld:
    """A `wakewise.core.interfaces.World` that begins alike each time.

    `make` puts the true vehicle into its water at the start; `draw` gives a fresh generator of the same seed at each
    call.
    """

    name: str
    vehicle: Vehicle
    make: Callable[[Vehicle, np.random.Generator], VehicleInWater]
    draw: Callable[[], np.random.Generator]

    def begin(self) -> tuple[VehicleInWater, VehicleInWater]:
        """Vehicle and water at their start, as plant and as truth provider."""
        water = self.make(self.vehicle, self.draw())
        return water, water
