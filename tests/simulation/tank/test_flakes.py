"""Flakes that drift with the water."""

import numpy as np
import pytest

from wakewise.core.geometry import Pose, quat_from_rotvec
from wakewise.simulation.tank.flakes import DEPTH_M, HALF_M, HEIGHT_M, PER_M3, SLOPES, Flakes
from wakewise.simulation.water import AiryWave, SteadyCurrent

CENTRE = np.array([0.2, -0.1, 1.4])
CURRENT = SteadyCurrent(velocity_W_m_s=np.array([0.05, -0.02, 0.0]))
LEVEL = Pose(np.array([-0.5, -0.1, 1.0]), quat_from_rotvec(np.array([0.0, np.pi / 2, 0.0])))


class Jet:
    """A uniform addition of the thrusters to the water."""

    def __init__(self, velocity):
        self.u = np.array(velocity)

    def excess_velocity(self, points_W_m):
        return np.tile(self.u, (len(points_W_m), 1))


def _flakes(ambient=CURRENT, seed=0):
    return Flakes(CENTRE, 1.5, ambient, np.random.default_rng(seed))


def _apart(a, b):
    """Way from b to a, the short way round the box."""
    side = np.array([2 * HALF_M, 2 * HALF_M, HEIGHT_M])
    return (a - b + side / 2) % side - side / 2


def test_flakes_go_with_a_current():
    """After four seconds each is where the current and the jets have carried it, or as far in on the other side."""
    flakes = _flakes()
    start = flakes.p_W_m.copy()
    assert flakes.move(0.0, Jet([0.01, 0.0, 0.0])) == pytest.approx(np.tile([0.06, -0.02, 0.0], (len(start), 1)))
    flakes.move(4.0, Jet([0.0, 0.0, 0.0]))
    assert _apart(flakes.p_W_m, start) == pytest.approx(np.tile([0.24, -0.08, 0.0], (len(start), 1)), abs=1e-9)


def test_a_swell_brings_flakes_back():
    """After one period of a small wave they are where they were, to a tenth of the way they were away."""
    wave = AiryWave(amplitude_m=0.02, period_s=4.0, heading_rad=0.0, depth_m=1.5)
    flakes = _flakes(wave)
    start = flakes.p_W_m.copy()
    flakes.move(2.0, Jet([0, 0, 0]))
    half = np.linalg.norm(_apart(flakes.p_W_m, start), axis=1)
    flakes.move(4.0, Jet([0, 0, 0]))
    whole = np.linalg.norm(_apart(flakes.p_W_m, start), axis=1)
    assert np.median(half) > 0.02
    assert np.median(whole) < 0.1 * np.median(half)


def test_their_number_stays_even():
    """After minutes in a current the box still holds them evenly, each half as many as the other."""
    flakes = _flakes()
    for k in range(60):
        flakes.move(2.0 * k, Jet([0.0, 0.0, 0.01]))
    n = len(flakes.p_W_m)
    assert n == pytest.approx(PER_M3 * 4 * HALF_M**2 * HEIGHT_M, rel=0.05)
    middle = np.array([CENTRE[0], CENTRE[1], 1.5 - HEIGHT_M / 2])
    for axis in range(3):
        assert abs((flakes.p_W_m[:, axis] > middle[axis]).sum() - n / 2) < 2.5 * np.sqrt(n)


def test_those_before_the_camera_are_told():
    """What is told is all that lies in the view and nothing else, and is the same flake with the same looks later."""
    flakes = _flakes()
    told = flakes.before(LEVEL, 1.0, Jet([0, 0, 0]))
    p_C = LEVEL.inverse().apply(told.p_W_m)
    assert 100 < len(p_C) < 0.2 * len(flakes.p_W_m)
    assert p_C[:, 2].min() > 0.0 and p_C[:, 2].max() < DEPTH_M
    assert np.all(np.abs(p_C[:, :2]) <= p_C[:, 2:] * SLOPES)
    assert told.covers(flakes.p_W_m, LEVEL).sum() == len(p_C)
    later = flakes.before(LEVEL, 1.5, Jet([0, 0, 0]))
    common = np.isin(told.looks[:, 1], later.looks[:, 1])
    assert common.mean() > 0.85
    where = dict(zip(later.looks[:, 1], later.p_W_m, strict=True))
    moved = np.array([where[size] for size in told.looks[common, 1]]) - told.p_W_m[common]
    assert moved == pytest.approx(np.tile([0.025, -0.01, 0.0], (len(moved), 1)), abs=1e-9)


def test_the_same_seed_gives_the_same_flakes():
    """Two tanks of one seed have the same flakes, another has others."""
    assert np.array_equal(_flakes().p_W_m, _flakes().p_W_m)
    assert not np.array_equal(_flakes().p_W_m[:10], _flakes(seed=1).p_W_m[:10])
