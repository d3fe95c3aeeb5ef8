"""Laws of jets that both models or one of them must meet; the paper's formula to machine precision."""

import numpy as np
import pytest
from scipy.special import erf

from wakewise.core.errors import InputError
from wakewise.wake import GaussianJet, PaperJet, RoundJet, wake_model

AREA = np.pi * 0.03**2
D = 0.06
RHO = 998.0


def speed_of(model, x, r, thrust=1.0, area=AREA):
    """Speed at distances x along a jet that goes along +z, and r off its axis; arrays of one shape."""
    x, r = np.broadcast_arrays(np.asarray(x, float), np.asarray(r, float))
    points = np.stack([r.ravel(), np.zeros(r.size), x.ravel()], axis=1)
    velocity = model.unit_velocity(points, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), np.array([area]))[0]
    np.testing.assert_array_equal(velocity[:, :2], 0.0)
    return (np.sqrt(thrust) * velocity[:, 2]).reshape(r.shape)


def paper_twin(point, origin, direction, area):
    """The printed formula, one point and one jet at a time."""
    offset = point - origin
    r = np.linalg.norm(offset)
    theta = np.arccos(np.clip(offset @ direction / r, -1.0, 1.0))
    if theta > np.pi / 4:
        return np.zeros(3)
    return np.sqrt(1.0 / (2 * np.pi * 998.0 * area)) * (1.0**2 / r**2) * direction * np.cos(theta) ** 4


def round_twin(x, r, area, slope=0.096):
    """The round jet written from its description: core by bisection of the momentum balance, no shortcuts."""
    if x <= 0:
        return 0.0
    radius = np.sqrt(area / np.pi)
    b = slope / np.sqrt(np.log(2)) * x
    length = np.sqrt(2) * radius / (slope / np.sqrt(np.log(2)))
    centre = (1 + (x / length) ** 6) ** (-1 / 6)
    low, high = 0.0, 2 * radius
    for _ in range(200):
        a = 0.5 * (low + high)
        low, high = (a, high) if a**2 + np.sqrt(np.pi / 2) * a * b + b**2 / 2 < (radius / centre) ** 2 else (low, a)
    return centre / np.sqrt(RHO * area) * np.exp(-(max(r - a, 0.0) ** 2) / b**2)


