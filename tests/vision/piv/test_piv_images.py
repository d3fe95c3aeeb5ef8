"""Tracers and pictures of virtual PIV: particles follow the water, spots hold their light, seeding is as asked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from wakewise.vision.piv import (
    CameraSettings,
    LightSheet,
    TracerSettings,
    carried,
    photograph_pair,
    picture,
    relaxation_s,
    settling_speed_m_s,
)
from wakewise_paper.wake_piv import ShearFlow

SHEET = LightSheet(
    centre_W_m=np.array([0.1, 0.2, 0.3]),
    right_W=np.array([0.0, 1.0, 0.0]),
    down_W=np.array([0.0, 0.0, 1.0]),
    half_thickness_m=2e-3,
)


class Spin:
    """Water that turns about z once in 2 pi seconds."""

    def velocity(self, points_W_m):
        return np.stack([-points_W_m[:, 1], points_W_m[:, 0], np.zeros(len(points_W_m))], axis=1)


def test_tracers_follow_the_water_within_microseconds():
    """Stokes relaxation is 6 us at 10 um and 0.14 ms at 50 um; neither settles a pixel in a frame."""
    assert relaxation_s(10e-6, 1000.0) == pytest.approx(5.6e-6, rel=0.02)
    assert relaxation_s(50e-6, 1000.0) == pytest.approx(139e-6, rel=0.02)
    assert 0.0 < settling_speed_m_s(50e-6, 1050.0) / 120.0 < 1e-6


def test_carrying_is_second_order_and_goes_back():
    """A turn by 0.1 rad is met within a millionth in four substeps; going back leads home."""
    start = np.array([[1.0, 0.0, 0.0]])
    end = carried(Spin(), start, 0.1, substeps=4)
    np.testing.assert_allclose(end[0], [math.cos(0.1), math.sin(0.1), 0.0], atol=1.5e-5)
    finer = carried(Spin(), start, 0.1, substeps=8)
    error = [abs(e[0, 1] - math.sin(0.1)) for e in (end, finer)]
    assert 3.3 < error[0] / error[1] < 4.7
    np.testing.assert_allclose(carried(Spin(), end, -0.1, substeps=4), start, atol=1e-5)


def test_sheet_coordinates_go_there_and_back():
    """To the world and back is nothing; depth is along right x down."""
    local = np.array([[0.01, -0.02, 0.003]])
    world = SHEET.to_world(local)
    np.testing.assert_allclose(world, [[0.103, 0.21, 0.28]], atol=1e-15)
    np.testing.assert_allclose(SHEET.to_local(world - SHEET.centre_W_m), local, atol=1e-15)


def test_a_spot_holds_its_light_and_its_place():
    """The grey levels of one spot sum to peak 2 pi sigma^2 and balance at its place, wherever in the pixel that is."""
    camera = CameraSettings(width_px=128, height_px=128, noise=0.0, background=0.0, particle_px=5.0)
    where = np.array([64.3]), np.array([60.8])
    grey = picture(*where, np.array([200.0]), camera, np.random.default_rng(0)).astype(float)
    assert grey.sum() == pytest.approx(200.0 * 2.0 * math.pi * 1.25**2, rel=0.01)
    centres = np.arange(128) + 0.5
    assert grey.sum(axis=0) @ centres / grey.sum() == pytest.approx(64.3, abs=0.02)
    assert grey.sum(axis=1) @ centres / grey.sum() == pytest.approx(60.8, abs=0.02)


def test_seeding_and_gap_are_as_asked():
    """As many bright particles as asked stand in the picture, and a second frame comes a frame period later."""
    camera = CameraSettings(width_px=256, height_px=256, noise=0.0, background=0.0, particle_px=1.5)
    assert camera.dt_s == pytest.approx(1.0 / 120.0)
    tracers = TracerSettings(per_pixel=0.002)
    pair = photograph_pair(ShearFlow(0.0, 0.0), SHEET, camera, tracers, np.random.default_rng(0))
    assert np.array_equal(pair.first, pair.second)
    # In a sheet of Gaussian light a particle has on average 3/4 (own) of the peak over an effective depth.
    light = 0.75 * camera.brightness * 2.0 * math.pi * (1.5 / 4.0) ** 2
    assert pair.first.astype(float).sum() / light / 256**2 == pytest.approx(0.002, rel=0.25)
