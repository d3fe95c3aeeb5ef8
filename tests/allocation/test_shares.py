"""What part of a wrench limits allow, and by what measure moments are held against forces."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise.allocation import Weights, compile_layout, disturbance_of, min_norm_allocation, min_wash_allocation
from wakewise.allocation.layout import _at_limits, _box_scale, axis_scaling
from wakewise.robot.vehicles import load_vehicle


@pytest.mark.parametrize(
    ("thrusts", "share"),
    [((10.0, 0.0), 0.8), ((0.0, -10.0), 0.5), ((10.0, -10.0), 0.5), ((10.0, -5.5), 0.8), ((8.0, -5.0), 1.0)],
)
def test_the_share_of_thrusts_is_that_of_the_one_most_over_its_own_limit(
    thrusts: tuple[float, float], share: float
) -> None:
    """Forward against the forward limit, reverse against the reverse one; within limits it is all."""
    assert _box_scale(np.array(thrusts), np.array([-5.0, -5.0]), np.array([8.0, 8.0])) == pytest.approx(share)


def test_four_thrusters_without_any_to_spare_keep_the_direction_of_a_wrench() -> None:
    """Beyond their limits the wrench shrinks to the share that the weakest one allows, and stays what it was."""
    B = np.vstack([np.eye(4), np.zeros((2, 4))])
    layout = compile_layout(B, np.full(4, -5.0), np.full(4, 8.0))
    found = min_norm_allocation(layout, np.array([16.0, -8.0, 2.0, 0.0, 0.0, 0.0]))
    assert found.scale == pytest.approx(0.5)
    np.testing.assert_allclose(found.thrusts_N, [8.0, -4.0, 1.0, 0.0], atol=1e-12)


def test_an_answer_at_its_limits_is_made_exact() -> None:
    """What lies within a millionth of either limit is put there, and the rest follows from the wrench's direction."""
    rng = np.random.default_rng(3)
    B = rng.normal(size=(6, 9))
    layout = compile_layout(B, np.full(9, -5.0), np.full(9, 8.0))
    full = rng.normal(size=9) * 60.0
    full -= layout.null @ (layout.null.T @ full)
    from wakewise.allocation.layout import _within_polytope

    exact, share = _within_polytope(layout, full)
    at_low, at_high = np.isclose(exact, -5.0, atol=1e-9), np.isclose(exact, 8.0, atol=1e-9)
    assert at_low.any()
    assert at_high.any()
    rough = exact + np.where(at_low, 3e-7, np.where(at_high, -3e-7, 1e-7 * rng.normal(size=9)))
    sharp, again = _at_limits(layout, full, rough, share)
    np.testing.assert_allclose(sharp, exact, atol=1e-9)
    assert again == pytest.approx(share, abs=1e-10)
    np.testing.assert_array_equal(sharp[at_low], -5.0)
    np.testing.assert_array_equal(sharp[at_high], 8.0)


def test_the_null_space_falls_apart_into_thrusters_that_have_nothing_to_do_with_one_another() -> None:
    """Four horizontal and four vertical thrusters give one line each, and the two span the whole null space."""
    B = np.array(load_vehicle("paper").allocation_matrix)
    layout = compile_layout(B, np.full(8, -5.0), np.full(8, 8.0))
    assert [block.shape for block in layout.blocks] == [(8, 1), (8, 1)]
    np.testing.assert_array_equal(layout.owners.sum(axis=0), np.ones(8))
    span = np.hstack(layout.blocks)
    np.testing.assert_allclose(B @ span, 0.0, atol=1e-9)
    np.testing.assert_allclose(span @ (span.T @ layout.null), layout.null, atol=1e-9)


def test_moments_count_as_forces_at_the_lever_arm() -> None:
    """The root mean square one, so that a vehicle twice as large weighs its axes alike."""
    B = np.array(load_vehicle("paper").allocation_matrix)
    arm = np.sqrt(np.sum(B[3:] ** 2) / np.sum(B[:3] ** 2))
    np.testing.assert_allclose(axis_scaling(B), [1.0, 1.0, 1.0, 1.0 / arm, 1.0 / arm, 1.0 / arm])
    larger = B * np.array([[1.0], [1.0], [1.0], [2.0], [2.0], [2.0]])
    np.testing.assert_allclose((axis_scaling(larger)[:, None] * larger), axis_scaling(B)[:, None] * B, rtol=1e-12)


def test_a_weak_coupling_of_two_lines_is_not_left_out() -> None:
    """Two parts of the null space whose jets meet but for a hundredth are searched together: no thrusts do better."""
    vehicle = load_vehicle("paper")
    lower = np.array([-thruster.max_reverse_N for thruster in vehicle.thrusters])
    upper = np.array([thruster.max_forward_N for thruster in vehicle.thrusters])
    layout = compile_layout(vehicle.allocation_matrix, lower, upper)
    assert len(layout.lines) == 2
    one, other = (np.flatnonzero(np.abs(line) > 1e-9) for line in layout.lines)
    gram = np.diag(np.linspace(1.0, 2.0, 16))
    for i in one:
        for j in other:
            for a, b in ((i, j), (i + 8, j), (i, j + 8), (i + 8, j + 8)):
                gram[a, b] = gram[b, a] = -0.05
    weights = Weights(disturbance=1.0, effort=1e-6, previous=0.0)
    wrench = np.array([3.0, -2.0, 4.0, 0.1, 0.2, 0.3])
    found = min_wash_allocation(layout, wrench, gram, weights, budget=20_000)
    assert found.method == "boxes"
    assert found.disturbance == pytest.approx(disturbance_of(gram, found.thrusts_N))
    grid = np.linspace(-12.0, 12.0, 121)
    base = min_norm_allocation(layout, wrench).thrusts_N
    best = min(
        disturbance_of(gram, base + a * layout.lines[0] + b * layout.lines[1])
        + 1e-6 * float(np.sum((base + a * layout.lines[0] + b * layout.lines[1]) ** 2))
        for a in grid
        for b in grid
    )
    assert found.disturbance + 1e-6 * float(found.thrusts_N @ found.thrusts_N) <= best * (1.0 + 1e-6)
