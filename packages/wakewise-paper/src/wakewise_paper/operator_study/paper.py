"""The same in the paper's own world, circular: the planner's model is the water
(`wakewise.operation.worlds.quasi_steady_world`).

`wake-aware` against `mpc` at the same weight, same commands, same seeds, by the paper's cost alone (no mechanisms). The
operator asks for 0.1 m/s, reached at 0.1 m/s2. Two courses. `front`: sideways, up, back and down in front of the
target, camera on it, where spare thrusters alone can keep every jet off it. `over`: to and fro above the target in a
vehicle that sinks by the largest unknown trim; its lift blows at the target whatever the spare thrusters do, and only
disobedience is left.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.control import AllocationSettings, ControlSettings, make_controller
from wakewise.control.velocity_reference import (
    PAPER_W_TRACK,
    VelocityCommand,
    advance_reference,
    goal_of,
    limit_acceleration,
    scaled_tracking,
)
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, Goal, TruthProvider
from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.flights import FlightProbe
from wakewise.experiments.campaigns.study import Key, Row, flight_trial
from wakewise.operation import Parts
from wakewise.operation.loop import Step
from wakewise.operation.worlds.quasi_steady_world import QuasiSteadyWater, paper_jets
from wakewise.operation.worlds.vehicle_in_water import RepeatableWorld
from wakewise.robot.vehicles import load_vehicle, perturbed
from wakewise.scene.missions import open_route
from wakewise.wake import InfluenceModel, WakeSettings, disturbance, wake_model
from wakewise_paper.operator_study.flight import SOURCES, ControllerProbe, deviations
from wakewise_paper.wash_reduction.paper import OFF, PAPER_WAKE, paper_place

SEEDS = 1
SPEED_M_S, HOLD_S = 0.10, 5.0
DIRECT, OURS, UNAWARE = "dp", "wake-aware", "mpc"


@dataclass(frozen=True, kw_only=True)
class PaperCourse:
    """What the operator asks for: directions in W one after the other, from a place beside the target's centre.

    `watches`: the camera is kept on the target; otherwise the vehicle is level and heads north. `sinks`: heavier than
    believed by the largest trim; otherwise the trim is drawn.
    """

    from_target_m: tuple[float, float, float]
    legs_W: tuple[tuple[float, float, float], ...]
    leg_s: float
    watches: bool = True
    sinks: bool = False


PAPER_COURSES = {
    "front": PaperCourse(
        from_target_m=(-0.65, -0.2, -0.30),
        legs_W=((0.0, 1.0, 0.0), (0.0, 0.0, -0.5), (0.0, -1.0, 0.0), (0.0, 0.0, 0.5)),
        leg_s=4.0,
    ),
    "over": PaperCourse(
        from_target_m=(0.0, -0.3, -0.42),
        legs_W=((0.0, 1.0, 0.0), (0.0, -1.0, 0.0)),
        leg_s=6.0,
        watches=False,
        sinks=True,
    ),
}
"""Climbing and sinking at half speed. 0.42 m above the target's centre leaves 0.2 m between hull and coral."""


@dataclass
class ScriptedOperator:
    """A `Pilot` that asks for one velocity after the other; holds its place for the first seconds."""

    course: PaperCourse
    watch_W_m: Array | None
    start: Goal
    dt_s: float
    velocity_W: Array = field(default_factory=lambda: np.zeros(3))
    place_W: Array = field(init=False)

    def __post_init__(self) -> None:
        self.place_W = self.start.X_WB.p_m

    def goal(self, time_s: float, estimate: BodyState) -> Goal:
        """Hold, then the leg's velocity, reached at 0.1 m/s2."""
        if time_s < HOLD_S:
            return self.start
        leg = min(int((time_s - HOLD_S) / self.course.leg_s), len(self.course.legs_W) - 1)
        self.velocity_W = limit_acceleration(self.velocity_W, SPEED_M_S * np.array(self.course.legs_W[leg]), self.dt_s)
        self.place_W = advance_reference(self.place_W, self.velocity_W, estimate, self.dt_s)
        return goal_of(VelocityCommand(velocity_W_m_s=self.velocity_W, watch_W_m=self.watch_W_m), self.place_W)


def paper_trial(course: str, method: str, seed: int, w_track: float = PAPER_W_TRACK) -> PlannedTrial:
    """One flight there."""
    base = ControlSettings(wake=WakeSettings(**PAPER_WAKE), allocation=AllocationSettings(**OFF))
    control = base.model_copy(update={"plan": scaled_tracking(base.plan, w_track)})
    return flight_trial(
        f"paper, {course}",
        f"{method} {w_track:g}",
        seed,
        {"method": method, "seed": seed, "control": control.model_dump(mode="json")},
        preset=None,
        setup={f"{__name__}:paper_course": {"course": course}},
        probes={f"{__name__}:PaperOperatorFigures": {}},
        sources=SOURCES,
    )


def paper_trials(w_tracks: tuple[float, ...], seeds: int) -> dict[Key, PlannedTrial]:
    """Flights to make, seed by seed; `dp`, which has no w_track, once a seed."""
    return {
        (f"paper, {course}", f"{method} {w_track:g}", seed): paper_trial(course, method, seed, w_track)
        for seed in range(1, seeds + 1)
        for course in PAPER_COURSES
        for method, weights in ((DIRECT, (PAPER_W_TRACK,)), (OURS, w_tracks), (UNAWARE, w_tracks))
        for w_track in weights
    }


