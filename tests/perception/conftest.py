"""Pictures of a coral on its bed along an arc, rendered once for all tests of the tracker."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.perception import CalibratedCamera
from wakewise.perception.feature_tracks import Grey
from wakewise.scene.missions.orbit import camera_pose
from wakewise.scene.targets import Target, find_target
from wakewise.vision.imaging import ImagingSettings, PinholeCamera, Scene, photograph

WIDTH, HEIGHT, BED_M = 480, 360, 1.5


@dataclass(frozen=True)
class Pictures:
    """Grey pictures, the camera poses X_WC that they were taken from, and what they show."""

    target: Target
    camera: CalibratedCamera
    poses: list[Pose]
    pictures: list[Grey]


@pytest.fixture(scope="session")
def arc() -> Pictures:
    """An arc of 30 deg about a point beside a branching coral, 0.7 m off."""
    target = find_target("branching", BED_M)
    scene = Scene.build(target, 0)
    settings = ImagingSettings(width=WIDTH, height=HEIGHT, samples=1, flakes_per_m3=0.0)
    focal = 0.5 * WIDTH / math.tan(math.radians(0.5 * settings.fov_deg))
    lens, rng = PinholeCamera(WIDTH, HEIGHT, math.radians(settings.fov_deg)), np.random.default_rng(0)
    beside = target.centre_W_m + np.array([0.05, 0.08, 0.0])
    poses = [camera_pose(beside, math.radians(azimuth), 0.45, 0.7) for azimuth in np.linspace(-15.0, 15.0, 31)]
    taken = [photograph(scene, lens, [X_WC], None, settings, rng).image for X_WC in poses]
    camera = CalibratedCamera(
        width=WIDTH, height=HEIGHT, fx=focal, fy=focal, cx=0.5 * (WIDTH - 1), cy=0.5 * (HEIGHT - 1)
    )
    greys = [np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8) for image in taken]
    return Pictures(target, camera, poses, greys)
