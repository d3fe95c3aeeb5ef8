"""Flakes follow the concentration, drift, and hide behind what is nearer."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import FlakeCloud, ScalarGrid
from wakewise.vision.imaging import Lights, PinholeCamera, Shutter, water_optics
from wakewise.vision.imaging.particles import (
    FARTHEST_M,
    NEAREST_M,
    VisibleFlakes,
    concentration,
    draw_flakes,
    flake_positions,
    flakes_before,
)

CAMERA = PinholeCamera(160, 120, np.deg2rad(90))
LIGHTS = Lights(lamp=0.3, lamps_C_m=np.array([[0.2, 0.0, 0.0]]))
STILL = [Pose(np.zeros(3))]


def _seen(points, velocity=(0.0, 0.0, 0.0)):
    n = len(points)
    return VisibleFlakes(
        p_C_m=np.array(points), v_W_m_s=np.tile(np.array(velocity), (n, 1)), size=np.zeros(n), shade=np.full(n, 0.5)
    )


def _cloud(n=6000, per_m3=1500.0, slopes=(1.05, 0.8), velocity=(0.0, 0.0, 0.0)):
    """Flakes evenly in a box of the world before the camera at the origin, all of them that it may see."""
    rng = np.random.default_rng(5)
    low, high = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, n / per_m3 / 4])
    whole = FlakeCloud(
        p_W_m=rng.uniform(low, high, (n, 3)), v_W_m_s=np.tile(np.array(velocity), (n, 1)),
        looks=np.column_stack([rng.random(n), rng.standard_normal(n), rng.random(n)]), low_W_m=low, high_W_m=high,
        per_m3=per_m3, depth_m=0.62, slopes=slopes,
    )  # fmt: skip
    seen = whole.covers(whole.p_W_m, STILL[0])
    return replace(whole, p_W_m=whole.p_W_m[seen], v_W_m_s=whole.v_W_m_s[seen], looks=whole.looks[seen])


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


def test_a_cloud_out_of_sight_costs_no_draws():
    """However dense it is: the flakes that are seen are those that were drawn without it, to the last one."""
    values = np.zeros((40, 5, 5))
    values[18:22] = 0.05
    near = ScalarGrid(origin_W_m=np.array([-2.0, -0.2, -0.2]), spacing_m=0.1, values=values)
    far = values.copy()
    far[0, 0, 0] = 1e6  # its flakes would fill the memory
    clouds = (near, replace(near, values=far), replace(near, outer=replace(near, spacing_m=0.5, values=far)))
    drawn = [flake_positions(CAMERA, STILL[0], silt, 1e3, 1e6, np.random.default_rng(2)) for silt in clouds]
    assert len(drawn[0]) > 100
    assert all(np.array_equal(drawn[0], one) for one in drawn[1:])


def test_no_place_has_more_silt_than_the_largest_near_it():
    """The bound of a ball about the camera holds for all places in it, on either grid."""
    rng = np.random.default_rng(3)
    outer = ScalarGrid(origin_W_m=np.full(3, -2.0), spacing_m=0.4, values=rng.random((11, 11, 11)) ** 8)
    silt = ScalarGrid(origin_W_m=np.full(3, -0.5), spacing_m=0.1, values=rng.random((11, 11, 11)) ** 8, outer=outer)
    for centre in rng.uniform(-2.5, 2.5, (20, 3)):
        ways = rng.normal(size=(500, 3))
        places = centre + 0.6 * rng.random((500, 1)) * ways / np.linalg.norm(ways, axis=1)[:, None]
        assert concentration(silt, places).max() <= silt.largest_near(centre, 0.6) + 1e-12


def test_flakes_show_before_the_wall_only():
    """Flakes brighten a dark image where they are before the wall, and leave it alone where they are behind."""
    points = np.array([[0.0, 0.0, 0.2], [0.05, 0.05, 0.3]])
    image = np.zeros((120, 160, 3), np.float32)
    water = water_optics("IB")
    shown = draw_flakes(image, np.full((120, 160), 1.0, np.float32), CAMERA, STILL, _seen(points), 0.01, water, LIGHTS)
    hidden = draw_flakes(image, np.full((120, 160), 0.1, np.float32), CAMERA, STILL, _seen(points), 0.01, water, LIGHTS)
    assert shown[60, 80].min() > 0.0
    assert hidden.max() == 0.0
    assert image.max() == 0.0


def test_motion_streaks_a_flake_without_more_light():
    """A moving camera spreads a flake over more pixels and keeps its light, within 10 %."""
    poses = [Pose(np.array([x, 0.0, 0.0])) for x in np.linspace(-0.005, 0.005, 5)]
    image, depth = np.zeros((120, 160, 3), np.float32), np.full((120, 160), 1.0, np.float32)
    one = np.array([[0.0, 0.0, 0.15]])
    water = water_optics("IB")
    still = draw_flakes(image, depth, CAMERA, STILL, _seen(one), 0.01, water, LIGHTS)
    streak = draw_flakes(image, depth, CAMERA, poses, _seen(one), 0.01, water, LIGHTS)
    assert (streak > 0).sum() > 1.5 * (still > 0).sum()
    assert streak.sum() == pytest.approx(still.sum(), rel=0.1)


def test_moving_water_streaks_a_flake_as_a_moving_camera_does():
    """A flake that drifts past a still camera leaves the streak of a still one before a camera going the other way."""
    image, depth = np.zeros((120, 160, 3), np.float32), np.full((120, 160), 1.0, np.float32)
    water, one = water_optics("IB"), np.array([[0.01, 0.0, 0.15]])
    poses = [Pose(np.array([x, 0.0, 0.0])) for x in np.linspace(-0.004, 0.004, 9)]
    by_camera = draw_flakes(image, depth, CAMERA, poses, _seen(one), 0.02, water, LIGHTS)
    by_water = draw_flakes(image, depth, CAMERA, STILL, _seen(one, (-0.4, 0.0, 0.0)), 0.02, water, LIGHTS)
    assert by_water == pytest.approx(by_camera, abs=1e-6)
    assert (by_water > 0).sum() > 1.3 * (
        draw_flakes(image, depth, CAMERA, STILL, _seen(one), 0.02, water, LIGHTS) > 0
    ).sum()


def test_the_same_flakes_are_seen_again_where_the_water_has_brought_them():
    """Of as many as drift, two photographs with other draws show the same ones, the later moved by the water's way."""
    cloud = _cloud()
    way = np.array([0.0, 0.0, 0.01])
    later = replace(cloud, p_W_m=cloud.p_W_m + way)
    first = flakes_before(CAMERA, STILL[0], None, 1500.0, 1e6, np.random.default_rng(1), cloud)
    second = flakes_before(CAMERA, STILL[0], None, 1500.0, 1e6, np.random.default_rng(2), later)
    again = {tuple(np.round(p, 9)) for p in second.p_C_m - way}
    inside = first.p_C_m[first.p_C_m[:, 2] < FARTHEST_M - 0.011]
    assert len(inside) > 200
    known = [tuple(np.round(p, 9)) in again for p in inside]
    assert np.mean(known) > 0.97  # all but those new ones that fill the view's rim


