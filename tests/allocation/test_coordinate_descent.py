"""Parts of the null space that belong together, and thrusts to descend from."""

import numpy as np

from wakewise.allocation import compile_layout
from wakewise.allocation.line_search import coupled_directions, feasible_starts, start_directions, step_limit
from wakewise.robot.vehicles import load_vehicle

PAPER = load_vehicle("paper")
LAYOUT = compile_layout(PAPER.allocation_matrix, PAPER.thrust_lower_N, PAPER.thrust_upper_N)


def starts_twin(start, previous, null, lower, upper):
    """`feasible_starts` as whole arrays."""

    def far(step, most):
        moving = np.abs(step) > 1e-12
        room = np.where(step > 0.0, upper, lower) - start
        return max(float(np.min(room[moving] / step[moving], initial=most)), 0.0)

    toward = null @ (null.T @ (previous - start))
    starts = [start, start + far(toward, 1.0) * toward]
    directions = np.random.default_rng(0).normal(size=(6, null.shape[1]))
    for number, direction in enumerate(directions):
        step = null @ (direction / np.linalg.norm(direction))
        starts.append(start + ((number + 1) / 6) ** 2 * far(step, np.inf) * step)
    return np.clip(np.array(starts), lower, upper)


def test_starts_are_those_of_the_formulas():
    """For least and previous thrusts of all sorts, some beyond limits."""
    rng, null = np.random.default_rng(5), np.array(LAYOUT.null)
    for _ in range(50):
        start, previous = rng.normal(size=8) * 20.0, rng.normal(size=8) * 20.0
        found = feasible_starts(start, previous, null, start_directions(2), LAYOUT.lower_N, LAYOUT.upper_N)
        wanted = starts_twin(start, previous, null, LAYOUT.lower_N, LAYOUT.upper_N)
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


def test_parts_are_tied_by_any_gram_entry_that_is_more_than_rounding():
    """An entry of one part's thrusters alone ties nothing; one between two parts does, in any of its four slots."""
    assert LAYOUT.owners.tolist() == [[True] * 4 + [False] * 4, [False] * 4 + [True] * 4]
    for slot in ((1, 6), (9, 6), (1, 14), (9, 14)):
        G = np.diag(np.full(16, 1.0))
        G[0, 2] = G[2, 0] = 0.5
        assert not np.any(coupled_directions(G, LAYOUT.owners, 1e-10) & ~np.eye(2, dtype=bool))
        G[slot] = G[slot[::-1]] = 0.9e-10
        assert not coupled_directions(G, LAYOUT.owners, 1e-10)[0, 1]
        G[slot] = G[slot[::-1]] = -1.1e-10
        assert coupled_directions(G, LAYOUT.owners, 1e-10)[0, 1] and coupled_directions(G, LAYOUT.owners, 1e-10)[1, 0]


def test_a_step_reaches_to_the_first_limit_on_either_side():
    """From any point, along any direction: nothing beyond a limit, upper or lower, and one of them just met."""
    rng = np.random.default_rng(11)
    met = {"lower": 0, "upper": 0}
    for _ in range(200):
        start = rng.uniform(0.9 * LAYOUT.lower_N, 0.9 * LAYOUT.upper_N)
        step = LAYOUT.null @ rng.normal(size=LAYOUT.null.shape[1])
        end = start + step_limit(start, step, LAYOUT.lower_N, LAYOUT.upper_N, np.inf) * step
        assert np.all(end >= LAYOUT.lower_N - 1e-9)
        assert np.all(end <= LAYOUT.upper_N + 1e-9)
        low, high = np.isclose(end, LAYOUT.lower_N), np.isclose(end, LAYOUT.upper_N)
        assert np.any(low | high)
        met["lower"] += bool(np.any(low))
        met["upper"] += bool(np.any(high))
        assert step_limit(start, 1e-6 * step, LAYOUT.lower_N, LAYOUT.upper_N, 1.0) == 1.0
    assert min(met.values()) > 20
    outside = LAYOUT.lower_N - 1.0
    assert step_limit(outside, -np.ones(8), LAYOUT.lower_N, LAYOUT.upper_N, 1.0) == 0.0
