"""Assisted teleoperation: inputs and settings become goals for any method; the controller follows the settings.

The pilot holds one smooth `MotionReference`. Sticks command a velocity in the body's level frame, or along the sphere
about the target. When they are released, the motion brakes to a position ahead, where the vehicle can stop. The mission
can take over and be interrupted at any time (see `resumable_mission.py`). Each mode continues from the current
reference, so goals are continuous.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from wakewise.control import vehicle_layout
from wakewise.control.bumpless_transfer import switched
from wakewise.control.velocity_reference import PAPER_W_TRACK, deviation_limit
from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.core.interfaces import BodyState, Controller, Goal
from wakewise.operation.parts import Parts
from wakewise.operation.teleop.arbitration import (
    BRAKING_M_S2,
    CollisionLimiter,
    StickFrame,
    steer_attitude,
    steer_position,
)
from wakewise.operation.teleop.input import CENTRED, Controls, ControlSource
from wakewise.operation.teleop.input.control_log import ControlLogWriter
from wakewise.operation.teleop.motion import MotionReference
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.operation.teleop.region_methods import RegionMethods, region_methods
from wakewise.operation.teleop.resumable_mission import ResumableMission, ScanState
from wakewise.scene.missions import CameraAim

DIAL_PER_S = 2.0
"""How fast the tracking weight follows its dial, in natural logarithms a second: from end to end in 2.3 s."""
MEAN_S, LEAST_M_S = 2.0, 0.01
"""Time over which deviations are averaged, and the mean command below which there is nothing to deviate from."""
SAID_EVERY_S = 3.0
"""What is in the way is said no more often."""
KEPT = 200
"""Largest number of actions and of notes in a queue."""


@dataclass(frozen=True, kw_only=True)
class OperatorMessage:
    """Something to say: "info", "warn" or "error", in words, and when."""

    level: str
    text: str
    time_s: float


@dataclass(kw_only=True, eq=False)
class AssistedPilot:
    """A `Pilot` whose goals follow from inputs, settings and a mission; it is reset at time zero.

    Parameters
    ----------
    target_W_m : ndarray, shape (3,)
        What the camera is kept on, and the middle of orbits.
    dt_s : float
        Time between two goals.
    begin : OperatorSettings, optional
        Settings at time zero, for reproducible flights; None: they stay as they are.
    keep_off : CollisionLimiter, optional
        Obstacles that the motion commanded by the sticks must not reach.

    Attributes
    ----------
    controls : Controls or None
        As last read.
    velocity_W_m_s : ndarray, shape (3,)
        Commanded velocity after filtering.
    deviation_pct : float or None
        Of the estimated from the commanded velocity, rms over the last seconds; None while the command is zero.
    trace : ControlLogWriter
        Inputs and settings of the whole flight, to be written beside its record.
    state : OperatorSettings
        What was set at the last step: the controller goes by it, so that a change from another thread in the middle of
        a step counts for the next one, and the record of a flight gives the same flight.
    """

    source: ControlSource
    operator: OperatorState
    mission: ResumableMission
    target_W_m: Array
    dt_s: float
    begin: OperatorSettings | None = None
    keep_off: CollisionLimiter | None = None
    controls: Controls | None = None
    trace: ControlLogWriter = field(default_factory=ControlLogWriter)
    state: OperatorSettings = field(init=False)
    motion: MotionReference = field(init=False)
    _scan: ScanState = field(init=False)
    _mode: str = "hold"
    _dial: float = 0.0
    _sphere: StickFrame = field(default_factory=StickFrame)
    _asked: float = 0.0
    _missed: float = 0.0
    _there: bool = True
    _blocked_s: float = -math.inf
    _actions: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT))
    _notes: deque[OperatorMessage] = field(default_factory=lambda: deque(maxlen=KEPT))

    def __post_init__(self) -> None:
        self.state = self.operator.state
        self.motion, self._scan = MotionReference.at(self.mission.route.body(0.0, self.aim)), ScanState()

    @property
    def aim(self) -> CameraAim:
        """What the camera is aimed with."""
        return self.mission.aim

    @property
    def velocity_W_m_s(self) -> Array:
        """Commanded velocity after filtering, shape (3,)."""
        return self.motion.velocity_W_m_s

    @property
    def deviation_pct(self) -> float | None:
        """Root mean square of the estimated less the commanded velocity over that of the commanded, in percent."""
        return None if self._asked < LEAST_M_S**2 else 100.0 * math.sqrt(self._missed / self._asked)

    @property
    def mission_s(self) -> float:
        """How much of the mission is flown, on its own clock."""
        return self._scan.mission_s

    def taken(self) -> tuple[str, ...]:
        """Requests since the last call, in order: "capture" for a photograph, "stop" for the end."""
        return _emptied(self._actions)

    def notes(self) -> tuple[OperatorMessage, ...]:
        """What there was to say since the last call."""
        return _emptied(self._notes)

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """The goal after one step of inputs, settings and mission."""
        first = time_s <= 0.0
        if first:
            self._begin(estimate)
        controls = self._read(time_s, estimate)
        for action in () if controls is None else controls.pressed:
            if action in ("capture", "stop"):
                self._actions.append(action)
            else:
                self.operator.press(action)
        state = self.state = self._set(time_s)
        self.trace.take(time_s, controls, vars(state))
        self._enter(state.mode, time_s, first)
        if not first:
            self._move(state, CENTRED if controls is None else controls, time_s, estimate)
        self._weigh(estimate)
        desired = math.log(state.w_track / PAPER_W_TRACK)
        most = math.inf if first else DIAL_PER_S * self.dt_s
        self._dial += min(max(desired - self._dial, -most), most)
        scale = math.exp(self._dial)
        return self.motion.goal(
            tracking_weight_scale=scale, max_tracking_deviation=deviation_limit(PAPER_W_TRACK * scale)
        )

    def retarget(self, parts: Parts) -> None:
        """Go by another target and its mission, which is not begun; the motion goes on from its present state."""
        other = assisted_pilot(parts, self.source, self.operator)
        self.target_W_m, self.keep_off = other.target_W_m, other.keep_off
        self.mission, self._scan = other.mission, ScanState()

    @property
    def leg(self) -> str:
        """What is flown now, as the record calls it."""
        if self._mode != "scan":
            return {"operator": "by hand", "hold": "hold"}[self._mode]
        flying = self._scan.phase == "flying"
        return self.mission.route.leg_name(self._scan.mission_s) if flying else "back to the mission"

    def _set(self, time_s: float) -> OperatorSettings:
        """The settings; in a replay those of the record."""
        recorded = getattr(self.source, "settings_at", None)
        played = None if recorded is None else recorded(time_s)
        return self.operator.state if played is None else self.operator.set(**played)

    def _begin(self, estimate: BodyState) -> None:
        if self.begin is not None:
            self.operator.set(**vars(self.begin))
        self.motion = MotionReference.at(estimate, self.mission.route.tilt(0.0, self.aim)[0])
        self._scan, self._mode = ScanState(), "hold"
        self._sphere, self._asked, self._missed, self._there = StickFrame(), 0.0, 0.0, True
        self._blocked_s = -math.inf
        self._dial = math.log(self.operator.state.w_track / PAPER_W_TRACK)
        self.trace = ControlLogWriter()
        self._actions.clear()
        self._notes.clear()

    def _read(self, time_s: float, estimate: BodyState) -> Controls | None:
        """The inputs; None if the source fails. Loss and return of the inputs are reported."""
        try:
            look = getattr(self.source, "look", None)
            if look is not None:
                look(time_s, estimate, self.operator.state.share)
            self.controls, why = self.source.read(time_s), "no input from the sticks"
        except Exception as fault:  # a device that goes away must not end the flight
            self.controls, why = None, f"sticks cannot be read ({type(fault).__name__}: {fault})"
        there = self.controls is not None
        if there != self._there:
            if there:
                self._say("info", "input from the sticks is back", time_s)
            else:
                self._say("warn", f"{why}: stopping, then holding the position", time_s)
            self._there = there
        return self.controls

    def _enter(self, mode: str, time_s: float, first: bool) -> None:
        """Change of the mode of control; the motion goes on from its present state."""
        if mode == "scan" and not self.mission.flies:
            self._say("warn", "no mission to fly: holding the position", time_s)
            mode = self.operator.press("hold").mode
        if mode == self._mode:
            return
        if mode == "scan":
            self._scan = replace(self._scan, phase="stopping", pace=0.0, back=None)
            if first:
                self._scan, self.motion = self.mission.begun()
        elif self._mode == "scan":
            self._sphere = StickFrame()
        words = {"operator": "operator flies", "hold": "holding the position", "scan": "the mission flies"}
        self._say("info", words[mode], time_s)
        self._mode = mode

    def _move(self, state: OperatorSettings, controls: Controls, time_s: float, estimate: BodyState) -> None:
        if self._mode != "scan":
            axes = controls.axes if self._mode == "operator" else CENTRED.axes
            motion = steer_attitude(self.motion, state, axes, self.target_W_m, self.aim, self.dt_s)
            free = self._sphere.blocked_by is None
            self.motion, self._sphere = steer_position(
                motion, self._sphere, state, axes, self.target_W_m, self.aim, estimate, self.dt_s, self.keep_off
            )
            blocks = self._sphere.blocked_by
            if blocks is not None and free and time_s > self._blocked_s + SAID_EVERY_S:
                self._say("warn", f"{blocks} is in the way: stopping short of it", time_s)
                self._blocked_s = time_s
            return
        before = self._scan.mission_s
        self._scan, self.motion = self.mission.step(self._scan, self.motion, self.dt_s)
        opens_s = self.mission.route.exposures_s
        due = int(np.count_nonzero((opens_s > before) & (opens_s <= self._scan.mission_s)))
        self._actions.extend(["capture"] * due)
        if self._scan.mission_s >= self.mission.route.duration_s:
            self._say("info", "the mission is flown", time_s)
            self._enter(self.operator.press("hold").mode, time_s, False)

    def _weigh(self, estimate: BodyState) -> None:
        share = self.dt_s / MEAN_S
        asked = self.motion.velocity_W_m_s
        missed = estimate.X_WB.R @ estimate.nu_B[:3] - asked
        self._asked += share * (float(asked @ asked) - self._asked)
        more = float(missed @ missed)
        self._missed += share * (more - self._missed) if math.isfinite(more) else 0.0

    def _say(self, level: str, text: str, time_s: float) -> None:
        self._notes.append(OperatorMessage(level=level, text=text, time_s=time_s))


def assisted(
    parts: Parts, source: ControlSource, operator: OperatorState, begin: OperatorSettings | None = None
) -> Parts:
    """Parts of an assisted flight: the pilot is the assisted one, the controller follows the settings at each step.

    The route of `parts` is the mission of the mode `scan`. `begin` are the settings at time zero of each flight; None:
    they stay as they are.

    Returns
    -------
    Parts
        `pilot` and `controller` replaced; the body's attitude is the pilot's, so the method does not lean it.

    Raises InputError of a scenario whose pilot is `find` or `survey`, which fly by themselves.
    """
    if parts.finds:
        raise InputError(
            f"pilot: {parts.scenario.pilot} flies by itself, take wakewise scan, or pilot route to fly by hand"
        )
    pilot = assisted_pilot(parts, source, operator, begin)
    flown = parts.replace(pilot=pilot)
    return flown.replace(controller=switched_controller(flown, lambda: pilot.state.method))


def assisted_pilot(
    parts: Parts, source: ControlSource, operator: OperatorState, begin: OperatorSettings | None = None
) -> AssistedPilot:
    """The pilot of `assisted`."""
    mission = parts.scenario.mission
    return AssistedPilot(
        source=source,
        operator=operator,
        mission=ResumableMission(
            route=parts.route,
            aim=parts.aim,
            speed_m_s=mission.speed_m_s,
            acceleration_m_s2=mission.acceleration_m_s2,
            braking_m_s2=BRAKING_M_S2,
        ),
        target_W_m=parts.surveyed_target.centre_W_m,
        dt_s=1.0 / parts.control.rate_hz,
        begin=begin,
        keep_off=CollisionLimiter(
            around=parts.surroundings, half_m=0.5 * np.array(parts.vehicle.size_m), braking_m_s2=BRAKING_M_S2
        ),
    )


def switched_controller(
    parts: Parts, wanted: Callable[[], str], methods: RegionMethods | None = None
) -> Controller[Any]:
    """A controller that is `wake-aware` or direct (`dp`), as is wanted at each step.

    `methods`: pipelines whose protected region may change in flight; by default those of the scenario's region.
    """
    made = region_methods(parts) if methods is None else methods
    return switched("operator", made, wanted, vehicle_layout(parts.vehicle))


def _emptied(queue: deque[Any]) -> tuple[Any, ...]:
    """What is in a queue, which another thread may fill meanwhile."""
    found = []
    while queue:
        found.append(queue.popleft())
    return tuple(found)
