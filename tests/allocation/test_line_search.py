"""The line search is global, its bound is true, and its kernel agrees with a readable twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.allocation.line_search import box_range, cost, coupling, disjoint_search, line_minimum


def plain_cost(G, thrusts, previous, weights):
    """The cost as it is written on paper."""
    s = np.sqrt(np.concatenate([np.maximum(thrusts, 0.0), np.maximum(-thrusts, 0.0)]))
    return weights[0] * s @ G @ s + weights[1] * thrusts @ thrusts + weights[2] * np.sum((thrusts - previous) ** 2)


def random_gram(rng, n, share=0.4):
    A = rng.normal(size=(2 * n, 30)) * (rng.random((2 * n, 30)) < share)
    return A @ A.T * 10 ** rng.uniform(-3, 0)


def random_weights(rng):
    return np.array([10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-4, -1), rng.choice([0.0, 5e-3])])


def test_the_cost_kernel_equals_its_twin():
    """What the kernel sums is s' G s + effort + change as written with split thrusts."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        G, weights = random_gram(rng, 8), random_weights(rng)
        thrusts, previous = rng.normal(size=8) * (rng.random(8) < 0.8), rng.normal(size=8)
        assert cost(G, thrusts, previous, weights) == pytest.approx(
            plain_cost(G, thrusts, previous, weights), rel=1e-12
        )


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_no_point_of_a_dense_grid_lies_below_the_line_minimum(seed):
    """On any line through any thrusts, 4,001 points never beat the result by more than the proven gap."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 9))
    G, weights = random_gram(rng, n), random_weights(rng)
    base, previous = rng.normal(size=n) * 3, rng.normal(size=n)
    direction = rng.normal(size=n) * (rng.random(n) < 0.7)
    direction[0] = 0.7
    low, high = box_range(base, direction, np.full(n, -40.0), np.full(n, 51.0))
    t, _, gap = line_minimum(G, base, direction, np.ones(n, bool), low, high, previous, weights, np.inf)
    found = plain_cost(G, base + t * direction, previous, weights)
    ts = np.concatenate([np.linspace(low, high, 2001), np.linspace(max(low, t - 1), min(high, t + 1), 2000)])
    grid = min(plain_cost(G, base + u * direction, previous, weights) for u in ts)
    assert low <= t <= high
    assert gap <= 1e-6 * found + 1e-15
    assert found <= grid + gap + 1e-12 * found


def test_an_incumbent_below_the_line_gives_no_point():
    """A line that has nothing lower than what is known says so with NaN."""
    G, weights = np.eye(4), np.array([1.0, 1.0, 0.0])
    t, _, _ = line_minimum(
        G, np.ones(2), np.array([1.0, -1.0]), np.ones(2, bool), -5.0, 5.0, np.zeros(2), weights, incumbent=-1.0
    )
    assert np.isnan(t)


def test_two_thrusters_in_a_squeeze_have_a_closed_form():
    """With G diagonal and the pull only on jet 1, f(t) = g (1 + t) + w ((1 + t)^2 + (1 - t)^2) is least at -g/4w."""
    g, w = 0.4, 0.2
    G = np.diag([g, 0.0, 0.0, 0.0])
    t, value, _ = line_minimum(
        G,
        np.ones(2),
        np.array([1.0, -1.0]),
        np.ones(2, bool),
        -10.0,
        10.0,
        np.zeros(2),
        np.array([1.0, w, 0.0]),
        np.inf,
    )
    assert t == pytest.approx(-g / (4 * w), abs=1e-6)
    assert value == pytest.approx(g * 0.5 + w * (0.25 + 2.25), rel=1e-9)


def test_disjoint_lines_are_searched_as_well_together_as_one_by_one():
    """Without coupling between the lines, a two-dimensional grid finds nothing below the two line searches."""
    rng = np.random.default_rng(3)
    lines = np.array([[0.5, 0.5, 0.5, 0.5, 0, 0, 0, 0], [0, 0, 0, 0, 0.5, -0.5, -0.5, 0.5]])
    owner = np.tile(np.repeat([0, 1], 4), 2)
    lower, upper = np.full(8, -40.0), np.full(8, 51.0)
    for _ in range(10):
        G = np.where(owner[:, None] == owner[None, :], random_gram(rng, 8), 0.0)
        weights, previous, start = random_weights(rng), rng.normal(size=8), rng.normal(size=8) * 3
        thrusts, gap = disjoint_search(G, start, lines, lower, upper, previous, weights)
        found = plain_cost(G, thrusts, previous, weights)
        centre = lines @ (thrusts - start)
        grid = np.inf
        for a in np.linspace(-8, 8, 41):
            for b in np.linspace(-8, 8, 41):
                trial = start + (centre[0] + a) * lines[0] + (centre[1] + b) * lines[1]
                grid = min(grid, cost(G, trial, previous, weights))
        assert found <= grid + gap + 1e-12
        assert coupling(G, lines) == 0.0


def test_coupling_sees_an_entry_between_two_lines():
    """One Gram entry between thrusters of different lines is reported relative to the largest."""
    lines = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    G = np.diag(np.full(8, 2.0))
    G[0, 6] = G[6, 0] = 0.5
    assert coupling(G, lines) == pytest.approx(0.25)
