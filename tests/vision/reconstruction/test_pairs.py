"""Which photos are matched: every pair, a sequence, or neighbours by pose; nobody stays alone."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.vision.reconstruction import ReconstructionSettings
from wakewise.vision.reconstruction.sfm.pairs import choose_pairs, pose_pairs, sequence_pairs


def names(n):
    return [f"{k:03d}" for k in range(n)]


def orbit(n, elevation_deg=40.0, start=0.0):
    """Centres on a circle and axes that look at its middle."""
    angle, tilt = start + 2 * np.pi * np.arange(n) / n, np.radians(elevation_deg)
    out = np.stack([np.cos(tilt) * np.cos(angle), np.cos(tilt) * np.sin(angle), np.full(n, -np.sin(tilt))], axis=1)
    return 0.5 * out, -out


def test_small_sets_match_all_pairs_large_ones_neighbours():
    """80 photos make 3160 pairs; 200 make far fewer, with no pair twice and everyone within reach of the next."""
    few = choose_pairs(names(80), ReconstructionSettings())
    assert len(few) == 80 * 79 // 2
    pairs = choose_pairs(names(200), ReconstructionSettings())
    assert len(set(pairs)) == len(pairs) < 200 * 16
    assert ("000", "010") in pairs and ("000", "128") in pairs and ("000", "050") not in pairs
    assert choose_pairs(names(200), ReconstructionSettings(matching="sequential")) == pairs
    assert len(choose_pairs(names(100), ReconstructionSettings(matching="exhaustive"))) == 4950


def test_a_sequence_closes_its_orbit():
    """The last photos of a lap meet the first."""
    pairs = sequence_pairs(names(30), 4)
    assert ("000", "029") in pairs and ("002", "027") not in pairs and ("000", "026") in pairs
    assert all(a < b for a, b in pairs)


def test_neighbours_on_an_orbit_are_the_next_ones():
    """Of a ring of 24 each is paired with two on either side and with nobody across."""
    centres, axes = orbit(24)
    pairs = set(pose_pairs(names(24), centres, axes, 4))
    assert pairs == {tuple(sorted((f"{k:03d}", f"{(k + s) % 24:03d}"))) for k in range(24) for s in (1, 2)}


def test_photos_that_look_away_are_no_neighbours():
    """Two cameras side by side that look opposite ways are paired only if nothing else ties them together."""
    centres = np.array([[0.0, 0, 0], [0.01, 0, 0], [1.0, 0, 0], [1.01, 0, 0]])
    axes = np.array([[0.0, 0, 1], [0, 0, -1], [0, 0, 1], [0, 0, -1]])
    pairs = pose_pairs(names(4), centres, axes, 2)
    assert ("000", "002") in pairs and ("001", "003") in pairs
    assert len(pairs) == 3


@settings(max_examples=25, deadline=None)
@given(st.integers(2, 40), st.integers(2, 6), st.integers(0, 10_000))
def test_pairs_by_pose_leave_nobody_alone(n, neighbours, seed):
    """Wherever the cameras are and look, the pairs tie all photos together, and no pair comes twice."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(n, 3))
    pairs = pose_pairs(names(n), rng.normal(size=(n, 3)), axes, neighbours)
    graph = nx.Graph(pairs)
    assert len(set(pairs)) == len(pairs)
    assert set(graph) == set(names(n)) and nx.is_connected(graph)


def test_auto_takes_poses_when_it_has_them_and_poses_need_them():
    """With centres and axes auto goes by poses; asked for without positions it is an input error."""
    centres, axes = orbit(24)
    by_name = (dict(zip(names(24), centres, strict=True)), dict(zip(names(24), axes, strict=True)))
    assert choose_pairs(names(24), ReconstructionSettings(), *by_name) == pose_pairs(names(24), centres, axes, 8)
    assert len(choose_pairs(names(24), ReconstructionSettings(), by_name[0])) == 24 * 23 // 2
    with pytest.raises(InputError, match="matching by poses"):
        choose_pairs(names(3), ReconstructionSettings(matching="poses"))