def test_drifting_flakes_leave_the_density_as_it_is():
    """In a view beyond the flakes that are told, and in murkier water, new ones fill up to base plus per_kg C."""
    silt = ScalarGrid(origin_W_m=np.full(3, -5.0), spacing_m=5.0, values=np.full((3, 3, 3), 0.004))
    for base, grid, cloud in (
        (1500.0, None, _cloud()),
        (1500.0, None, _cloud(slopes=(0.4, 0.4))),
        (500.0, None, _cloud()),
        (1500.0, silt, _cloud()),
    ):
        expected = (base + (4e3 if grid else 0.0)) * 160 * 120 / CAMERA.focal_px**2 * (FARTHEST_M**3 - NEAREST_M**3) / 3
        seen = flakes_before(CAMERA, STILL[0], grid, base, 1e6, np.random.default_rng(3), cloud)
        inside = np.all(np.abs(seen.p_C_m[:, :2]) <= seen.p_C_m[:, 2:] * [1.0, 0.75], axis=1)
        assert abs(inside.sum() - expected) < 5 * np.sqrt(expected)


def test_new_flakes_move_as_their_neighbours_do():
    """A flake drawn anew takes the velocity of the nearest one that drifts."""
    silt = ScalarGrid(origin_W_m=np.full(3, -5.0), spacing_m=5.0, values=np.full((3, 3, 3), 0.004))
    seen = flakes_before(
        CAMERA, STILL[0], silt, 1500.0, 1e6, np.random.default_rng(3), _cloud(velocity=(0.1, 0.0, -0.02))
    )
    assert len(seen.p_C_m) > 500
    assert seen.v_W_m_s == pytest.approx(np.tile([0.1, 0.0, -0.02], (len(seen.p_C_m), 1)))


def test_a_rolling_shutter_shifts_flakes_as_it_shifts_the_scene():
    """A flake at the top is seen before the middle of the window and one at the bottom after: skewed by the motion."""
    heights = np.array([-0.12, 0.0, 0.12])
    points = np.column_stack([np.zeros(3), heights, np.full(3, 0.2)])
    poses = [Pose(np.array([x, 0.0, 0.0])) for x in np.linspace(-0.01, 0.01, 5)]
    dark, far = np.zeros((120, 160, 3), np.float32), np.full((120, 160), 1.0, np.float32)
    water = water_optics("IB")

    def columns(shutter):
        lit = draw_flakes(dark, far, CAMERA, poses, _seen(points), 0.02, water, LIGHTS, shutter)[..., 1]
        bands = [lit[:40], lit[40:80], lit[80:]]
        return np.array([band.sum(axis=0) @ (np.arange(160) + 0.5) / band.sum() for band in bands])

    rows = CAMERA.project(points)[:, 1] / 120
    motion_px = CAMERA.focal_px * 0.02 / 0.2
    np.testing.assert_allclose(
        columns(Shutter(open=0.02, rolling=0.98)) - 80.0, -0.98 * motion_px * (rows - 0.5), atol=0.4
    )
    np.testing.assert_allclose(columns(Shutter()), 80.0, atol=0.2)
