"""Widths, lives and wakes of the closure: what holds at any of them."""

import math

import numpy as np
import pytest
from round_jet_reference import lasting_spread, travel, wake_sigma_m

from wakewise.simulation.water.faces import TankFaces
from wakewise.simulation.water.parcel_advection import advect_parcels
from wakewise.simulation.water.round_jet_closure import CORE_END_D, PLAIN, SWIRLING, JetSpreading
from wakewise.simulation.water.water import Water

D_M = 0.06
AREA_M2 = math.pi * D_M**2 / 4
DENSITY = 998.0
WIDTHS = [0.086, 0.094, 0.13, 0.18]


def _steady(width, thrust_N, life=1.0):
    """A jet long since steady, of any thrust: its flow is that of 1 N in a time that goes with the root."""
    water = Water(
        np.full(1, AREA_M2),
        density_kg_m3=DENSITY,
        bed_z_m=math.inf,
        rng=np.random.default_rng(0),
        spreading=JetSpreading.of_width(width),
        wake_life=life,
        rest_speed_m_s=1e-4,
    )
    slow = 1 / math.sqrt(thrust_N)
    dt_s, at, axis = 0.05 * slow, np.zeros((1, 3)), np.array([[-1.0, 0.0, 0.0]])
    for _ in range(round(12.0 * slow / dt_s)):
        water.step(dt_s, at, at, axis, np.array([[thrust_N * dt_s, 0.0]]))
    return water


def _across(water, x, thrust_N):
    """Speeds along a radius at x, shape (20, 300), at as many instants."""
    r, dt_s, speeds = np.linspace(0, 0.7 * x, 300), 0.05 / math.sqrt(thrust_N), []
    points, at, axis = np.column_stack([np.full(300, x), r, 0 * r]), np.zeros((1, 3)), np.array([[-1.0, 0.0, 0.0]])
    for _ in range(20):
        for _ in range(2):
            water.step(dt_s, at, at, axis, np.array([[thrust_N * dt_s, 0.0]]))
        speeds.append(water.velocity(points)[:, 0])
    return r, np.array(speeds)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("thrust_N", [0.1, 1.0, 5.0])
def test_a_jet_of_any_width_keeps_its_momentum_and_entrains(width, thrust_N):
    """Momentum flux is the thrust within 10 %, Q/Q0 follows 4 spread x/D within 15 %, the half width as asked, 8 %.

    At the thrusts of the claims, 0.1 to 5 N, and at .6 and .8 m, where targets stand. The widest jet lacks 16 % of
    momentum and flux at .8 m (bounds 18 and 20 %): neighbours in its row differ so much in size that they no longer add
    up to a slender jet's.
    """
    water, spread = _steady(width, thrust_N), JetSpreading.of_width(width)
    tip = (spread.core_D - CORE_END_D / spread.spread) * D_M
    for x in (0.6, 0.8):
        r, speeds = _across(water, x, thrust_N)
        momentum = np.mean([np.trapezoid(DENSITY * u**2 * 2 * np.pi * r, r) for u in speeds])
        assert momentum == pytest.approx(thrust_N, rel=0.10 if width < 0.15 else 0.18)
        u = speeds.mean(axis=0)
        half = np.interp(-0.5 * u[0], -u, r)
        assert half == pytest.approx(width * (x - tip), rel=0.08)
        inside = r < 3.0 * half
        flux = np.trapezoid((2 * np.pi * r * np.maximum(u, 0.0))[inside], r[inside])
        first = math.sqrt(thrust_N / DENSITY / AREA_M2) * AREA_M2
        assert flux / first == pytest.approx(4 * spread.spread * (x - tip) / D_M, rel=0.15 if width < 0.15 else 0.20)


@pytest.mark.parametrize("life", [1.0, 1.7])
def test_a_long_life_leaves_a_fed_jet_as_it_was(life):
    """The axis of a steady jet is the same within 1 % at any life of its remains."""
    x = np.array([0.3, 0.6, 0.8])
    points = np.column_stack([x, 0 * x, 0 * x])
    plain = _steady(0.094, 1.0).velocity(points)[:, 0]
    assert _steady(0.094, 1.0, life).velocity(points)[:, 0] == pytest.approx(plain, rel=0.01)


