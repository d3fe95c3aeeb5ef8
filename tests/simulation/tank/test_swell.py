"""What a swell does to the bed."""

import math

import numpy as np
import pytest

from wakewise.simulation.tank.grains import Swell, friction_velocity_m_s, wave_friction_factor
from wakewise.simulation.tank.sediment import Silt, SiltProperties
from wakewise.simulation.water import AiryWave

WAVE = AiryWave(amplitude_m=0.05, period_s=4.0, heading_rad=0.6, depth_m=1.5)
SWELL = Swell(wave=WAVE, grain_m=20e-6, density_kg_m3=1000.0)


class Moving:
    """Water in which nothing but a wave and a stream moves."""

    def __init__(self, time_s, stream=(0.0, 0.0, 0.0)):
        self.time_s, self.stream = time_s, np.array(stream)

    def velocity(self, points_W_m):
        return WAVE.velocity(points_W_m, self.time_s) + self.stream


def test_the_orbit_at_the_bed_is_the_waves():
    """Speed along the heading at the bed is that of the wave's own velocity field, and so is the amplitude."""
    places = np.random.default_rng(0).uniform(-2, 2, (50, 2))
    field = WAVE.velocity(np.column_stack([places, np.full(50, 1.5)]), 1.3)
    assert SWELL.speed_m_s(places, 1.3)[:, None] * SWELL.ahead == pytest.approx(field[:, :2], abs=1e-12)
    k = WAVE.number_per_m
    assert SWELL.amplitude_m_s == pytest.approx(0.05 * 2 * math.pi / 4.0 / math.sinh(1.5 * k))


def test_a_laminar_layer_is_stokes_own():
    """Over a smooth bed at low Reynolds numbers the stress is that of Stokes's second problem, rho U sqrt(nu omega)."""
    u, period = 0.1, 4.0
    stokes = 1000.0 * u * math.sqrt(1e-6 * 2 * math.pi / period)
    assert 0.5 * 1000.0 * wave_friction_factor(u, period, 20e-6) * u**2 == pytest.approx(stokes, rel=1e-9)


def test_coarse_beds_are_rough():
    """Over gravel Soulsby's rough law holds: twice the orbit, 2^-0.52 times the factor."""
    one, two = wave_friction_factor(0.5, 4.0, 5e-3), wave_friction_factor(1.0, 4.0, 5e-3)
    assert two / one == pytest.approx(2**-0.52)


def test_a_swell_drags_on_the_bed_more_than_a_stream_of_its_speed():
    """A silt bed under the wave alone feels the swell's stress everywhere, far above that of the log law."""
    silt = Silt(
        SiltProperties.of(20e-6, 2710.0, 1000.0, 5e-5), 0.1, (4.0, 3.0, 1.5), 100, np.random.default_rng(0), SWELL
    )
    silt._shear(Moving(0.7), np.zeros((0, 3)))
    stress = 1000.0 * silt._star_m_s**2
    places = silt._middles
    assert stress.ravel() == pytest.approx(SWELL.stress_Pa(places, 0.7), abs=1e-6)
    stream = 1000.0 * float(friction_velocity_m_s(SWELL.amplitude_m_s, 0.01, 20e-6)) ** 2
    assert stress.max() > 2.0 * stream


def test_stream_and_swell_add_as_squares():
    """The squares of the two stresses add up in every cell, whatever the phase of the wave there."""
    silt = Silt(
        SiltProperties.of(20e-6, 2710.0, 1000.0, 5e-5), 0.1, (4.0, 3.0, 1.5), 100, np.random.default_rng(0), SWELL
    )
    silt._shear(Moving(0.7, [0.2, 0.1, 0.0]), np.zeros((0, 3)))
    stream = 1000.0 * float(friction_velocity_m_s(math.hypot(0.2, 0.1), 0.01, 20e-6)) ** 2
    expected = np.hypot(stream, SWELL.stress_Pa(silt._middles, 0.7))
    assert 1000.0 * silt._star_m_s.ravel() ** 2 == pytest.approx(expected, rel=1e-3)


def test_a_strong_swell_lifts_silt_where_its_speed_alone_would_not():
    """Orbits of 0.11 m/s over 20 um silt: the log law stays below the threshold, the swell's own stress does not."""
    laws = SiltProperties.of(20e-6, 2710.0, 1000.0, 5e-5)
    wave = AiryWave(amplitude_m=0.05, period_s=4.0, heading_rad=0.0, depth_m=1.5)
    swell = Swell(wave=wave, grain_m=20e-6, density_kg_m3=1000.0)
    assert 1000.0 * float(friction_velocity_m_s(swell.amplitude_m_s, 0.01, 20e-6)) ** 2 < laws.threshold_Pa
    lifted = []
    for known in (None, swell):
        silt = Silt(laws, 0.1, (2.0, 2.0, 1.5), 2000, np.random.default_rng(0), known)
        for k in range(40):
            flow = Moving(0.1 * k)
            flow.velocity = lambda points, t=0.1 * k: wave.velocity(points, t)
            silt.step(flow, np.zeros((0, 3)), 0.1)
        lifted.append(silt.lifted_kg)
    assert lifted[0] == 0.0
    assert lifted[1] > 1e-4
