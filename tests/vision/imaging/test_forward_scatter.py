"""Forward scattering against closed forms: Airy's pattern, Poisson's law of turns, the lever of a ray."""

import math

import numpy as np
import pytest
from scipy.special import j0, j1

from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid
from wakewise.vision.imaging import SiltOptics, attenuate, haze_between, water_optics
from wakewise.vision.imaging.camera import PinholeCamera
from wakewise.vision.imaging.forward_scatter import (
    FORWARD_SHARE,
    WAVELENGTH_M,
    blurred,
    forward_scattered,
    lobe_rad,
    mean_square_lever,
)
from wakewise.vision.imaging.renderer import Lights, Render

EVEN = np.full((2, 2), 1 / 3, np.float32)


def _moments(image):
    """Sum, and variance per axis about the middle of mass, of the first channel."""
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    weight = image[..., 0].astype(np.float64)
    total = weight.sum()
    mean = (weight * x).sum() / total, (weight * y).sum() / total
    return total, 0.5 * ((weight * (x - mean[0]) ** 2).sum() + (weight * (y - mean[1]) ** 2).sum()) / total


def _point(size=201):
    image = np.zeros((size, size, 3), np.float32)
    image[size // 2, size // 2] = 1.0
    return image


def test_half_of_the_lobe_lies_where_half_of_airys_pattern_does():
    """Within the Gaussian's median angle Airy's pattern has 1 - J0^2 - J1^2 = half of its light, to 3 %."""
    for d in (5e-6, 20e-6):
        v = math.pi * d * lobe_rad(d) * math.sqrt(2 * math.log(2)) / WAVELENGTH_M
        assert 1 - j0(v) ** 2 - j1(v) ** 2 == pytest.approx(0.5, abs=0.03)


def test_light_is_kept():
    """A point's blurred light sums to exp(tau / 2) - 1 of what came straight, so that only half of tau is loss."""
    tau = np.full((201, 201), 1.4, np.float32)
    straight = _point() * math.exp(-1.4)
    added = forward_scattered(straight, tau, EVEN, 6.0)
    assert (straight + added)[..., 0].sum() == pytest.approx(math.exp(-0.7), rel=1e-3)


@pytest.mark.parametrize("depth", [0.1, 1.0, 3.0])
@pytest.mark.parametrize("lobe_px", [2.0, 6.0])
def test_the_blur_has_the_variance_of_its_turns(depth, lobe_px):
    """The variance per axis is lobe^2 / 3 times the mean number of turns of light turned at least once."""
    tau = np.full((201, 201), depth, np.float32)
    added = forward_scattered(_point(), tau, EVEN, lobe_px)
    n = 0.5 * depth
    turns = n * math.exp(n) / math.expm1(n)
    assert _moments(added)[1] == pytest.approx(turns * lobe_px**2 / 3, rel=0.05)


def test_poissons_turns_have_that_mean():
    """Half a million drawn numbers of turns, those of none left out, have the mean that the blur takes."""
    n = 0.9
    turns = np.random.default_rng(0).poisson(n, 500_000)
    assert turns[turns > 0].mean() == pytest.approx(n * math.exp(n) / math.expm1(n), rel=0.005)


@pytest.mark.parametrize("variance", [0.5, 2.0, 9.0, 100.0, 400.0])
def test_a_blur_keeps_sum_and_variance(variance):
    """A wide Gaussian made on a small image has the sum and the variance of a Gaussian."""
    total, spread = _moments(blurred(_point(301), variance))
    assert total == pytest.approx(1.0, rel=2e-3)
    assert spread == pytest.approx(variance, rel=0.06)


def test_an_even_cloud_has_a_lever_of_a_third_and_one_at_the_lens_of_one():
    """The integral over the ray is 1/3 for even water, 1 if all grains are before the lens, 0 if at the scene."""
    ranges = 4.0 * np.linspace(0, 1, 49) ** 2
    tau = np.zeros((2, 4, 49), np.float32)
    tau[:, 0] = 0.7 * ranges
    tau[:, 1, 1:] = 1.0
    tau[:, 2] = np.where(ranges > 0.95, 1.0, 0.0)
    at = np.array([[1.0, 1.0, 1.0]], np.float32)
    lever = mean_square_lever(ranges, tau, at)[0]
    assert lever[0] == pytest.approx(1 / 3, abs=0.01)
    assert lever[1] == pytest.approx(1.0, abs=0.02)
    assert lever[2] < 0.02
    assert mean_square_lever(ranges, np.zeros((2, 4, 49), np.float32), at) == pytest.approx(np.full((1, 3), 1 / 3))


def test_coarse_grains_only_take_away_half():
    """Grains that turn light by less than a pixel blur nothing: the added light is the signal's own."""
    signal = np.random.default_rng(0).random((20, 20, 3), np.float32)
    tau = np.full((20, 20), 0.8, np.float32)
    assert forward_scattered(signal, tau, EVEN, 0.1) == pytest.approx(signal * math.expm1(0.4), rel=1e-5)


def test_a_photograph_of_a_wall_loses_half_of_what_the_beam_does():
    """Through even silt an even wall shows exp(-tau / 2) of the grains, exp(-tau) where nobody says what they are."""
    camera = PinholeCamera(160, 120, math.radians(70.0))
    lights = Lights(ambient=0.0, panels=0.0, lamp=0.0, lamps_C_m=np.zeros((1, 3)))
    shape = (120, 160)
    wall = Render(
        radiance=np.ones((*shape, 3), np.float32),
        lamp_radiance=np.zeros((*shape, 3), np.float32),
        depth_m=np.full(shape, 0.5, np.float32),
        target_fraction=np.zeros(shape, np.float32),
    )
    grains, water = SiltOptics(), water_optics("I")
    silt = ScalarGrid(origin_W_m=np.full(3, -8.0), spacing_m=8.0, values=np.full((3, 3, 3), 0.02))
    haze = haze_between(camera, Pose(np.zeros(3)), water, grains, silt, lights)
    clear = haze_between(camera, Pose(np.zeros(3)), water, grains, None, lights)
    without = attenuate(wall, camera, clear, water, 0.0, grains)[0][60, 80]
    lost = attenuate(wall, camera, haze, water, 0.0)[0][60, 80]
    kept = attenuate(wall, camera, haze, water, 0.0, grains)[0][60, 80]
    tau = 0.02 * grains.attenuation_m2_kg * 0.5
    assert lost / without == pytest.approx(np.full(3, math.exp(-tau)), rel=0.01)
    assert kept / without == pytest.approx(np.full(3, math.exp(-(1 - FORWARD_SHARE) * tau)), rel=0.01)


def test_clear_water_is_as_it_was():
    """Without silt the photograph has the same bytes whether the grains are known or not."""
    camera = PinholeCamera(160, 120, math.radians(70.0))
    lights = Lights(ambient=1.0, panels=0.0, lamp=0.3, lamps_C_m=np.zeros((1, 3)))
    rng, shape = np.random.default_rng(0), (120, 160)
    view = Render(
        radiance=rng.random((*shape, 3), np.float32),
        lamp_radiance=np.zeros((*shape, 3), np.float32),
        depth_m=np.full(shape, 0.5, np.float32),
        target_fraction=np.zeros(shape, np.float32),
    )
    water = water_optics("II")
    haze = haze_between(camera, Pose(np.zeros(3)), water, SiltOptics(), None, lights)
    known, unknown = (attenuate(view, camera, haze, water, 1.0, g)[0] for g in (SiltOptics(), None))
    assert known.tobytes() == unknown.tobytes()


def test_an_edge_behind_silt_is_softer_than_one_behind_clear_water():
    """The steepest step of a black-and-white edge falls by the blurred share, and is as steep where it is clear."""
    edge = np.zeros((100, 160, 3), np.float32)
    edge[:, 80:] = 1.0
    tau = np.full((100, 160), 1.0, np.float32)
    straight = edge * math.exp(-1.0)
    seen = straight + forward_scattered(straight, tau, EVEN, 8.0)
    contrast = seen[50, -20, 0] - seen[50, 20, 0]
    steepest = np.diff(seen[50, :, 0]).max()
    assert steepest / contrast == pytest.approx(math.exp(-1.0) / math.exp(-0.5), rel=0.12)


def test_hardly_any_silt_blurs_nothing_and_keeps_its_light():
    """Light of which less than half a grey level is turned comes back where it was lost."""
    signal = np.random.default_rng(0).random((20, 20, 3), np.float32)
    tau = np.full((20, 20), 3e-3, np.float32)
    assert forward_scattered(signal, tau, EVEN, 6.0) == pytest.approx(signal * math.expm1(1.5e-3), rel=1e-4)
