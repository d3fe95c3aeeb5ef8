"""What takes long to make of a target is made once: a region by all that it follows from, a soft target's modes too."""

from dataclasses import fields

import numpy as np
import pytest

from wakewise.operation import parts
from wakewise.operation.parts import CACHED_MODES, CACHED_REGIONS, modes_of, region_of
from wakewise.operation.scenario.randomization import Seeds
from wakewise.scene.targets import TISSUES, BendingModes, Mesh, find_target, place_on_bed, sample_region

POINTS = 6


def pyramid(height_m=0.1, bed_z_m=1.0):
    """Four sides on a square of 0.1 m."""
    corners = np.array([[-0.05, -0.05, 0], [0.05, -0.05, 0], [0.05, 0.05, 0], [-0.05, 0.05, 0], [0, 0, height_m]])
    faces = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]])
    return place_on_bed("pyramid", Mesh(corners, faces), bed_z_m)


@pytest.fixture(autouse=True)
def empty_cache(monkeypatch):
    monkeypatch.setattr(parts, "_regions", {})
    monkeypatch.setattr(parts, "_modes", {})


def test_the_kept_region_is_the_one_that_would_be_drawn():
    """To the bit, the first time and from memory, of another object of the same shape."""
    drawn = sample_region(pyramid(), POINTS, Seeds(3).region())
    first, again = (region_of(pyramid(), POINTS, Seeds(3)) for _ in range(2))
    assert again is first
    for name in ("points_W_m", "weights", "distance_m"):
        assert np.array_equal(getattr(first, name), getattr(drawn, name))
        assert not getattr(first, name).flags.writeable


def test_any_change_of_what_it_follows_from_draws_anew(monkeypatch):
    """Shape, depth, number of points, seed and gain each have their own."""
    monkeypatch.setattr(parts, "sample_region", lambda *_: object())
    asked = [
        (pyramid(), POINTS, Seeds(0), 0.0),
        (pyramid(0.11), POINTS, Seeds(0), 0.0),
        (pyramid(bed_z_m=1.1), POINTS, Seeds(0), 0.0),
        (pyramid(), POINTS + 1, Seeds(0), 0.0),
        (pyramid(), POINTS, Seeds(1), 0.0),
        (pyramid(), POINTS, Seeds(0), 2.0),
    ]
    found = [region_of(*each) for each in asked]
    assert len({id(region) for region in found}) == len(asked)
    assert all(region_of(*each) is region for each, region in zip(asked, found, strict=True))


def test_the_oldest_goes_first(monkeypatch):
    """Memory is bounded; what was asked for again has become the youngest."""
    drawn = []
    monkeypatch.setattr(parts, "sample_region", lambda target, points, *_: drawn.append(points) or object())
    for points in (*range(CACHED_REGIONS), 0, CACHED_REGIONS, 0, 1):
        region_of(pyramid(), points, Seeds(0))
    assert drawn == [*range(CACHED_REGIONS), CACHED_REGIONS, 1]


def test_the_kept_modes_are_those_of_the_target():
    """To the bit, the first time and from memory."""
    target, tissue = find_target("seagrass", 1.5, 0, None), TISSUES["seagrass"]
    made = BendingModes.of(target, tissue, 1000.0)
    first, again = (modes_of(find_target("seagrass", 1.5, 0, None), tissue, 1000.0) for _ in range(2))
    assert again is first
    for field in fields(made):
        assert np.array_equal(getattr(first, field.name), getattr(made, field.name)), field.name


def test_any_change_of_what_modes_follow_from_makes_them_anew_and_the_oldest_go_first(monkeypatch):
    """Shape, depth, tissue and water each have their own, and memory is bounded."""
    made = []
    monkeypatch.setattr(parts.BendingModes, "of", lambda *asked: made.append(asked) or object())
    tissue = TISSUES["soft-coral"]
    asked = [
        (pyramid(), tissue, 1000.0),
        (pyramid(0.11), tissue, 1000.0),
        (pyramid(bed_z_m=1.1), tissue, 1000.0),
        (pyramid(), TISSUES["gorgonian"], 1000.0),
        (pyramid(), tissue, 1025.0),
    ]
    assert len({id(modes_of(*each)) for each in asked * 2}) == len(made) == len(asked)
    for k in range(CACHED_MODES):
        modes_of(pyramid(), tissue, 900.0 + k)
    modes_of(*asked[0])
    assert len(made) == len(asked) + CACHED_MODES + 1
