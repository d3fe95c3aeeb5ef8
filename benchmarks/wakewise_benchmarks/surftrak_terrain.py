"""Bed following beside ArduSub's own: the terrains and results of the public project on SURFTRAK.

github.com/clydemcqueen/ardusub_surftrak (MIT), commit 7a85f52, flew ArduSub's real firmware in simulation over terrain
that is replayed in time: a trapezoid of 5 m and a sawtooth of 1 m, faces of 0.2 m/s, 20 m deep, rangefinder noise 5 cm,
delay 0.3 s. Here the same bed passes under a survey at 0.1 m/s, with the simulated autopilot in place of the firmware.
Its results are figures over all rows of results/sitl/surftrak/TERRAIN/stamped_terrain.csv: the vehicle's height above
the terrain about its median.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from wakewise.core.arrays import Array
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.sitl.sea_sensors import Relief, SensorErrors

TERRAINS: dict[str, tuple[tuple[float, float], ...]] = {
    "trapezoid": ((0.0, 0.0), (20.0, 0.0), (45.0, 5.0), (65.0, 5.0), (90.0, 0.0)),
    "sawtooth": ((0.0, 0.0), (10.0, 0.0), (10.01, 1.0), (20.0, 1.0), (25.0, 0.0)),
}
"""Time, s, and height of the bed, m, at the corners of one period."""
FIRMWARE_CM = {"trapezoid": {"rms": 17.8, "p95": 31.1}, "sawtooth": {"rms": 34.4, "p95": 92.2}}
DEPTH_M, ALTITUDE_M, SPEED_M_S, LENGTH_M = 20.0, 8.85, 0.1, 15.4
RANGE_NOISE_M = 0.05


@dataclass(frozen=True, kw_only=True)
class ReplayedTerrain(Relief):
    """A terrain over time, laid along north for a vehicle at `SPEED_M_S`; corners as in `TERRAINS`."""

    corners: tuple[tuple[float, float], ...]

    def bed_m(self, north_m: float, east_m: float) -> float:
        """Depth of the bed at a place, m."""
        del east_m
        times, heights = np.array(self.corners).T
        return self.depth_m - float(np.interp(north_m / SPEED_M_S % times[-1], times, heights))

    def range_m(self, place_W_m: Array, way_W: Array) -> float:
        """That of the bed straight below: theirs was replayed in time, whatever the vehicle's tilt."""
        return (self.bed_m(float(place_W_m[0]), float(place_W_m[1])) - float(place_W_m[2])) / max(float(way_W[2]), 0.1)


def surftrak_figures(name: str, length_m: float = LENGTH_M) -> dict[str, Any]:
    """Altitude error of one survey over a terrain, cm, beside that of the firmware's SURFTRAK."""
    from wakewise_ardusub.sitl.survey_harness import SurveyHarness, straight_line
    from wakewise_ardusub.survey.survey_plan import SurveyPace
    from wakewise_ardusub.survey.transect_session import TransectOptions

    harness = SurveyHarness(
        load_vehicle("bluerov2-heavy"),
        relief=ReplayedTerrain(corners=TERRAINS[name], depth_m=DEPTH_M),
        errors=SensorErrors(range_noise_m=RANGE_NOISE_M, outlier_share=0.0, gaps_per_min=0.0),
        lines=straight_line(length_m),
        options=TransectOptions(pace=SurveyPace(speed_m_s=SPEED_M_S, altitude_m=ALTITUDE_M)),
        depth_m=DEPTH_M - ALTITUDE_M,
    )
    harness.ready().session.consent()
    session = harness.to_the_end(20.0 * length_m / SPEED_M_S).session
    found = harness.figures()
    return {
        "finished": session.finished,
        "altitude_rms_cm": found["altitude_rms_cm"],
        "altitude_p95_cm": found["altitude_p95_cm"],
        "firmware_rms_cm": FIRMWARE_CM[name]["rms"],
        "firmware_p95_cm": FIRMWARE_CM[name]["p95"],
    }
