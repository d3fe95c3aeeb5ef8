"""Any layout: branch and bound against brute force, its bound against truth, the convex sum, blocks, chatter."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.allocation import Weights, compile_layout, min_norm_allocation, min_wash_allocation
from wakewise.allocation.allocate import convex_allocation, is_incoherent
from wakewise.allocation.branch_and_bound import coordinates, global_minimum
from wakewise.allocation.layout import independent_blocks
from wakewise.allocation.line_search import cost
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle

PAPER = load_vehicle("paper")


def layout_of(rng, n):
    """Eight thrusters of the paper's vehicle less or more some in random places; n from 4 to 12."""
    B = np.column_stack([PAPER.allocation_matrix[:, : min(n, 8)], rng.normal(size=(6, max(n - 8, 0))) * 0.4])
    return compile_layout(B, np.full(n, -40.0), np.full(n, 51.0))


def gram_of(rng, n, kind):
    A = rng.normal(size=(2 * n, 30)) * (rng.random((2 * n, 30)) < 0.25)
    if kind == "positive":
        A = np.abs(A)
    G = A @ A.T * 10 ** rng.uniform(-2, 0)
    return np.diag(np.diag(G)) if kind == "diagonal" else G


def plain_costs(T, G, previous, weights):
    s = np.sqrt(np.concatenate([np.maximum(T, 0.0), np.maximum(-T, 0.0)], axis=1))
    w_D, w_u, w_p = weights.packed
    return w_D * np.einsum("ni,ij,nj->n", s, G, s) + w_u * (T**2).sum(1) + w_p * ((T - previous) ** 2).sum(1)


def lowest_nearby(layout, found, G, previous, weights, rng):
    """Least cost of thousands of thrusts that make the same wrench: wide, near, and at every meeting of zeros."""
    Z, k = layout.null, layout.k
    sizes = 10 ** rng.uniform(-4, 1.5, size=(20000, 1))
    T = found.thrusts_N + (rng.normal(size=(20000, k)) * sizes) @ Z.T
    rested = []
    for _ in range(400):
        zero = rng.choice(len(Z), size=k, replace=False)
        if np.linalg.cond(Z[zero]) < 1e6:
            rested.append(found.thrusts_N - Z @ np.linalg.solve(Z[zero], found.thrusts_N[zero]))
    T = np.vstack([T, *rested])
    T = T[np.all((layout.lower_N <= T) & (layout.upper_N >= T), axis=1)]
    return float(plain_costs(T, G, previous, weights).min())


@pytest.mark.parametrize("n", [4, 6, 7, 8, 9, 10, 12])
@pytest.mark.parametrize("kind", ["random", "positive", "diagonal"])
def test_no_thrusts_of_the_same_wrench_cost_less(n, kind):
    """Twenty thousand others, near and far, with jets that cancel or not, never beat the answer by more than 1e-4."""
    rng = np.random.default_rng(n)
    for _ in range(2):
        layout, G = layout_of(rng, n), gram_of(rng, n, kind)
        weights, previous = Weights(effort=10 ** rng.uniform(-3, -1), previous=5e-3), rng.normal(size=n)
        wrench = layout.B @ rng.normal(size=n) * 2.0
        found = min_wash_allocation(layout, wrench, G, weights, previous, budget=400)
        value = cost(G, found.thrusts_N.copy(), previous, weights.packed)
        np.testing.assert_allclose(found.wrench_B, wrench, atol=1e-9 * (1.0 + np.linalg.norm(wrench)))
        assert 0.0 <= found.gap <= 1.0
        assert found.method in ("unique", "lines", "convex", "boxes")
        if layout.k:
            assert value <= lowest_nearby(layout, found, G, previous, weights, rng) * (1.0 + 1e-4)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(7, 10), st.sampled_from(["random", "positive"]), st.integers(1, 300))
def test_the_bound_is_true_whatever_the_budget(seed, n, kind, budget):
    """Cost minus gap never lies above what any thrusts of the wrench cost, even when the search stops at once."""
    rng = np.random.default_rng(seed)
    layout, G = layout_of(rng, n), gram_of(rng, n, kind)
    weights = Weights(effort=10 ** rng.uniform(-4, -1))
    wrench, rest = layout.B @ rng.normal(size=n), np.zeros(n)
    stopped = min_wash_allocation(layout, wrench, G, weights, budget=budget)
    value = cost(G, stopped.thrusts_N.copy(), rest, weights.packed)
    longer = min_wash_allocation(layout, wrench, G, weights, budget=600)
    others = lowest_nearby(layout, longer, G, rest, weights, rng)
    assert value * (1.0 - stopped.gap) <= others * (1.0 + 1e-9) + 1e-12


def test_a_larger_budget_closes_the_gap():
    """With two coupled spare thrusters the gap falls with the budget, to a proof."""
    rng = np.random.default_rng(1)
    layout, G = layout_of(rng, 8), gram_of(rng, 8, "random")
    wrench = layout.B @ rng.normal(size=8)
    gaps = [min_wash_allocation(layout, wrench, G, Weights(), budget=budget).gap for budget in (1, 30, 5000)]
    assert gaps[0] >= gaps[1] >= gaps[2]
    assert gaps[2] <= 1e-5


