"""The round jet for many points at once: the law of its twin at every point, and several points at a time."""

import re

import numpy as np
import pytest

from wakewise.core.jit.njit import COMPILED
from wakewise.wake import wake_model
from wakewise.wake.jets import FAST, _cored_law, as_tuple, fill_cored_jet, own_constants, speed_and_slope

AREAS = np.array([np.pi * 0.03**2])
LAW = wake_model("jet").law
NUMBERS = np.array(LAW.parameters)
OWN = own_constants(LAW.kind, NUMBERS, AREAS)[0]
DISK, AXIS = np.array([0.1, -0.2, 0.05]), np.array([0.6, 0.0, 0.8])


def points():
    """Points all round the disk, shape (3, P): ahead, astern, beyond reach, in the core, on the axis, in the disk."""
    rng = np.random.default_rng(0)
    around = rng.uniform(-0.6, 0.6, (400, 3))
    close = np.outer(rng.uniform(-0.5, 0.5, 60), AXIS) + rng.normal(0.0, 0.02, (60, 3))
    on_axis = np.outer([-0.3, 0.2, 0.4], AXIS)
    beside = np.array([[0.8, 0.0, -0.6]])
    return np.ascontiguousarray((DISK + np.vstack([around, close, on_axis, 0.02 * beside])).T)


def room(count):
    return np.empty(count, np.int64), np.full((6, 3, count), np.nan)


def twin(q, roots):
    """Signed speeds (P,) and gradients of their size (3, P), one point after another."""
    speed, gradient = np.zeros(q.shape[1]), np.zeros_like(q)
    for j, e in enumerate((q - DISK[:, None]).T):
        along, r2 = AXIS @ e, e @ e
        x = abs(along)
        if x > 0.0 and r2 <= OWN[3] + OWN[4] * x + OWN[5] * x * x:
            f, alpha, beta = speed_and_slope(LAW.kind, as_tuple(NUMBERS), *OWN[:3], x, r2)
            speed[j] = np.sign(along) * f * roots[j]
            gradient[:, j] = roots[j] * (np.sign(along) * alpha * AXIS + beta * e)
    return speed, gradient


def test_every_point_has_the_speed_and_slope_of_the_law():
    """Speeds and slopes are those of `speed_and_slope`, and zero beyond the jet's reach."""
    q = points()
    roots = np.random.default_rng(1).uniform(0.5, 1.5, q.shape[1])
    near, pose = room(q.shape[1])
    fill_cored_jet(q, roots, DISK, AXIS, OWN, NUMBERS, True, near, pose)
    speed, gradient = twin(q, roots)
    assert 0 < np.count_nonzero(speed) < len(speed)
    np.testing.assert_array_equal(pose[0, 0] == 0.0, speed == 0.0)
    np.testing.assert_allclose(pose[0, 0], speed, rtol=1e-12)
    np.testing.assert_allclose(pose[1], gradient, rtol=1e-9, atol=1e-12 * abs(gradient).max())


def test_a_cost_alone_has_the_same_speeds():
    """Without slopes the speeds are the same, and the place of the gradient is left as it was."""
    q = points()
    roots = np.ones(q.shape[1])
    near, with_slopes = room(q.shape[1])
    alone = with_slopes.copy()
    fill_cored_jet(q, roots, DISK, AXIS, OWN, NUMBERS, True, near, with_slopes)
    fill_cored_jet(q, roots, DISK, AXIS, OWN, NUMBERS, False, near, alone)
    np.testing.assert_allclose(alone[0, 0], with_slopes[0, 0], rtol=1e-14)
    assert np.isnan(alone[1]).all()


@pytest.mark.skipif(not COMPILED, reason="interpreted: there is no machine code")
def test_roots_are_taken_of_several_points_at_a_time():
    """The law's square roots are of vectors: one point after another is two to three times the time of a plan."""
    import numba

    law = numba.njit(error_model="numpy", fastmath=FAST)(_cored_law.py_func)
    near, pose = room(8)
    law(NUMBERS, OWN, near, 0, True, pose)
    assert re.search(r"call [^\n]*<\d+ x double> @llvm\.sqrt", law.inspect_llvm(law.signatures[0]))
