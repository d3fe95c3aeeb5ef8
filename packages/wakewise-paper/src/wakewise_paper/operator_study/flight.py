"""One flight of the operator's bench: a world, a pilot, a method, a w_track, a seed."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.allocation import disturbance_of
from wakewise.control.intent import FULL_M_S, PAPER_W_TRACK
from wakewise.control.spare import watching
from wakewise.core.arrays import Array
from wakewise.core.interfaces import BodyState, TruthProvider
from wakewise.operation import Parts, Scenario, fly
from wakewise.operation.loop import Step
from wakewise.operation.teleop.assist_modes import level_frame
from wakewise.operation.teleop.assisted import AssistedPilot, assisted_pilot
from wakewise.operation.teleop.input import ControlSource
from wakewise.operation.teleop.operator_state import OperatorSettings, OperatorState
from wakewise.operation.teleop.simulated_operator import SimulatedOperatorInput
from wakewise.scene.missions import SETTLING, RoutePilot
from wakewise.vision.evaluation import flight_figures
from wakewise_paper.operator_study.controller_probe import ControllerProbe
from wakewise_paper.operator_study.courses import COURSES, SQUARE, CourseInput, look_route, operator_route, start_pose
from wakewise_paper.operator_study.worlds import water_of
from wakewise_paper.wash_reduction.paper import WATER_EVERY_S
from wakewise_paper.wash_reduction.routes import SETTLE_S

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


@dataclass(frozen=True, kw_only=True)
class OperatorTrial:
    """One flight to make; hashable and plain, so that it can be handed to a worker.

    Parameters
    ----------
    world, pilot, method : str
    seed : int
        From 1.
    w_track : float
        On the paper's scale; no matter to a method that does not plan.
    duration_s : float or None
        Only the first part of the flight.
    """

    world: str
    pilot: str
    method: str
    seed: int
    w_track: float = PAPER_W_TRACK
    duration_s: float | None = None


def course_of(trial: OperatorTrial) -> str:
    """Which course is flown: the human's own, or the script's by stratum."""
    return LOOK if trial.pilot == "human" else SQUARE[water_of(trial.world, trial.seed).course_number]


def parts_of(trial: OperatorTrial) -> Parts:
    """Parts of the flight: the assisted pilot under script or person, and the method itself, `ControllerProbe`."""
    water = water_of(trial.world, trial.seed)
    parts = Scenario.preset("quick", method=trial.method, **water.fields).parts()
    course, target = COURSES[course_of(trial)], parts.found_target
    standoff_m = parts.scenario.mission.standoff_m
    dt_s, hands = 1.0 / parts.control.rate_hz, None
    if trial.pilot == "human":
        parts = parts.replace(route=look_route(target.centre_W_m, water.azimuth_rad, standoff_m))
        hands = SimulatedOperatorInput(
            wish=RoutePilot(route=parts.route, aim=parts.aim),
            X_BC=parts.vehicle.X_BC,
            target_W_m=target.centre_W_m,
            dt_s=dt_s,
            seed=parts.control.person or 0,
        )
    else:
        X_WB = start_pose(course, target, water.azimuth_rad, standoff_m, parts.vehicle.X_BC)
        route = operator_route(target.centre_W_m, course.duration_s)
        parts = parts.replace(start=BodyState(X_WB=X_WB), route=route)
    begin = OperatorSettings(mode="operator", w_track=trial.w_track, watch_target=course.watches)
    source: ControlSource = hands or CourseInput(course, begin.share)
    parts = parts.replace(pilot=assisted_pilot(parts, source, OperatorState(begin), begin))
    return parts.replace(controller=ControllerProbe(parts.controller))


def fly_trial(trial: OperatorTrial) -> dict[str, float | None]:
    """Figures of one flight."""
    began = time.process_time()
    parts = parts_of(trial)
    heard, pilot = parts.controller, parts.pilot
    assert isinstance(heard, ControllerProbe)
    assert isinstance(pilot, AssistedPilot)
    # One yardstick for all methods: what the levers know, in the current that the estimator finds.
    watch = watching(parts.vehicle, parts.region, parts.wake, parts.control)
    rows: list[tuple[Array, ...]] = []
    D: list[float] = []
    solve_ms: list[float] = []
    every = round(DISTURBANCE_EVERY_S * parts.control.rate_hz)

    def listen(step: Step, witness: TruthProvider | None) -> None:  # noqa: ARG001
        if step.time_s < SETTLE_S or step.truth is None or heard.asked_W_m_s is None:
            return
        state = step.truth.state
        asked = heard.asked_W_m_s
        planned = asked if heard.planned_W_m_s is None else heard.planned_W_m_s
        rows.append((asked, state.X_WB.R @ state.nu_B[:3], planned, by_sticks(pilot)))
        solve_ms.append(1e3 * step.solve_s)
        if len(rows) % every == 1:
            thrusts = step.truth.thrusts_N
            D.append(float(disturbance_of(watch.gram(step.estimate, thrusts), thrusts)))

    # The courses lie where the mission's own orbits are, which its check has seen, or above the target.
    flown = fly(parts, checked=False, water_every_s=WATER_EVERY_S, duration_s=trial.duration_s, watch=listen).steps
    figures: dict[str, Any] = flight_figures(flown.filter(flown["leg"] != SETTLING))
    figures |= deviations(*(np.array(column) for column in zip(*rows, strict=True)))
    figures["disturbance"] = float(np.mean(D))
    figures["solve_ms_p99"] = float(np.percentile(solve_ms, 99))
    figures["cpu_s"] = time.process_time() - began
    return {key: figures.get(key) for key in FIGURES}


def by_sticks(pilot: AssistedPilot) -> Array:
    """Velocity in W that the sticks point at now, before it is reached at a vehicle's pace, shape (3,)."""
    if pilot.controls is None:
        return np.zeros(3)
    full_m_s = FULL_M_S * pilot.desk.state.share
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