@pytest.mark.slow
def test_boxes_and_lines_agree_where_both_apply():
    """On a null space that splits, branch and bound over the whole of it finds what the line searches find."""
    rng = np.random.default_rng(2)
    layout = layout_of(rng, 8)
    horizontal = np.tile(np.abs(layout.lines[0]) > 1e-9, 2)
    rest = np.zeros(8)
    for _ in range(3):
        G = np.where(horizontal[:, None] == horizontal[None, :], gram_of(rng, 8, "random"), 0.0)
        wrench, weights = layout.B @ rng.normal(size=8) * 3.0, Weights(effort=1e-2)
        lines = min_wash_allocation(layout, wrench, G, weights)
        starts = min_norm_allocation(layout, wrench).thrusts_N[None, :].copy()
        T, gap, _ = global_minimum(
            G, starts, layout.null.copy(), layout.lower_N, layout.upper_N, rest, weights.packed, 4000
        )
        a, b = cost(G, lines.thrusts_N.copy(), rest, weights.packed), cost(G, T, rest, weights.packed)
        assert lines.method == "lines"
        assert a == pytest.approx(b, rel=2e-5)
        assert gap <= 1.1e-5 * b


@pytest.mark.slow
def test_the_incoherent_sum_is_one_quadratic_program():
    """A diagonal Gram matrix on a layout in one piece is solved as convex, and branch and bound does not beat it."""
    rng = np.random.default_rng(3)
    methods = []
    for _ in range(8):
        layout, G = layout_of(rng, 10), gram_of(rng, 10, "diagonal")
        wrench, previous, weights = layout.B @ rng.normal(size=10) * 2, rng.normal(size=10), Weights(effort=1e-2)
        found = min_wash_allocation(layout, wrench, G, weights, previous)
        methods.append(found.method)
        value = cost(G, found.thrusts_N.copy(), previous, weights.packed)
        starts = found.thrusts_N[None, :].copy()
        T, _, _ = global_minimum(
            G, starts, layout.null.copy(), layout.lower_N, layout.upper_N, previous, weights.packed, 300
        )
        assert value <= cost(G, T, previous, weights.packed) * (1.0 + 2e-5)
        assert found.gap <= 1e-5
    assert is_incoherent(G) and not is_incoherent(G + 1.0)
    assert methods.count("convex") >= 6


def test_the_convex_bound_is_that_of_a_closed_form():
    """Two opposed thrusters share a pull: T1 + T2 = 2 with g1 T1 + g2 T2 + w |T|^2 has its minimum in closed form."""
    B = np.zeros((6, 2))
    B[0] = 1.0
    g, w = np.array([0.3, 0.1, 5.0, 5.0]), 0.1
    T, gap = convex_allocation(
        B, np.ones(2), np.full(2, -9.0), np.full(2, 9.0), np.diag(g), np.zeros(2), np.array([1.0, w, 0.0])
    )
    shift = (g[1] - g[0]) / (4 * w)
    np.testing.assert_allclose(T, [1 + shift, 1 - shift], atol=1e-7)
    assert gap <= 1e-7


def test_coordinates_set_all_other_thrusters():
    """The chosen rows of the null space are independent, and thrusters at rest are chosen first."""
    rng = np.random.default_rng(4)
    layout = layout_of(rng, 11)
    thrusts = rng.normal(size=11)
    thrusts[[2, 9]] = 0.0
    chosen = coordinates(layout.null.copy(), thrusts)
    assert set(chosen[:2]) == {2, 9}
    assert np.linalg.cond(layout.null[chosen]) < 1e3


def test_blocks_span_the_null_space_and_share_no_thruster():
    """Parts of a null space are orthonormal, disjoint, and together all of it."""
    layout = layout_of(np.random.default_rng(5), 8)
    assert len(layout.blocks) == 2
    together = np.hstack(layout.blocks)
    np.testing.assert_allclose(together @ together.T, layout.null @ layout.null.T, atol=1e-12)
    assert not np.any((np.abs(layout.blocks[0]) > 1e-9).any(axis=1) & (np.abs(layout.blocks[1]) > 1e-9).any(axis=1))
    assert independent_blocks(np.zeros((4, 0))) == ()


def test_the_proximal_term_calms_the_thrusts():
    """Along noisy wrenches a larger weight on change gives smaller jumps."""
    rng = np.random.default_rng(6)
    layout = layout_of(rng, 8)
    horizontal = np.tile(np.abs(layout.lines[0]) > 1e-9, 2)
    G = np.where(horizontal[:, None] == horizontal[None, :], gram_of(rng, 8, "positive"), 0.0)
    course = [layout.B @ (rng.normal(size=8) * 0.3) for _ in range(60)]
    jumps = []
    for proximal in (0.0, 0.5):
        path, thrusts = [], np.zeros(8)
        for wrench in course:
            found = min_wash_allocation(layout, wrench, G, Weights(effort=1e-3, previous=proximal), thrusts)
            thrusts = found.thrusts_N
            path.append(thrusts)
        jumps.append(np.abs(np.diff(path, axis=0)).mean())
    assert jumps[1] < jumps[0]


def test_too_many_spare_thrusters_and_no_budget_are_refused():
    """More than eight spare thrusters cannot be searched, and a budget of nothing finds nothing."""
    with pytest.raises(InputError, match="spare thrusters"):
        compile_layout(np.random.default_rng(0).normal(size=(6, 15)), np.full(15, -1.0), np.full(15, 1.0))
    layout = layout_of(np.random.default_rng(0), 8)
    with pytest.raises(InputError, match="budget"):
        min_wash_allocation(layout, np.zeros(6), np.eye(16), Weights(), budget=0)
