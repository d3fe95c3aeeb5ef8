"""Trials: which photographs are matched, what a folder belongs to."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wakewise.experiments.trial import nearby_pairs


@given(st.integers(2, 12), st.integers(0, 1000))
def test_photographs_are_paired_when_their_axes_are_within_45_degrees(count: int, seed: int) -> None:
    """Each pair listed is near, each pair not listed is not, and none is listed twice or with itself."""
    axes = np.random.default_rng(seed).normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    names = [f"{i}.png" for i in range(count)]
    pairs = nearby_pairs(names, axes)
    assert len(set(pairs)) == len(pairs)
    for i in range(count):
        for j in range(i + 1, count):
            angle = np.degrees(np.arccos(np.clip(axes[i] @ axes[j], -1, 1)))
            assert ((names[i], names[j]) in pairs) == (angle < 45.0)
