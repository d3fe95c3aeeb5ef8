"""Assisted flight by hand: hands and desk become goals, which any method flies; and a controller that heeds the desk.

The pilot holds one smooth `Motion`. Sticks ask for a velocity in the body's level frame, or along the sphere about the
target; released, the motion brakes, and the place that is held lies ahead, where the vehicle can stop. The mission may
take over and be left at any moment (see `scanning.py`). Whoever steers goes on from where the motion is, so goals never
jump.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wakewise.arrays import Array
from wakewise.control import make_controller, vehicle_layout
from wakewise.control.intent import FULL_M_S, FULL_RAD_S, HIGHEST_RAD, PAPER_W_TRACK, moved_on, slewed
from wakewise.control.switching import Switched
from wakewise.interfaces import BodyState, Controller, Goal
from wakewise.missions import CameraAim
from wakewise.operation.assists import elevation_rad, level_frame, sphere_frame, watching
from wakewise.operation.desk import WAYS, Desk, DeskState
from wakewise.operation.motion import STEEPEST_RAD, Attitude, Motion, turned_to, turning
from wakewise.operation.scanning import Mission, Scan
from wakewise.pilot import CENTRED, Controls, ControlSource

if TYPE_CHECKING:
    from wakewise.operation.parts import Parts

FASTER_M_S2, BRAKING_M_S2 = 0.15, 0.2
"""How fast a commanded velocity grows and falls; from 0.3 m/s to rest it takes 1.5 s and 0.23 m."""
PULL_M_S = 0.5
"""Fastest that the leash pulls the commanded place towards a vehicle that is held up or far off."""
RANGE_PER_S, RANGE_M_S = 1.0, 0.05
"""How an orbit keeps its range: speed per distance, and at most."""
DIAL_PER_S = 2.0
"""How fast the obedience follows its dial, in natural logarithms a second: from end to end in 2.3 s."""
TILT_RAD_S = math.radians(40.0)
"""What the tilt stick asks for at gain 1."""
MEAN_S, LEAST_M_S = 2.0, 0.01
"""Time over which deviations are averaged, and the mean command below which there is nothing to deviate from."""
KEPT = 200
"""Most actions and notes that are kept for somebody to take."""


@dataclass(frozen=True, kw_only=True)
class Note:
    """Something to say: "info", "warn" or "error", in words, and when."""

    level: str
    text: str
    time_s: float


@dataclass(kw_only=True, eq=False)
class AssistedPilot:
    """A `Pilot` whose goals come from hands, a desk and a mission; begins afresh at time zero.

    Parameters
    ----------
    source : ControlSource
    desk : Desk
    mission : Mission
    target_W_m : ndarray, shape (3,)
        What the camera is kept on, and the middle of orbits.
    dt_s : float
        Time between two goals.
    begin : DeskState, optional
        What the desk is set to at time zero, for flights that are to be flown again; None: it stays as it is.

    Attributes
    ----------
    controls : Controls or None
        As last read.
    velocity_W_m_s : ndarray, shape (3,)
        Asked for, as slewed.
    deviation_pct : float or None
        Of the estimated velocity from the one asked for, rms over the last seconds; None while none is asked for.
    motion : Motion
    """

    source: ControlSource
    desk: Desk
    mission: Mission
    target_W_m: Array
    dt_s: float
    begin: DeskState | None = None
    controls: Controls | None = None
    motion: Motion = field(init=False)
    _scan: Scan = field(init=False)
    _mode: str = "hold"
    _dial: float = 0.0
    _frame: Array | None = None
    _orbits: bool = False
    _range_m: float | None = None
    _asked: float = 0.0
    _missed: float = 0.0
    _there: bool = True
    _actions: deque[str] = field(default_factory=lambda: deque(maxlen=KEPT))
    _notes: deque[Note] = field(default_factory=lambda: deque(maxlen=KEPT))

    def __post_init__(self) -> None:
        self.motion, self._scan = Motion.at(self.mission.route.body(0.0, self.aim)), Scan()

    @property
    def aim(self) -> CameraAim:
        """What the camera is aimed with."""
        return self.mission.aim

    @property
    def velocity_W_m_s(self) -> Array:
        """Asked for, as slewed, shape (3,)."""
        return self.motion.velocity_W_m_s

    @property
    def deviation_pct(self) -> float | None:
        """Root mean square of the estimated less the commanded velocity over that of the commanded, in percent."""
        return None if self._asked < LEAST_M_S**2 else 100.0 * math.sqrt(self._missed / self._asked)

    @property
    def mission_s(self) -> float:
        """How much of the mission is flown, on its own clock."""
        return self._scan.mission_s

    @property
    def scan_phase(self) -> str | None:
        """What the scan does ("stopping", "returning", "flying"); None in other modes."""
        return self._scan.phase if self._mode == "scan" else None

    def taken(self) -> tuple[str, ...]:
        """Photographs ("capture") and the end ("stop") asked for since the last call, in order."""
        return _emptied(self._actions)

    def notes(self) -> tuple[Note, ...]:
        """What there was to say since the last call."""
        return _emptied(self._notes)

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Where hands, desk and mission lead, a step on."""
        first = time_s <= 0.0
        if first:
            self._begin(estimate)
        controls = self._read(time_s)
        for action in () if controls is None else controls.pressed:
            if action in ("capture", "stop"):
                self._actions.append(action)
            else:
                self.desk.press(action)
        state = self.desk.state
        self._enter(state.mode, time_s, first)
        if not first:
            self._move(state, CENTRED if controls is None else controls, time_s, estimate)
        self._weigh(estimate)
        wished = math.log(state.w_track / PAPER_W_TRACK)
        most = math.inf if first else DIAL_PER_S * self.dt_s
        self._dial += min(max(wished - self._dial, -most), most)
        return self.motion.goal(obedience=math.exp(self._dial))

    def _begin(self, estimate: BodyState) -> None:
        if self.begin is not None:
            self.desk.set(**vars(self.begin))
        self.motion = Motion.at(estimate, self.mission.route.tilt(0.0, self.aim)[0])
        self._scan, self._mode = Scan(), "hold"
        self._frame, self._range_m, self._asked, self._missed, self._there = None, None, 0.0, 0.0, True
        self._dial = math.log(self.desk.state.w_track / PAPER_W_TRACK)
        self._actions.clear()
        self._notes.clear()

    def _read(self, time_s: float) -> Controls | None:
        """The hands; a source that fails counts as nobody there, and both are said."""
        try:
            self.controls, why = self.source.read(time_s), "nobody at the sticks"
        except Exception as fault:  # a device that goes away must not end the flight
            self.controls, why = None, f"sticks cannot be read ({type(fault).__name__}: {fault})"
        there = self.controls is not None
        if there != self._there:
            if there:
                self._say("info", "hands at the sticks again", time_s)
            else:
                self._say("warn", f"{why}: stopping, then holding the place", time_s)
            self._there = there
        return self.controls

    def _enter(self, mode: str, time_s: float, first: bool) -> None:
        """Change of who steers; what was there goes on from where it is."""
        if mode == "scan" and not self.mission.flies:
            self._say("warn", "no mission to fly: holding the place", time_s)
            mode = self.desk.press("hold").mode
        if mode == self._mode:
            return
        if mode == "scan":
            self._scan = replace(self._scan, phase="stopping", pace=0.0, back=None)
            if first:
                self._scan, self.motion = self.mission.begun()
        elif self._mode == "scan":
            self._frame = None
        words = {"operator": "operator flies", "hold": "holding the place", "scan": "the mission flies"}
        self._say("info", words[mode], time_s)
        self._mode = mode

    def _move(self, state: DeskState, controls: Controls, time_s: float, estimate: BodyState) -> None:
        if self._mode != "scan":
            axes = controls.axes if self._mode == "operator" else CENTRED.axes
            self.motion = self._steered(self._turned(self.motion, state, axes), state, axes, estimate)
            return
        before = self._scan.mission_s
        self._scan, self.motion = self.mission.step(self._scan, self.motion, self.dt_s)
        opens_s = self.mission.route.exposures_s
        due = int(np.count_nonzero((opens_s > before) & (opens_s <= self._scan.mission_s)))
        self._actions.extend(["capture"] * due)
        if self._scan.mission_s >= self.mission.route.duration_s:
            self._say("info", "the mission is flown", time_s)
            self._enter(self.desk.press("hold").mode, time_s, False)

    def _turned(self, motion: Motion, state: DeskState, axes: Array) -> Motion:
        """Attitude and tilt a step on: by the sticks, where these are held, else by the assist or level."""
        turn, tilt = float(axes[3]), float(axes[4])
        dt_s, joint = self.dt_s, self.aim.joint
        angles, rates = np.array(motion.angles_rad), np.array(motion.rates_rad_s)
        wished = Attitude(
            angles_rad=np.array([0.0, angles[1], angles[2]]), rates_rad_s=np.zeros(3), tilt_rad=motion.tilt_rad
        )
        if state.watch_target:
            wished = watching(
                motion.place_W_m, motion.velocity_W_m_s, float(angles[2]), self.target_W_m, self.aim, dt_s
            )
        elif joint is not None:
            wished = replace(wished, angles_rad=np.array([0.0, 0.0, angles[2]]))
        raised = tilt * TILT_RAD_S * state.gain
        if tilt != 0.0 and joint is not None:
            wished = replace(wished, tilt_rad=joint.within(motion.tilt_rad + raised * dt_s))
        new = turned_to(motion, wished, dt_s, self.aim)
        by_hand = [(2, turn * FULL_RAD_S * state.share)] if turn != 0.0 or not state.watch_target else []
        if joint is None and (tilt != 0.0 or not state.watch_target):
            beyond = abs(angles[1]) >= STEEPEST_RAD and raised * angles[1] > 0.0
            by_hand.append((1, 0.0 if beyond else raised))
        for k, rate in by_hand:
            one = turning(motion, k, rate, dt_s)
            angles, rates = np.array(new.angles_rad), np.array(new.rates_rad_s)
            angles[k], rates[k] = one.angles_rad[k], one.rates_rad_s[k]
            new = replace(new, angles_rad=angles, rates_rad_s=rates)
        return new

    def _steered(self, motion: Motion, state: DeskState, axes: Array, estimate: BodyState) -> Motion:
        """Velocity and place a step on.

        The velocity is kept in the frame of the sticks, which turns, so that a held stick goes on along a circle.
        """
        eye, swing = motion.camera(self.aim)
        orbits = state.orbit
        frame = sphere_frame(eye, self.target_W_m) if orbits else level_frame(float(motion.angles_rad[2]))
        if self._frame is None or orbits != self._orbits:
            self._frame, self._orbits, self._range_m = frame, orbits, None
        moved_W = motion.velocity_W_m_s + (swing if orbits else 0.0)
        wish = FULL_M_S * state.share * axes[:3]
        if orbits and elevation_rad(eye, self.target_W_m) > HIGHEST_RAD:
            wish = np.array([wish[0], wish[1], max(wish[2], 0.0)])
        now = self._frame.T @ moved_W
        harder = BRAKING_M_S2 if np.linalg.norm(wish) < np.linalg.norm(now) else FASTER_M_S2
        new = slewed(now, wish, self.dt_s, harder)
        self._frame = frame
        if orbits:
            new = self._at_range(new, wish, float(np.linalg.norm(eye - self.target_W_m)))
        velocity = frame @ new - (swing if orbits else 0.0)
        place = self._led(motion.place_W_m, 0.5 * (motion.velocity_W_m_s + velocity), estimate)
        return replace(motion, place_W_m=place, velocity_W_m_s=velocity)

    def _at_range(self, velocity: Array, wish: Array, range_m: float) -> Array:
        """The velocity on the sphere with what brings it back to its radius; forward sets another one."""
        if wish[0] != 0.0 or self._range_m is None:
            self._range_m = range_m if wish[0] == 0.0 and abs(velocity[0]) < RANGE_M_S else None
        if self._range_m is None:
            return velocity
        closes = min(max(RANGE_PER_S * (range_m - self._range_m), -RANGE_M_S), RANGE_M_S)
        return np.array([closes, velocity[1], velocity[2]])

    def _led(self, place: Array, velocity: Array, estimate: BodyState) -> Array:
        """The place moved on, on its leash while it moves; at rest it is held wherever the vehicle is carried."""
        known = bool(np.isfinite(estimate.X_WB.p_m).all())
        if not velocity.any() or not known:
            return place + self.dt_s * velocity
        led = moved_on(place, velocity, estimate, self.dt_s)
        step = led - place
        size, most = float(np.linalg.norm(step)), (PULL_M_S + float(np.linalg.norm(velocity))) * self.dt_s
        return np.asarray(led if size <= most else place + step * (most / size))

    def _weigh(self, estimate: BodyState) -> None:
        share = self.dt_s / MEAN_S
        asked = self.motion.velocity_W_m_s
        missed = estimate.X_WB.R @ estimate.nu_B[:3] - asked
        self._asked += share * (float(asked @ asked) - self._asked)
        more = float(missed @ missed)
        self._missed += share * (more - self._missed) if math.isfinite(more) else 0.0

    def _say(self, level: str, text: str, time_s: float) -> None:
        self._notes.append(Note(level=level, text=text, time_s=time_s))


