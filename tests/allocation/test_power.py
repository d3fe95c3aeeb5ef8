"""What shares are worth their power: the same wrench, within limits, within a bound, and never a bad deal."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from wakewise.allocation import (
    PowerLaw,
    Weights,
    best_by_power,
    compile_layout,
    min_norm_allocation,
    min_wash_allocation,
    power_adjusted_cost,
)
from wakewise.allocation.line_search import cost

RNG = np.random.default_rng(3)
HALF = np.sqrt(0.5)
AXES = np.array([[-HALF, HALF, 0], [-HALF, -HALF, 0], [HALF, HALF, 0], [HALF, -HALF, 0], *[[0, 0, 1.0]] * 4])
CORNERS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
PLACES = np.zeros((8, 3))
PLACES[:4, :2], PLACES[4:, :2], PLACES[:4, 2] = CORNERS * [0.16, 0.1], CORNERS * [0.08, 0.14], 0.05
B = np.vstack([AXES.T, np.cross(PLACES, AXES).T])
LAYOUT = compile_layout(B, np.full(8, -40.0), np.full(8, 50.0))
LAW = PowerLaw(forward=np.full(8, 30.0), reverse=np.full(8, 43.0), least_forward_N=0.4, least_reverse_N=0.36)
WEIGHTS = Weights(disturbance=150.0, effort=1e-3)


def gram():
    """A Gram matrix of eight jets' speeds at forty points."""
    speeds = RNG.uniform(0.0, 0.05, (16, 40)) * (RNG.uniform(size=(16, 1)) < 0.6)
    return speeds @ speeds.T / 40.0


def problem():
    wrench = RNG.uniform(-1.0, 1.0, 6) * [4.0, 4.0, 8.0, 0.2, 0.6, 0.3]
    G = gram()
    return wrench, G, min_norm_allocation(LAYOUT, wrench, G), min_wash_allocation(LAYOUT, wrench, G, WEIGHTS)


def value(thrusts_N, G, calm):
    return power_adjusted_cost(
        cost(G, np.array(thrusts_N), np.zeros(8), WEIGHTS.packed), float(LAW.power_W(thrusts_N)), calm
    )


@pytest.mark.parametrize("share", [1.0, 1.05, 1.3, 2.0])
def test_the_bound_holds_at_the_same_wrench_within_limits(share):
    """For thirty wrenches and targets; nor is there a better deal at either end of the way."""
    for _ in range(30):
        wrench, G, least, found = problem()
        most_W = share * float(LAW.power_W(least.thrusts_N))
        best = best_by_power(LAYOUT, found, least.thrusts_N, LAW, most_W, 1e-4, G, WEIGHTS).thrusts_N
        assert float(LAW.power_W(best)) <= most_W * (1.0 + 1e-12)
        np.testing.assert_allclose(B @ best, wrench, atol=1e-9)
        assert np.all(best >= LAYOUT.lower_N) and np.all(best <= LAYOUT.upper_N)
        assert value(best, G, 1e-4) <= value(least.thrusts_N, G, 1e-4)
        if float(LAW.power_W(found.thrusts_N)) <= most_W:
            assert value(best, G, 1e-4) <= value(found.thrusts_N, G, 1e-4)


def test_the_best_deal_is_that_of_all_combinations_of_the_parts():
    """Held against a search that is easy to read: sixteenths of the way along each part, by itself."""
    for _ in range(10):
        _, G, least, found = problem()
        most_W = 1.4 * float(LAW.power_W(least.thrusts_N))
        best = best_by_power(LAYOUT, found, least.thrusts_N, LAW, most_W, 1e-4, G, WEIGHTS)
        ways = [np.where(own, found.thrusts_N - least.thrusts_N, 0.0) for own in LAYOUT.owners]
        assert len(ways) == 2
        points = [least.thrusts_N + i / 16 * ways[0] + j / 16 * ways[1] for i, j in product(range(17), repeat=2)]
        allowed = [T for T in points if float(LAW.power_W(T)) <= most_W]
        assert value(best.thrusts_N, G, 1e-4) == pytest.approx(min(value(T, G, 1e-4) for T in allowed), rel=1e-9)
        assert best.disturbance == pytest.approx(
            best_by_power(LAYOUT, best, best.thrusts_N, LAW, 0.0, 1e-4, G, WEIGHTS).disturbance
        )


def test_what_stands_beside_makes_power_cheap():
    """The more a vehicle draws anyway, the less wash is left; a bound is one for the thrusters alone."""
    for _ in range(10):
        _, G, least, found = problem()
        most_W = 1.3 * float(LAW.power_W(least.thrusts_N))
        left = []
        for standing_W in (0.0, 20.0, 1e6):
            law = replace(LAW, standing_W=standing_W)
            best = best_by_power(LAYOUT, found, least.thrusts_N, law, most_W, 1e-4, G, WEIGHTS)
            assert float(LAW.power_W(best.thrusts_N)) <= most_W * (1.0 + 1e-9)
            left.append(cost(G, best.thrusts_N, np.zeros(8), WEIGHTS.packed))
        assert left[0] >= left[1] >= left[2]


