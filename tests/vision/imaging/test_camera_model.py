"""The written camera model is COLMAP's, exact where it can be, and honest where it cannot."""

import json

import numpy as np
import pytest

from wakewise.vision.imaging import FlatPort, LensCamera, PinholeCamera, calibrate


def test_pinhole_and_distortion_are_written_exactly(tmp_path):
    """Without a port the model's numbers are the camera's own and nothing is left over."""
    camera = LensCamera(960, 720, np.deg2rad(90), (-0.11, 0.10, 0.0014, 0.0005))
    model = calibrate(camera)
    points = np.random.default_rng(0).uniform([-0.5, -0.4, 0.6], [0.5, 0.4, 2.0], (100, 3))
    assert np.abs(model.project(points) - camera.project(points)).max() < 1e-9
    assert (model.rms_px, model.max_px, model.ahead_m) == (0.0, 0.0, 0.0)
    model.write(tmp_path)
    words = (tmp_path / "cameras.txt").read_text().splitlines()[-1].split()
    assert words[:4] == ["1", "OPENCV", "960", "720"]
    assert np.array(words[4:], float) == pytest.approx([camera.focal_px] * 2 + [480, 360, -0.11, 0.10, 0.0014, 0.0005])
    told = json.loads((tmp_path / "camera.json").read_text())
    assert told["residual_max_px"] == 0.0
    assert told["k1"] == -0.11
    ideal = calibrate(PinholeCamera(640, 480, 1.0))
    assert ideal.params[4:] == pytest.approx(np.zeros(4))


def test_what_refraction_leaves_is_stated():
    """Between and at the fitted depths the model is off by no more than it says, and far better than no distortion."""
    camera = LensCamera(960, 720, np.deg2rad(60), port=FlatPort(air_m=0.01))
    model = calibrate(camera)
    pixels = np.random.default_rng(1).uniform([0, 0], [960, 720], (2000, 2))
    points = camera.unproject(pixels, np.random.default_rng(2).uniform(0.3, 1.0, 2000))
    error = np.linalg.norm(model.project(points) - pixels, axis=1)
    assert 0.0 < model.rms_px < 0.5
    assert error.max() < 1.1 * model.max_px
    assert np.sqrt(np.mean(error**2)) < 1.2 * model.rms_px
    plain = PinholeCamera(960, 720, np.deg2rad(60)).project(points)
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.sqrt(np.mean(np.sum((plain - pixels) ** 2, axis=1)))
    assert -0.02 < model.ahead_m < 0.0


def test_wide_views_through_flat_glass_are_worse():
    """The residual grows with the field of view: the rays meet the axis ever farther apart."""
    port = FlatPort(air_m=0.01)
    left = [calibrate(LensCamera(480, 360, np.deg2rad(fov), port=port)).rms_px for fov in (40, 60, 80)]
    assert left[0] < left[1] < left[2]
