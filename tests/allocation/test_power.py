"""The bound on power: the same wrench, within limits, for no more than is allowed, and no worse than least thrusts."""

import numpy as np
import pytest

from wakewise.allocation import (
    PowerLaw,
    Weights,
    compile_layout,
    gentle_allocation,
    least_thrusts,
    within_power,
)
from wakewise.allocation.search import cost

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
    return wrench, G, least_thrusts(LAYOUT, wrench, G), gentle_allocation(LAYOUT, wrench, G, WEIGHTS)


@pytest.mark.parametrize("share", [1.0, 1.05, 1.3])
def test_the_bound_holds_at_the_same_wrench_within_limits(share):
    """For thirty wrenches and targets; where the gentlest shares are cheap enough they are what is given."""
    for _ in range(30):
        wrench, G, least, found = problem()
        most_W = share * float(LAW.power_W(least.thrusts_N))
        bound = within_power(LAYOUT, found, least.thrusts_N, LAW, most_W, G, WEIGHTS)
        power_W = float(LAW.power_W(bound.thrusts_N))
        assert power_W <= most_W * (1.0 + 1e-12)
        np.testing.assert_allclose(B @ bound.thrusts_N, wrench, atol=1e-9)
        assert np.all(bound.thrusts_N >= LAYOUT.lower_N) and np.all(bound.thrusts_N <= LAYOUT.upper_N)
        if float(LAW.power_W(found.thrusts_N)) <= most_W:
            assert bound is found


def test_the_cost_lies_between_that_of_the_least_thrusts_and_of_the_gentlest():
    """It costs no more than the least thrusts and no less than what no bound holds, which a wide one gives."""
    for _ in range(20):
        _, G, least, found = problem()
        base_W, packed = float(LAW.power_W(least.thrusts_N)), WEIGHTS.packed
        costs = [
            cost(
                G,
                np.array(within_power(LAYOUT, found, least.thrusts_N, LAW, c * base_W, G, WEIGHTS).thrusts_N),
                np.zeros(8),
                packed,
            )
            for c in (1.0, 1.1, 1.2, 1.3, 1.5, 2.0, 5.0)
        ]
        assert costs[-1] == pytest.approx(cost(G, np.array(found.thrusts_N), np.zeros(8), packed))
        assert max(costs) <= cost(G, np.array(least.thrusts_N), np.zeros(8), packed) * (1 + 1e-9)
        assert costs[-1] <= min(costs) * (1.0 + 1e-9)


def test_power_is_convex_and_goes_with_thrust_in_pulses():
    """|T|^1.5 above the least thrust, |T| below it, each sign by its own figure."""
    T = np.zeros(8)
    T[0] = 1.0
    assert float(LAW.power_W(T)) == pytest.approx(30.0)
    assert float(LAW.power_W(-T)) == pytest.approx(43.0)
    assert float(LAW.power_W(0.1 * T)) == pytest.approx(0.25 * float(LAW.power_W(0.4 * T)))
    line = np.linspace(-2.0, 2.0, 401)[:, None] * T
    assert np.all(np.diff(LAW.power_W(line), 2) >= -1e-9)


def test_the_parts_of_the_null_space_are_gone_along_as_is_worth_most():
    """Of two spare thrusts one of which saves nothing, what power there is goes into the other."""
    wrench = np.array([-4.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    G = np.zeros((16, 16))
    for slot in (0, 1):
        G[slot, slot] = 1e-3
    found, least = gentle_allocation(LAYOUT, wrench, G, WEIGHTS), least_thrusts(LAYOUT, wrench, G)
    most_W = 1.3 * float(LAW.power_W(least.thrusts_N))
    bound = within_power(LAYOUT, found, least.thrusts_N, LAW, most_W, G, WEIGHTS)
    assert float(LAW.power_W(found.thrusts_N)) > most_W > 0.97 * float(LAW.power_W(bound.thrusts_N)) / 1.0
    assert bound.disturbance < 0.6 * least.disturbance


def test_the_power_of_many_is_the_sum_over_each_ones_thrusters():
    """Of thrusts of any shape, either way, below the least thrust and above: the law thruster by thruster."""
    T = RNG.normal(size=(3, 5, 8))
    each = np.empty_like(T)
    for place, thrust in np.ndenumerate(T):
        factor, least = (30.0, 0.4) if thrust >= 0.0 else (43.0, 0.36)
        each[place] = factor * abs(thrust) * np.sqrt(max(abs(thrust), least))
    np.testing.assert_allclose(LAW.power_W(T), each.sum(axis=-1), rtol=1e-12)
    assert LAW.power_W(T[0, 0]).shape == ()
