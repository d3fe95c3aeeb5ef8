"""Photographs are chosen at even steps of the way flown."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wakewise.vision.photo_selection.spacing import choose_spaced, path_length

STEPS = st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(0.0, 1.0), st.booleans()), min_size=1, max_size=60)


@given(STEPS, st.floats(0.1, 3.0))
def test_chosen_ones_are_further_apart_than_one_and_a_half_steps_only_where_no_other_is(
    steps: list[tuple[float, float, bool]], step: float
) -> None:
    """Between two chosen ones that far apart lies no usable photograph; none is chosen twice or unusable."""
    way, sharpness, usable = (
        np.cumsum([s[0] for s in steps]),
        np.array([s[1] for s in steps]),
        np.array([s[2] for s in steps]),
    )
    chosen = choose_spaced(way, sharpness, usable, step)
    assert usable[chosen].all() and (np.diff(chosen) > 0).all()
    assert bool(len(chosen)) == bool(usable.any())
    for first, last in pairwise(chosen):
        if way[last] - way[first] > 1.5 * step:
            between = usable & (way > way[first]) & (way < way[last])
            assert not between.any()


def test_dense_photographs_are_chosen_one_for_each_step_and_sharp() -> None:
    """Of photographs 5 cm apart one is chosen for each metre, and it is the sharpest within a quarter of a metre."""
    way = np.arange(0.0, 20.0, 0.05)
    sharpness = np.random.default_rng(0).uniform(size=len(way))
    chosen = choose_spaced(way, sharpness, np.ones(len(way), bool), 1.0)
    assert len(chosen) in (20, 21)
    assert sharpness[chosen].mean() > 0.85
    assert np.diff(way[chosen]).max() <= 1.5


def test_noise_of_positions_adds_no_metres() -> None:
    """A vehicle that stays for a minute, with 2 cm of noise, flies nothing by a ruler of 10 cm; a line is as long."""
    rng = np.random.default_rng(0)
    assert path_length(rng.normal(scale=0.02, size=(600, 3)), 0.1)[-1] < 0.3
    line = np.linspace([0.0, 0, 0], [10.0, 0, 0], 500) + rng.normal(scale=0.005, size=(500, 3))
    assert abs(path_length(line, 0.1)[-1] - 10.0) < 0.3
