"""One flight of the gentle bench: a scenario or a world of the library, one vehicle, one method, one seed."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import TruthProvider
from wakewise.operation import Parts, Scenario, fly
from wakewise.operation.loop import Step
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.missions import SETTLING, Route
from wakewise.simulation.tank.tether import DRAG_COEFFICIENT
from wakewise.vision.evaluation import attitude_rmse_deg, flight_figures
from wakewise_paper.wash_reduction.ballasted_world import ballasted_world, blocks_of
from wakewise_paper.wash_reduction.paper import WATER_EVERY_S
from wakewise_paper.wash_reduction.routes import (
    BRAKE_AT_M,
    CLOSE_M,
    HOVER_DEG,
    STANDOFF_M,
    brake_route,
    gentle_route,
    looking_down,
    lowest_clear_deg,
    station_route,
    transect_route,
)
from wakewise_paper.wash_reduction.scenario_files import (
    WORLD,
    SampledConditions,
    fields_of,
    load_scenario_file,
    sample_conditions,
)
from wakewise_paper.world_study.flight import WorldTrial, short_flight

TRIM = "+trim"
"""Ends the name of a method that is flown with the float or lead that its own hover asks for."""
CABLE_M, WINCH_M = 0.01, 1.5
"""Diameter of a cable such as small vehicles have; its winch is this far off, at the surface, across the current, so
that it pulls straight down it."""
WRONG_SHARE, WRONG_RAD = 0.3, np.radians(30.0)
"""How wrong a current is believed: its speed by this share, its heading by this angle; the seed draws both signs."""

FIGURES = (
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "exceedance_1cm_s_pct",
    "exceedance_ambient_pct",
    "exposure_exceedance_1cm_s_pct",
    "target_pressure_mean_Pa",
    "bed_shear_p95_Pa",
    "silt_lifted_g",
    "silt_suspended_max_g",
    "ray_optical_depth",
    "exposure_optical_depth",
    "sway_rms_mm",
    "sway_about_mean_mm",
    "sway_wash_mm",
    "position_rmse_mm",
    "path_rmse_mm",
    "attitude_rmse_deg",
    "camera_rmse_mm",
    "camera_attitude_rmse_deg",
    "energy_kJ",
    "sign_flips_per_s",
    "solve_ms_p99",
    "fallbacks",
    "collisions",
    "float_N",
    "cpu_s",
)
"""Of each flight, from the end of settling on; `float_N` is what +trim added, null for others."""


@dataclass(frozen=True, kw_only=True)
class WashTrial:
    """One flight to make; hashable and plain, so that it can be handed to a worker.

    Parameters
    ----------
    scenario : str
        Full name: `orbit/paper`, `world/mud`.
    method : str
        A method's name, or one with `TRIM` at its end.
    seed : int
        From 1.
    control : tuple
        Dotted fields of `ControlSettings` and their values.
    wrong_current : bool
        State a wrong current to the controller.
    duration_s : float or None
        Only the first part of the flight.
    """

    scenario: str
    method: str
    seed: int
    control: tuple[tuple[str, Any], ...] = ()
    wrong_current: bool = False
    duration_s: float | None = None


def parts_of(trial: WashTrial) -> Parts:
    """Parts of the flight, but for what +trim adds."""
    method = trial.method.removesuffix(TRIM)
    if trial.scenario.startswith(WORLD):
        world = WorldTrial(world=trial.scenario.removeprefix(WORLD), method=method, seed=trial.seed)
        parts = short_flight(world)
    else:
        name, vehicle = trial.scenario.split("/")
        parts = scenario_parts(name, vehicle, method, trial.seed)
    told = dict(trial.control)
    if trial.wrong_current:
        told |= wrong_current(parts.scenario.tank.current.velocity_m_s, parts.scenario.seed)
    return parts.replace(**{f"control.{key}": value for key, value in told.items()}) if told else parts


def scenario_parts(name: str, vehicle: str, method: str, seed: int) -> Parts:
    """Parts of a flight of one of the bench's own scenarios."""
    file, what = load_scenario_file(name), sample_conditions(name, seed)
    values, draws = fields_of(name)
    told: dict[str, Any] = values | {
        "world": "tank",
        "vehicle": vehicle,
        "method": method,
        "seed": what.seed,
        "tank.mismatch.trim_N": what.trim_N,
        "tank.current.velocity_m_s": what.current_W_m_s,
        "randomize": {key: draw.model_dump(exclude_none=True) for key, draw in draws.items()},
    }
    parts = Scenario.preset("quick", **told).parts()
    if file.course == "nadir":
        parts = parts.replace(vehicle=looking_down(parts.vehicle))
    parts = parts.replace(route=route_of(file.course, parts, what))
    return parts.replace(**cable(parts, what)) if what.pull_N is not None else parts


