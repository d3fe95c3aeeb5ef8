"""What the crew knows of target, camera and current before the flight, and how wrong that is."""

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
"""Error of the surveyed current's direction, one sigma: what a streamer's swing and a compass beside thrusters leave
together, an estimate. Its speed is not asked for: only the direction orders the views."""
WATCHED_S, WATCHED_EVERY_S = 60.0, 0.5
"""How long the water at the target is watched for it, and how often: several periods of any swell, and many eddies."""


class CalibrationErrorSettings(Settings):
    """How well target and camera are known to mission, controller and reconstruction; drawn once for a flight.

    The target is found by the camera that the vehicle flies by, whose poses are off by 3 to 5 mm per axis for as long
    as a look takes: 5 mm. A calibration under water is as good as it can be repeated. Those of two sport cameras of one
    make in one make of housing lie 0.07 % apart in focal length, 2.0 and 1.6 px of 960 in principal point, 0.005 and
    0.010 in k1 and k2, 0.00002 and 0.002 in p1 and p2 (calibration files of SVIn2, S. Rahman, A. Quattrini Li, I.
    Rekleitis, arXiv:1810.03200), from which the spreads here are rounded; a focal length is less well known than that
    once the housing was opened or the water is another (M. Shortis, Sensors 15 (2015) 30810, doi 10.3390/s151229831):
    0.2 %, an estimate.
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
    """The target where the crew takes it to be; its shape, and the bed, are known."""
    return target.moved(rng.normal(0.0, errors.target_position_m, 3))


def calibration_with_error(
    true: OpenCVCamera, errors: CalibrationErrorSettings, rng: np.random.Generator
) -> OpenCVCamera:
    """The calibration that the crew has of a camera; its true one is in camera.json alone."""
    focal, centre = (
        rng.normal(0.0, 0.01 * errors.focal_length_pct),
        rng.normal(0.0, 0.01 * errors.principal_point_pct * true.width, 2),
    )
    bend = errors.distortion * np.array([1.0, 2.0, 0.25, 0.25]) * rng.normal(size=4)
    params = np.concatenate([true.params[:2] * (1.0 + focal), true.params[2:4] + centre, true.params[4:] + bend])
    return replace(true, params=params)


def current_with_error(water: Current, place_W_m: Array, rng: np.random.Generator) -> Array:
    """Current at a place, shape (3,), as the crew knows it before the flight: the mean of a minute, turned by an error.

    Parameters
    ----------
    water : Current
        The water's own motion.
    place_W_m : ndarray, shape (3,)
    rng : numpy Generator
    """
    times_s = np.arange(0.0, WATCHED_S, WATCHED_EVERY_S)
    north, east, down = np.mean([water.velocity(place_W_m[None], float(t))[0] for t in times_s], axis=0)
    turn = math.radians(rng.normal(0.0, CURRENT_DEG))
    c, s = math.cos(turn), math.sin(turn)
    return np.array([c * north - s * east, s * north + c * east, down])