def paper_figures(rows: Mapping[Key, Row], w_tracks: tuple[float, ...]) -> dict[str, Any]:
    """Sweeps of both courses, the first as `w_track`; against `mpc` at the same weight, which is direct there."""

    def flights(course: str, method: str, w_track: float) -> list[Row]:
        return [row for key, row in rows.items() if key[:2] == (f"paper, {course}", f"{method} {w_track:g}")]

    answer: dict[str, Any] = {"circular": True, "seeds": len({key[2] for key in rows})}
    for course, name in zip(PAPER_COURSES, ("w_track", "w_track_over"), strict=True):
        floor = _mean(flights(course, DIRECT, PAPER_W_TRACK), "velocity_deviation_pct")
        answer[name] = {f"{w:g}": _row(flights(course, OURS, w), flights(course, UNAWARE, w), floor) for w in w_tracks}
    return answer


def _row(gentle: list[Row], careless: list[Row], floor: float | None) -> dict[str, Any]:
    def less(key: str) -> float | None:
        ours, theirs = _mean(gentle, key), _mean(careless, key)
        return None if ours is None or not theirs else 100.0 * (1.0 - ours / theirs)

    names = ("velocity_deviation_pct", "velocity_deviation_planned_pct", "velocity_deviation_behind_plan_pct")
    told: dict[str, Any] = {name: _mean(gentle, name) for name in (*names, "target_speed_mean_m_s")}
    told["velocity_deviation_floor_pct"] = floor
    told["velocity_deviation_mpc_pct"] = _mean(careless, names[0])
    told["disturbance_reduction_pct"] = less("disturbance")
    told["target_speed_reduction_pct"] = less("target_speed_mean_m_s")
    told["why"] = {key: "no flight gave it" for key, value in told.items() if value is None}
    return told


def _mean(rows: list[Row], key: str) -> float | None:
    known = [float(value) for row in rows if (value := row.get(key)) is not None]
    return float(np.mean(known)) if known else None


def paper_course(parts: Parts, course: str) -> Parts:
    """The flight of a course: vehicles believed and true, target, start, pilot and the paper's water."""
    asked, seed = PAPER_COURSES[course], parts.scenario.seed
    tank, control = parts.scenario.tank, parts.control
    vehicle = load_vehicle("paper")
    target, region = paper_place(tank.size_m[2])
    plant_rng, _ = np.random.default_rng([seed, 13]).spawn(2)
    trim_N = float(plant_rng.uniform(-tank.mismatch.trim_range_N, tank.mismatch.trim_range_N))
    true = perturbed(
        vehicle,
        plant_rng,
        mass_pct=5.0,
        damping_pct=30.0,
        added_mass_pct=20.0,
        thrust_pct=5.0,
        trim_N=-tank.mismatch.trim_range_N if asked.sinks else trim_N,
    )
    watch = target.centre_W_m if asked.watches else None
    rest = VelocityCommand(velocity_W_m_s=np.zeros(3), watch_W_m=watch)
    here = goal_of(rest, target.centre_W_m + np.array(asked.from_target_m))
    start = BodyState(X_WB=here.X_WB)
    method = make_controller(parts.scenario.method, vehicle, region, wake_model(control.wake), control)
    return parts.replace(
        vehicle=vehicle,
        target=target,
        region=region,
        route=open_route(target.centre_W_m, HOLD_S + asked.leg_s * len(asked.legs_W)),
        start=start,
        pilot=ScriptedOperator(asked, watch, here, 1.0 / control.rate_hz),
        controller=ControllerProbe(method),
        world=RepeatableWorld(
            name="paper",
            vehicle=true,
            make=lambda vehicle, rng: QuasiSteadyWater(paper_jets(), vehicle, target, tank, start, rng),
            draw=lambda: np.random.default_rng([seed, 13]).spawn(2)[1],
        ),
    )


class PaperOperatorFigures(FlightProbe):
    """Deviations, D by the paper's model and the water at the target, from the end of rest on."""

    def __init__(self, parts: Parts, folder: Path) -> None:
        super().__init__(parts, folder)
        controller, pilot = parts.controller, parts.pilot
        assert isinstance(controller, ControllerProbe)
        assert isinstance(pilot, ScriptedOperator)
        self._controller, self._pilot = controller, pilot
        self._view = InfluenceModel.of(parts.vehicle, parts.region, wake_model(WakeSettings(**PAPER_WAKE)))
        self._velocities: list[tuple[Array, Array, Array]] = []
        self._D: list[float] = []
        self._speed: list[float] = []

    def step(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Keep what was asked, flown and planned; D and the water every fifth step."""
        if step.time_s < HOLD_S or step.truth is None or truth_provider is None:
            return
        state, asked, planned = step.truth.state, self._pilot.velocity_W, self._controller.planned_W_m_s
        self._velocities.append((asked, state.X_WB.R @ state.nu_B[:3], asked if planned is None else planned))
        if len(self._velocities) % 5 == 0:
            self._D.append(disturbance(self._view.gram(state.X_WB), step.truth.thrusts_N))
            self._speed.append(truth_provider.water().target_speed_mean_m_s)

    def figures(self, steps: pl.DataFrame) -> dict[str, float | None]:
        """`DEVIATIONS`, `disturbance` and `target_speed_mean_m_s`."""
        del steps
        return deviations(*(np.array(column) for column in zip(*self._velocities, strict=True))) | {
            "disturbance": float(np.mean(self._D)),
            "target_speed_mean_m_s": float(np.mean(self._speed)),
        }
