"""Simulated tank: vehicle, water, silt and sensors on one clock, and the water's speeds at the target; as a world.

Water and silt may advance on a second thread beside the vehicle. The module is long because one clock moves them all.
"""

from __future__ import annotations

import logging
import math
import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import (
    BodyState,
    FlakeCloud,
    Measurement,
    Plant,
    ScalarGrid,
    TargetDeformation,
    Truth,
    TruthProvider,
    WaterTruth,
)
from wakewise.robot.thrusters import electrical_power_W
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.targets import Target
from wakewise.simulation.tank.ambient import build_ambient, tank_water
from wakewise.simulation.tank.flakes import Flakes
from wakewise.simulation.tank.grains import STRESS_INTENSITY, Swell, speed_at_stress_m_s
from wakewise.simulation.tank.plant import VehiclePlant
from wakewise.simulation.tank.sediment import SHEAR_HEIGHT_M, Silt, SiltProperties
from wakewise.simulation.tank.sensors import CameraJoint, Sensors
from wakewise.simulation.tank.settings import MAX_SILT_PARTICLES, TankSettings
from wakewise.simulation.tank.soft_body import TargetCompliance, TargetMotion
from wakewise.simulation.tank.tether import Tether
from wakewise.simulation.tank.water_truth import TargetProbes, surface_points
from wakewise.simulation.water import AiryWave, AmbientSum
from wakewise.simulation.water.hullwake import HullPush
from wakewise.simulation.water.induction import cores, impulse_velocity
from wakewise.simulation.water.water import Water
from wakewise.simulation.water.water_snapshot import WaterSnapshot


class WorkerThread:
    """Does one piece of work after another, in the order in which they were given, on a thread of its own.

    Where there is one core only, or nothing is to be done `beside` who asked, each is done at once. Threads are shared
    by all lanes of a name, and the order of a lane's own pieces is kept among those of others; what a piece does must
    not depend on what others do meanwhile.
    """

    def __init__(self, name: str, beside: bool = True) -> None:
        self._name, self._beside = name, beside
        self._under_way: deque[Future[None]] = deque()

    def do(self, work: Callable[[], None]) -> None:
        """Take on a piece of work; what an earlier one raised is raised here or by `wait`."""
        while self._under_way and self._under_way[0].done():
            self._under_way.popleft().result()
        if cores() == 1 or not self._beside:
            work()
        else:
            self._under_way.append(_thread(self._name).submit(work))

    def wait(self) -> None:
        """Return once all of it is done; raise what a piece raised."""
        while self._under_way:
            self._under_way.popleft().result()


@cache
def _thread(name: str) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix=name)


# Threads do not survive a fork, where there is such a thing; the child starts its own.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_thread.cache_clear)


GRID_SPACING_M = 0.05
_GRID_HALF_M = 0.8
_GRID_HEIGHT_M = 1.0
_OUTER_SPACING_M, _OUTER_NODES = 0.2, 8000
_CONTACT_POINTS = 1500  # on the target, besides its vertices, so that a hull touches one
_SILT_STEP_S = 0.1  # longest step of the silt: a few cm of travel in the fastest wall jets
_STIRRING_SHARE = 0.4  # jets slower than this share of the threshold's speed are left out of the search for erosion
_TURBIDITY_EVERY_S = 1.0  # how often the camera's water is looked at for the loss of poses
_TIME_TOLERANCE_S = 1e-9
_SOON_S = 600.0

log = logging.getLogger(__name__)


