"""A scenario's parts joined to a real vehicle: one flight, its target and the region that it protects."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState
from wakewise.operation.parts import Parts
from wakewise.operation.scenario import Scenario
from wakewise.operation.teleop.assisted import assisted_pilot, switched_controller
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.operation.teleop.region_methods import RegionMethods, region_methods
from wakewise.planning import Surroundings, check_start, state_of
from wakewise.scene.targets import Region, Target
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.session.camera_mount import MountControl
from wakewise_ardusub.session.engagement import (
    EngagedController,
    EngagedPilot,
    FlightOwnership,
    GroundStationInput,
    ServoEstimator,
)
from wakewise_ardusub.session.vehicle_plant import ArduSubPlant, ArduSubWorld, FlightClock
from wakewise_ardusub.session.wash_figures import WashFigures

RATE_HZ = 10.0
"""Control steps a second; the autopilot's own loop goes on beneath."""
SEA = {
    "control.rate_hz": RATE_HZ,
    "calibration_error.target_position_m": 0.0,
    "calibration_error.focal_length_pct": 0.0,
    "calibration_error.principal_point_pct": 0.0,
    "calibration_error.distortion": 0.0,
    "estimation.position_std_m": 0.02,
    "estimation.attitude_std_rad": 0.02,
    "estimation.gyro_std_rad_s": 0.01,
    "estimation.accelerometer_std_m_s2": 0.3,
}
"""What a flight at sea has other than one in the tank: an autopilot's own estimate is no camera pose, and errors are
those that there are. Estimates."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VehicleFlight:
    """What flies at sea: parts, wash figures, settings of the operator, and the parts without their output gate."""

    parts: Parts
    bare: Parts
    figures: WashFigures
    operator: OperatorState
    methods: RegionMethods
    turn: FlightOwnership = field(default_factory=FlightOwnership)

    @property
    def on_mission(self) -> bool:
        """Whether the mission flies, or was left and can be gone on with."""
        pilot = self.parts.pilot
        assert isinstance(pilot, EngagedPilot)  # see `join_vehicle`
        return self.operator.state.mode == "scan" or pilot.inner.mission_s > 0.0

    def retarget(self, parts: Parts, estimate: BodyState) -> None:
        """Fly by the target, region and surroundings of these parts from the next step on.

        The fence stays about the first target. Takes longer than a step: not to be called in a thread that flies.

        Raises
        ------
        InputError
            If the vehicle stands where no plan can be good, or what it flies cannot be made; nothing is changed then.
        """
        check_start(parts.vehicle, parts.region, state_of(estimate), parts.surroundings, what="here")
        pilot = self.parts.pilot
        assert isinstance(pilot, EngagedPilot)  # see `join_vehicle`
        made = region_methods(parts)
        pilot.inner.retarget(parts)
        self.methods.adopt(made)
        self.figures.retarget(parts)

    def protect(self, parts: Parts) -> None:
        """Protect the region of these parts from the next step on; mission, obstacles and coverage stay as they are."""
        self.methods.adopt(region_methods(parts))
        self.figures.protect(parts)


def surroundings_of_target(target: Target, surface: Array) -> Surroundings:
    """What is solid: the water's surface as planes, shape (k, 4), and a target's ball."""
    return Surroundings(
        planes=surface,
        spheres=np.array([[*target.centre_W_m, target.radius_m]]),
        names=(*("the water surface",) * len(surface), "the target"),
    )


def join_vehicle(
    scenario: Scenario,
    gate: OutputGate,
    *,
    start: BodyState,
    target: Target,
    region: Region,
    clock: Callable[[], FlightClock],
    wait: Callable[[float], object],
    flown_N: Callable[[], Array],
    photographed: Callable[[float, BodyState], None],
    mount: MountControl | None = None,
) -> VehicleFlight:
    """Join a scenario's parts to the vehicle of an output gate.

    Parameters
    ----------
    scenario : Scenario
        Vehicle, method and settings; its tank and world are not flown in.
    gate : OutputGate
    start : BodyState
        Where the vehicle is now.
    target : Target
        Where it is, in the autopilot's frame.
    region : Region
        The water to be spared.
    clock : callable
        Gives the flight's clock once the flight begins.
    wait : callable
        See `ArduSubPlant`.
    flown_N : callable
        What the thrusters give by the servos' pulses, shape (n,).
    photographed : callable
        Called when the pilot or the mission takes a photograph, with the time and the estimate of its step.
    mount : MountControl, optional
        The joint of its camera; by default the controller's vehicle has one that always obeys.

    Raises
    ------
    InputError
        If the vehicle stands where no plan can be good, such as with the target inside its hull.
    """
    turn, known = FlightOwnership(), gate.known
    place_z = float(start.X_WB.p_m[2])
    surface = np.array([[0.0, 0.0, 1.0, place_z - known.depth_m]]) if math.isfinite(known.depth_m) else np.zeros((0, 4))
    around = surroundings_of_target(target, surface)

    def plant() -> ArduSubPlant:
        return ArduSubPlant(gate=gate, clock=clock(), wait=wait, entry=lambda: turn.entry, mount=mount)

    parts = Parts(scenario)
    parts = parts.replace(
        vehicle=parts.vehicle if mount is None else mount.flown(parts.vehicle),
        target=target,
        region=region,
        surroundings=around,
        start=start,
        world=ArduSubWorld(plant=plant),
    )
    check_start(parts.vehicle, region, state_of(start), around, what="here")
    if gate.target_W_m is None:
        gate.target_W_m = target.centre_W_m
    operator = OperatorState(OperatorSettings(mode="operator"))
    if parts.finds:
        raise InputError("pilot: a session with a vehicle is flown by sticks only")
    inner = assisted_pilot(parts, GroundStationInput(gate=gate), operator, OperatorSettings(mode="operator"))
    flown = parts.replace(pilot=inner)
    methods = region_methods(flown)
    flown = flown.replace(controller=switched_controller(flown, lambda: inner.state.method, methods))
    beside = EngagedPilot(inner=inner, gate=gate, turn=turn, photographed=photographed, mount=mount)
    rests = EngagedController(inner=flown.controller, turn=turn, thrusters=len(parts.vehicle.thrusters))
    told = ServoEstimator(inner=flown.estimator, turn=turn, flown_N=flown_N)
    whole = flown.replace(pilot=beside, controller=rests, estimator=told)
    return VehicleFlight(
        parts=whole,
        bare=parts,
        figures=WashFigures(parts=parts, gate=gate, turn=turn, flown_N=flown_N),
        operator=operator,
        methods=methods,
        turn=turn,
    )
