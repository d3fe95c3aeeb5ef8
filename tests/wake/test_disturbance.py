"""The disturbance as a quadratic form of roots of thrust, against its definition; and which way the jets go."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.interfaces import WakeModel
from wakewise.wake import PaperJet, RoundJet, disturbance, gram, point_disturbance

MODELS = [PaperJet(), RoundJet()]


def scene(seed, n=300, m=8):
    """Points in a ball of 8 cm, thrusters round it at 0.2 to 0.6 m, axes anyhow."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(n, 3))
    points *= 0.08 * rng.random((n, 1)) ** (1 / 3) / np.linalg.norm(points, axis=1)[:, None]
    origins = rng.normal(size=(m, 3))
    origins *= rng.uniform(0.2, 0.6, (m, 1)) / np.linalg.norm(origins, axis=1)[:, None]
    axes = origins + 0.2 * rng.normal(size=(m, 3))
    axes *= rng.choice([-1, 1], (m, 1)) / np.linalg.norm(axes, axis=1)[:, None]
    return points, np.exp(-rng.random(n)), origins, axes, rng.uniform(0.002, 0.006, m)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_a_push_towards_the_target_blows_away_from_it(model):
    """The jet leaves opposite to the force, and flips with the sign of thrust.

    A thruster stands 0.3 m from the target and its force axis points at the target. Pushing the vehicle towards the
    target (T > 0) sends the water away from it, and the target feels nothing. Pushing the vehicle away (T < 0) sends
    the water at it.
    """
    target, weight = np.zeros((1, 3)), np.ones(1)
    origin, axis, area = np.array([[0.3, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]]), np.array([0.0028])
    G = gram(model, target, weight, origin, axis, area)
    assert disturbance(G, [5.0]) == 0.0
    assert disturbance(G, [-5.0]) > 0.0
    assert disturbance(gram(model, target, weight, origin, -axis, area), [5.0]) == disturbance(G, [-5.0])
    velocity = model.unit_velocity(target, origin, axis, area)[0, 0]
    assert velocity[0] < 0.0, "water driven along -x, from the thruster at x = 0.3 m towards the target at 0"


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
@pytest.mark.parametrize("seed", range(5))
def test_the_quadratic_form_is_the_definition(model, seed):
    """The form s' G s equals the sum over points to one part in 10^12, for thrusts of any sign, idle ones too."""
    points, weights, origins, axes, areas = scene(seed)
    thrusts = np.random.default_rng(seed).uniform(-40, 51, 8) * (np.arange(8) != 3)
    slow = point_disturbance(model, points, weights, origins, axes, areas, thrusts)
    assert slow > 0
    assert disturbance(gram(model, points, weights, origins, axes, areas), thrusts) == pytest.approx(slow, rel=1e-12)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_the_kernel_meets_its_readable_twin(model):
    """G is sum_j w_j V_j V_j' of all 2 m unit velocities, entry by entry."""
    points, weights, origins, axes, areas = scene(11, n=120)
    velocity = model.unit_velocity(points, np.tile(origins, (2, 1)), np.concatenate([-axes, axes]), np.tile(areas, 2))
    twin = np.einsum("n,inx,jnx->ij", weights, velocity, velocity)
    fast = gram(model, points, weights, origins, axes, areas)
    np.testing.assert_allclose(fast, twin, rtol=1e-12, atol=1e-14 * twin.max())


def test_any_wake_model_has_a_gram():
    """A model that is not one of ours, here a uniform stream, goes the readable way and gives the same form."""

    class Stream:
        name = "stream"

        def unit_velocity(self, points_W_m, origins_W_m, directions_W, area_m2):
            return np.repeat(directions_W[:, None, :], len(points_W_m), axis=1) / np.sqrt(area_m2)[:, None, None]

    model: WakeModel = Stream()
    points, weights, origins, axes, areas = scene(7, n=40)
    thrusts = np.array([1.0, -2.0, 3.0, 0.0, -5.0, 6.0, 7.0, -8.0])
    expected = np.sum(weights) * np.sum((np.sign(thrusts) * np.sqrt(np.abs(thrusts) / areas) @ axes) ** 2)
    assert disturbance(gram(model, points, weights, origins, axes, areas), thrusts) == pytest.approx(expected)
    assert point_disturbance(model, points, weights, origins, axes, areas, thrusts) == pytest.approx(expected)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), factor=st.floats(0.0, 50.0), model=st.sampled_from(MODELS))
def test_the_disturbance_is_linear_in_a_common_factor_of_thrust(seed, factor, model):
    """Twice every thrust is twice the disturbance, and no thrust is none."""
    points, weights, origins, axes, areas = scene(seed, n=60)
    thrusts = np.random.default_rng(seed).uniform(-10, 10, 8)
    G = gram(model, points, weights, origins, axes, areas)
    assert disturbance(G, factor * thrusts) == pytest.approx(factor * disturbance(G, thrusts), rel=1e-9, abs=1e-12)
    assert disturbance(G, np.zeros(8)) == 0.0


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10_000), model=st.sampled_from(MODELS))
def test_the_matrix_is_symmetric_and_never_negative(seed, model):
    """G = G', and no eigenvalue is below rounding error."""
    G = gram(model, *scene(seed, n=80))
    np.testing.assert_array_equal(G, G.T)
    assert np.linalg.eigvalsh(G).min() >= -1e-12 * max(np.trace(G), 1e-300)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_a_thruster_never_disturbs_forward_and_backward_at_one_point(model):
    """The entry that couples a thruster's two jets is zero: no point is downstream of both."""
    G = gram(model, *scene(3))
    np.testing.assert_array_equal(np.diag(G[:8, 8:]), 0.0)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_the_matrix_is_quick(model):
    """300 points and 8 thrusters take well under a millisecond of one thread (aim: 60 us; slack for slow machines)."""
    arguments = scene(0)
    gram(model, *arguments)
    times = []
    for _ in range(50):
        start = time.thread_time()
        gram(model, *arguments)
        times.append(time.thread_time() - start)
    assert np.median(times) < 400e-6
