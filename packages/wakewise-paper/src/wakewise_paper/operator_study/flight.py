"""One flight of the study of operators: a world, a pilot, a method, a w_track, a seed.

The pilot asks for velocities in the vehicle's level frame, as sticks do: forward along its heading, right, down. A
script flies three courses; the human model flies a route by eye. Every course begins with `SETTLE_S` of rest, like the
flights of the study of wash, so that what holds the vehicle has come to the target by then. A `ControllerProbe` about
the controller keeps what was asked and what its plan expects.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.allocation import disturbance_of
from wakewise.control import Pipeline
from wakewise.control.null_space_allocation import allocation_context
from wakewise.control.velocity_reference import FULL_M_S, PAPER_W_TRACK
from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_euler
from wakewise.core.interfaces import BodyState, Command, Controller, Goal, TruthProvider
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.flights import FlightProbe
from wakewise.experiments.campaigns.study import flight_trial
from wakewise.operation import Parts
from wakewise.operation.loop import Step
from wakewise.operation.teleop.arbitration import level_frame
from wakewise.operation.teleop.assisted import AssistedPilot, assisted_pilot
from wakewise.operation.teleop.human_pilot import SimulatedOperatorInput
from wakewise.operation.teleop.input import Controls, ControlSource
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.scene.missions import Leg, Route, RoutePilot
from wakewise.scene.missions.route import rest_to_rest
from wakewise.scene.targets import Target
from wakewise_paper import flights
from wakewise_paper.operator_study.worlds import water_of
from wakewise_paper.routes import SETTLE_S, joined, resting, top_above_centre_m


@dataclass(eq=False)
class ControllerProbe:
    """A controller, and what was asked of it and what its plan expects at the last step; implements `Controller`.

    `asked_W_m_s`, shape (3,); `planned_W_m_s`, shape (3,), None where nothing is planned.
    """

    inner: Controller[Any]
    asked_W_m_s: Array | None = None
    planned_W_m_s: Array | None = None

    @property
    def name(self) -> str:
        """Name of the controller within."""
        return self.inner.name

    def init(self) -> Any:
        """State before the first step."""
        return self.inner.init()

    def step(self, state: Any, dt_s: float, estimate: BodyState, goal: Goal) -> tuple[Any, Command]:
        """Decide, and remember what was asked and what the plan expects by then."""
        state, command = self.inner.step(state, dt_s, estimate, goal)
        self.asked_W_m_s = goal.X_WB.R @ goal.nu_B[:3]
        expected = self.inner.expected(state) if isinstance(self.inner, Pipeline) else None
        self.planned_W_m_s = None if expected is None else matrix_from_quat(expected[3:7]) @ expected[7:10]
        return state, command


SPEED_M_S, CLIMB_M_S = 0.10, 0.05
SLEW_M_S2 = 0.1
ELEVATION_DEG, CLIMBED_DEG = 30.0, 50.0
"""Where a course begins; the middle of a mission's lower two orbits. The human climbs to between its upper two."""
APPROACH_M, LOOK_ARC_M, LOOK_REST_S = 0.4, 0.5, 3.0
ABOVE_M, HALF_HULL_M, HALF_WAY_M = 0.2, 0.14, 0.3
"""Left between hull and target by `over`; half the height of the paper's hull; half of the way to and fro."""


@dataclass(frozen=True, kw_only=True)
class Course:
    """What a script asks for.

    `legs` are seconds and velocity forward, right, down in m/s, one after the other, from the end of rest on.
    `watches`: the camera is kept on the target; otherwise the vehicle is level and keeps its heading. `outside_m`: so
    much farther off than the standoff it begins.
    """

    legs: tuple[tuple[float, tuple[float, float, float]], ...]
    watches: bool = True
    outside_m: float = 0.0

    @property
    def duration_s(self) -> float:
        """How long it asks, without the rest."""
        return sum(seconds for seconds, _ in self.legs)

    def asked_m_s(self, time_s: float) -> Array:
        """Velocity asked `time_s` after the start, shape (3,); none at rest and after the end."""
        left_s = time_s - SETTLE_S
        for seconds, velocity in self.legs:
            if 0.0 <= left_s < seconds:
                return np.array(velocity)
            left_s -= seconds
        return np.zeros(3)


@dataclass(frozen=True, eq=False)
class CourseInput:
    """A `ControlSource` that flies a course; `share` is what full stick asks for, of the fastest."""

    course: Course
    share: float

    def read(self, time_s: float) -> Controls:
        """The sticks of that time."""
        return Controls(axes=np.array([*self.course.asked_m_s(time_s) / (FULL_M_S * self.share), 0.0, 0.0]))