def route_of(course: str, parts: Parts, what: SampledConditions) -> Route:
    """The route of a course, about where the target is taken to be."""
    centre, azimuth = parts.found_target.centre_W_m, what.azimuth_rad
    if course == "station":
        return station_route(parts.found_target, centre, azimuth)
    if course == "nadir":
        return transect_route(parts.found_target, centre, azimuth, what.altitude_m or 0.0)
    if course == "orbit":
        return gentle_route(centre, STANDOFF_M, azimuth)
    standoff_m = CLOSE_M if course == "close" else BRAKE_AT_M
    low_deg = lowest_clear_deg(parts.vehicle, parts.bounds, parts.found_target, standoff_m)
    if course == "close":
        return gentle_route(centre, standoff_m, azimuth, (max(HOVER_DEG, low_deg), low_deg))
    return brake_route(centre, azimuth, low_deg)


def cable(parts: Parts, what: SampledConditions) -> dict[str, Any]:
    """Fields of a cable that pulls `pull_N` down the current at the flight's start.

    From the tank's own law of a straight cable across a current: half of its drag comes to the vehicle,
    1/4 rho C_D d L U^2, which gives the length L.
    """
    north, east, _ = what.current_W_m_s
    speed = float(np.hypot(north, east))
    per_metre = 0.25 * parts.scenario.tank.density_kg_m3 * DRAG_COEFFICIENT * CABLE_M * speed**2
    start = parts.start.X_WB.p_m
    return {
        "tank.tether.diameter_m": CABLE_M,
        "tank.tether.length_m": round((what.pull_N or 0.0) / per_metre, 3),
        "tank.tether.from_m": (
            round(float(start[0] - WINCH_M * east / speed), 4),
            round(float(start[1] + WINCH_M * north / speed), 4),
            0.0,
        ),
    }


def wrong_current(current_W_m_s: tuple[float, ...], seed: int) -> dict[str, Any]:
    """Fields of control that state a current too fast or too slow, and turned."""
    faster, left = np.random.default_rng([seed, 31]).uniform(-1.0, 1.0, 2) < 0.0
    share = 1.0 + (WRONG_SHARE if faster else -WRONG_SHARE)
    turn = WRONG_RAD if left else -WRONG_RAD
    north, east, down = current_W_m_s
    c, s = np.cos(turn), np.sin(turn)
    stated = (share * (c * north - s * east), share * (s * north + c * east), down)
    return {"allocation.current_m_s": tuple(round(float(v), 6) for v in stated)}


def fly_trial(trial: WashTrial) -> dict[str, float | None]:
    """Figures of one flight."""
    began = time.process_time()
    parts, float_N = parts_of(trial), None
    if trial.method.endswith(TRIM):
        blocks = blocks_of(parts)
        float_N = float(sum(block.float_N for block in blocks))
        parts = ballasted_world(parts, blocks)
    solve_ms: list[float] = []

    def heard(step: Step, witness: TruthProvider | None) -> None:  # noqa: ARG001
        solve_ms.append(1e3 * step.solve_s)

    # Courses clear the bed by their own check, orbits by the mission's.
    flown = fly(parts, checked=False, water_every_s=WATER_EVERY_S, duration_s=trial.duration_s, watch=heard).steps
    frame = flown.filter(pl.col("leg") != SETTLING)
    judged = frame if frame.height else flown
    figures: dict[str, Any] = flight_figures(judged) | camera_errors(judged, parts.vehicle)
    figures["float_N"] = float_N
    figures["solve_ms_p99"] = float(np.percentile(solve_ms[-judged.height :], 99))
    figures["cpu_s"] = time.process_time() - began
    return {key: figures.get(key) for key in FIGURES}


def camera_errors(frame: pl.DataFrame, vehicle: Vehicle) -> dict[str, float]:
    """How far the true camera is from the wished one: place in mm and angle in degrees, root mean square over steps."""
    poses = {who: _camera_poses(frame, vehicle, who) for who in ("true", "goal")}
    apart = poses["true"][0] - poses["goal"][0]
    return {
        "camera_rmse_mm": 1e3 * float(np.sqrt(np.mean(np.sum(apart**2, axis=1)))),
        "camera_attitude_rmse_deg": attitude_rmse_deg(poses["true"][1], poses["goal"][1]),
    }


def _camera_poses(frame: pl.DataFrame, vehicle: Vehicle, who: str) -> tuple[Array, Array]:
    """Places, shape (n, 3), and attitudes, shape (n, 4), of the camera in W."""
    places = frame.select(f"{who}_x_m", f"{who}_y_m", f"{who}_z_m").to_numpy()
    turns = frame.select(f"{who}_qw", f"{who}_qx", f"{who}_qy", f"{who}_qz").to_numpy()
    tilts = np.radians(frame[f"{who}_tilt_deg"].to_numpy())
    cameras = [Pose(p, q) @ vehicle.X_BC_at(float(tilt)) for p, q, tilt in zip(places, turns, tilts, strict=True)]
    return np.array([X.p_m for X in cameras]), np.array([X.q for X in cameras])
