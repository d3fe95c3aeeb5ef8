"""One flight of the study of wash: a scenario of its own or a world of the library, one vehicle, one method, one
seed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.flights import flight_parts
from wakewise.experiments.campaigns.study import flight_trial
from wakewise.operation import Parts
from wakewise.scene.missions import Route
from wakewise.simulation.tank.tether import DRAG_COEFFICIENT
from wakewise_paper import flights
from wakewise_paper.routes import (
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

SOURCES = (*flights.SOURCES, "wakewise_paper:wash_reduction")
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


def wash_trial(
    scenario: str,
    method: str,
    seed: int,
    *,
    name: str = "",
    control: Mapping[str, Any] | None = None,
    wrong_current: bool = False,
    duration_s: float | None = None,
) -> PlannedTrial:
    """One flight to make.

    `scenario` is a full name such as orbit/paper or world/mud; `method` may end with `TRIM`; `name` is what the flight
    is called if not by its method; `control` are dotted fields of `ControlSettings`; `wrong_current` states a wrong
    current to the controller; `duration_s` flies the first part only.
    """
    own = method.removesuffix(TRIM)
    setup: dict[str, dict[str, Any]] = {}
    if scenario.startswith(WORLD):
        fields: dict[str, Any] = {"world": scenario.removeprefix(WORLD), "method": own, "seed": seed}
        setup[flights.HOVER_AND_ARC] = {}
    else:
        file, vehicle = scenario.split("/")
        fields = scenario_fields(file, seed) | {"vehicle": vehicle, "method": own}
        setup[f"{__name__}:scenario_setup"] = {"name": file, "seed": seed}
    if wrong_current:
        setup[f"{__name__}:wrong_current"] = {}
    if method.endswith(TRIM):
        setup[flights.BALLASTED] = {}
    return flight_trial(
        scenario,
        name or method,
        seed,
        fields | {f"control.{key}": value for key, value in (control or {}).items()},
        setup=setup,
        probes={flights.CAMERA_ERRORS: {}},
        duration_s=duration_s,
        sources=SOURCES,
    )


def parts_of(scenario: str, method: str, seed: int, **more: Any) -> Parts:
    """Parts of a flight of `wash_trial`."""
    return flight_parts(wash_trial(scenario, method, seed, **more).task.settings)[0]


def scenario_fields(name: str, seed: int) -> dict[str, Any]:
    """Fields of a scenario of the study that a seed has, by dotted name, with what the scenario's own seed draws."""
    what = sample_conditions(name, seed)
    values, draws = fields_of(name)
    return values | {
        "world": "tank",
        "seed": what.seed,
        "tank.mismatch.trim_N": what.trim_N,
        "tank.current.velocity_m_s": what.current_W_m_s,
        "randomize": {key: draw.model_dump(exclude_none=True) for key, draw in draws.items()},
    }


def scenario_setup(parts: Parts, name: str, seed: int) -> Parts:
    """Camera, route and cable of a flight of a scenario of the study."""
    file, what = load_scenario_file(name), sample_conditions(name, seed)
    if file.course == "nadir":
        parts = parts.replace(vehicle=looking_down(parts.vehicle))
    parts = parts.replace(route=route_of(file.course, parts, what))
    return parts.replace(**cable(parts, what)) if what.pull_N is not None else parts


def route_of(course: str, parts: Parts, what: SampledConditions) -> Route:
    """The route of a course, about where the target is taken to be."""
    centre, azimuth = parts.surveyed_target.centre_W_m, what.azimuth_rad
    if course == "station":
        return station_route(parts.surveyed_target, centre, azimuth)
    if course == "nadir":
        return transect_route(parts.surveyed_target, centre, azimuth, what.altitude_m or 0.0)
    if course == "orbit":
        return gentle_route(centre, STANDOFF_M, azimuth)
    standoff_m = CLOSE_M if course == "close" else BRAKE_AT_M
    low_deg = lowest_clear_deg(parts.vehicle, parts.bounds, parts.surveyed_target, standoff_m)
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


def wrong_current(parts: Parts) -> Parts:
    """State a current to the controller that is too fast or too slow, and turned; the seed draws both signs."""
    stated = wrong_current_m_s(parts.scenario.tank.current.velocity_m_s, parts.scenario.seed)
    return parts.replace(**{"control.allocation.current_m_s": stated})


def wrong_current_m_s(current_W_m_s: tuple[float, ...], seed: int) -> tuple[float, ...]:
    """A current that is believed in place of the true one, north, east and down."""
    faster, left = np.random.default_rng([seed, 31]).uniform(-1.0, 1.0, 2) < 0.0
    share = 1.0 + (WRONG_SHARE if faster else -WRONG_SHARE)
    turn = WRONG_RAD if left else -WRONG_RAD
    north, east, down = current_W_m_s
    c, s = np.cos(turn), np.sin(turn)
    stated = (share * (c * north - s * east), share * (s * north + c * east), down)
    return tuple(round(float(v), 6) for v in stated)