def test_nobody_pays_for_water_stiller_than_calm():
    """Where all shares count as calm those of least power are taken, whatever they do."""
    for _ in range(10):
        _, G, least, found = problem()
        best = best_by_power(LAYOUT, found, least.thrusts_N, LAW, np.inf, 1e9, G, WEIGHTS)
        assert float(LAW.power_W(best.thrusts_N)) <= float(LAW.power_W(least.thrusts_N)) * (1.0 + 1e-9)


def test_what_saves_little_is_mostly_left():
    """Of two spare thrusts one saves much of the wash, the other little: only the first is gone along to its end."""
    wrench = np.array([-4.0, 0.0, 8.0, 0.0, 0.0, 0.0])
    G = np.zeros((16, 16))
    for slot in (0, 1):
        G[slot, slot] = 1e-3
    G[4, 4] = 1e-4
    found, least = min_wash_allocation(LAYOUT, wrench, G, WEIGHTS), min_norm_allocation(LAYOUT, wrench, G)
    best = best_by_power(LAYOUT, found, least.thrusts_N, LAW, np.inf, 0.3, G, WEIGHTS)
    assert best.disturbance < 0.1 * least.disturbance
    assert found.thrusts_N[4] < 0.1 < least.thrusts_N[4]
    np.testing.assert_allclose(best.thrusts_N[:4], found.thrusts_N[:4], atol=1e-9)
    gone = (best.thrusts_N[4] - least.thrusts_N[4]) / (found.thrusts_N[4] - least.thrusts_N[4])
    assert 0.0 <= gone < 0.5
    assert float(LAW.power_W(best.thrusts_N)) < 0.95 * float(LAW.power_W(found.thrusts_N))


@pytest.mark.parametrize("pairs", [0, 1, 3, 6])
def test_any_number_of_parts_is_gone_along(pairs):
    """Thrusters that stand twice are a part each: from none to six, the wash that is saved for nothing is saved."""
    twice = np.r_[np.arange(6), np.arange(pairs)]
    layout = compile_layout(np.eye(6)[:, twice], np.full(6 + pairs, -40.0), np.full(6 + pairs, 40.0))
    assert len(layout.owners) == pairs
    n = 6 + pairs
    law = PowerLaw(forward=np.full(n, 30.0), reverse=np.full(n, 30.0))
    G = np.diag(np.r_[np.full(6, 1e-3), np.full(pairs, 1e-9), np.zeros(n)])
    wrench = np.full(6, 2.0)
    found, least = min_wash_allocation(layout, wrench, G, WEIGHTS), min_norm_allocation(layout, wrench, G)
    best = best_by_power(layout, found, least.thrusts_N, law, np.inf, 0.0, G, WEIGHTS)
    np.testing.assert_allclose(layout.B @ best.thrusts_N, wrench, atol=1e-9)
    if pairs == 6:
        np.testing.assert_allclose(best.thrusts_N[6:], 2.0, atol=1e-6)
    else:
        assert best.disturbance <= least.disturbance * (1.0 + 1e-12)


def test_power_is_convex_and_goes_with_thrust_in_pulses():
    """|T|^1.5 above the least thrust, |T| below it, each sign by its own figure."""
    T = np.zeros(8)
    T[0] = 1.0
    assert float(LAW.power_W(T)) == pytest.approx(30.0)
    assert float(LAW.power_W(-T)) == pytest.approx(43.0)
    assert float(LAW.power_W(0.1 * T)) == pytest.approx(0.25 * float(LAW.power_W(0.4 * T)))
    line = np.linspace(-2.0, 2.0, 401)[:, None] * T
    assert np.all(np.diff(LAW.power_W(line), 2) >= -1e-9)


def test_the_power_of_many_is_the_sum_over_each_ones_thrusters():
    """Of thrusts of any shape, either way, below the least thrust and above: the law thruster by thruster."""
    T = RNG.normal(size=(3, 5, 8))
    each = np.empty_like(T)
    for place, thrust in np.ndenumerate(T):
        factor, least = (30.0, 0.4) if thrust >= 0.0 else (43.0, 0.36)
        each[place] = factor * abs(thrust) * np.sqrt(max(abs(thrust), least))
    np.testing.assert_allclose(LAW.power_W(T), each.sum(axis=-1), rtol=1e-12)
    assert LAW.power_W(T[0, 0]).shape == ()
