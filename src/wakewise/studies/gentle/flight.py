"""One short flight of the gentle bench: a hover and an arc of an orbit, in one world, by one method, with one seed."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import polars as pl

from wakewise.control.trim import ballasted
from wakewise.evaluation import flight_figures
from wakewise.geometry import Pose, matrix_from_quat
from wakewise.missions import SETTLING, Leg, Route
from wakewise.missions.route import rest_to_rest
from wakewise.operation import Parts, fly
from wakewise.operation.scenario import Scenario, check_scenario
from wakewise.operation.seeds import Seeds
from wakewise.targets import Region, find_target, sample_region
from wakewise.vehicles import Vehicle, load_vehicle
from wakewise.wake import WakeSettings, WakeView, disturbance, wake_model

World = Literal["parcels", "paper"]

SETTLE_S, HOVER_S, ARC_S = 8.0, 15.0, 15.0
HOVER_DEG, ARC_DEG = 40.0, 20.0
"""Elevations of two orbits of the default mission."""
STANDOFF_M, ARC_SPEED_M_S, TRANSIT_SPEED_M_S, ACCELERATION_M_S2 = 0.5, 0.06, 0.10, 0.05
EXPOSURE_EVERY_S = 3.0
WATER_EVERY_S = 0.25
WAKE_OF: dict[str, dict[str, Any]] = {
    "parcels": {"model": "jet", "floor": False},
    "paper": {"model": "paper-calibrated", "edge_width_deg": 3.0, "floor": False},
}
"""What the controllers believe: the default, and in the paper's world the paper's model with a smooth edge."""

OFF = {"spare": False, "meet": False, "drift": False}
"""Levers that a scenario has on; here each is added by name."""

FIGURES = (
    "target_speed_mean_m_s",
    "target_speed_p95_m_s",
    "exposure_speed_mean_m_s",
    "bed_speed_p95_m_s",
    "disturbance",
    "position_rmse_mm",
    "path_rmse_mm",
    "velocity_deviation_pct",
    "roll_pitch_rms_deg",
    "energy_kJ",
    "sign_flips_per_s",
    "fallbacks",
    "collisions",
    "camera_rmse_mm",
    "hover_speed_mean_m_s",
    "orbit_speed_mean_m_s",
    "cpu_s",
)
"""Of each flight. `camera_rmse_mm` is how far the camera is from where the mission wants it, attitude included."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One flight to make; hashable, so that it can be handed to a worker.

    Parameters
    ----------
    world : "parcels" or "paper"
    method : str
    seed : int
    control : tuple
        Dotted fields of `ControlSettings` and their values.
    float_N : float
        Buoyancy by which the vehicle is ballasted away from neutral, known to everybody; the unknown trim comes on top.
    shift_mm : float
        How far its centre of gravity is moved forward, known to everybody.
    standoff_m : float
    with_current : bool
        Fly the arc in that direction in which the mean current helps.
    """

    world: World
    method: str
    seed: int
    control: tuple[tuple[str, Any], ...] = ()
    float_N: float = 0.0
    shift_mm: float = 0.0
    standoff_m: float = STANDOFF_M
    with_current: bool = False


def scenario_of(trial: Trial) -> Scenario:
    """Everything at its default but for the levers, which are off, the method, the seed and what the trial changes."""
    control: dict[str, Any] = {"wake": dict(WAKE_OF[trial.world]), "levers": dict(OFF)}
    for name, value in trial.control:
        branch = control
        *parents, leaf = name.split(".")
        for parent in parents:
            branch = branch.setdefault(parent, {})
        branch[leaf] = value
    world = "tank" if trial.world == "parcels" else trial.world
    told = {"method": trial.method, "seed": trial.seed, "world": world, "control": control}
    return check_scenario(told, "gentle bench")


def gentle_route(
    centre_W_m: Any,
    standoff_m: float,
    azimuth_rad: float,
    direction: float = 1.0,
    elevations_deg: tuple[float, float] = (HOVER_DEG, ARC_DEG),
) -> Route:
    """Hover on a higher orbit, sink to a lower one, fly part of it: towards larger azimuths, or less for -1."""
    high = np.array([azimuth_rad, np.radians(elevations_deg[0]), standoff_m])
    low = np.array([azimuth_rad, np.radians(elevations_deg[1]), standoff_m])
    turn = direction * ARC_SPEED_M_S * ARC_S / (standoff_m * np.cos(low[1]))
    end = low + np.array([turn, 0.0, 0.0])
    hover = Leg(
        name="hover",
        start=high,
        end=high,
        length_m=0.0,
        duration_s=HOVER_S,
        speed_m_s=TRANSIT_SPEED_M_S,
        acceleration_m_s2=ACCELERATION_M_S2,
    )
    sink = rest_to_rest("transit", high, low, TRANSIT_SPEED_M_S, ACCELERATION_M_S2)
    arc = rest_to_rest("orbit", low, end, ARC_SPEED_M_S, ACCELERATION_M_S2)
    legs = (hover, sink, arc)
    starts = SETTLE_S + np.cumsum([0.0, hover.duration_s, sink.duration_s])
    shots = [
        start + t
        for start, leg in ((starts[0], hover), (starts[2], arc))
        for t in np.arange(0.5 * EXPOSURE_EVERY_S, leg.duration_s, EXPOSURE_EVERY_S)
    ]
    return Route(
        centre_W_m=centre_W_m,
        legs=legs,
        starts_s=starts,
        exposures_s=np.array(shots),
        exposure_names=tuple(f"{k:03d}.png" for k in range(len(shots))),
        X_WC_planned=tuple(Pose(np.zeros(3)) for _ in shots),
        duration_s=float(starts[2] + arc.duration_s + 0.3),
    )


@lru_cache(maxsize=2)
def paper_place(bed_z_m: float) -> tuple[Any, Any]:
    """Target and the region about it; the same for all seeds, but for where each takes the target to be."""
    scenario = Scenario()
    target = find_target(scenario.target.kind, bed_z_m)
    return target, sample_region(target, scenario.target.points, Seeds(0).region())


def true_disturbance(frame: pl.DataFrame, parts: Parts, region: Region, world: World, rate_hz: float) -> float:
    """Mean of D in (m/s)^2 of the true thrusts at the true poses about the true target, by the model believed there.

    The same yardstick for all methods, whatever each of them weighs itself; looked at five times a second.
    """
    wake = wake_model(WakeSettings(**WAKE_OF[world]))
    view = WakeView.of(parts.vehicle, region, wake)
    rows = frame.gather_every(round(0.2 * rate_hz))
    places = rows.select("true_x_m", "true_y_m", "true_z_m").to_numpy()
    turns = rows.select("true_qw", "true_qx", "true_qy", "true_qz").to_numpy()
    thrusts = rows.select(f"thrust_{i + 1}_N" for i in range(len(parts.vehicle.thrusters))).to_numpy()
    steps = zip(places, turns, thrusts, strict=True)
    return float(np.mean([disturbance(view.gram(Pose(p, q)), T) for p, q, T in steps]))


def helped_by(current_m_s: tuple[float, float, float], azimuth_rad: float) -> float:
    """1 if the current runs towards larger azimuths at an azimuth, else -1."""
    north, east, _ = current_m_s
    return 1.0 if east * np.cos(azimuth_rad) - north * np.sin(azimuth_rad) >= 0.0 else -1.0


def camera_rmse_mm(frame: pl.DataFrame, vehicle: Vehicle) -> float:
    """Root mean square distance of the true camera from the wished one, in mm."""
    places = {}
    for who in ("true", "goal"):
        p = frame.select(f"{who}_x_m", f"{who}_y_m", f"{who}_z_m").to_numpy()
        q = frame.select(f"{who}_qw", f"{who}_qx", f"{who}_qy", f"{who}_qz").to_numpy()
        tilts = np.radians(frame[f"{who}_tilt_deg"].to_numpy())
        mounts = np.array([vehicle.X_BC_at(float(tilt)).p_m for tilt in tilts])
        places[who] = p + np.einsum("nij,nj->ni", matrix_from_quat(q), mounts)
    return 1e3 * float(np.sqrt(np.mean(np.sum((places["true"] - places["goal"]) ** 2, axis=1))))


def fly_trial(trial: Trial) -> dict[str, float | None]:
    """Figures of one flight, from the end of settling on, both legs and the way between them together."""
    began = time.process_time()
    scenario = scenario_of(trial)
    target, region = paper_place(scenario.tank.size_m[2])
    # The wind rose of the current is not round: each seed hovers at its own azimuth.
    azimuth = float(np.random.default_rng([trial.seed, 7]).uniform(-np.pi, np.pi))
    direction = helped_by(scenario.tank.current.velocity_m_s, azimuth) if trial.with_current else 1.0
    parts = scenario.parts().replace(
        vehicle=ballasted(load_vehicle(scenario.vehicle), trial.float_N, trial.shift_mm), target=target
    )
    found = parts.found_target.centre_W_m
    parts = parts.replace(
        region=region.moved(found - target.centre_W_m),
        route=gentle_route(found, trial.standoff_m, azimuth, direction),
    )
    # The arc passes the target at the mission's own standoff, which the mission's check has seen.
    frame = fly(parts, checked=False, water_every_s=WATER_EVERY_S).steps.filter(pl.col("leg") != SETTLING)
    figures: dict[str, Any] = flight_figures(frame)
    out = {key: figures.get(key) for key in FIGURES}
    out["disturbance"] = true_disturbance(frame, parts, region, trial.world, scenario.control.rate_hz)
    for leg in ("hover", "orbit"):
        speed = frame.filter(pl.col("leg") == leg)["target_speed_mean_m_s"].mean()
        out[f"{leg}_speed_mean_m_s"] = float(speed)  # type: ignore[arg-type]
    out["camera_rmse_mm"] = camera_rmse_mm(frame, parts.vehicle)
    out["cpu_s"] = time.process_time() - began
    return out
