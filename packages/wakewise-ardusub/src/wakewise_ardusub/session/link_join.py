"""Parts of a flight joined to a real vehicle: plant, pilot, controller, estimator, wash figures and warm-up.

`ArduSubPlant` passes thrusts to the output gate and returns the measurements since. A step waits until shortly before
the flight's clock has reached its end: the estimator processes the measurements meanwhile, so that the next thrusts are
computed on time from data that are nearly as fresh as possible. The gate decides whether thrusts are sent.

`LinkThread` receives messages and ticks the gate. `FlightOwnership` records who flies, the pilot or the controller,
once for each step; `EngagedPilot`, `EngagedController` and `ServoEstimator` act on it. `WashFigures` are the values for
ground stations: D, savings and coverage. `run_warm_up` runs the whole chain a few times without output, so that the
first real step is not slow.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from wakewise.allocation import disturbance_of, min_norm_allocation
from wakewise.control import make_pid, vehicle_layout
from wakewise.core.arrays import Array
from wakewise.core.constants import GRAVITY_M_S2
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import BodyState, Command, Controller, Estimator, Goal, Measurement, TruthProvider
from wakewise.operation.loop import Step
from wakewise.operation.parts import Parts
from wakewise.operation.scenario import Scenario
from wakewise.operation.teleop.assisted import AssistedPilot, assisted, assisted_pilot, switched_controller
from wakewise.operation.teleop.input.controls import CENTRED, Controls
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.operation.teleop.region_methods import RegionMethods, region_methods
from wakewise.planning import Surroundings, check_start, state_of
from wakewise.scene.missions import Coverage, patches_of
from wakewise.scene.targets import Region, Target
from wakewise.wake import InfluenceModel
from wakewise_ardusub.link.message_state import MavlinkMessage
from wakewise_ardusub.link.output_gate import RELEASES, TICK_S, OutputGate
from wakewise_ardusub.link.protocol import COVERAGE_NAME, DISTURBANCE_NAME, SAVED_NAME
from wakewise_ardusub.session.camera_mount import MountControl

EARLY = 0.1
"""Share of a step by which measurements are handed over before its end: 10 ms at 10 Hz, where a filter takes 4."""


class FlightClock(Protocol):
    """When moments of a flight are by the computer's clock, which is also the output gate's."""

    def due_s(self, time_s: float) -> float:
        """The computer's time at which `time_s` of the flight has come."""
        ...


@dataclass(kw_only=True, eq=False)
class ArduSubPlant:
    """The vehicle of an output gate; implements `wakewise.core.interfaces.Plant`.

    Parameters
    ----------
    gate : OutputGate
    clock : FlightClock
    wait : callable
        Waits so many seconds, or less where there is nothing to wait for any more.
    entry : callable
        In which engagement the controller decided what it hands over; None: in none, and nothing is sent.
    mount : MountControl, optional
        The joint of its camera.
    """

    gate: OutputGate
    clock: FlightClock
    wait: Callable[[float], object]
    entry: Callable[[], int | None]
    mount: MountControl | None = None
    _time_s: float = 0.0

    def aim(self, tilt_rad: float) -> None:
        """Turn the camera's joint while engaged."""
        if self.mount is not None:
            entry = self.entry()
            self.mount.ask(tilt_rad, engaged=entry is not None and entry == self.gate.entry)

    def step(self, thrusts_N: Array, dt_s: float) -> tuple[Measurement, ...]:
        """Send thrusts, shape (n,), if they may be, and return what was measured until they are nearly due again."""
        entry = self.entry()
        if entry is not None:
            self.gate.command(thrusts_N, entry)
        self._time_s += dt_s
        left_s = self.clock.due_s(self._time_s) - EARLY * dt_s - self.gate.clock()
        if left_s > 0.0:
            self.wait(left_s)
        begun_s, mount = self.clock.due_s(0.0), self.mount
        tilt_rad = mount.angle_rad if mount is not None and mount.reported else None
        return tuple(
            replace(found, time_s=found.time_s - begun_s, tilt_rad=tilt_rad) for found in self.gate.measurements()
        )


@dataclass(kw_only=True, eq=False)
class ArduSubWorld:
    """Where a real vehicle flies; implements `wakewise.core.interfaces.World`. It does not wait and has no truth.

    `plant` is what makes the plant when a flight begins.
    """

    plant: Callable[[], ArduSubPlant]
    name: str = "sea"
    waits: bool = field(default=False, init=False)

    def begin(self) -> tuple[ArduSubPlant, TruthProvider | None]:
        """The vehicle, and no truth provider."""
        return self.plant(), None


MOST_AT_ONCE = 50
"""Messages taken between two looks at the clock, however many wait."""


class MessageReceiver(Protocol):
    """Where messages come in."""

    def receive(self, timeout_s: float) -> tuple[Iterable[MavlinkMessage], int]:
        """Messages that came, and bytes that are none; waits for the first at most so long."""
        ...


