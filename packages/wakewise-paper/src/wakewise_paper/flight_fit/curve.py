"""Error of a jet that was calibrated in place, against minutes of flight, in worlds whose jets are drawn.

The flight hovers on the middle orbit, by a method of the library. What the fit is given is what the vehicle has:
frames, poses of its filter, commands. The drawn width is used to judge only.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import Progress, no_progress
from wakewise.operation import Parts, Scenario, fly
from wakewise.robot.vehicles import Vehicle
from wakewise.scene.missions import Leg, Route
from wakewise.vision.imaging import PinholeCamera
from wakewise.wake import RoundJet
from wakewise_paper.flight_fit.flake_likelihood import FlightFit, fit_flight
from wakewise_paper.flight_fit.flake_tracks import FlakeObserver, FlakeTracks, held_sightings
from wakewise_paper.learned_wake.evaluation import WakeModelScore, unit_f
from wakewise_paper.learned_wake.truth import SampledWater, even_parcel_rows

MINUTES = (0.5, 1.0, 2.0, 5.0)
SETTLE_S = 8.0
BELIEVED_SLOPE = RoundJet().half_width_slope


@dataclass(frozen=True, kw_only=True)
class CalibrationFlight:
    """One flight to calibrate on."""

    world: str = "payload"
    method: str = "dp"
    seed: int = 1
    minutes: float = 5.0
    standoff: float = 1.0
    """Times the mission's own."""


def hover_parts(flight: CalibrationFlight) -> Parts:
    """A hover on the middle orbit, from a side that the seed draws, as long as asked."""
    parts = Scenario.preset("quick", world=flight.world, method=flight.method, seed=flight.seed).parts()
    mission = parts.scenario.mission
    azimuth = float(np.random.default_rng([flight.seed, 7]).uniform(-np.pi, np.pi))
    elevation = sorted(mission.elevations_deg)[len(mission.elevations_deg) // 2]
    place = np.array([azimuth, np.radians(elevation), flight.standoff * mission.standoff_m])
    duration = 60.0 * flight.minutes
    leg = Leg(
        name="hover",
        start=place,
        end=place,
        length_m=0.0,
        duration_s=duration,
        speed_m_s=0.1,
        acceleration_m_s2=0.05,
    )
    middle = SETTLE_S + 0.5 * duration
    route = Route(
        centre_W_m=parts.target.centre_W_m,
        legs=(leg,),
        starts_s=np.array([SETTLE_S]),
        exposures_s=np.array([middle]),
        exposure_names=("000.png",),
        X_WC_planned=(Pose(np.zeros(3)),),
        duration_s=SETTLE_S + duration,
    )
    return parts.replace(route=route)


def watched(flight: CalibrationFlight, progress: Progress = no_progress) -> tuple[FlakeTracks, Parts, Array | None]:
    """What the camera saw on the flight, its parts, and the last current that the filter had."""
    parts = hover_parts(flight)
    rng = np.random.default_rng([flight.seed, 11])
    per_m3 = parts.scenario.imaging.flakes_per_m3
    watcher = FlakeObserver(camera=camera_of(parts), vehicle=parts.vehicle, rng=rng, per_m3=per_m3)
    current: list[Array | None] = [None]

    def watch(step: Any, truth_provider: Any) -> None:
        current[0] = step.estimate.current_W_m_s
        if step.time_s >= SETTLE_S:
            watcher.watch(step, truth_provider)

    fly(parts, checked=False, water_every_s=5.0, watch=watch, progress=progress)
    return watcher.sightings(), parts, current[0]


def curve(flight: CalibrationFlight, progress: Progress = no_progress) -> dict[str, Any]:
    """Fits of the first minutes of a hover, as plain values with the truth that they are judged by."""
    began = time.process_time()
    seen, parts, current = watched(flight, progress)
    jets = parts.scenario.tank.jets
    water = SampledWater(half_width_growth=jets.half_width_growth, wake_life=jets.wake_life)
    found = _curve(seen, camera_of(parts), parts.vehicle, water, flight.minutes, SETTLE_S, current)
    true_current = [float(v) for v in parts.scenario.tank.current.velocity_m_s]
    told = {"way": flight.method, "world": flight.world, "seed": flight.seed, "true_current_m_s": true_current}
    return told | found | {"cpu_s": time.process_time() - began}


def held_curve(world: str, seed: int, minutes: float = 5.0) -> dict[str, Any]:
    """The same of a vehicle that is held while its bow thrusters push in turn, in the jets that a world draws."""
    began = time.process_time()
    parts = Scenario.preset("quick", world=world, seed=seed).parts()
    jets = parts.scenario.tank.jets
    water = SampledWater(half_width_growth=jets.half_width_growth, wake_life=jets.wake_life)
    current = np.array(parts.scenario.tank.current.velocity_m_s)
    rng = np.random.default_rng([seed, 13])
    camera, per_m3 = camera_of(parts), parts.scenario.imaging.flakes_per_m3
    seen = held_sightings(parts.vehicle, camera, water, current, rng, minutes=minutes, per_m3=per_m3)
    told = {"way": "held", "world": world, "seed": seed, "true_current_m_s": [float(v) for v in current]}
    found = _curve(seen, camera, parts.vehicle, water, minutes, 0.0, None)
    return told | found | {"cpu_s": time.process_time() - began}


def camera_of(parts: Parts) -> PinholeCamera:
    """The pinhole that a calibrated and undistorted view is."""
    imaging = parts.scenario.imaging
    return PinholeCamera(imaging.width, imaging.height, float(np.radians(imaging.fov_deg)))


def _curve(
    seen: FlakeTracks,
    camera: PinholeCamera,
    vehicle: Vehicle,
    water: SampledWater,
    minutes: float,
    start_s: float,
    current_m_s: Array | None,
) -> dict[str, Any]:
    rows = []
    for until in (m for m in MINUTES if m <= minutes + 1e-9):
        fit = fit_flight(seen.until(start_s + 60.0 * until), camera, vehicle, current_m_s)
        rows.append({"minutes": until, **fit_figures(fit, water)})
    return {
        "true_half_width_growth": water.half_width_growth,
        "believed": {"slope": BELIEVED_SLOPE, **judged(BELIEVED_SLOPE, 1.0, water)},
        "curve": rows,
    }


def fit_figures(fit: FlightFit, water: SampledWater) -> dict[str, Any]:
    """A fit as plain values; what is not known is None."""
    error = fit.slope_error
    return {
        "flakes": fit.flakes,
        "half_width_slope": fit.half_width_slope,
        "slope_standard_error": float(error) if np.isfinite(error) else None,
        "gain": fit.gain,
        "gain_standard_error": float(fit.gain_error) if np.isfinite(fit.gain_error) else None,
        "current_m_s": [float(v) for v in fit.current_m_s],
        "told": fit.told,
        "slope_error_pct": 100.0 * (fit.half_width_slope / water.half_width_growth - 1.0),
        **judged(fit.half_width_slope, fit.gain, water),
    }


def judged(slope: float, gain: float, water: SampledWater) -> dict[str, float]:
    """How the round jet with these numbers meets an even jet of that water, where a target may be."""
    rows = even_parcel_rows(water, np.random.default_rng(5), instants=3, count=200, judged=True, likes=2)
    score = WakeModelScore.of(gain * unit_f(RoundJet(half_width_slope=float(np.clip(slope, 0.05, 0.4))), rows), rows)
    return {"error_share": score.error_share, "factor_of_2_pct": score.factor_of_2_pct}
