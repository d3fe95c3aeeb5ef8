"""Flakes follow the concentration and hide behind what is nearer."""

import numpy as np
import pytest

from wakewise.geometry import Pose
from wakewise.imaging import Lights, PinholeCamera, Shutter, water_optics
from wakewise.imaging.particles import FARTHEST_M, NEAREST_M, draw_flakes, flake_positions
from wakewise.interfaces import ScalarGrid

CAMERA = PinholeCamera(160, 120, np.deg2rad(90))
LIGHTS = Lights(lamp=0.3, lamps_C_m=np.array([[0.2, 0.0, 0.0]]))
STILL = [Pose(np.zeros(3))]


def test_number_of_flakes_is_density_times_volume():
    """A uniform cloud gives (base + per_kg C) V flakes, V the volume of the frustum, within five deviations."""
    silt = ScalarGrid(origin_W_m=np.full(3, -5.0), spacing_m=5.0, values=np.full((3, 3, 3), 0.02))
    points = flake_positions(CAMERA, STILL[0], silt, 1e4, 1e6, np.random.default_rng(0))
    expected = (1e4 + 2e4) * 160 * 120 / CAMERA.focal_px**2 * (FARTHEST_M**3 - NEAREST_M**3) / 3
    assert abs(len(points) - expected) < 5 * np.sqrt(expected)
    assert points[:, 2].min() >= NEAREST_M
    assert points[:, 2].max() <= FARTHEST_M


def test_flakes_are_where_the_silt_is():
    """A cloud on one side of the view puts its flakes there; clear water without base has none."""
    values = np.zeros((2, 3, 3))
    values[1] = 0.1
    silt = ScalarGrid(origin_W_m=np.array([-1.0, -2.0, -2.0]), spacing_m=2.0, values=values)
    points = flake_positions(CAMERA, STILL[0], silt, 0.0, 1e6, np.random.default_rng(1))
    assert np.mean(points[:, 0]) > 0.01
    assert len(flake_positions(CAMERA, STILL[0], None, 0.0, 1e6, np.random.default_rng(1))) == 0


def test_flakes_show_before_the_wall_only():
    """Flakes brighten a dark image where they are before the wall, and leave it alone where they are behind."""
    points = np.array([[0.0, 0.0, 0.2], [0.05, 0.05, 0.3]])
    image = np.zeros((120, 160, 3), np.float32)
    water = water_optics("IB")
    shown = draw_flakes(
        image, np.full((120, 160), 1.0, np.float32), CAMERA, STILL, points, water, LIGHTS, np.random.default_rng(2)
    )
    hidden = draw_flakes(
        image, np.full((120, 160), 0.1, np.float32), CAMERA, STILL, points, water, LIGHTS, np.random.default_rng(2)
    )
    assert shown[60, 80].min() > 0.0
    assert hidden.max() == 0.0
    assert image.max() == 0.0


def test_motion_streaks_a_flake_without_more_light():
    """A moving camera spreads a flake over more pixels and keeps its light, within 10 %."""
    poses = [Pose(np.array([x, 0.0, 0.0])) for x in np.linspace(-0.005, 0.005, 5)]
    image, depth = np.zeros((120, 160, 3), np.float32), np.full((120, 160), 1.0, np.float32)
    one = np.array([[0.0, 0.0, 0.15]])
    water = water_optics("IB")
    still = draw_flakes(image, depth, CAMERA, STILL, one, water, LIGHTS, np.random.default_rng(3))
    streak = draw_flakes(image, depth, CAMERA, poses, one, water, LIGHTS, np.random.default_rng(3))
    assert (streak > 0).sum() > 1.5 * (still > 0).sum()
    assert streak.sum() == pytest.approx(still.sum(), rel=0.1)


def test_a_rolling_shutter_shifts_flakes_as_it_shifts_the_scene():
    """A flake at the top is seen before the middle of the window and one at the bottom after: skewed by the motion."""
    heights = np.array([-0.12, 0.0, 0.12])
    points = np.column_stack([np.zeros(3), heights, np.full(3, 0.2)])
    poses = [Pose(np.array([x, 0.0, 0.0])) for x in np.linspace(-0.01, 0.01, 5)]
    dark, far = np.zeros((120, 160, 3), np.float32), np.full((120, 160), 1.0, np.float32)
    water = water_optics("IB")

    def columns(shutter):
        lit = draw_flakes(dark, far, CAMERA, poses, points, water, LIGHTS, np.random.default_rng(2), shutter)[..., 1]
        bands = [lit[:40], lit[40:80], lit[80:]]
        return np.array([band.sum(axis=0) @ (np.arange(160) + 0.5) / band.sum() for band in bands])

    rows = CAMERA.project(points)[:, 1] / 120
    motion_px = CAMERA.focal_px * 0.02 / 0.2
    np.testing.assert_allclose(
        columns(Shutter(open=0.02, rolling=0.98)) - 80.0, -0.98 * motion_px * (rows - 0.5), atol=0.4
    )
    np.testing.assert_allclose(columns(Shutter()), 80.0, atol=0.2)
