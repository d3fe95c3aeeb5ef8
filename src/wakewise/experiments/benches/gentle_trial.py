"""One short flight of the gentle bench: a hover and an arc of an orbit, in one world, by one method, with one seed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import polars as pl

from wakewise.control import WakeView
from wakewise.control.trim import ballasted
from wakewise.evaluation import flight_figures
from wakewise.experiments.benches.paper_world import PaperWorld
from wakewise.geometry import Pose
from wakewise.missions import SETTLING, Leg, Route
from wakewise.missions.route import rest_to_rest
from wakewise.operation import FlightRecorder, Mission, fly
from wakewise.operation.build import Seeds, build_flight, build_target
from wakewise.operation.scenario import Scenario, check_scenario
from wakewise.targets import sample_region
from wakewise.vehicles import load_vehicle
from wakewise.wake import WakeSettings, disturbance, wake_model

World = Literal["parcels", "paper"]

SETTLE_S, HOVER_S, ARC_S = 8.0, 15.0, 15.0
HOVER_DEG, ARC_DEG = 40.0, 20.0
"""Elevations of two orbits of the default mission."""
STANDOFF_M, ARC_SPEED_M_S, TRANSIT_SPEED_M_S, ACCELERATION_M_S2 = 0.5, 0.06, 0.10, 0.05
EXPOSURE_EVERY_S = 3.0
WATER_EVERY_S = 0.25
WAKE_OF: dict[str, dict[str, Any]] = {
    "parcels": {"model": "jet"},
    "paper": {"model": "paper-calibrated", "edge_width_deg": 3.0},
}
"""What the controllers believe: the default, and in the paper's world the paper's model with a smooth edge."""

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
)


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
    """

    world: World
    method: str
    seed: int
    control: tuple[tuple[str, Any], ...] = ()
    float_N: float = 0.0
    shift_mm: float = 0.0
    standoff_m: float = STANDOFF_M


def scenario_of(trial: Trial) -> Scenario:
    """Everything at its default but for the method, the seed and what the trial changes."""
    control: dict[str, Any] = {"wake": dict(WAKE_OF[trial.world])}
    for name, value in trial.control:
        branch = control
        *parents, leaf = name.split(".")
        for parent in parents:
            branch = branch.setdefault(parent, {})
        branch[leaf] = value
    return check_scenario({"method": trial.method, "seed": trial.seed, "control": control}, "gentle bench")


def gentle_route(centre_W_m: Any, standoff_m: float, azimuth_rad: float) -> Route:
    """Hover on a higher orbit, sink to a lower one, fly part of it."""
    high = np.array([azimuth_rad, np.radians(HOVER_DEG), standoff_m])
    low = np.array([azimuth_rad, np.radians(ARC_DEG), standoff_m])
    turn = ARC_SPEED_M_S * ARC_S / (standoff_m * np.cos(low[1]))
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
    """Target and region; the same for all seeds, since the region is the controller's own choice of points."""
    scenario = Scenario()
    target = build_target(scenario.target, bed_z_m)
    return target, sample_region(target, scenario.target.points, Seeds.of(0).region)


def true_disturbance(frame: pl.DataFrame, mission: Mission, world: World, rate_hz: float) -> float:
    """Mean of D in (m/s)^2 of the true thrusts at the true poses, by the model believed in that world.

    The same yardstick for all methods, whatever each of them weighs itself; looked at five times a second.
    """
    wake = wake_model(WakeSettings(**WAKE_OF[world]))
    view = WakeView.of(mission.vehicle, mission.region, wake)
    rows = frame.gather_every(round(0.2 * rate_hz))
    places = rows.select("true_x_m", "true_y_m", "true_z_m").to_numpy()
    turns = rows.select("true_qw", "true_qx", "true_qy", "true_qz").to_numpy()
    thrusts = rows.select(f"thrust_{i + 1}_N" for i in range(len(mission.vehicle.thrusters))).to_numpy()
    steps = zip(places, turns, thrusts, strict=True)
    return float(np.mean([disturbance(view.gram(Pose(p, q)), T) for p, q, T in steps]))


def fly_trial(trial: Trial) -> dict[str, float | None]:
    """Figures of one flight, from the end of settling on, both legs and the way between them together."""
    scenario = scenario_of(trial)
    target, region = paper_place(scenario.tank.size_m[2])
    # The wind rose of the current is not round: each seed hovers at its own azimuth.
    azimuth = float(np.random.default_rng([trial.seed, 7]).uniform(-np.pi, np.pi))
    mission = Mission(
        vehicle=ballasted(load_vehicle(scenario.vehicle), trial.float_N, trial.shift_mm),
        target=target,
        region=region,
        route=gentle_route(target.centre_W_m, trial.standoff_m, azimuth),
        clearance_m=0.0,
    )
    flight = build_flight(scenario, mission)
    plant: Any = flight.tank
    witness: Any = flight.witness
    if trial.world == "paper":
        plant = witness = PaperWorld(
            flight.true_vehicle, target, scenario.tank, flight.tank.state, np.random.default_rng([trial.seed, 11])
        )
    dt_s, n = 1.0 / scenario.control.rate_hz, len(mission.vehicle.thrusters)
    recorder = FlightRecorder(
        route=mission.route,
        X_BC=mission.vehicle.X_BC,
        exposure_s=scenario.imaging.exposure_s,
        instants=1,
        thrusters=n,
        dt_s=dt_s,
        witness=witness,
        water_every_s=WATER_EVERY_S,
    )
    fly(
        pilot=flight.pilot,
        controller=flight.controller,
        estimator=flight.estimator,
        plant=plant,
        witness=witness,
        start=flight.start,
        thrusters=n,
        duration_s=mission.route.duration_s,
        dt_s=dt_s,
        record=recorder,
    )
    frame = recorder.frame().filter(pl.col("leg") != SETTLING)
    figures: dict[str, Any] = flight_figures(frame)
    out = {key: figures.get(key) for key in FIGURES}
    out["disturbance"] = true_disturbance(frame, mission, trial.world, scenario.control.rate_hz)
    for leg in ("hover", "orbit"):
        speed = frame.filter(pl.col("leg") == leg)["target_speed_mean_m_s"].mean()
        out[f"{leg}_speed_mean_m_s"] = float(speed)  # type: ignore[arg-type]
    return out
