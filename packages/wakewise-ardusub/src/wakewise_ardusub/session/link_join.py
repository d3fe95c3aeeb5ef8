"""The parts of a flight, joined to the vehicle of a warden.

What ground stations are told of a flight: D, what is saved of it, how much of the target photographs have seen.

A rehearsal: the whole chain decides a few times for nobody, so that nothing is slow when thrusts count.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wakewise.allocation import disturbance_of, min_norm_allocation
from wakewise.control import make_pid, vehicle_layout
from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Goal, Measurement, TruthProvider
from wakewise.operation.loop import Step
from wakewise.operation.parts import Parts
from wakewise.operation.scenario import Scenario
from wakewise.operation.teleop.assisted import AssistedPilot, assisted
from wakewise.operation.teleop.input.controls import Controls
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.planning import Surroundings, check_start, state_of
from wakewise.scene.missions import Coverage, patches_of
from wakewise.scene.targets import Region, Target
from wakewise.wake import InfluenceModel
from wakewise_ardusub.link.ardusub_plant import ArduSubPlant, ArduSubWorld, FlightClock
from wakewise_ardusub.link.output_gate import OutputGate
from wakewise_ardusub.link.protocol import COVERAGE_NAME, DISTURBANCE_NAME, SAVED_NAME
from wakewise_ardusub.session.control_handover import (
    EngagedController,
    EngagedPilot,
    FlightOwnership,
    GroundStationInput,
    ServoEstimator,
)

FIGURES_S = 0.5
STILL_M_S = 1e-4
"""Root mean square speed at the points below which there is nothing to save."""


@dataclass(kw_only=True, eq=False)
class WashFigures:
    """D of the thrusts that act and what they save against the least ones, for ground stations; twice a second.

    `speeds_m_s` is the root mean square speed at the target's points of both, for people; None before any.
    """

    parts: Parts
    gate: OutputGate
    turn: FlightOwnership
    flown_N: Callable[[], Array]
    speeds_m_s: tuple[float, float] | None = None
    _due_s: float = -math.inf
    _covered_pct: float | None = None
    _coverage: Coverage | None = None

    def __call__(self, step: Step, witness: TruthProvider | None = None) -> None:  # noqa: ARG002  (as flights call it)
        """Reckon them anew, if it is time."""
        if step.time_s < self._due_s:
            return
        self._due_s = step.time_s + FIGURES_S
        engaged = self.turn.entry is not None
        thrusts = step.command.thrusts_N if engaged else self.flown_N()
        gram = self._view.gram(step.estimate.X_WB)
        if not np.isfinite(gram).all():
            return
        found = {DISTURBANCE_NAME: disturbance_of(gram, thrusts)}
        least = min_norm_allocation(self._layout, self._layout.B @ thrusts, gram).disturbance or 0.0
        weight = self._view.total_weight
        self.speeds_m_s = (math.sqrt(found[DISTURBANCE_NAME] / weight), math.sqrt(max(least, 0.0) / weight))
        if engaged and least > weight * STILL_M_S**2:
            found[SAVED_NAME] = 100.0 * (1.0 - found[DISTURBANCE_NAME] / least)
        if self._covered_pct is not None:
            found[COVERAGE_NAME] = self._covered_pct
        self.gate.figures = found

    def photographed(self, X_WC: Pose) -> None:
        """A photograph was taken from here; what it has seen is reckoned beside the flight."""
        self._beside.submit(self._see, X_WC)

    def _see(self, X_WC: Pose) -> None:
        target, before = self.parts.target, self._coverage
        if before is None:
            before = Coverage.begin(patches_of(target.mesh, target.bed_z_m))
        self._coverage = after = before.seen(X_WC, self.parts.camera)
        self._covered_pct = 100.0 * after.share

    def begin(self) -> None:
        """Reckon afresh at the next step."""
        self._due_s = -math.inf
        self.gate.figures = {}

    def __post_init__(self) -> None:
        self._view = InfluenceModel.of(self.parts.vehicle, self.parts.region, self.parts.wake)
        self._layout = vehicle_layout(self.parts.vehicle)
        self._beside = ThreadPoolExecutor(1, thread_name_prefix="coverage")


RATE_HZ = 10.0
"""Control steps a second; the autopilot's own loop goes on beneath."""
SEA = {
    "control.rate_hz": RATE_HZ,
    "calibration_error.target_position_m": 0.0,
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
    gate: OutputGate,
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
    turn, known = FlightOwnership(), gate.known
    place_z = float(start.X_WB.p_m[2])
    surface = np.array([[0.0, 0.0, 1.0, place_z - known.depth_m]]) if math.isfinite(known.depth_m) else np.zeros((0, 4))
    around = Surroundings(
        planes=surface,
        spheres=np.array([[*target.centre_W_m, target.radius_m]]),
        names=(*("the water surface",) * len(surface), "the target"),
    )

    def plant() -> ArduSubPlant:
        return ArduSubPlant(gate=gate, clock=clock(), wait=wait, entry=lambda: turn.entry)

    parts = Parts(scenario).replace(
        target=target, region=region, surroundings=around, start=start, world=ArduSubWorld(plant=plant)
    )
    check_start(parts.vehicle, region, state_of(start), around, what="here")
    if gate.target_W_m is None:
        gate.target_W_m = target.centre_W_m
    desk = OperatorState(OperatorSettings(mode="operator"))
    flown = assisted(parts, GroundStationInput(gate=gate), desk, OperatorSettings(mode="operator"))
    inner = flown.pilot
    if not isinstance(inner, AssistedPilot):
        raise InputError("pilot: only hands fly at sea")
    beside = EngagedPilot(inner=inner, gate=gate, turn=turn, photographed=photographed)
    rests = EngagedController(inner=flown.controller, turn=turn, thrusters=len(parts.vehicle.thrusters))
    told = ServoEstimator(inner=flown.estimator, turn=turn, flown_N=flown_N)
    whole = flown.replace(pilot=beside, controller=rests, estimator=told)
    return VehicleFlight(
        parts=whole,
        bare=parts,
        figures=WashFigures(parts=parts, gate=gate, turn=turn, flown_N=flown_N),
        desk=desk,
        turn=turn,
    )


class _WaitingWorld:
    """A world that waits for its controller: what takes long the first time is not cut short."""

    name, waits = "rehearsal", True

    def begin(self) -> Any:
        raise NotImplementedError  # nobody flies in it


class _MovingInput:
    """Sticks that are moved a little, for a rehearsal."""

    def read(self, time_s: float) -> Controls:  # noqa: ARG002
        return Controls(axes=np.array([0.0, 0.1, 0.1, 0.1, 0.0]))


def run_warm_up(sea: VehicleFlight, steps: int = 12) -> float:
    """Let the whole chain decide a few times for nobody, so that its kernels are there when thrusts count.

    Returns
    -------
    float
        The longest of the last steps, in s: what takes longer than a control period is not flown.
    """
    parts, start = sea.parts, sea.parts.start
    dt_s, layout = 1.0 / parts.control.rate_hz, vehicle_layout(parts.vehicle)
    chain = assisted(
        sea.bare.replace(world=_WaitingWorld()), _MovingInput(), OperatorState(), OperatorSettings(mode="operator")
    )
    resting = sea.parts.controller
    assert isinstance(resting, EngagedController)  # see `join.at_sea`
    flying, filtering, method = chain.pipeline, chain.estimator, resting.inner
    state, own, known, estimate, took_s = flying.init(), method.init(), filtering.init(start), start, 0.0
    for k in range(steps):
        began = time.perf_counter()
        goal = chain.pilot.goal(k * dt_s, estimate)
        state, command = flying.step(state, dt_s, estimate, goal)
        seen = Measurement(
            time_s=(k + 1) * dt_s,
            X_WB=start.X_WB,
            omega_B_rad_s=np.zeros(3),
            force_B_m_s2=np.array([0.0, 0.0, -GRAVITY_M_S2]),
        )
        known, estimate = filtering.step(known, dt_s, (seen,), command.thrusts_N)
        sea.figures(Step(time_s=k * dt_s, goal=goal, estimate=start, command=command, truth=None, solve_s=0.0))
        took_s = max(took_s, time.perf_counter() - began) if k >= steps // 2 else 0.0
        own, _ = method.step(own, dt_s, estimate, goal)  # what it keeps beside its state
    tracker = make_pid(parts.vehicle, parts.control)
    min_norm_allocation(layout, tracker.wrench(tracker.init(), dt_s, start, Goal(X_WB=start.X_WB))[1])
    sea.figures.begin()
    return took_s
