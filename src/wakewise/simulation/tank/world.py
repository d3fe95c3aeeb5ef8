"""The tank as a world that a flight can begin in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import (
    BodyState,
    FlakeCloud,
    Plant,
    ScalarGrid,
    TargetDeformation,
    Truth,
    TruthProvider,
    WaterTruth,
)
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.tank.settings import TankSettings
from wakewise.simulation.tank.soft_body import TargetCompliance
from wakewise.simulation.tank.tank import Tank


@dataclass(frozen=True, kw_only=True, eq=False)
class TankTruth:
    """Reads the truth from the simulated tank, for the record."""

    tank: Tank

    def observe(self) -> Truth:
        """Vehicle, thrusters and collisions now."""
        tank = self.tank
        return Truth(
            state=tank.state,
            thrusts_N=tank.thrusts_N,
            power_W=tank.power_W,
            collision=tank.collision,
            tilt_rad=tank.tilt_rad,
        )

    def water(self) -> WaterTruth:
        """Water at the target now."""
        return self.tank.measure()

    def excess_velocity(self, points_W_m: Array) -> Array:
        """What the thrusters add to the water's velocity at points now, both shape (n, 3)."""
        return self.tank.excess_velocity(points_W_m)

    def silt(self) -> ScalarGrid:
        """Silt around the target now."""
        return self.tank.concentration_grid()

    def flakes(self, X_WC: Pose) -> FlakeCloud:
        """Visible flakes before a camera now."""
        return self.tank.flakes(X_WC)

    def posture(self) -> TargetDeformation | None:
        """How a soft or a loose target stands now; None of one that nothing moves."""
        return self.tank.posture()


@dataclass(frozen=True, kw_only=True, eq=False)
class TankWorld:
    """A tank that begins alike each time; implements `wakewise.core.interfaces.World`.

    Parameters
    ----------
    vehicle : Vehicle
        True parameters, known to nobody else.
    target : Target
    settings : TankSettings
    start : BodyState
        Where the vehicle really is when the flight begins.
    draw : callable
        Gives the generator of all draws, a fresh one of the same seed at each call.
    tilt_rad : float
        Where the camera's joint stands when the flight begins.
    yielding : Yielding, optional
        How the target gives way; None of one that nothing moves.
    """

    vehicle: Vehicle
    target: Target
    settings: TankSettings
    start: BodyState
    draw: Callable[[], np.random.Generator]
    name: str = "tank"
    tilt_rad: float = 0.0
    yielding: TargetCompliance | None = None

    def tank(self, beside: bool = True) -> Tank:
        """A fresh tank at its start, with all that it knows; its water moves `beside` the vehicle, or after it."""
        return Tank(
            self.vehicle,
            self.target,
            self.settings,
            self.start,
            self.draw(),
            self.tilt_rad,
            self.yielding,
            beside,
        )

    def begin(self) -> tuple[Plant, TruthProvider | None]:
        """A fresh tank at its start, as plant and witness."""
        tank = self.tank(beside=False)  # a flight has a controller
        return tank, TankTruth(tank=tank)