def random_geometry(seed, n=200, m=8):
    rng = np.random.default_rng(seed)
    points, origins = rng.normal(scale=0.3, size=(n, 3)), rng.normal(scale=0.3, size=(m, 3))
    directions = rng.normal(size=(m, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return points, origins, directions, rng.uniform(0.002, 0.006, m)


def test_the_papers_jet_is_the_printed_formula():
    """Kernel and printed formula agree to machine precision at random places."""
    points, origins, directions, areas = random_geometry(0)
    fast = PaperJet().unit_velocity(points, origins, directions, areas)
    slow = [[paper_twin(p, o, d, a) for p in points] for o, d, a in zip(origins, directions, areas, strict=True)]
    assert np.count_nonzero(fast) > 500
    np.testing.assert_allclose(fast, slow, rtol=1e-13, atol=0)


def test_the_papers_jet_as_printed_is_far_too_fast():
    """One newton on a 60 mm disk gives 23.8 m/s at 0.1 m, where a round jet has about 0.6: stated, not mended."""
    assert speed_of(PaperJet(), 0.1, 0.0) == pytest.approx(23.8, abs=0.1)
    assert speed_of(RoundJet(), 0.1, 0.0) == pytest.approx(0.60, abs=0.01)


def test_the_papers_cone_ends_at_45_degrees():
    """Just inside 45 degrees there is water moving, just outside there is none, and none behind the disk."""
    inside, outside = np.deg2rad([44.999, 45.001])
    assert speed_of(PaperJet(), np.cos(inside), np.sin(inside)) > 0
    assert speed_of(PaperJet(), np.cos(outside), np.sin(outside)) == 0
    assert speed_of(PaperJet(), -0.3, 0.0) == 0
    assert speed_of(PaperJet(), 0.0, 0.0) == 0


def test_the_papers_constants_cannot_be_changed():
    """The model has no field to set."""
    with pytest.raises(TypeError):
        PaperJet(reference_distance_m=0.2)


def test_the_round_jet_is_its_description():
    """Kernel and description agree, in the core, the passage and the far field."""
    rng = np.random.default_rng(1)
    x, r = rng.uniform(-0.05, 1.2, 400), rng.uniform(0, 0.15, 400)
    slow = [round_twin(a, b, AREA) for a, b in zip(x, r, strict=True)]
    np.testing.assert_allclose(speed_of(RoundJet(), x, r), slow, rtol=1e-9, atol=1e-8)


@pytest.mark.parametrize("thrust", [0.5, 5.0])
@pytest.mark.parametrize("diameters", [0.1, 1, 3, 5, 6, 7, 10, 20, 50])
def test_every_plane_of_the_round_jet_carries_the_thrust(diameters, thrust):
    """The momentum flux, integrated over a plane across the jet, is T / rho within 0.1 % (the law asks for 5 %)."""
    r = np.linspace(0, 0.1 + diameters * D, 40001)
    u = speed_of(RoundJet(), diameters * D, r, thrust)
    assert np.trapezoid(2 * np.pi * r * u**2, r) == pytest.approx(thrust / RHO, rel=1e-3)


def test_the_water_leaves_the_disk_at_the_exit_speed():
    """At the disk the jet is a top hat of speed sqrt(T / (rho A))."""
    r = np.array([0.0, 0.5, 0.95, 1.05, 2.0]) * 0.03
    np.testing.assert_allclose(
        speed_of(RoundJet(), 1e-4, r), np.array([1, 1, 1, 0, 0]) / np.sqrt(RHO * AREA), atol=1e-6
    )


def test_far_down_the_round_jet_meets_the_published_band():
    """Beyond 10 D: U_c x / sqrt(M) in 6.5 to 7.0 and the half width over x in 0.094 to 0.102."""
    for x in np.array([10, 15, 25, 50]) * D:
        centre = float(speed_of(RoundJet(), x, 0.0))
        assert 6.5 <= centre * x / np.sqrt(1 / RHO) <= 7.0
        r = np.linspace(0, 0.2 * x, 20001)
        half = np.interp(-0.5 * centre, -speed_of(RoundJet(), x, r), r)
        assert 0.094 <= half / x <= 0.102


def test_the_core_is_as_long_as_measured():
    """The decay law, carried back, meets the exit speed at 6.1 to 6.3 D (Albertson et al. 1950: 6.2 D)."""
    far = 100 * D
    length = speed_of(RoundJet(), far, 0.0) * far / speed_of(RoundJet(), 1e-6, 0.0)
    assert 6.1 <= length / D <= 6.3
    assert speed_of(RoundJet(), 4 * D, 0.0) > 0.98 / np.sqrt(RHO * AREA)


def test_the_round_jet_draws_in_water():
    """Volume flux over that at the disk grows as 0.32 x / D far away, within 15 % (notes: entrainment law)."""
    flux = []
    for x in (30 * D, 40 * D):
        r = np.linspace(0, x, 40001)
        flux.append(np.trapezoid(2 * np.pi * r * speed_of(RoundJet(), x, r), r))
    growth = (flux[1] - flux[0]) / 10 * np.sqrt(RHO * AREA) / AREA
    assert growth == pytest.approx(0.32, rel=0.15)


def test_the_far_profile_is_gaussian():
    """Across the jet at 40 D the speed falls as a Gaussian: its integral over a line is that of one."""
    x = 40 * D
    r = np.linspace(0, x, 40001)
    u = speed_of(RoundJet(), x, r)
    b = RoundJet().width_slope * x
    line = 0.5 * np.sqrt(np.pi) * b * erf(x / b)
    assert np.trapezoid(u / u[0], r) == pytest.approx(line, rel=2e-3)


@pytest.mark.parametrize("model", [PaperJet(), RoundJet()])
def test_four_times_the_thrust_doubles_the_speed(model):
    """Speed grows with the square root of thrust."""
    points, origins, directions, areas = random_geometry(2)
    unit = model.unit_velocity(points, origins, directions, areas)
    np.testing.assert_array_equal(np.sqrt(4.0) * unit, 2.0 * (np.sqrt(1.0) * unit))
    assert speed_of(model, 0.3, 0.01, thrust=4.0) == pytest.approx(2 * speed_of(model, 0.3, 0.01, thrust=1.0))


@pytest.mark.parametrize("model", [PaperJet(), RoundJet()])
def test_upstream_of_the_disk_the_water_is_still(model):
    """No speed behind the disk."""
    np.testing.assert_array_equal(speed_of(model, np.linspace(-1, 0, 50), np.linspace(0, 0.1, 50)), 0.0)


@pytest.mark.parametrize("model", [PaperJet(), RoundJet()])
def test_the_speed_is_continuous_downstream(model):
    """Within the cone a small step changes the speed a little, through the end of the core as well."""
    x = np.linspace(0.02, 1.0, 4001)
    u = speed_of(model, x, 0.3 * x * (x < 2))
    on_axis = speed_of(model, x, 0.0)
    assert np.abs(np.diff(np.log(on_axis))).max() < 0.03
    assert np.abs(np.diff(u)).max() < 0.03 * u.max()


def test_a_round_jet_of_no_physical_width_is_refused():
    """The message names field, value and range."""
    with pytest.raises(InputError, match=r"half_width_slope 2, allowed 0\.05 to 0\.4"):
        RoundJet(half_width_slope=2.0)


def gaussian_twin(x, r, thrust, diameter, K, x0, b0, half_slope):
    """The jet with virtual origin written from its description."""
    if x <= 0:
        return 0.0
    b = b0 * diameter + half_slope / np.sqrt(np.log(2)) * x
    return K * np.sqrt(thrust / RHO) / (x + x0 * diameter) * np.exp(-((r / b) ** 2))


def test_the_fitted_jet_is_its_description():
    """Kernel and description agree wherever more than 1e-8 of the centreline speed is left."""
    rng = np.random.default_rng(2)
    x, r = rng.uniform(-0.05, 1.0, 400), rng.uniform(0, 0.3, 400)
    K, x0, b0, slope = 4.1, 2.5, 0.6, 0.15
    jet = GaussianJet(decay=K, virtual_origin_diameters=x0, start_width_diameters=b0, half_width_slope=slope)
    slow = [gaussian_twin(a, b, 3.0, D, K, x0, b0, slope) for a, b in zip(x, r, strict=True)]
    np.testing.assert_allclose(speed_of(jet, x, r, 3.0), slow, rtol=1e-12, atol=2e-8)


def test_the_speed_along_and_across_a_jet_is_the_speed_at_points():
    """`speed` of distances along and across equals the velocity at points laid out so; either sign of thrust."""
    rng = np.random.default_rng(3)
    x, r = rng.uniform(-0.1, 0.8, 50), rng.uniform(0, 0.3, 50)
    for name in ("paper", "fitted", "linear", "jet", "jet-fitted"):
        model = wake_model(name)
        by_points = speed_of(model, x, r, 2.0)
        np.testing.assert_allclose(model.speed(x, r, -2.0, AREA), by_points, rtol=1e-10, atol=1e-12)


def test_the_default_fitted_jet_carries_the_thrust():
    """Its numbers are those of a Gaussian of a propeller's width with momentum T / rho at every distance."""
    jet = wake_model("jet-fitted")
    np.testing.assert_allclose(jet.momentum_ratio([0.0, 1.0, 5.0, 50.0]), 1.0, rtol=1e-3)
    r = np.linspace(0, 1.0, 20001)
    flux = np.trapezoid(2 * np.pi * r * speed_of(jet, 0.3, r) ** 2, r)
    assert flux == pytest.approx(1 / RHO, rel=1e-3)


@pytest.mark.parametrize("diameters", [0.5, 3, 6, 10, 40])
def test_the_propellers_jet_is_wider_and_carries_the_thrust(diameters):
    """Swirl makes the jet about twice as wide (exp(-22.2 (r/x)^2)); its momentum flux is still T / rho."""
    jet = RoundJet.of_propeller()
    assert jet.half_width_slope / RoundJet().half_width_slope == pytest.approx(2, rel=0.1)
    assert np.exp(-22.2) == pytest.approx(np.exp(-1 / jet.width_slope**2))
    r = np.linspace(0, 0.1 + 2 * diameters * D, 40001)
    u = speed_of(jet, diameters * D, r)
    assert np.trapezoid(2 * np.pi * r * u**2, r) == pytest.approx(1 / RHO, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.2, -0.1, 1.0, AREA), "across_m -0.1, a radius must not be negative"),
        ((0.2, 0.1, 1.0, 0.0), "area_m2 0, a disk's area must be more than 0"),
        ((0.2, 0.1, np.nan, AREA), "thrust_N holds NaN"),
        ((np.inf, 0.1, 1.0, AREA), "along_m holds NaN or infinity"),
    ],
)
def test_a_speed_at_no_place_is_refused(arguments, message):
    """Negative radius, a disk without area and NaN are named."""
    with pytest.raises(InputError, match=message):
        RoundJet().speed(*arguments)


def test_a_jet_from_nowhere_is_refused():
    """A virtual origin in the disk would make the speed there infinite."""
    with pytest.raises(InputError, match=r"virtual_origin_diameters 0, allowed 0\.01 to 100"):
        GaussianJet(decay=6.9, virtual_origin_diameters=0.0, start_width_diameters=0.7, half_width_slope=0.1)
    with pytest.raises(InputError, match="decay nan"):
        GaussianJet(decay=np.nan, virtual_origin_diameters=1.0, start_width_diameters=0.7, half_width_slope=0.1)