class Tank:
    """The simulated world of a trial (a `Plant`); its truth is for the record and never for the controller.

    - `vehicle`: the plant's own parameters, which differ from the controller's model.
    - `target`: standing on the bed, at the tank's depth.
    - `rng`: its children serve water, silt, sensors and probes.
    - `tilt_rad`: where the joint of the camera, if it has one, stands at the start.
    - `yielding`: how the target gives way to the water; None of one that nothing moves.
    - `beside`: move water and silt on threads of their own, while the vehicle goes on. It pays where whoever calls
      `step` does little in between; a controller in Python and they would wait for each other's hold of the
      interpreter.

    Raises InputError if the vehicle starts in the floor, a wall, the air or the target, the target does not stand on
    the bed, or the settings' current, pump, cable or failures do not fit.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        target: Target,
        settings: TankSettings,
        start: BodyState,
        rng: np.random.Generator,
        tilt_rad: float = 0.0,
        yielding: TargetCompliance | None = None,
        beside: bool = True,
    ) -> None:
        depth = settings.size_m[2]
        if abs(target.bed_z_m - depth) > 1e-6:
            raise InputError(
                f"target {target.name}: stands on a bed at {target.bed_z_m:g} m, tank.size_m has {depth:g}"
            )
        water_rng, silt_rng, sensor_rng, probe_rng, current_rng = _streams(rng)
        self.settings = settings
        self.target = target
        self.ambient = build_ambient(settings, current_rng)
        more = surface_points(target, _CONTACT_POINTS, np.random.default_rng(0))
        self._plant = VehiclePlant(
            vehicle,
            start,
            density_kg_m3=settings.density_kg_m3,
            ambient=self.ambient,
            size_m=settings.size_m,
            target_W_m=np.concatenate([target.mesh.vertices_m, more]),
            failures=settings.failures,
            tether=Tether.of(settings),
        )
        self._water = tank_water(vehicle, target, settings, self.ambient, water_rng)
        silt = settings.silt
        laws = SiltProperties.of(
            silt.grain_m,
            silt.grain_density_kg_m3,
            settings.density_kg_m3,
            silt.erosion_kg_m2_s,
            silt.threshold_Pa,
            silt.erosion_law,
            settling_m_s=silt.settling_m_s,
            stress_intensity=STRESS_INTENSITY,
            firm_kg_m2=silt.consolidated_load_kg_m2,
        )
        self._swell = _swell(self.ambient, laws)
        self._silt = Silt(laws, silt.load_kg_m2, settings.size_m, MAX_SILT_PARTICLES, silt_rng, self._swell)
        self._silt.suspend(1e-3 * silt.suspended_mg_l, target.centre_W_m)
        _say_when_it_clears(settings, laws)
        self._stirring_speed = _STIRRING_SHARE * speed_at_stress_m_s(
            laws.threshold_Pa / settings.density_kg_m3, SHEAR_HEIGHT_M, laws.grain_m
        )
        self._sensors = Sensors(settings.sensors, sensor_rng)
        self._joint = CameraJoint(vehicle.tilt, tilt_rad, settings.sensors, self._sensors.joint_rng)
        self._probes = TargetProbes(target, probe_rng)
        self._flakes: Flakes | None = None  # drawn when first asked for
        self._flake_rng = probe_rng.spawn(1)[0]
        self._swaying = None
        if yielding is not None:
            self._swaying = TargetMotion(target, yielding, settings.density_kg_m3, self.ambient)
        self._time = 0.0
        self._flow_steps = 0
        self._silt_every = max(1, math.floor(_SILT_STEP_S / settings.flow_step_s + 1e-9))
        self._silt_middle = -(-self._silt_every // 2) % self._silt_every
        self._disks_before_m = self._plant.disks()[0]
        self._drag_before_N = self._plant.drag()[1]
        # The water at the disks is looked at once for each of its own steps.
        self._inflow = self.ambient.velocity(self._disks_before_m, 0.0) if settings.jets.inflow_loss else None
        self._muddy = self._silt.total_kg > 0.0
        self._touching = ""
        self._measured: WaterTruth | None = None
        self._water_lane, self._silt_lane = WorkerThread("water", beside), WorkerThread("silt", beside)
        self._turbidity_per_m = self._probes.turbidity_per_m(laws, self._silt_grid())

    @property
    def water(self) -> Water:
        """The water, as it is after its last step."""
        self._catch_up()
        return self._water

    @property
    def silt(self) -> Silt:
        """The silt, as it is after its last step."""
        self._catch_up()
        return self._silt

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle as it truly is."""
        return self._plant.vehicle

    @property
    def time_s(self) -> float:
        """Time since the start."""
        return self._time

    @property
    def state(self) -> BodyState:
        """True pose and twist."""
        return self._plant.state

    @property
    def thrusts_N(self) -> Array:
        """True force of each thruster, shape (n,)."""
        return self._plant.thrusts_N

    @property
    def power_W(self) -> float:
        """Estimated electrical power of all thrusters."""
        areas = self._plant.vehicle.disk_areas_m2
        return float(electrical_power_W(self.thrusts_N, areas, water_density_kg_m3=self.settings.density_kg_m3).sum())

    @property
    def collision(self) -> bool:
        """Whether the hull touched anything during the last step."""
        return bool(self._touching)

    @property
    def touching(self) -> str:
        """What it touched: "the floor", "a wall", "the target", or nothing."""
        return self._touching

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """Hold commanded thrusts, shape (n,), for dt_s; return what the sensors handed over, oldest sample first.

        Raises InputError if the commands do not match the thrusters or are not finite, or dt_s is not positive.
        """
        commands = np.asarray(thrusts_N, dtype=np.float64)
        n = len(self._plant.vehicle.thrusters)
        if commands.shape != (n,) or not np.all(np.isfinite(commands)):
            raise InputError(
                f"thrusts_N: shape {commands.shape} with values {commands.tolist()}, needs {n} finite ones"
            )
        if not (math.isfinite(dt_s) and dt_s > 0.0):
            raise InputError(f"dt_s: {dt_s:g}, must be finite and more than 0")
        end = self._time + dt_s
        self._touching = ""
        while end - self._time > _TIME_TOLERANCE_S:
            flow_due = (self._flow_steps + 1) * self.settings.flow_step_s
            self._advance(commands, min(end, flow_due, self._sensors.next_due_s()))
            if flow_due - self._time < _TIME_TOLERANCE_S:
                self._move_water()
        self._touching = self._touching or self._plant.touches()
        return self._sensors.collect(self._time) + self._joint.turn(self._time, dt_s)

    def push(self, wrench_B: Array) -> None:
        """A wrench from outside the water that acts until the next call; see `wakewise.core.interfaces.Plant`."""
        self._plant.push_B = np.array(wrench_B, dtype=np.float64)

    def aim(self, tilt_rad: float) -> None:
        """Command an angle of the camera's joint; without effect on a fixed camera."""
        self._joint.aim(tilt_rad)

    @property
    def tilt_rad(self) -> float:
        """True angle of the camera's joint, 0 where it is fixed."""
        return self._joint.tilt_rad

    def excess_velocity(self, points_W_m: Array) -> Array:
        """Velocity of the water less that of the same water without thrusters, shape (n, 3)."""
        return self.water.excess_velocity(points_W_m)

    def concentration_grid(self) -> ScalarGrid:
        """Silt in kg/m3 over 1.6 x 1.6 m about the target's foot, from the bed up to 1 m or the surface.

        Its outer grid is a coarser one of all the water: light comes from farther away than 0.8 m.
        """
        centre, depth = self.target.centre_W_m, self.settings.size_m[2]
        layers = int(min(_GRID_HEIGHT_M, depth) / GRID_SPACING_M + 1e-9) + 1
        across = 2 * round(_GRID_HALF_M / GRID_SPACING_M) + 1
        origin = np.array([centre[0] - _GRID_HALF_M, centre[1] - _GRID_HALF_M, depth - (layers - 1) * GRID_SPACING_M])
        return self.silt.concentration(origin, GRID_SPACING_M, (across, across, layers), self._outer_grid())

    def _outer_grid(self) -> ScalarGrid:
        """Silt in kg/m3 in all the water, on some 8,000 nodes no closer than 0.2 m."""
        length, width, depth = self.settings.size_m
        spacing = max(_OUTER_SPACING_M, (length * width * depth / _OUTER_NODES) ** (1 / 3))
        nx, ny, nz = (math.ceil(side / spacing - 1e-9) + 1 for side in (length, width, depth))
        origin = np.array([-length / 2, -width / 2, depth - (nz - 1) * spacing])
        return self.silt.concentration(origin, spacing, (nx, ny, nz))

    def flakes(self, X_WC: Pose) -> FlakeCloud:
        """Visible flakes before a camera now; the same ones each time, carried by the water meanwhile."""
        if self._flakes is None:
            self._flakes = Flakes(self.target.centre_W_m, self.settings.size_m[2], self.ambient, self._flake_rng)
        return self._flakes.before(X_WC, self._time, self.water)

    def measure(self) -> WaterTruth:
        """Speeds and turbidity at the target now; the water moves in steps, so it is computed once for each."""
        if self._measured is None:
            X_WC = self._plant.state.X_WB @ self._plant.vehicle.X_BC_at(self.tilt_rad)
            grid, density = self._silt_grid(), self.settings.density_kg_m3
            measured = self._probes.measure(
                self.water, self.silt.laws, grid, X_WC.p_m, density, self._swell, self._water.time_s
            )
            self._measured = replace(
                measured,
                silt_lifted_g=1e3 * self.silt.lifted_kg,
                silt_suspended_g=1e3 * self.silt.suspended_kg,
                bed_over_threshold=measured.bed_over_threshold if self._muddy else math.nan,
            )
        return self._measured

    def posture(self) -> TargetDeformation | None:
        """How a soft or a loose target stands after the water's last step; None of one that nothing moves."""
        self._catch_up()
        return None if self._swaying is None else self._swaying.posture()

    def _silt_grid(self) -> ScalarGrid | None:
        return self.concentration_grid() if len(self.silt.mass_kg) else None

    def _inflow_W_m_s(self) -> Array:
        """Velocity of the water at each disk without the free jet that its own thruster sends, shape (n, 3)."""
        origins, parcels = self._disks_before_m, self.water.parcels
        inflow = self.water.velocity(origins)
        for i in range(len(origins)):
            own = parcels.take(parcels.stream // 2 == i)
            inflow[i] -= impulse_velocity(origins[i : i + 1], own.position_m, own.impulse_m4_s, own.sigma_m)[0]
        return inflow

    def _advance(self, commands_N: Array, until_s: float) -> None:
        touched = self._plant.advance(commands_N, until_s, self._inflow)
        self._touching = self._touching or touched
        self._time = self._plant.time_s
        if self._sensors.next_due_s() - self._time < _TIME_TOLERANCE_S:
            self._sensors.sample(self._time, self._plant.vector, self._plant.force_B_m_s2, self._turbidity_per_m)

    def _move_water(self) -> None:
        """Send water and silt off on their steps; the vehicle goes on meanwhile, which neither of them feels.

        The silt follows the water's instant, which stays what it is while the water takes its next step.
        """
        origins, axes = self._plant.disks()
        dt_s, before, impulse_N_s = self.settings.flow_step_s, self._disks_before_m, self._plant.take_impulse_N_s()
        self._disks_before_m = origins
        hull = self._hull_push(dt_s) if self.settings.hull_wake else None
        self._flow_steps += 1
        self._measured = None
        silt_too = self._muddy and self._flow_steps % self._silt_every == self._silt_middle

        def move() -> None:
            self._water.step(dt_s, before, origins, axes, impulse_N_s, hull)
            if self._swaying is not None:
                self._swaying.step(self._water.now, dt_s)
            if silt_too:
                now = self._water.now
                self._silt_lane.do(lambda: self._move_silt(now))

        self._water_lane.do(move)
        if self._inflow is not None:
            self._inflow = self._inflow_W_m_s()
        if self._muddy and self._flow_steps % round(_TURBIDITY_EVERY_S / dt_s) == 0:
            self._turbidity_per_m = self._probes.turbidity_per_m(self.silt.laws, self._silt_grid())

    def _hull_push(self, dt_s: float) -> HullPush:
        """What the hull's drag did to the water since the last step of the water: the mean of its ends."""
        plant, before_N = self._plant, self._drag_before_N
        through, self._drag_before_N = plant.drag()
        return HullPush(
            p_WB_m=plant.vector[:3],
            R_WB=plant.R_WB,
            size_m=plant.vehicle.size_m,
            velocity_W_m_s=plant.R_WB @ plant.vector[7:10],
            through_W_m_s=through,
            impulse_W_N_s=0.5 * dt_s * (before_N + self._drag_before_N),
        )

    def _move_silt(self, now: WaterSnapshot) -> None:
        """Move the silt by its whole step with the water of the step's middle, which makes the step of second order."""
        circles = np.concatenate([now.stirred_bed(self._stirring_speed), self.ambient.stirred_bed()])
        self._silt.step(now, circles, self._silt_every * self.settings.flow_step_s)

    def _catch_up(self) -> None:
        """Wait for water and silt to have done their steps."""
        self._water_lane.wait()
        self._silt_lane.wait()


def tank_ambient(settings: TankSettings, rng: np.random.Generator) -> AmbientSum:
    """The water's own motion in a tank that is made with a generator like this one; the same draws."""
    return build_ambient(settings, _streams(rng)[-1])


def tank_points(target: Target, rng: np.random.Generator) -> Array:
    """Points on the target at which a tank that is made with a generator like this one is judged, shape (n, 3)."""
    return TargetProbes(target, _streams(rng)[3]).surface_W_m


def _streams(rng: np.random.Generator) -> list[np.random.Generator]:
    """Generators of water, silt, sensors, probes and the water's own motion."""
    return rng.spawn(5)


def _swell(ambient: AmbientSum, laws: SiltProperties) -> Swell | None:
    """The ambient water's wave over this bed, if there is one."""
    for part in ambient.parts:
        if isinstance(part, AiryWave):
            return Swell(wave=part, grain_m=laws.grain_m, density_kg_m3=laws.water_density_kg_m3)
    return None


def _say_when_it_clears(settings: TankSettings, laws: SiltProperties) -> None:
    """Warn that grains which are in the water at the start will not stay there."""
    clears_s = settings.size_m[2] / laws.settling_m_s
    if settings.silt.suspended_mg_l > 0.0 and clears_s < _SOON_S:
        log.warning(
            "tank.silt.suspended_mg_l %g: grains of %.3g mm sink %.1f mm/s and all lie on the bed after %.0f s",
            settings.silt.suspended_mg_l,
            1e3 * settings.silt.grain_m,
            1e3 * laws.settling_m_s,
            clears_s,
        )


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
    """A tank that begins alike each time; implements `wakewise.core.interfaces.World`."""

    vehicle: Vehicle  # true parameters
    target: Target
    settings: TankSettings
    start: BodyState  # where the vehicle really is when the flight begins
    # Gives the generator of all draws, a fresh one of the same seed at each call.
    draw: Callable[[], np.random.Generator]
    name: str = "tank"
    tilt_rad: float = 0.0  # where the camera's joint stands when the flight begins
    yielding: TargetCompliance | None = None  # how the target gives way; None of one that nothing moves

    def tank(self, beside: bool = True) -> Tank:
        """A new tank at its start; its water moves on a second thread if `beside`."""
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
        """A fresh tank at its start, as plant and truth provider."""
        tank = self.tank(beside=False)  # a flight has a controller
        return tank, TankTruth(tank=tank)
