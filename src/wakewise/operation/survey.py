"""What the crew knows of target and camera before the flight, and how wrong that is."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from wakewise.settings import Settings
from wakewise.targets import Target

if TYPE_CHECKING:
    from wakewise.imaging import Calibration


class SurveySettings(Settings):
    """How well target and camera are known to mission, controller and reconstruction; drawn once for a flight.

    The target is found by the camera that the vehicle flies by, whose poses are off by 3 to 5 mm per axis for as long
    as a look takes: 5 mm. A calibration under water is as good as it can be repeated. Those of two sport cameras of one
    make in one make of housing lie 0.07 % apart in focal length, 2.0 and 1.6 px of 960 in principal point, 0.005 and
    0.010 in k1 and k2, 0.00002 and 0.002 in p1 and p2 (calibration files of SVIn2, S. Rahman, A. Quattrini Li, I.
    Rekleitis, arXiv:1810.03200), from which the spreads here are rounded; a focal length is less well known than that
    once the housing was opened or the water is another (M. Shortis, Sensors 15 (2015) 30810, doi 10.3390/s151229831):
    0.2 %, an estimate.
    """

    place_m: float = Field(0.005, ge=0.0, le=0.2, description="error of the target's place, one sigma per axis")
    focal_pct: float = Field(0.2, ge=0.0, le=10.0, description="error of the focal length, one sigma")
    centre_pct: float = Field(
        0.15, ge=0.0, le=5.0, description="error of the principal point, one sigma per axis, of the image's width"
    )
    distortion: float = Field(
        0.003, ge=0.0, le=0.1, description="error of k1, one sigma; k2's is twice, p1's and p2's a quarter of it"
    )


def found_target(target: Target, survey: SurveySettings, rng: np.random.Generator) -> Target:
    """The target where the crew takes it to be; its shape, and the bed, are known."""
    return target.moved(rng.normal(0.0, survey.place_m, 3))


def known_calibration(true: Calibration, survey: SurveySettings, rng: np.random.Generator) -> Calibration:
    """The calibration that the crew has of a camera; its true one is in camera.json alone."""
    focal, centre = rng.normal(0.0, 0.01 * survey.focal_pct), rng.normal(0.0, 0.01 * survey.centre_pct * true.width, 2)
    bend = survey.distortion * np.array([1.0, 2.0, 0.25, 0.25]) * rng.normal(size=4)
    params = np.concatenate([true.params[:2] * (1.0 + focal), true.params[2:4] + centre, true.params[4:] + bend])
    return replace(true, params=params)
