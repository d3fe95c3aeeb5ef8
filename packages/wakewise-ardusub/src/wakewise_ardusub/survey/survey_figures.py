"""Figures of a survey by the autopilot's own position, heading and rangefinder."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from wakewise.core.arrays import Array

FIGURE_MEANINGS = {
    "folder": "figures.json and a journal of place, altitude and photographs",
    "finished": "all of it was flown",
    "state": "of the session",
    "why": "what it ended by",
    "flown_m": "metres of line flown",
    "planned_m": "metres of line in all",
    "centre_m": "centre of the orbits: north, east of the autopilot's origin, m",
    "current_m_s": "current: north, east, m/s",
    "speed_error_rms_m_s": "speed along the line against the one asked for, in cruise, m/s",
    "altitude_error_rms_m": "altitude above the bed against the one asked for, m",
    "altitude_error_p95_m": "the same, 95 % of the time within, m",
    "cross_track_p95_m": "place across the line, 95 % of the time within, m",
    "cross_track_max_m": "the same, at most, m",
    "heading_error_p95_deg": "heading against the one asked for (which turns into the current), 95 % within, deg",
    "photographs": "triggered",
    "interruptions": "times that it was paused by the pilot or a loss",
    "outliers": "distances of the rangefinder that were refused",
    "weight_N": "of the vehicle in water, as its vertical thrusters held it, N",
}


class SurveyRow(NamedTuple):
    """One target on a line: time, speed along it and as asked for, altitude and as asked for, place beside and ahead of
    the target place, and error of the heading (on an arc: of the bearing to its centre); s, m/s, m, rad.
    """

    time_s: float
    speed_m_s: float
    asked_m_s: float
    altitude_m: float
    asked_m: float
    across_m: float
    along_m: float
    heading_rad: float


def errors_of(rows: Sequence[SurveyRow], cruise_m_s: float) -> dict[str, Any]:
    """Errors over lines, of speed in cruise alone; None where nothing was flown."""
    speeds = np.array([row.speed_m_s - row.asked_m_s for row in rows if row.asked_m_s >= cruise_m_s - 1e-6])
    altitudes = np.array([row.altitude_m - row.asked_m for row in rows])
    across, headings = np.array([row.across_m for row in rows]), np.array([row.heading_rad for row in rows])
    turned = _p95(headings)
    return {
        "speed_error_rms_m_s": _rms(speeds),
        "altitude_error_rms_m": _rms(altitudes),
        "altitude_error_p95_m": _p95(altitudes),
        "cross_track_p95_m": _p95(across),
        "cross_track_max_m": float(np.abs(across).max()) if across.size else None,
        "heading_error_p95_deg": None if turned is None else math.degrees(turned),
    }


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else None


def _p95(values: Array) -> float | None:
    return float(np.percentile(np.abs(values), 95)) if values.size else None