COURSES = {
    "front": Course(
        legs=(
            (4.0, (0.0, SPEED_M_S, 0.0)),
            (4.0, (0.0, 0.0, -CLIMB_M_S)),
            (4.0, (0.0, -SPEED_M_S, 0.0)),
            (4.0, (0.0, 0.0, CLIMB_M_S)),
        )
    ),
    "over": Course(legs=((6.0, (SPEED_M_S, 0.0, 0.0)), (6.0, (-SPEED_M_S, 0.0, 0.0))), watches=False),
    "look": Course(
        legs=(
            (APPROACH_M / SPEED_M_S, (SPEED_M_S, 0.0, 0.0)),
            (LOOK_ARC_M / SPEED_M_S, (0.0, SPEED_M_S, 0.0)),
            (LOOK_REST_S, (0.0, 0.0, 0.0)),
            (4.0, (0.0, 0.0, -CLIMB_M_S)),
        ),
        outside_m=APPROACH_M,
    ),
}
"""In the order of the Latin square (see `waters`)."""
SQUARE = tuple(COURSES)


def operator_route(centre_W_m: Array, duration_s: float) -> Route:
    """Rest, then a leg of this length that says nothing of where to be, with photographs."""
    return joined(centre_W_m, (resting("operator", np.array([0.0, 0.0, 1.0]), duration_s),), ("operator",))


def look_route(centre_W_m: Array, azimuth_rad: float, standoff_m: float) -> Route:
    """What the human would like to see: `look` as a route, by the clock and on the sphere."""
    elevation, climbed = np.radians((ELEVATION_DEG, CLIMBED_DEG))
    # To the right of a camera that looks inward is towards smaller azimuths, seen from above with x north, y east.
    turn = -LOOK_ARC_M / (standoff_m * np.cos(elevation))
    far = np.array([azimuth_rad, elevation, standoff_m + APPROACH_M])
    near = np.array([azimuth_rad, elevation, standoff_m])
    round_ = near + np.array([turn, 0.0, 0.0])
    legs: tuple[Leg, ...] = (
        rest_to_rest("approach", far, near, SPEED_M_S, SLEW_M_S2),
        rest_to_rest("arc", near, round_, SPEED_M_S, SLEW_M_S2),
        resting("stop", round_, LOOK_REST_S),
        rest_to_rest("climb", round_, np.array([round_[0], climbed, standoff_m]), CLIMB_M_S, SLEW_M_S2),
    )
    return joined(centre_W_m, legs, tuple(leg.name for leg in legs))


def start_pose(course: Course, target: Target, azimuth_rad: float, standoff_m: float, X_BC: Pose) -> Pose:
    """Where a course begins, X_WB: its camera on the target from outside, or level above it."""
    centre = target.centre_W_m
    if not course.watches:
        inward = np.array([np.cos(azimuth_rad + np.pi), np.sin(azimuth_rad + np.pi), 0.0])
        up_m = top_above_centre_m(target) + ABOVE_M + HALF_HULL_M
        return Pose(centre - HALF_WAY_M * inward - [0.0, 0.0, up_m], quat_from_euler(0.0, 0.0, azimuth_rad + np.pi))
    place = np.array([azimuth_rad, np.radians(ELEVATION_DEG), standoff_m + course.outside_m])
    return joined(centre, (resting("start", place, 0.0),), ()).body(0.0, X_BC).X_WB


SOURCES = (*flights.SOURCES, "wakewise_paper:operator_study", "wakewise_paper:wash_reduction")
PILOTS = ("script", "human")
LOOK = "look"
"""Course of the human."""
DISTURBANCE_EVERY_S = 0.2

DEVIATIONS = (
    "velocity_deviation_pct",
    "velocity_deviation_planned_pct",
    "velocity_deviation_behind_plan_pct",
    "velocity_deviation_from_sticks_pct",
    "velocity_error_rms_mm_s",
    "velocity_asked_rms_mm_s",
)
FIGURES = (
    *DEVIATIONS,
    "disturbance",
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "silt_lifted_g",
    "ray_optical_depth",
    "sway_rms_mm",
    "sway_wash_mm",
    "position_rmse_mm",
    "attitude_rmse_deg",
    "estimate_rmse_mm",
    "energy_kJ",
    "fallbacks",
    "collisions",
    "solve_ms_p99",
    "cpu_s",
)
"""Of each flight, from the end of rest on. `position_rmse_mm` is off the place that the sticks led to."""


def operator_trial(
    world: str,
    pilot: str,
    method: str,
    seed: int,
    w_track: float = PAPER_W_TRACK,
    *,
    name: str = "",
    duration_s: float | None = None,
) -> PlannedTrial:
    """One flight to make: `pilot` is one of `PILOTS`, seeds count from 1, `w_track` is on the paper's scale.

    A method that does not plan has no use for `w_track`. `name` is what the flight is called if not by its method;
    `duration_s` flies the first part only.
    """
    return flight_trial(
        f"{world}, {pilot}",
        name or method,
        seed,
        water_of(world, seed).fields | {"method": method},
        setup={f"{__name__}:operated": {"world": world, "pilot": pilot, "seed": seed, "w_track": w_track}},
        probes={f"{__name__}:OperatorFigures": {}},
        duration_s=duration_s,
        sources=SOURCES,
    )


def course_of(world: str, pilot: str, seed: int) -> str:
    """Which course is flown: the human's own, or the script's by stratum."""
    return LOOK if pilot == "human" else SQUARE[water_of(world, seed).course_number]


