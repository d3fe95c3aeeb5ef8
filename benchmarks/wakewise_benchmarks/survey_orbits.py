"""Orbits on the simulated autopilot: circles round a centre, bow towards it, over relief in a current.

Written down before the figures of these flights were known; the bounds of the turn were chosen on seed 1, from shorter
flights on which larger ones had failed:

- asked: place along the radius within 10 cm and altitude within 5 cm at 95 % of the time, speed along the circle within
  1 cm/s rms, bearing of the centre within 5 deg at 95 % of the time (a camera with 60 deg of view keeps a target that
  is 1 m wide at 1.5 m in its picture);
- flights: seeds 0 to `--seeds`, over a drawn trapezoid (even seeds) or sawtooth (odd), in a drawn current of 0 to
  0.15 m/s of any direction, from a drawn heading, with the errors of `SensorErrors`; one turn of each of `CIRCLES`;
- speed and altitude are true ones. Radius and bearing are by the autopilot's own position, as across a line.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Progress
from wakewise.robot.vehicles import load_vehicle

VEHICLE, FASTEST_CURRENT_M_S = "bluerov2-heavy", 0.15
CIRCLES: dict[str, tuple[float, float]] = {
    "orbit": (1.5, 0.1),
    "orbit_small": (1.0, 0.1),
    "orbit_fast": (2.0, 0.2),
    "orbit_fastest": (4.5, 0.3),
}
"""Radius (m) and speed (m/s) of each: the one asked for, and the smallest that is flown at three speeds."""
ASKED = {"speed_rms_cm_s": 1.0, "altitude_p95_cm": 5.0, "cross_track_p95_cm": 10.0, "heading_p95_deg": 5.0}
NAMES = (*ASKED, "cross_track_max_cm", "heading_max_deg")


def orbit_figures(seed: int, radius_m: float, speed_m_s: float, turns: float = 1.0) -> dict[str, Any]:
    """One orbit, until it ends by itself."""
    from wakewise_ardusub.sitl.sea_sensors import Relief, drawn_current
    from wakewise_ardusub.sitl.survey_harness import SurveyHarness
    from wakewise_ardusub.survey.orbit_plan import OrbitRequest
    from wakewise_ardusub.survey.survey_plan import SurveyLeg, SurveyPace
    from wakewise_ardusub.survey.transect_session import TransectOptions

    began, rng = time.thread_time(), np.random.default_rng([seed, 77])
    bed = Relief.drawn("sawtooth" if seed % 2 else "trapezoid", rng)
    current_m_s = float(rng.uniform(0.0, FASTEST_CURRENT_M_S))
    request, pace = OrbitRequest(radius_m=radius_m, turns=turns), SurveyPace(speed_m_s=speed_m_s)

    def legs(place: Array, heading: float, water: Array, _anchor: object) -> list[SurveyLeg]:
        return request.legs(place, heading, water)

    harness = SurveyHarness(
        load_vehicle(VEHICLE),
        relief=bed,
        current=drawn_current(rng, current_m_s),
        lines=legs,
        options=TransectOptions(pace=pace, every_m=0.5),
        seed=seed,
        heading_rad=float(rng.uniform(-np.pi, np.pi)),
    )
    harness.ready().session.consent()
    session = harness.to_the_end(900.0).session
    return {
        "seed": seed,
        "relief": bed.shape,
        "current_m_s": current_m_s,
        "finished": session.finished,
        "ended_by": session.ended_by,
        "photographs": session.photographs,
        "flown_m": 0.0 if session.at is None else session.at.flown_m,
        **harness.figures(),
        "cpu_s": time.thread_time() - began,
    }


def orbits(seeds: int, summary: Callable[..., dict[str, Any]], progress: Progress) -> dict[str, Any]:
    """Summary and flights of each of `CIRCLES`."""
    told: dict[str, Any] = {}
    for name, (radius_m, speed_m_s) in CIRCLES.items():
        progress(len(told), len(CIRCLES), f"{name}, {seeds} flights")
        flights = [orbit_figures(seed, radius_m, speed_m_s) for seed in range(seeds)]
        row = {"radius_m": radius_m, "speed_m_s": speed_m_s, **summary(flights, ASKED, NAMES)}
        told[name] = row | {"each": flights}
    return told
