"""The parts of a flight, joined to the vehicle of a warden."""

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
from wakewise.operation.teleop.assisted import AssistedPilot, assisted
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.planning import Surroundings, check_start, state_of
from wakewise.scene.targets import Region, Target
from wakewise_ardusub.link.ardusub_plant import ArduSubPlant, ArduSubWorld, FlightClock
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.session.control_handover import (
    EngagedController,
    EngagedPilot,
    FlightOwnership,
    GroundStationInput,
    ServoEstimator,
)
from wakewise_ardusub.session.figures import WashFigures

RATE_HZ = 10.0
"""Control steps a second; the autopilot's own loop goes on beneath."""
SEA = {
    "control.rate_hz": RATE_HZ,
    "survey.place_m": 0.0,
    "estimation.position_std_m": 0.02,
    "estimation.attitude_std_rad": 0.02,
    "estimation.gyro_std_rad_s": 0.01,
    "estimation.accelerometer_std_m_s2": 0.3,
}
"""What a flight at sea has other than one in the tank: an autopilot's own estimate is no camera pose. Estimates."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VehicleFlight:
    """What flies at sea: the parts, what reckons the figures, the desk, and the parts without their warden."""

    parts: Parts
    bare: Parts
    figures: WashFigures
    desk: OperatorState
    turn: FlightOwnership = field(default_factory=FlightOwnership)


def join_vehicle(
    scenario: Scenario,
    warden: OutputGate,
    *,
    start: BodyState,
    target: Target,
    region: Region,
    clock: Callable[[], FlightClock],
    wait: Callable[[float], object],
    flown_N: Callable[[], Array],
    photographed: Callable[[], None],
) -> VehicleFlight:
    """Join a scenario's parts to the vehicle of a warden.

    Parameters
    ----------
    scenario : Scenario
        Vehicle, method and settings; its tank and world are not flown in.
    warden : OutputGate
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
        Called when the pilot or the mission takes a photograph.

    Raises
    ------
    InputError
        If the vehicle stands where no plan can be good, such as with the target inside its hull.
    """
    turn, known = FlightOwnership(), warden.known
    place_z = float(start.X_WB.p_m[2])
    surface = np.array([[0.0, 0.0, 1.0, place_z - known.depth_m]]) if math.isfinite(known.depth_m) else np.zeros((0, 4))
    around = Surroundings(
        planes=surface,
        spheres=np.array([[*target.centre_W_m, target.radius_m]]),
        names=(*("the water surface",) * len(surface), "the target"),
    )

    def plant() -> ArduSubPlant:
        return ArduSubPlant(warden=warden, clock=clock(), wait=wait, entry=lambda: turn.entry)

    parts = Parts(scenario).replace(
        target=target, region=region, surroundings=around, start=start, world=ArduSubWorld(plant=plant)
    )
    check_start(parts.vehicle, region, state_of(start), around, what="here")
    if warden.target_W_m is None:
        warden.target_W_m = target.centre_W_m
    desk = OperatorState(OperatorSettings(mode="operator"))
    flown = assisted(parts, GroundStationInput(warden=warden), desk, OperatorSettings(mode="operator"))
    inner = flown.pilot
    if not isinstance(inner, AssistedPilot):
        raise InputError("pilot: only hands fly at sea")
    beside = EngagedPilot(inner=inner, warden=warden, turn=turn, photographed=photographed)
    rests = EngagedController(inner=flown.controller, turn=turn, thrusters=len(parts.vehicle.thrusters))
    told = ServoEstimator(inner=flown.estimator, turn=turn, flown_N=flown_N)
    whole = flown.replace(pilot=beside, controller=rests, estimator=told)
    return VehicleFlight(
        parts=whole,
        bare=parts,
        figures=WashFigures(parts=parts, warden=warden, turn=turn, flown_N=flown_N),
        desk=desk,
        turn=turn,
    )