class LinkThread:
    """Runs until it is stopped; what breaks it is kept in `fault`, after the output gate has let go.

    `heard` is called with each message after the gate has taken it; must be quick.
    """

    def __init__(
        self, connection: MessageReceiver, gate: OutputGate, heard: Callable[[MavlinkMessage], object] | None = None
    ) -> None:
        self._connection, self._gate, self._heard = connection, gate, heard
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="link", daemon=True)
        self.fault: BaseException | None = None

    def start(self) -> None:
        """Begin to listen."""
        self._gate.begin()
        self._thread.start()

    def stop(self, why: str) -> None:
        """Let go of the vehicle, say so as often as it takes, and end."""
        self._gate.end(why)
        self._over.set()
        self._thread.join(timeout=2.0)

    def _run(self) -> None:
        gate = self._gate
        try:
            due_s, left = gate.clock(), RELEASES + 1
            while left:
                said, noise = self._connection.receive(max(due_s - gate.clock(), 0.0))
                if noise:
                    gate.noise(noise)
                for k, message in enumerate(said):
                    gate.take(message)
                    if self._heard is not None:
                        self._heard(message)
                    if k % MOST_AT_ONCE == 0 and gate.clock() >= due_s:
                        gate.tick()
                        due_s = gate.clock() + TICK_S
                if gate.clock() >= due_s:
                    gate.tick()
                    due_s = max(due_s + TICK_S, gate.clock())
                    left -= self._over.is_set()
        except BaseException as fault:  # whatever it is, the vehicle is let go first
            self.fault = fault
            gate.end(f"the link broke ({type(fault).__name__}: {fault})")


@dataclass(kw_only=True, eq=False)
class FlightOwnership:
    """In which engagement the present step is flown, None in none, and when in the flight that began."""

    entry: int | None = None
    began_s: float = 0.0


@dataclass(kw_only=True, eq=False)
class GroundStationInput:
    """A `ControlSource`: the sticks that the pilot moves at the ground station, and the buttons that mean something."""

    gate: OutputGate
    stale_s: float = 0.3

    def read(self, _time_s: float) -> Controls | None:
        """The sticks as last heard; None where nobody was heard for a while."""
        sticks, pressed = self.gate.known.sticks, self.gate.pressed()
        if sticks is None or self.gate.clock() - sticks.came_s > self.stale_s:
            return Controls(axes=CENTRED.axes, pressed=pressed) if pressed else None
        return Controls(axes=sticks.axes, pressed=pressed)


@dataclass(kw_only=True, eq=False)
class EngagedPilot:
    """A `Pilot`: the assisted one while engaged, on its own clock; else the vehicle is wished to be where it is.

    `photographed`: called with the step's time and estimate for each photograph. `mount`: of its camera, which is where
    the pilot had turned it as an engagement begins.
    """

    inner: AssistedPilot
    gate: OutputGate
    turn: FlightOwnership
    photographed: Callable[[float, BodyState], None]
    mount: MountControl | None = None
    _step: tuple[float, BodyState] = field(init=False)

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """What is wanted now; settles in which engagement this step is flown."""
        self._step = time_s, estimate
        self.gate.estimated(estimate)
        entry, turn = self.gate.entry, self.turn
        if entry is None:
            turn.entry = None
            return Goal(X_WB=estimate.X_WB, nu_B=estimate.nu_B)
        begins = entry != turn.entry
        if begins:
            turn.entry, turn.began_s = entry, time_s
        goal = self.inner.goal(time_s - turn.began_s, estimate)
        if begins and self.mount is not None and self.mount.reported:
            self.inner.motion = replace(self.inner.motion, tilt_rad=self.mount.angle_rad)
            goal = replace(goal, tilt_rad=self.inner.motion.tilt_rad)
        for note in self.inner.notes():
            if self.gate.journal is not None:
                self.gate.journal.write("note", level=note.level, words=note.text)
        return goal

    def taken(self) -> tuple[str, ...]:
        """Photographs and the end asked for since the last call."""
        actions = self.inner.taken() if self.turn.entry is not None else self.gate.pressed()
        found = tuple(what for what in actions if what in ("capture", "stop"))
        for _ in range(found.count("capture")):
            self.photographed(*self._step)
        return found

    @property
    def leg(self) -> str:
        """What is flown now, as the record calls it."""
        return self.inner.leg if self.turn.entry is not None else "the pilot flies"


@dataclass(frozen=True, eq=False)
class EngagedControllerState:
    """State of a controller that rests while it is not engaged."""

    entry: int | None
    inner: Any


