"""Laws of the allocation: same wrench, limits held, never worse than least thrusts or than a grid."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.allocation import (
    Weights,
    compile_layout,
    disturbance_of,
    min_norm_allocation,
    min_wash_allocation,
    pseudo_inverse,
)
from wakewise.allocation.line_search import cost
from wakewise.control import vehicle_layout
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise.wake import disturbance

PAPER = load_vehicle("paper")
LAYOUT = vehicle_layout(PAPER)
HORIZONTAL = np.tile(np.abs(LAYOUT.lines[0]) > 1e-9, 2)


def random_gram(rng, n=8, decoupled=True):
    A = rng.normal(size=(2 * n, 40)) * (rng.random((2 * n, 40)) < 0.3)
    G = A @ A.T * 10 ** rng.uniform(-3, 0)
    return np.where(HORIZONTAL[:, None] == HORIZONTAL[None, :], G, 0.0) if decoupled else G


def random_wrench(rng, size=1.0):
    return size * rng.normal(size=6) * np.array([10.0, 10.0, 10.0, 0.5, 0.8, 0.8])


def random_weights(rng):
    return Weights(disturbance=1.0, effort=10 ** rng.uniform(-4, -1), previous=float(rng.choice([0.0, 5e-3])))


def lowest_on_grid(layout, start, centre, G, previous, weights, span, count):
    """Least cost on a square grid over a two-dimensional null space, within limits."""
    side = np.linspace(-span, span, count)
    shifts = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) + centre
    T = start + shifts @ layout.null.T
    T = T[np.all((layout.lower_N <= T) & (layout.upper_N >= T), axis=1)]
    s = np.sqrt(np.concatenate([np.maximum(T, 0.0), np.maximum(-T, 0.0)], axis=1))
    w_D, w_u, w_p = weights.packed
    total = w_D * np.einsum("ni,ij,nj->n", s, G, s) + w_u * (T**2).sum(1) + w_p * ((T - previous) ** 2).sum(1)
    return float(total.min())


def tilted_vehicle():
    """The paper's vehicle with its verticals leaning, so that all eight thrusters share one null space."""
    thrusters = tuple(
        replace(t, axis_B=np.array([0.3, 0.2, -1.0]) / np.linalg.norm([0.3, 0.2, -1.0])) if i == 4 else t
        for i, t in enumerate(PAPER.thrusters)
    )
    return replace(PAPER, thrusters=thrusters)


@pytest.mark.parametrize(("decoupled", "method"), [(True, "lines"), (False, "boxes")])
def test_never_worse_than_a_dense_grid(decoupled, method):
    """No point of a wide and of a fine grid over the null space lies more than 1e-4 below the result."""
    rng = np.random.default_rng(7)
    for _ in range(5):
        G, weights = random_gram(rng, decoupled=decoupled), random_weights(rng)
        wrench, previous = random_wrench(rng), rng.normal(size=8)
        found = min_wash_allocation(LAYOUT, wrench, G, weights, previous)
        value = cost(G, found.thrusts_N.copy(), previous, weights.packed)
        start = LAYOUT.inverse @ wrench
        fine = LAYOUT.null.T @ (found.thrusts_N - start)
        grid = min(
            lowest_on_grid(LAYOUT, start, np.zeros(2), G, previous, weights, 60.0, 101),
            lowest_on_grid(LAYOUT, start, np.zeros(2), G, previous, weights, 6.0, 101),
            lowest_on_grid(LAYOUT, start, fine, G, previous, weights, 0.5, 61),
        )
        assert found.method == method
        assert value <= grid * (1.0 + 1e-4)
        assert 0.0 <= found.gap < 1e-4


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 60.0), st.integers(-1, 7), st.booleans())
def test_limits_hold_and_the_wrench_keeps_its_direction(seed, size, failed, decoupled):
    """Within limits the wrench is met to 1e-9; beyond them it shrinks, and never turns, for both methods alike."""
    rng = np.random.default_rng(seed)
    lower, upper = PAPER.thrust_lower_N.copy(), PAPER.thrust_upper_N.copy()
    if failed >= 0:
        lower[failed] = upper[failed] = 0.0
    layout = compile_layout(PAPER.allocation_matrix, lower, upper)
    wrench, G = random_wrench(rng, size), random_gram(rng, decoupled=decoupled)
    least = pseudo_inverse(PAPER.allocation_matrix, wrench, lower, upper)
    gentle = min_wash_allocation(layout, wrench, G, Weights(), rng.normal(size=8))
    for found in (least, gentle):
        assert np.all(found.thrusts_N >= lower) and np.all(found.thrusts_N <= upper)
        assert 0.0 <= found.scale <= 1.0
        np.testing.assert_allclose(found.wrench_B, found.scale * wrench, atol=1e-9 * (1.0 + np.linalg.norm(wrench)))
        if failed >= 0:
            assert found.thrusts_N[failed] == 0.0
    assert gentle.scale == pytest.approx(least.scale, abs=1e-12)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_never_costs_more_than_least_thrusts(seed, decoupled):
    """Least thrusts are always a candidate, so the gentle answer cannot cost more."""
    rng = np.random.default_rng(seed)
    G, weights, previous = random_gram(rng, decoupled=decoupled), random_weights(rng), rng.normal(size=8)
    wrench = random_wrench(rng, 10 ** rng.uniform(-2, 1))
    least, gentle = min_norm_allocation(LAYOUT, wrench, G), min_wash_allocation(LAYOUT, wrench, G, weights, previous)
    ours, theirs = (cost(G, a.thrusts_N.copy(), previous, weights.packed) for a in (gentle, least))
    assert ours <= theirs * (1.0 + 1e-12)


