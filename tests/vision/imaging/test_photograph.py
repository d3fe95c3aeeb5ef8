"""Photographs of a real coral: repeatable, well exposed, blurred by motion and dimmed by silt."""

import cv2
import numba
import numpy as np
import pytest
from imaging_helpers import coral_scene, view

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid
from wakewise.vision.imaging import SiltOptics, photograph, sharpness
from wakewise.vision.imaging.settings import ImagingSettings

SETTINGS = ImagingSettings()


def take(poses=None, silt=None, seed=0, settings=SETTINGS):
    scene, target = coral_scene()
    poses = poses or [view(40, centre=target.centre_W_m)]
    return photograph(scene, settings.camera(), poses, silt, settings, np.random.default_rng(seed))


def cloud(kg_m3):
    return ScalarGrid(origin_W_m=np.array([-2.0, -2.0, 0.0]), spacing_m=1.0, values=np.full((5, 5, 3), kg_m3))


def test_a_photograph_is_well_exposed_and_rich():
    """From three elevations the mean grey is 0.3-0.55, next to nothing saturates, and SIFT finds the coral."""
    target = coral_scene()[1]
    for elevation in (20, 40, 60):
        photo = take([view(elevation, centre=target.centre_W_m)])
        grey = cv2.cvtColor(photo.image, cv2.COLOR_RGB2GRAY)
        assert photo.image.shape == (720, 960, 3)
        assert 0.3 < grey.mean() / 255 < 0.55
        assert (photo.image == 255).mean() < 0.01
        features = cv2.SIFT_create().detect(grey[240:480, 340:620], None)
        assert len(features) > 300
        assert photo.turbidity_per_m == 0.0


def test_same_seed_same_bytes_on_any_thread_count():
    """Seed and inputs decide every byte, on one thread as on all."""
    silt, threads = cloud(0.01), numba.get_num_threads()
    first = take(silt=silt, seed=4)
    numba.set_num_threads(1)
    try:
        second = take(silt=silt, seed=4)
    finally:
        numba.set_num_threads(threads)
    assert first.image.tobytes() == second.image.tobytes()
    assert first.image.tobytes() != take(silt=silt, seed=5).image.tobytes()


def test_silt_and_motion_soften_the_picture():
    """Sharpness falls with silt and with motion; turbidity is attenuation per concentration times concentration."""
    middle = view(40, centre=coral_scene()[1].centre_W_m)
    clear = take([middle])
    silty = take([middle], cloud(0.05))
    moved = take([middle @ Pose(np.array([x, 0.0, 0.0])) for x in (-0.003, 0.0, 0.003)])
    assert silty.sharpness < 0.5 * clear.sharpness
    assert moved.sharpness < 0.5 * clear.sharpness
    assert silty.turbidity_per_m == pytest.approx(0.05 * SiltOptics().attenuation_m2_kg, rel=1e-3)


def test_sharpness_without_a_target_is_unknown():
    """Looking away from the target there is nothing to judge."""
    image = np.zeros((20, 20, 3), np.uint8)
    assert sharpness(image, np.zeros((20, 20), np.float32)) is None


def test_negative_silt_is_refused():
    """A negative concentration raises InputError."""
    with pytest.raises(InputError, match="silt"):
        take(silt=cloud(-0.1))


@pytest.mark.parametrize("lens", [{"distortion": (-0.11, 0.1, 0.0, 0.0)}, {"fov_deg": 75.0, "port_air_m": 0.01}])
def test_a_lens_takes_the_whole_picture(lens):
    """Through distortion and port a moving camera in silt takes a picture without holes, and blur shows."""
    settings = ImagingSettings(width=320, height=240, **lens)
    middle = view(40, centre=coral_scene()[1].centre_W_m)
    moving = [middle @ Pose(np.array([x, 0.0, 0.0])) for x in (-0.01, 0.0, 0.01)]
    still = take([middle], cloud(0.01), settings=settings)
    moved = take(moving, cloud(0.01), settings=settings)
    assert moved.sharpness < 0.7 * still.sharpness
    assert np.abs(moved.image.mean() - still.image.mean()) < 3.0
    assert still.image.min(axis=2).mean() > 20
    assert still.turbidity_per_m == pytest.approx(0.01 * SiltOptics().attenuation_m2_kg, rel=1e-3)