def operated(parts: Parts, world: str, pilot: str, seed: int, w_track: float) -> Parts:
    """The flight under the assisted pilot, with script or person at the sticks, and the method in a
    `ControllerProbe`.
    """
    water = water_of(world, seed)
    course, target = COURSES[course_of(world, pilot, seed)], parts.surveyed_target
    standoff_m = parts.scenario.mission.standoff_m
    dt_s, simulated = 1.0 / parts.control.rate_hz, None
    if pilot == "human":
        parts = parts.replace(route=look_route(target.centre_W_m, water.azimuth_rad, standoff_m))
        simulated = SimulatedOperatorInput(
            reference=RoutePilot(route=parts.route, aim=parts.aim),
            X_BC=parts.vehicle.X_BC,
            target_W_m=target.centre_W_m,
            dt_s=dt_s,
            seed=parts.control.operator_seed or 0,
        )
    else:  # the courses lie where the mission's own orbits are, which its check has seen, or above the target
        X_WB = start_pose(course, target, water.azimuth_rad, standoff_m, parts.vehicle.X_BC)
        route = operator_route(target.centre_W_m, course.duration_s)
        parts = parts.replace(start=BodyState(X_WB=X_WB), route=route)
    begin = OperatorSettings(mode="operator", w_track=w_track, watch_target=course.watches)
    source: ControlSource = simulated or CourseInput(course, begin.share)
    parts = parts.replace(pilot=assisted_pilot(parts, source, OperatorState(begin), begin))
    return parts.replace(controller=ControllerProbe(parts.controller))


class OperatorFigures(FlightProbe):
    """Deviations from the velocity asked for, and D, from the end of rest on.

    D has one yardstick for all methods: what the allocator knows, in the current that the estimator finds.
    """

    def __init__(self, parts: Parts, folder: Path) -> None:
        super().__init__(parts, folder)
        controller, pilot = parts.controller, parts.pilot
        assert isinstance(controller, ControllerProbe)
        assert isinstance(pilot, AssistedPilot)
        self._heard, self._pilot = controller, pilot
        self._context = allocation_context(parts.vehicle, parts.region, parts.wake, parts.control)
        self._every = round(DISTURBANCE_EVERY_S * parts.control.rate_hz)
        self._rows: list[tuple[Array, ...]] = []
        self._D: list[float] = []
        self._solve_ms: list[float] = []

    def step(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Keep what was asked, flown and planned; D five times a second."""
        del truth_provider
        asked = self._heard.asked_W_m_s
        if step.time_s < SETTLE_S or step.truth is None or asked is None:
            return
        state, planned = step.truth.state, self._heard.planned_W_m_s
        true = state.X_WB.R @ state.nu_B[:3]
        self._rows.append((asked, true, asked if planned is None else planned, by_sticks(self._pilot)))
        self._solve_ms.append(1e3 * step.solve_s)
        if len(self._rows) % self._every == 1:
            thrusts = step.truth.thrusts_N
            self._D.append(float(disturbance_of(self._context.gram(step.estimate, thrusts), thrusts)))

    def figures(self, steps: pl.DataFrame) -> dict[str, float | None]:
        """`DEVIATIONS`, `disturbance` and `solve_ms_p99`."""
        del steps
        return deviations(*(np.array(column) for column in zip(*self._rows, strict=True))) | {
            "disturbance": float(np.mean(self._D)),
            "solve_ms_p99": float(np.percentile(self._solve_ms, 99)),
        }


def by_sticks(pilot: AssistedPilot) -> Array:
    """Velocity in W that the sticks point at now, before it is reached at a vehicle's pace, shape (3,)."""
    if pilot.controls is None:
        return np.zeros(3)
    full_m_s = FULL_M_S * pilot.operator.state.share
    return level_frame(float(pilot.motion.angles_rad[2])) @ (full_m_s * pilot.controls.axes[:3])


def deviations(
    asked_W_m_s: Array, true_W_m_s: Array, planned_W_m_s: Array, sticks_W_m_s: Array | None = None
) -> dict[str, float | None]:
    """Rms of differences over the rms of what was asked, in percent; shape (steps, 3) each, in W.

    `asked` is the command, shaped; `sticks` what the sticks point at. None where nothing was asked.
    """

    def rms(values: Array) -> float:
        return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))

    size = rms(asked_W_m_s)

    def percent(off: Array) -> float | None:
        return 100.0 * rms(off) / size if size > 0.0 else None

    pointed = asked_W_m_s if sticks_W_m_s is None else sticks_W_m_s
    whole = rms(pointed)
    return {
        "velocity_deviation_from_sticks_pct": 100.0 * rms(true_W_m_s - pointed) / whole if whole > 0.0 else None,
        "velocity_deviation_pct": percent(true_W_m_s - asked_W_m_s),
        "velocity_deviation_planned_pct": percent(planned_W_m_s - asked_W_m_s),
        "velocity_deviation_behind_plan_pct": percent(true_W_m_s - planned_W_m_s),
        "velocity_error_rms_mm_s": 1e3 * rms(true_W_m_s - asked_W_m_s),
        "velocity_asked_rms_mm_s": 1e3 * size,
    }
