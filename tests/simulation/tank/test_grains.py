"""What a grain does in water, against published values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.simulation.tank.grains import (
    beam_attenuation_per_m,
    erosion_rates_kg_m2_s,
    friction_from,
    friction_table_m_s,
    friction_velocity_m_s,
    grain_number,
    least_mean,
    mean_excess,
    mean_pickup_rates_kg_m2_s,
    pickup_rate_kg_m2_s,
    settling_speed_m_s,
    speed_at_stress_m_s,
    threshold_stress_Pa,
)

CALCITE = 2710.0


def test_calcite_sand_settles_and_moves_as_soulsby_says():
    """0.3 mm sinks at 42 to 46 mm/s and moves at 0.187 Pa; 20 um at 0.34 mm/s and 0.063 Pa."""
    assert 0.042 < settling_speed_m_s(3e-4, CALCITE, 998.0) < 0.0461
    assert threshold_stress_Pa(3e-4, CALCITE, 998.0) == pytest.approx(0.187, rel=0.02)
    assert settling_speed_m_s(20e-6, CALCITE, 998.0) == pytest.approx(0.34e-3, rel=0.10)
    assert threshold_stress_Pa(20e-6, CALCITE, 998.0) == pytest.approx(0.063, rel=0.02)


def test_fine_grains_settle_as_stokes_says():
    """Below 30 um the settling speed is within 15 % of g (s-1) d^2 / (18 nu)."""
    for d in (5e-6, 10e-6, 30e-6):
        stokes = 9.80665 * (CALCITE / 1000 - 1) * d**2 / 18e-6
        assert settling_speed_m_s(d, CALCITE, 1000.0) == pytest.approx(stokes, rel=0.15)


def test_smooth_beds_follow_the_universal_log_law():
    """Over fine silt u/u* is 2.5 ln(z u*/nu) + 5.5, within 2 %."""
    star = float(friction_velocity_m_s(0.3, 0.01, 1e-6))
    assert 0.3 / star == pytest.approx(2.5 * math.log(0.01 * star / 1e-6) + 5.5, rel=0.02)


@given(st.floats(0.03, 2.0), st.floats(1e-6, 5e-4))
def test_friction_velocity_and_its_inverse_agree(speed, grain):
    """The speed at the stress that a speed makes is that speed, within 1 %."""
    star = float(friction_velocity_m_s(speed, 0.01, grain))
    assert speed_at_stress_m_s(star**2, 0.01, grain) == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize("grain", [5e-6, 20e-6, 3e-4])
def test_the_table_of_friction_velocities_is_the_law(grain):
    """From 1 mm/s to 4 m/s the table differs from the law by less than 1e-4 of it, and by 5 % at 6 m/s; 0 is 0."""
    table = friction_table_m_s(0.01, grain)
    speed = np.logspace(-3, math.log10(4.0), 2000)
    found = np.array([friction_from(table, v) for v in speed])
    assert found == pytest.approx(friction_velocity_m_s(speed, 0.01, grain), rel=1e-4)
    assert friction_from(table, 6.0) == pytest.approx(float(friction_velocity_m_s(6.0, 0.01, grain)), rel=0.05)
    assert friction_from(table, 0.0) == pytest.approx(0.0, abs=1e-8)


def test_erosion_starts_at_the_threshold():
    """Under a steady stress nothing below it, M at twice it."""
    stress = np.array([0.0, 0.05, 0.1, 0.2])
    assert erosion_rates_kg_m2_s(stress, np.full(4, 0.1), 5e-5, 0.0) == pytest.approx([0, 0, 0, 5e-5])


def _drawn(mean, intensity):
    s = np.sqrt(np.log1p(intensity**2))
    return mean * np.exp(s * np.random.default_rng(0).standard_normal(1_000_000) - 0.5 * s**2)


@pytest.mark.parametrize("intensity", [0.2, 0.4, 0.8])
@pytest.mark.parametrize("mean", [0.5, 0.8, 1.0, 1.5, 4.0])
def test_the_mean_excess_is_that_of_drawn_stresses(mean, intensity):
    """A million log-normal stresses with that mean and rms exceed the threshold by as much on average."""
    drawn = _drawn(mean, intensity)
    assert drawn.std() == pytest.approx(intensity * mean, rel=0.01)
    excess = np.maximum(drawn - 1.0, 0.0)
    noise = 4 * excess.std() / 1000
    assert mean_excess(mean, intensity) == pytest.approx(excess.mean(), abs=noise)


def test_strong_stress_erodes_as_if_it_were_steady():
    """Far above the threshold the fluctuation adds nothing, far below hardly anything, and never less than nothing."""
    assert mean_excess(10.0, 0.4) == pytest.approx(9.0, rel=1e-6)
    assert 0.0 < mean_excess(0.5, 0.4) < 0.01
    assert mean_excess(0.0, 0.4) == mean_excess(1e-9, 0.4) == 0.0
    assert mean_excess(1.5, 0.0) == 0.5
    below = least_mean(0.4)
    assert 0.2 < below < 0.5
    assert mean_excess(below, 0.4) == pytest.approx(1e-4, rel=1e-3)


@pytest.mark.parametrize("over", [0.7, 1.0, 2.0, 10.0])
def test_the_mean_pickup_is_that_of_drawn_stresses(over):
    """Van Rijn's rate averaged over a million drawn stresses is the quadrature, to its noise."""
    grain = 2.5e-4, 2710.0, 1000.0
    threshold = threshold_stress_Pa(*grain)
    drawn = pickup_rate_kg_m2_s(_drawn(over * threshold, 0.4), threshold, *grain)
    found = mean_pickup_rates_kg_m2_s(np.array([over * threshold]), np.array([threshold]), *grain, 0.4)
    assert found[0] == pytest.approx(drawn.mean(), abs=4 * drawn.std() / 1000 + 1e-12)
    steady = mean_pickup_rates_kg_m2_s(np.array([over * threshold]), np.array([threshold]), *grain, 0.0)
    assert steady[0] == pytest.approx(float(pickup_rate_kg_m2_s(over * threshold, threshold, *grain)))