def assisted(parts: Parts, source: ControlSource, desk: Desk, begin: DeskState | None = None) -> Parts:
    """Parts that hands and a desk fly: the pilot is the assisted one, the controller heeds the desk at each step.

    Parameters
    ----------
    parts : Parts
        Their route is the mission that the mode `scan` flies.
    source : ControlSource
    desk : Desk
    begin : DeskState, optional
        What the desk is set to at time zero of each flight; None: it stays as it is.

    Returns
    -------
    Parts
        `pilot` and `controller` replaced; the body's attitude is the pilot's, so the method does not lean it.
    """
    pilot = assisted_pilot(parts, source, desk, begin)
    flown = parts.replace(pilot=pilot)
    return flown.replace(controller=heeding(flown, lambda: desk.state.method))


def assisted_pilot(parts: Parts, source: ControlSource, desk: Desk, begin: DeskState | None = None) -> AssistedPilot:
    """The pilot of `assisted`."""
    mission = parts.scenario.mission
    return AssistedPilot(
        source=source,
        desk=desk,
        mission=Mission(
            route=parts.route,
            aim=parts.aim,
            speed_m_s=mission.speed_m_s,
            acceleration_m_s2=mission.acceleration_m_s2,
            braking_m_s2=BRAKING_M_S2,
        ),
        target_W_m=parts.found_target.centre_W_m,
        dt_s=1.0 / parts.control.rate_hz,
        begin=begin,
    )


def heeding(parts: Parts, wanted: Callable[[], str]) -> Controller[Any]:
    """A controller that is `wake-aware` or direct (`dp`), as is wanted at each step."""
    gentle = parts.scenario.method if parts.scenario.method not in ("dp", "manual", "ardusub") else WAYS[0]
    made = {
        way: make_controller(method, parts.vehicle, parts.region, parts.wake, parts.control, parts.surroundings)
        for way, method in ((WAYS[0], gentle), (WAYS[1], "dp"))
    }
    return Switched(name="operator", methods=made, wanted=wanted, layout=vehicle_layout(parts.vehicle))


def _emptied(queue: deque[Any]) -> tuple[Any, ...]:
    """What is in a queue, which another thread may fill meanwhile."""
    found = []
    while queue:
        found.append(queue.popleft())
    return tuple(found)
