"""Water and silt obey closed forms on flat targets, and the coefficients come from the published tables."""

import os
import pathlib

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import RegularGridInterpolator

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import ScalarGrid
from wakewise.vision.imaging import Lights, PinholeCamera, Render, SiltOptics, attenuate, haze_between, water_optics
from wakewise.vision.imaging.optics import exp_minus, sample_grid, water_types
from wakewise_benchmarks.optics_tables import band_errors

DATA = pathlib.Path(os.environ.get("WAKEWISE_DATA", pathlib.Path(__file__).parents[4] / "shared" / "data"))
CAMERA = PinholeCamera(64, 48, np.deg2rad(80))
DARK = Lights(lamp=0.0, lamps_C_m=np.zeros((0, 3)))
SILT = SiltOptics()


def wall(depth_m, radiance=0.4, lamp=0.0):
    """A flat target across the whole view."""
    shape = (48, 64)
    return Render(
        radiance=np.full((*shape, 3), radiance + lamp, np.float32),
        lamp_radiance=np.full((*shape, 3), lamp, np.float32),
        depth_m=np.full(shape, depth_m, np.float32),
        target_fraction=np.ones(shape, np.float32),
    )


def ray_lengths(depth_m):
    """Length of the ray from the camera to the wall, per pixel."""
    x, y = np.meshgrid(np.arange(64) + 0.5 - 32, np.arange(48) + 0.5 - 24)
    return depth_m * np.sqrt(1 + (x**2 + y**2) / CAMERA.focal_px**2)


def uniform_silt(kg_m3):
    return ScalarGrid(origin_W_m=np.full(3, -8.0), spacing_m=8.0, values=np.full((3, 3, 3), kg_m3))


@pytest.mark.parametrize("water_type", water_types())
def test_clear_water_follows_the_image_formation_model(water_type):
    """J exp(-beta_D r) + B (1 - exp(-beta_B r)) at every pixel of a flat wall, within 0.2 % of the veil."""
    water = water_optics(water_type)
    seen, silt = attenuate(wall(0.7), CAMERA, haze_between(CAMERA, Pose(np.zeros(3)), water, SILT, None, DARK), water)
    r = ray_lengths(0.7)[..., None]
    expected = 0.4 * np.exp(-water.signal_per_m * r) + water.veil * (1 - np.exp(-water.veil_per_m * r))
    assert np.abs(seen - expected).max() < 2e-3 * (1e-3 + water.veil.max())
    assert np.all(silt == 0.0)


def test_open_water_ends_in_the_veil():
    """Where nothing is hit the picture is B_inf; a wall 30 m away, beyond the integration's reach, is not brighter."""
    water = water_optics("II")
    haze = haze_between(CAMERA, Pose(np.zeros(3)), water, SILT, None, DARK)
    nothing, _ = attenuate(wall(np.inf, 0.0), CAMERA, haze, water)
    assert np.allclose(nothing, water.veil, rtol=1e-3)
    far, _ = attenuate(wall(30.0, 0.0), CAMERA, haze, water)
    r = ray_lengths(30.0)[..., None]
    assert np.allclose(far, water.veil * (1 - np.exp(-water.veil_per_m * r)), rtol=1e-3)


def test_uniform_silt_attenuates_and_veils_exponentially():
    """A uniform cloud adds c C to both coefficients, and its veil joins the water's in proportion to attenuation."""
    water, C = water_optics("IB"), 0.05
    c = SILT.attenuation_m2_kg * C
    haze = haze_between(CAMERA, Pose(np.zeros(3)), water, SILT, uniform_silt(C), DARK)
    seen, silt = attenuate(wall(0.5), CAMERA, haze, water)
    r = ray_lengths(0.5)[..., None]
    both = water.veil_per_m + c
    veil = (water.veil_per_m * water.veil + c * SILT.veil) / both
    expected = 0.4 * np.exp(-(water.signal_per_m + c) * r) + veil * (1 - np.exp(-both * r))
    assert np.allclose(seen, expected, rtol=5e-3)
    assert np.allclose(silt, c, rtol=1e-3)


def test_silt_attenuation_of_known_mud():
    """50 mg/L of 20 um carbonate grains attenuates 2.8 per metre, 0.3 mm sand 0.18 (1.5 Q C / (rho_s d), Q = 2)."""
    assert 0.05 * SILT.attenuation_m2_kg == pytest.approx(2.77, abs=0.01)
    assert 0.05 * SiltOptics(diameter_m=3e-4).attenuation_m2_kg == pytest.approx(0.185, abs=0.001)


