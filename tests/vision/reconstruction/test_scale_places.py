"""Points of the model from their places in photographs."""

import numpy as np
import pytest
from analytic_views import straight

from wakewise.vision.reconstruction.scale.marks import place

POINT = np.array([0.03, -0.02, 1.1])


def rig(noise_px=0.0, seed=0, count=6):
    rng = np.random.default_rng(seed)
    views = {str(k): straight(640, 480, 600.0, (0.1 * (k - count / 2), 0.02 * k, 0.0)) for k in range(count)}
    seen = {name: view.project(POINT[None])[0][0] + rng.normal(0, noise_px, 2) for name, view in views.items()}
    return views, seen


def test_a_point_comes_back_and_is_as_sure_as_it_says():
    """Exactly without noise; with it, errors over draws have the covariance that is told."""
    views, seen = rig()
    found = place(views, seen)
    assert np.abs(found.point_W - POINT).max() < 1e-9
    assert found.photos == tuple("012345")
    errors, told = [], []
    for seed in range(60):
        one = place(*rig(0.3, seed))
        errors.append(one.point_W - POINT)
        told.append(np.diag(one.covariance))
    assert np.sqrt(np.mean(np.square(errors), axis=0)) == pytest.approx(np.sqrt(np.mean(told, axis=0)), rel=0.4)


def test_a_photo_that_shows_something_else_is_left_out():
    """One 40 px off is dropped; where only two are and they disagree there is no place, nor from one spot."""
    views, seen = rig()
    seen["3"] = seen["3"] + np.array([0.0, 40.0])
    found = place(views, seen)
    assert "3" not in found.photos
    assert np.abs(found.point_W - POINT).max() < 1e-9
    assert place(views, {"3": seen["3"], "1": seen["1"]}) is None
    assert place(views, {"1": seen["1"]}) is None
    near = {str(k): straight(640, 480, 600.0, (1e-3 * k, 0.0, 0.0)) for k in range(2)}
    assert place(near, {name: view.project(POINT[None])[0][0] for name, view in near.items()}) is None
