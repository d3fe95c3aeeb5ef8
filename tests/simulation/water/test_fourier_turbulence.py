"""The compiled sum of modes against the sum as it is written."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.simulation.water.currents import add_modes


def written(points, waves, turned, cosines, sines):
    phase = points @ waves + turned
    return np.cos(phase) @ cosines.T + np.sin(phase) @ sines.T


@given(seed=st.integers(0, 10_000), points=st.integers(0, 9), modes=st.integers(1, 60), far=st.floats(0.01, 1e4))
def test_it_is_the_sum_of_sines_and_cosines(seed, points, modes, far):
    """To rounding of the phase, however many turns that has, and added to what is there."""
    rng = np.random.default_rng(seed)
    places, waves = rng.normal(size=(points, 3)), rng.normal(size=(3, modes))
    turned, a, b = far * rng.normal(size=modes), rng.normal(size=(3, modes)), rng.normal(size=(3, modes))
    out = np.ones((points, 3))
    add_modes(places, waves, turned, a, b, out)
    rounding = 1e-13 + 1e-15 * far
    assert np.abs(out - 1.0 - written(places, waves, turned, a, b)).max(initial=0.0) < 10.0 * modes * rounding


@pytest.mark.parametrize("quarter", range(-9, 10))
def test_it_holds_where_the_series_are_longest(quarter):
    """At quarters of a turn and just beside them, on either side of where one turn ends and the next begins."""
    for beside in (-1e-9, 0.0, 1e-9):
        angle = np.array([quarter * np.pi / 2 + beside])
        out = np.zeros((1, 3))
        none = np.zeros((3, 1))
        add_modes(np.zeros((1, 3)), none, angle, np.array([[1.0], [0.0], [1.0]]), np.array([[0.0], [1.0], [1.0]]), out)
        assert out[0] == pytest.approx(
            [np.cos(angle[0]), np.sin(angle[0]), np.cos(angle[0]) + np.sin(angle[0])], abs=3e-13
        )
