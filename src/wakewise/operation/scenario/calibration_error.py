"""Errors of the surveyed target, the camera calibration and the surveyed current."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from wakewise.core.arrays import Array
from wakewise.core.interfaces import Current
from wakewise.core.settings import Settings
from wakewise.scene.targets import Target

if TYPE_CHECKING:
    from wakewise.vision.imaging import OpenCVCamera

CURRENT_DEG = 15.0
"""Error of the surveyed current's direction, one sigma, deg: a streamer's swing and a compass beside thrusters, an
estimate. The speed has no error because only the direction orders the views."""
SURVEY_S, SURVEY_STEP_S = 60.0, 0.5
"""Length of the current survey and its sampling period: several periods of any swell, and many eddies."""


class CalibrationErrorSettings(Settings):
    """Errors of target and camera as mission, controller and reconstruction have them; drawn once for a flight.

    The vehicle's camera finds the target. The error of its poses is 3 to 5 mm per axis for the duration of a survey:
    5 mm. The calibrations of two sport cameras of one make in one make of housing differ by 0.07 % in focal length, 2.0
    and 1.6 px of 960 in principal point, 0.005 and 0.010 in k1 and k2, 0.00002 and 0.002 in p1 and p2 (calibration
    files of SVIn2, S. Rahman, A. Quattrini Li, I. Rekleitis, arXiv:1810.03200); the defaults are these, rounded. The
    focal length is less certain after the housing was opened or in other water (M. Shortis, Sensors 15 (2015) 30810,
    doi 10.3390/s151229831): 0.2 %, an estimate.
    """

    target_position_m: float = Field(
        0.005, ge=0.0, le=0.2, description="error of the target's place, one sigma per axis"
    )
    focal_length_pct: float = Field(0.2, ge=0.0, le=10.0, description="error of the focal length, one sigma")
    principal_point_pct: float = Field(
        0.15, ge=0.0, le=5.0, description="error of the principal point, one sigma per axis, of the image's width"
    )
    distortion: float = Field(
        0.003, ge=0.0, le=0.1, description="error of k1, one sigma; k2's is twice, p1's and p2's a quarter of it"
    )


def target_with_error(target: Target, errors: CalibrationErrorSettings, rng: np.random.Generator) -> Target:
    """The target at its surveyed place; its shape, and the bed, have no error."""
    return target.moved(rng.normal(0.0, errors.target_position_m, 3))


def calibration_with_error(
    true: OpenCVCamera, errors: CalibrationErrorSettings, rng: np.random.Generator
) -> OpenCVCamera:
    """The camera model with errors of calibration; the true one is in camera.json alone."""
    focal, centre = (
        rng.normal(0.0, 0.01 * errors.focal_length_pct),
        rng.normal(0.0, 0.01 * errors.principal_point_pct * true.width, 2),
    )
    bend = errors.distortion * np.array([1.0, 2.0, 0.25, 0.25]) * rng.normal(size=4)
    params = np.concatenate([true.params[:2] * (1.0 + focal), true.params[2:4] + centre, true.params[4:] + bend])
    return replace(true, params=params)


def current_with_error(water: Current, place_W_m: Array, rng: np.random.Generator) -> Array:
    """Surveyed current at a place, both shape (3,): the mean over `SURVEY_S`, turned about the vertical by an error."""
    times_s = np.arange(0.0, SURVEY_S, SURVEY_STEP_S)
    north, east, down = np.mean([water.velocity(place_W_m[None], float(t))[0] for t in times_s], axis=0)
    turn = math.radians(rng.normal(0.0, CURRENT_DEG))
    c, s = math.cos(turn), math.sin(turn)
    return np.array([c * north - s * east, s * north + c * east, down])