def test_remains_last_longer_when_told_to():
    """After a stop, the time for which water 0.36 to 0.5 m off keeps half its speed grows with the life."""
    at, axis, dt_s = np.zeros((1, 3)), np.array([[-1.0, 0.0, 0.0]]), 0.05
    points = np.array([[0.36, 0, 0], [0.42, 0, 0], [0.5, 0, 0]])
    lasted = []
    for life in (1.0, 1.35, 1.7):
        water, total = _steady(0.094, 1.0, life), 0.0
        fed = water.velocity(points)[:, 0]
        for _ in range(160):
            water.step(dt_s, at, at, axis, np.zeros((1, 2)))
            total = total + dt_s * water.velocity(points)[:, 0] / fed
        lasted.append(np.mean(total))

    assert 1.0 < lasted[1] / lasted[0] < lasted[2] / lasted[0] < 1.7


def test_the_two_published_jets_lie_on_one_line():
    """A width of 0.094 gives the jet without swirl, of 0.177 the propeller's; in between cores shorten evenly."""
    assert JetSpreading.of_width(0.094) == PLAIN
    wide = JetSpreading.of_width(SWIRLING.half_width_growth)
    assert wide.core_D == pytest.approx(SWIRLING.core_D, rel=1e-9)
    assert wide.spread == pytest.approx(SWIRLING.spread, rel=1e-9)
    cores = [JetSpreading.of_width(w).core_D for w in WIDTHS]
    assert np.all(np.diff(cores) < 0.0) and np.all(np.array(cores) > 2.0)


def _drifted(parcels, life, wake):
    """Sizes after one compiled step of 0.05 s."""
    sigma, D, speed, start = (a.copy() for a in parcels)
    n = len(sigma)
    still, u = np.zeros((n, 3)), np.column_stack([speed, np.zeros((n, 2))])
    laws = np.array([PLAIN.core_spread, PLAIN.spread, 0.17, 0.05, life])
    out = np.empty(n), np.full(n, wake)
    advect_parcels(
        still.copy(), sigma, np.zeros(n), out[0], D, still, u, still.copy(), start, out[1], laws, TankFaces(()).walls
    )
    return sigma


def _some(n=100):
    rng = np.random.default_rng(0)
    D = np.full(n, D_M)
    return rng.uniform(0.51, 4.0, n) * D, D, rng.uniform(0.0, 0.5, n), rng.uniform(0.1, 0.8, n)


def test_the_compiled_life_is_the_closure_as_written():
    """Sizes agree with `lasting_spread` and `travel` to rounding, and a long life makes parcels grow less."""
    sigma, D, speed, start = _some()
    wide = lasting_spread(PLAIN.spread, sigma, D, speed, start, 1.7)
    grown = travel(sigma, D, speed, 0.05, PLAIN, wide)[1]
    assert _drifted((sigma, D, speed, start), 1.7, False) == pytest.approx(grown, rel=1e-12)
    assert np.all(grown <= travel(sigma, D, speed, 0.05)[1])


def test_the_compiled_wake_is_the_closure_as_written():
    """A wake's parcels grow by their own deficit besides what carries them; alone, by the law's cube root."""
    sigma, D, speed, start = _some()
    moved = travel(sigma, D, speed, 0.05)[1]
    grown = wake_sigma_m(moved, 0.5 * D, start, 0.05, PLAIN.spread)
    assert _drifted((sigma, D, speed, start), 1.0, True) == pytest.approx(grown, rel=1e-12)
    theta, speed_m_s, x = 0.1, 0.2, np.array([5.0, 9.0])
    law = 1.14 * theta * (x / theta) ** (1 / 3)
    deficit = speed_m_s * theta**2 / law[0] ** 2
    after = wake_sigma_m(law[:1], law[:1], np.array([deficit]), (x[1] - x[0]) / speed_m_s)
    assert after == pytest.approx(law[1:], rel=1e-12)