@dataclass(kw_only=True, eq=False)
class EngagedController:
    """A `Controller` that begins afresh at each engagement and asks for nothing between them."""

    inner: Controller[Any]
    turn: FlightOwnership
    thrusters: int

    @property
    def name(self) -> str:
        """Name of the method."""
        return self.inner.name

    def init(self) -> EngagedControllerState:
        """At rest."""
        return EngagedControllerState(None, None)

    def step(
        self, state: EngagedControllerState, dt_s: float, estimate: BodyState, goal: Goal
    ) -> tuple[EngagedControllerState, Command]:
        """The method's thrusts while engaged, else none."""
        entry = self.turn.entry
        if entry is None:
            return EngagedControllerState(None, None), Command(thrusts_N=np.zeros(self.thrusters), wrench_B=np.zeros(6))
        inner = state.inner if entry == state.entry else self.inner.init()
        inner, command = self.inner.step(inner, dt_s, estimate, goal)
        return EngagedControllerState(entry, inner), command


@dataclass(kw_only=True, eq=False)
class ServoEstimator:
    """An `Estimator` that is told what the servos do while the pilot flies."""

    inner: Estimator[Any]
    turn: FlightOwnership
    flown_N: Callable[[], Array]

    def init(self, start: BodyState) -> Any:
        """State at the start."""
        return self.inner.init(start)

    def step(
        self, state: Any, dt_s: float, measurements: tuple[Measurement, ...], thrusts_N: Array
    ) -> tuple[Any, BodyState]:
        """Advance under the thrusts that act."""
        return self.inner.step(state, dt_s, measurements, self.flown_N() if self.turn.entry is None else thrusts_N)


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

    def __call__(self, step: Step, _truth_provider: TruthProvider | None = None) -> None:
        """Reckon them anew, if it is time."""
        if step.time_s < self._due_s:
            return
        self._due_s = step.time_s + FIGURES_S
        engaged = self.turn.entry is not None
        thrusts = step.command.thrusts_N if engaged else self.flown_N()
        view = self._view
        gram = view.gram(step.estimate.X_WB)
        if not np.isfinite(gram).all():
            return
        found = {DISTURBANCE_NAME: disturbance_of(gram, thrusts)}
        least = min_norm_allocation(self._layout, self._layout.B @ thrusts, gram).disturbance or 0.0
        weight = view.total_weight
        self.speeds_m_s = (math.sqrt(found[DISTURBANCE_NAME] / weight), math.sqrt(max(least, 0.0) / weight))
        if engaged and least > weight * STILL_M_S**2:
            found[SAVED_NAME] = 100.0 * (1.0 - found[DISTURBANCE_NAME] / least)
        if self._covered_pct is not None:
            found[COVERAGE_NAME] = self._covered_pct
        self.gate.figures = found

    def photographed(self, X_WC: Pose) -> None:
        """A photograph was taken from here; what it has seen is reckoned beside the flight."""
        self._beside.submit(self._do, self._see, X_WC)

    def retarget(self, parts: Parts) -> None:
        """Reckon them of another target from now on; nothing of it was photographed."""
        self._beside.submit(self._do, self._retarget, parts)

    def protect(self, parts: Parts) -> None:
        """Reckon them for another region of the same target from now on."""
        self._beside.submit(self._do, self._protect, parts)

    def close(self) -> None:
        """Finish what is reckoned beside the flight, and drop what waits."""
        self._beside.shutdown(cancel_futures=True)

    def _do(self, work: Callable[[Any], None], about: Pose | Parts) -> None:
        """Reckon beside the flight, which goes on with the last figures where that fails."""
        try:
            work(about)
        except Exception as fault:  # a fault of a figure must neither end the flight nor vanish
            if self.gate.journal is not None:
                self.gate.journal.write("figures", amiss=f"{type(fault).__name__}: {fault}")

    def _protect(self, parts: Parts) -> None:
        self._view = InfluenceModel.of(parts.vehicle, parts.region, parts.wake)

    def _retarget(self, parts: Parts) -> None:
        self.parts, self._coverage, self._covered_pct = parts, None, None
        self._view = InfluenceModel.of(parts.vehicle, parts.region, parts.wake)

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


class _WaitingWorld:
    """A world that waits for its controller: what takes long the first time is not cut short."""

    name, waits = "rehearsal", True

    def begin(self) -> Any:
        raise NotImplementedError  # nobody flies in it


class _MovingInput:
    """Sticks that are moved a little, for a rehearsal."""

    def read(self, _time_s: float) -> Controls:
        return Controls(axes=np.array([0.0, 0.1, 0.1, 0.1, 0.0]))


def run_warm_up(sea: VehicleFlight, steps: int = 12) -> float:
    """Let the whole chain decide a few times for nobody, so that its kernels are there when thrusts count.

    Gives the longest of the last steps, in s: what takes longer than a control period is not flown.
    """
    parts, start = sea.parts, sea.parts.start
    dt_s, layout = 1.0 / parts.control.rate_hz, vehicle_layout(parts.vehicle)
    chain = assisted(
        sea.bare.replace(world=_WaitingWorld()), _MovingInput(), OperatorState(), OperatorSettings(mode="operator")
    )
    resting = sea.parts.controller
    assert isinstance(resting, EngagedController)  # see `join_vehicle`
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
