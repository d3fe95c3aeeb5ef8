"""The disturbance as a quadratic form of roots of thrust, against its definition; and which way the jets go."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.core.interfaces import WakeModel
from wakewise.wake import disturbance, gram, incoherent, point_disturbance, wake_model
from wakewise.wake.models import OWN_MODELS

MODELS = [wake_model(name) for name in OWN_MODELS]


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


@pytest.mark.parametrize("n", [1, 255, 256, 257, 1000])
def test_points_are_summed_in_blocks_that_do_not_show(n):
    """Whatever the number of points, and its remainder by the size of a block, form and definition agree."""
    points, weights, origins, axes, areas = scene(5, n=n)
    thrusts = np.linspace(-10, 12, 8)
    slow = point_disturbance(wake_model("linear"), points, weights, origins, axes, areas, thrusts)
    G = gram(wake_model("linear"), points, weights, origins, axes, areas)
    assert slow > 0
    assert disturbance(G, thrusts) == pytest.approx(slow, rel=1e-12)


@pytest.mark.parametrize("model", MODELS, ids=lambda m: m.name)
def test_the_incoherent_sum_is_linear_in_split_thrusts(model):
    """D_inc = sum_j w_j sum_i |v_i|^2 = diag(G) . (T+, T-): additive and homogeneous, so convex; no jets cancel."""
    place, rng = scene(6), np.random.default_rng(0)
    G = gram(model, *place, superposition="incoherent")
    np.testing.assert_array_equal(G, incoherent(gram(model, *place)))
    a, b = rng.uniform(0, 40, (2, 16))

    def D(split):
        return disturbance(G, split[:8]) + disturbance(G, -split[8:])

    assert D(a) > 0
    assert D(0.3 * a + 2.0 * b) == pytest.approx(0.3 * D(a) + 2.0 * D(b), rel=1e-12)
    assert D(a) == pytest.approx(np.diag(G) @ a, rel=1e-12)
    thrusts = rng.uniform(-10, 10, 8)
    slow = point_disturbance(model, *place, thrusts, "incoherent")
    assert disturbance(G, thrusts) == pytest.approx(slow, rel=1e-12)


def test_head_on_jets_cancel_coherently_and_not_incoherently():
    """Two equal jets meet at a point half way: the coherent sum says still water, the incoherent twice one jet."""
    target, weight = np.zeros((1, 3)), np.ones(1)
    origins, axes = np.array([[0.3, 0, 0], [-0.3, 0, 0]]), np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    place = (wake_model("jet"), target, weight, origins, axes, np.full(2, 0.0028))
    one = disturbance(gram(*place), [2.0, 0.0])
    assert one > 0
    assert disturbance(gram(*place), [2.0, 2.0]) == pytest.approx(0.0, abs=1e-12 * one)
    assert disturbance(gram(*place, superposition="incoherent"), [2.0, 2.0]) == pytest.approx(2 * one)


@pytest.mark.parametrize(
    ("index", "value", "message"),
    [
        (0, np.nan, "region's points: row 3 holds NaN or infinity"),
        (1, np.inf, "region's weights: row 3 holds NaN or infinity"),
        (1, -2.0, "region's weights: -2, a weight must not be negative"),
        (2, np.nan, "thrusters' places: row 3 holds NaN"),
        (3, np.nan, "thrusters' axes: row 3 holds NaN"),
        (4, 0.0, "thrusters' areas: 0 m2, a disk's area must be more than 0"),
        (4, -1.0, "thrusters' areas: -1 m2, a disk's area must be more than 0"),
    ],
)
@pytest.mark.parametrize("name", ["paper", "fitted", "jet"])
def test_numbers_that_mean_nothing_are_refused(index, value, message, name):
    """NaN, infinity, a negative weight or a disk without area anywhere is named with its place."""
    arguments = list(scene(0, n=40))
    arguments[index] = arguments[index].copy()
    arguments[index][3] = value
    with pytest.raises(InputError, match=message):
        gram(wake_model(name), *arguments)


@pytest.mark.parametrize(
    ("index", "shape", "message"),
    [
        (0, (40, 2), r"region's points: shape \(40, 2\), allowed \(n, 3\)"),
        (1, (39,), r"region's weights: shape \(39,\), allowed \(40,\)"),
        (2, (7, 3), r"thrusters' places: shape \(7, 3\), allowed \(8, 3\)"),
        (3, (8, 2), r"thrusters' axes: shape \(8, 2\), allowed \(8, 3\)"),
        (4, (8, 1), r"thrusters' areas: shape \(8, 1\), allowed \(8,\)"),
    ],
)
def test_arrays_that_do_not_belong_together_are_refused(index, shape, message):
    """The message names the array, its shape and the one it should have."""
    arguments = list(scene(0, n=40))
    arguments[index] = np.ones(shape)
    with pytest.raises(InputError, match=message):
        gram(wake_model("paper"), *arguments)
    with pytest.raises(InputError, match=r"3 thrusts, allowed 8"):
        disturbance(np.zeros((16, 16)), np.zeros(3))


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
    """300 points and 8 thrusters take well under a millisecond of one thread (aim: 30 us; slack for slow machines)."""
    arguments = scene(0)
    gram(model, *arguments)
    times = []
    for _ in range(50):
        start = time.thread_time()
        gram(model, *arguments)
        times.append(time.thread_time() - start)
    assert np.median(times) < 400e-6
