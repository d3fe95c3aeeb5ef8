"""Which parts of a mapped patch need a closer look."""

import numpy as np
import pytest

from wakewise.core.arrays import Array
from wakewise.scene.missions.part_choice import CELL_M, choose_parts, everywhere, middle_of, need_of

SIZE = np.array([2.0, 2.0])
BED_M = 2.0


def ground(height: float = 0.0, hole_at: tuple[float, float] | None = None, step: bool = False) -> Array:
    """Points 2 cm apart on a level patch; without those about a place, or with a block of 0.3 m at (0.5, 0.5)."""
    x = np.arange(-1.0, 1.0, 0.02) + 0.01
    X, Y = (axis.ravel() for axis in np.meshgrid(x, x))
    z = np.full(len(X), BED_M - height)
    if step:
        z = np.where((np.abs(X - 0.5) < 0.15) & (np.abs(Y - 0.5) < 0.15), BED_M - 0.3, z)
    points = np.stack([X, Y, z], axis=1)
    if hole_at is None:
        return points
    return points[np.linalg.norm(points[:, :2] - hole_at, axis=1) > 0.2]


def test_a_level_patch_that_is_seen_well_needs_nothing() -> None:
    """There is no part to choose."""
    points = ground()
    need = need_of(points, np.ones(len(points), np.bool_), np.zeros(2), SIZE)
    assert need.need_m2.sum() == pytest.approx(0.0, abs=1e-12)
    assert len(choose_parts(need, 0.25, 3, 6)) == 0


def test_what_is_not_mapped_and_what_is_seen_poorly_is_chosen() -> None:
    """A hole in the map, a spot without photographs: each is the middle of a part."""
    points = ground(hole_at=(-0.5, 0.4))
    covered = np.linalg.norm(points[:, :2] - [0.5, -0.5], axis=1) > 0.15
    need = need_of(points, covered, np.zeros(2), SIZE)
    parts = choose_parts(need, 0.25, 1, 6)
    assert len(parts) == 2
    for desired in ((-0.5, 0.4), (0.5, -0.5)):
        assert np.linalg.norm(parts - desired, axis=1).min() < 0.15


def test_steep_relief_is_chosen_though_it_is_seen_well() -> None:
    """The sides of a block are mapped in parts only."""
    points = ground(step=True)
    need = need_of(points, np.ones(len(points), np.bool_), np.zeros(2), SIZE)
    (part,) = choose_parts(need, 0.3, 1, 1)
    assert np.linalg.norm(part - 0.5) < 0.1


def test_there_are_as_many_parts_as_asked_for() -> None:
    """At least `least` where there is any need, at most `most`; the area in need goes down with each."""
    points = ground()
    covered = np.random.default_rng(0).random(len(points)) > 0.3
    need = need_of(points, covered, np.zeros(2), SIZE)
    assert len(choose_parts(need, 0.25, 3, 5)) == 5
    assert len(choose_parts(need, 0.1, 3, 20)) == 3  # each holds less of the need than is worth an orbit
    assert need.need_m2.sum() == pytest.approx(0.3 * 4.0, rel=0.1)


def test_parts_everywhere_cover_the_patch() -> None:
    """Squares of twice the radius hold every place."""
    parts = everywhere(np.zeros(2), SIZE, 0.25)
    assert parts.shape == (16, 2)
    cells = np.stack(np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41)), axis=-1).reshape(-1, 2)
    assert np.abs(cells[:, None] - parts).max(axis=2).min(axis=1).max() <= 0.25 + 1e-9


def test_the_middle_of_a_part_is_halfway_up_its_relief() -> None:
    """Of a block it is half as high as the block; where nothing is mapped, at the depth that was given."""
    points = ground(step=True)
    middle = middle_of(points, np.array([0.5, 0.5]), 0.2, 9.0)
    assert middle[2] == pytest.approx(BED_M - 0.15, abs=0.02)
    assert middle_of(points, np.array([5.0, 5.0]), 0.2, 9.0)[2] == 9.0


def test_an_unmapped_patch_needs_a_look_everywhere() -> None:
    """Without a point all of it is in need."""
    need = need_of(np.zeros((0, 3)), np.zeros(0, np.bool_), np.zeros(2), SIZE)
    assert need.need_m2.sum() == pytest.approx(4.0)
    assert need.need_m2.shape == (round(2.0 / CELL_M), round(2.0 / CELL_M))