def test_lamps_light_fades_both_ways():
    """The part of the wall's radiance that came from the lamps is attenuated twice."""
    water = water_optics("III")
    haze = haze_between(CAMERA, Pose(np.zeros(3)), water, SILT, None, DARK)
    with_lamp, _ = attenuate(wall(0.6, 0.0, 0.5), CAMERA, haze, water)
    without, _ = attenuate(wall(0.6, 0.0, 0.0), CAMERA, haze, water)
    expected = 0.5 * np.exp(-2 * water.signal_per_m * ray_lengths(0.6)[..., None])
    assert np.allclose(with_lamp - without, expected, rtol=1e-4)


def test_lamp_backscatter_agrees_with_quadrature():
    """Light from one lamp scattered back by a uniform cloud, against adaptive quadrature along the same ray."""
    water, C = water_optics("II"), 0.02
    lights = Lights(ambient=0.0, lamp=0.8, lamps_C_m=np.array([[0.2, -0.05, 0.0]]))
    haze = haze_between(CAMERA, Pose(np.zeros(3)), water, SILT, uniform_silt(C), lights)
    c = SILT.attenuation_m2_kg * C
    direction = CAMERA.rays(np.array([[16.0, 32.0]]))[0]
    direction = direction / np.linalg.norm(direction)

    def source(s, band):
        to_point = s * direction - lights.lamps_C_m[0]
        r = np.sqrt(to_point @ to_point + 1e-4)
        back = 0.5 * (water.backscatter_per_m[band] + c * SILT.backscatter_share[band])
        irradiance = 0.8 * 0.5**2 * to_point[2] / r**3
        return back * irradiance * np.exp(-2 * (water.signal_per_m[band] + c) * s)

    node = int(np.searchsorted(haze.ranges_m, 0.8))
    for band in range(3):
        expected = quad(source, 0.0, haze.ranges_m[node], args=(band,))[0]
        assert haze.veil[2, 1, node, band] == pytest.approx(expected, rel=0.01)


def test_grid_sampling_is_trilinear_and_zero_outside():
    """Silt between nodes agrees with scipy's interpolator; outside the grid there is none."""
    rng = np.random.default_rng(0)
    values, origin, spacing = rng.random((4, 5, 6)), np.array([-0.3, 0.2, 1.0]), 0.11
    axes = [origin[k] + spacing * np.arange(n) for k, n in enumerate(values.shape)]
    reference = RegularGridInterpolator(axes, values, bounds_error=False, fill_value=0.0)
    for point in rng.uniform([-0.4, 0.1, 0.9], [0.2, 0.8, 1.7], (300, 3)):
        assert sample_grid(values, origin, spacing, *point) == pytest.approx(float(reference(point)[0]), abs=1e-12)


def test_the_fast_exponential_is_one():
    """What an optical depth leaves is exp(-tau) within 1e-9, falls steadily, and is nothing for endless ones."""
    tau = np.concatenate([np.linspace(0.0, 30.0, 3001), [60.0, 1e3, 1e9]])
    left = np.array([exp_minus(t) for t in tau])
    assert np.abs(left - np.exp(-tau)).max() < 1e-9
    assert np.abs(left * np.exp(np.minimum(tau, 3.0)) - 1.0)[tau <= 3.0].max() < 1e-8
    assert (np.diff(left) <= 0.0).all()
    assert left[-1] < 1e-20


def test_unknown_water_and_impossible_silt_are_refused():
    """A type that Jerlov did not name, and grains without size, raise InputError."""
    with pytest.raises(InputError, match="allowed I, IB"):
        water_optics("4X")
    with pytest.raises(InputError, match="silt"):
        SiltOptics(diameter_m=0.0)


def test_band_values_follow_from_the_published_tables():
    """The RGB coefficients are the stated averages of Solonenko & Mobley's spectra over 28 cameras' sensitivities."""
    folder = DATA / "ocean_optics"
    if not folder.is_dir():
        pytest.skip(f"{folder} is not there")
    errors = band_errors(folder)
    assert errors["signal_per_m"] < 6e-4
    assert errors["veil_per_m"] < 6e-4
    assert errors["backscatter_per_m"] < 6e-6
    assert errors["veil"] < 6e-5


def test_outside_the_grid_lies_the_outer_one():
    """A ray that leaves the inner grid goes on through the outer grid's silt: the depth is the sum of both."""
    water = water_optics("I")
    outer = uniform_silt(0.01)
    inner = ScalarGrid(
        origin_W_m=np.array([-1.0, -1.0, -0.5]), spacing_m=0.5, values=np.full((5, 5, 3), 0.03), outer=outer
    )
    haze = haze_between(CAMERA, Pose(np.zeros(3)), water, SILT, inner, DARK)
    ahead = haze.silt_tau[haze.silt_tau.shape[0] // 2, haze.silt_tau.shape[1] // 2]
    expected = SILT.attenuation_m2_kg * (0.03 * 0.5 + 0.01 * 0.5)
    assert np.interp(1.0, haze.ranges_m, ahead) == pytest.approx(expected, rel=0.08)