def test_the_null_space_is_used_before_any_wrench_is_given_up():
    """A surge that one thruster's weak reverse forbids to the pseudo-inverse is made in full by squeezing."""
    lower, upper = PAPER.thrust_lower_N.copy(), PAPER.thrust_upper_N.copy()
    plain = LAYOUT.inverse @ np.array([20.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    weakest = int(np.argmin(plain))
    lower[weakest] = 0.5 * plain[weakest]
    if plain[weakest] >= 0.0:
        upper[weakest] = 0.5 * plain[weakest]
        lower[weakest] = PAPER.thrust_lower_N[weakest]
    found = pseudo_inverse(PAPER.allocation_matrix, np.array([20.0, 0, 0, 0, 0, 0]), lower, upper)
    assert found.scale == 1.0
    assert np.linalg.norm(found.given_up_B) < 1e-9
    assert np.linalg.norm(found.thrusts_N) > np.linalg.norm(plain)


def test_scale_is_the_largest_that_the_limits_allow():
    """A linear program over thrusts and scale agrees with the closed form of the two lines."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(5)
    for _ in range(20):
        wrench = random_wrench(rng, 30.0)
        program = linprog(
            np.r_[np.zeros(8), -1.0],
            A_eq=np.column_stack([PAPER.allocation_matrix, -wrench]),
            b_eq=np.zeros(6),
            bounds=[*zip(PAPER.thrust_lower_N, PAPER.thrust_upper_N, strict=True), (0.0, 1.0)],
        )
        assert min_norm_allocation(LAYOUT, wrench).scale == pytest.approx(program.x[-1], rel=1e-7)


def test_a_null_space_in_one_piece_is_scaled_and_shifted_too():
    """Where no independent lines exist, linear programming gives the same laws: limits, direction, least shift."""
    vehicle = tilted_vehicle()
    layout = vehicle_layout(vehicle)
    assert layout.k == 2 and len(layout.lines) == 0
    rng = np.random.default_rng(2)
    for size in (1.0, 8.0, 40.0):
        wrench = random_wrench(rng, size)
        found = min_norm_allocation(layout, wrench)
        assert np.all(found.thrusts_N >= layout.lower_N) and np.all(found.thrusts_N <= layout.upper_N)
        np.testing.assert_allclose(found.wrench_B, found.scale * wrench, atol=1e-8 * np.linalg.norm(wrench))
    gentle = min_wash_allocation(layout, random_wrench(rng), random_gram(rng, decoupled=False), Weights())
    assert gentle.method == "boxes"


def test_more_than_two_spare_thrusters_are_searched_from_several_starts():
    """A ninth and tenth thruster give k = 4; random feasible thrusts of the same wrench cost no less."""
    rng = np.random.default_rng(11)
    B = np.column_stack([PAPER.allocation_matrix, rng.normal(size=(6, 2)) * 0.3])
    lower, upper = np.full(10, -40.0), np.full(10, 51.0)
    layout = compile_layout(B, lower, upper)
    wrench, G, weights = random_wrench(rng), random_gram(rng, 10, decoupled=False), Weights(effort=1e-2)
    found = min_wash_allocation(layout, wrench, G, weights)
    assert layout.k == 4 and found.method == "boxes"
    np.testing.assert_allclose(found.wrench_B, wrench, atol=1e-9)
    value = cost(G, found.thrusts_N.copy(), np.zeros(10), weights.packed)
    others = [
        cost(G, found.thrusts_N + layout.null @ (rng.normal(size=4) * r), np.zeros(10), weights.packed)
        for r in np.geomspace(1e-3, 10.0, 2000)
    ]
    assert value <= min(others) * (1.0 + 1e-4)
    assert 0.0 <= found.gap <= 1.0


def test_without_spare_thrusters_the_answer_is_unique():
    """Six independent thrusters leave no freedom: both methods agree."""
    lower, upper = PAPER.thrust_lower_N.copy(), PAPER.thrust_upper_N.copy()
    lower[[0, 4]] = upper[[0, 4]] = 0.0
    layout = compile_layout(PAPER.allocation_matrix, lower, upper)
    wrench, G = np.array([2.0, -1.0, 3.0, 0.05, 0.02, 0.1]), random_gram(np.random.default_rng(1))
    gentle = min_wash_allocation(layout, wrench, G, Weights())
    assert layout.k == 0 and gentle.method == "unique" and gentle.gap == 0.0
    np.testing.assert_allclose(gentle.thrusts_N, min_norm_allocation(layout, wrench).thrusts_N)


def test_too_few_thrusters_make_the_nearest_wrench():
    """With verticals only, heave is met and surge is given up."""
    lower, upper = PAPER.thrust_lower_N.copy(), PAPER.thrust_upper_N.copy()
    horizontal = np.abs(LAYOUT.lines[0]) > 1e-9
    vertical = np.abs(PAPER.allocation_matrix[2]) > 0.5
    dead = ~vertical if np.any(horizontal & ~vertical) else horizontal
    lower[dead] = upper[dead] = 0.0
    found = pseudo_inverse(PAPER.allocation_matrix, np.array([5.0, 0, 4.0, 0, 0, 0]), lower, upper)
    np.testing.assert_allclose(found.wrench_B, [0, 0, 4.0, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(found.given_up_B, [5.0, 0, 0, 0, 0, 0], atol=1e-9)


def test_disturbance_is_the_wake_rooms():
    """D as the allocation sums it is s' G s of `wakewise.wake`."""
    rng = np.random.default_rng(4)
    G, thrusts = random_gram(rng), rng.normal(size=8)
    assert disturbance_of(G, thrusts) == pytest.approx(disturbance(G, thrusts), rel=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"lower_N": np.full(8, 1.0)}, "zero thrust"),
        ({"lower_N": np.full(8, 2.0), "upper_N": np.full(8, 1.0)}, "above upper limit"),
        ({"wrench_B": np.full(6, np.nan)}, "finite"),
        ({"wrench_B": np.zeros(5)}, "shape"),
        ({"B": np.zeros((5, 8))}, "shape"),
    ],
)
def test_bad_input_is_refused_in_one_line(change, words):
    """Wrong shapes, NaN and limits that exclude rest raise InputError."""
    arguments = {
        "B": PAPER.allocation_matrix,
        "wrench_B": np.zeros(6),
        "lower_N": PAPER.thrust_lower_N,
        "upper_N": PAPER.thrust_upper_N,
    } | change
    with pytest.raises(InputError, match=words) as caught:
        pseudo_inverse(**arguments)
    assert "\n" not in str(caught.value)