def test_fifty_milligrams_of_silt_dim_a_beam():
    """50 mg/L of 20 um calcite takes 2.8 /m, of 0.3 mm 0.18 /m; twice the silt, twice as much."""
    assert float(beam_attenuation_per_m(0.05, 20e-6, CALCITE)) == pytest.approx(2.77, rel=0.01)
    assert float(beam_attenuation_per_m(0.05, 3e-4, CALCITE)) == pytest.approx(0.18, rel=0.03)
    assert np.allclose(beam_attenuation_per_m([0.1, 0.2], 20e-6, CALCITE), [5.535, 11.07], rtol=0.01)


@pytest.mark.parametrize(("grain", "density"), [(0.0, CALCITE), (-1e-6, CALCITE), (20e-6, 900.0)])
def test_grains_that_cannot_sink_are_refused(grain, density):
    """A grain of no size, or lighter than water, is bad input."""
    with pytest.raises(InputError, match="grain"):
        settling_speed_m_s(grain, density, 1000.0)


def test_van_rijns_pickup_is_his_formula_and_is_capped():
    """At twice the threshold it is 0.00033 rho_s ((s-1) g d)^0.5 D*^0.3; far above, it grows as stress to the half."""
    d, rho_s, rho = 3e-4, 2710.0, 1000.0
    threshold = threshold_stress_Pa(d, rho_s, rho)
    by_hand = 0.00033 * rho_s * (1.71 * 9.80665 * d) ** 0.5 * grain_number(d, rho_s, rho) ** 0.3
    assert pickup_rate_kg_m2_s(2 * threshold, threshold, d, rho_s, rho) == pytest.approx(by_hand, rel=1e-9)
    assert pickup_rate_kg_m2_s(0.9 * threshold, threshold, d, rho_s, rho) == 0.0
    high = pickup_rate_kg_m2_s(np.array([100.0, 400.0]), threshold, d, rho_s, rho)
    assert high[1] / high[0] == pytest.approx(2.0, rel=0.01)
