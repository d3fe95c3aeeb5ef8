"""The map of features: rays meet at points, with the covariance that their noise brings; what slides is kept out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from perception_cases import CAMERA, looking, slopes_of

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.geometry import Pose, quat_from_euler
from wakewise.perception.point_map import (
    LEAST_PARALLAX_RAD,
    MOST_OUTLIERS,
    PIXEL_STD,
    RAY_STD_M,
    PointMap,
    add_rays,
    dropped,
    empty_map,
    joined,
    ray_directions,
    solved,
)

MIDDLE = np.array([0.8, 0.0, 1.5])
FOCAL = CAMERA.focal_px
PLACES = MIDDLE + np.random.default_rng(0).uniform(-0.2, 0.2, (25, 3))
IDS = np.arange(10, 35)
DT = 0.2


def arc(wide_m: float, pictures: int) -> list[Pose]:
    """Cameras on a level line of a width, 0.94 m from the middle, a little up and down, that look at it."""
    y = np.linspace(-0.5 * wide_m, 0.5 * wide_m, pictures)
    return [looking(np.array([0.0, east, 1.0 + 0.03 * np.sin(3.0 * k)]), MIDDLE) for k, east in enumerate(y)]


def mapped(points_W_m: Array, cameras: list[Pose], known: PointMap | None = None, start_s: float = 0.0) -> PointMap:
    """Map of points seen without error, one picture in `DT`."""
    known = empty_map() if known is None else known
    for k, X_WC in enumerate(cameras):
        ids, slopes = IDS[: len(points_W_m)], slopes_of(points_W_m, X_WC)
        known = add_rays(known, ids, slopes, X_WC, start_s + DT * k, FOCAL, 0.8)
    return known


WELL = mapped(PLACES, arc(0.6, 40))
AFTER_S = 40 * DT


@given(st.integers(0, 2**32 - 1), st.integers(2, 12))
@settings(max_examples=25, deadline=None)
def test_rays_without_error_meet_at_the_point(seed: int, pictures: int) -> None:
    """Two cameras or more, anywhere round the points, give their places to a nanometre, and no ray misses."""
    rng = np.random.default_rng(seed)
    places = MIDDLE + rng.uniform(-0.2, 0.2, (5, 3))
    eyes = MIDDLE + rng.uniform([-1.2, -0.5, -0.6], [-0.6, 0.5, 0.0], (pictures, 3))
    eyes[:2] = MIDDLE + np.array([[-0.8, -0.3, -0.2], [-0.8, 0.3, -0.3]])
    known = mapped(places, [looking(eye, MIDDLE) for eye in eyes])
    np.testing.assert_allclose(known.points_W_m, places, atol=1e-9)
    misses = known.e - np.einsum("ni,ni->n", known.b, known.points_W_m)
    np.testing.assert_allclose(misses, 0.0, atol=1e-6)
    assert not known.outliers.any()
    np.testing.assert_array_equal(known.views, pictures)


def test_directions_are_unit_vectors_in_the_world() -> None:
    """The ray of a point's slopes points from the camera to it."""
    X_WC = looking(np.array([0.1, -0.4, 0.9]), MIDDLE)
    d = ray_directions(slopes_of(PLACES, X_WC), X_WC)
    away = PLACES - X_WC.p_m
    np.testing.assert_allclose(d, away / np.linalg.norm(away, axis=1, keepdims=True), atol=1e-12)


def test_the_covariance_is_that_of_many_repetitions() -> None:
    """With the stated noise the squared error in units of the covariance is 3 in the mean, to a quarter."""
    n, rng = 600, np.random.default_rng(1)
    places, known = np.repeat(MIDDLE[None], n, axis=0), empty_map()
    for X_WC in arc(0.5, 12):
        distance = float(np.linalg.norm(MIDDLE - X_WC.p_m))
        std = np.hypot(PIXEL_STD / FOCAL, RAY_STD_M / distance)
        slopes = slopes_of(places, X_WC) + std * rng.normal(size=(n, 2))
        known = add_rays(known, np.arange(n), slopes, X_WC, 0.0, FOCAL, distance)
    error = known.points_W_m - MIDDLE
    assert np.einsum("ni,nij,nj->n", error, known.A, error).mean() == pytest.approx(3.0, rel=0.25)
    scatter = np.sqrt(np.linalg.eigvalsh(np.cov(error.T)))
    stated = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(known.A.mean(axis=0))))
    np.testing.assert_allclose(scatter, stated, rtol=0.2)


def test_less_certain_rays_give_less_certain_points() -> None:
    """The standard deviation of a mature point is the largest of its covariance, and grows with that of its rays."""
    spread = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(WELL.A))[:, -1])
    np.testing.assert_allclose(WELL.std_m, np.maximum(spread, RAY_STD_M))
    place_std_m, known = np.linspace(0.004, 0.008, len(IDS)), empty_map()
    for k, X_WC in enumerate(arc(0.6, 40)):
        known = add_rays(known, IDS, slopes_of(PLACES, X_WC), X_WC, DT * k, FOCAL, 0.8, place_std_m, 0.003)
    assert known.mature.all()
    assert (known.std_m > 1.5 * WELL.std_m).all()


def test_no_point_is_mature_before_its_rays_cross_at_an_angle() -> None:
    """Below the least parallax none is, however many rays there are; of a wide arc all are."""
    distance = float(np.linalg.norm(MIDDLE - np.array([0.0, 0.0, 1.0])))
    narrow = mapped(MIDDLE[None], arc(0.8 * LEAST_PARALLAX_RAD * distance, 200))
    assert 0.5 * LEAST_PARALLAX_RAD < narrow.parallax_rad[0] < LEAST_PARALLAX_RAD
    assert narrow.views[0] == 200
    assert not narrow.mature.any()
    np.testing.assert_allclose(narrow.points_W_m[0], MIDDLE, atol=1e-6)
    assert np.isnan(mapped(MIDDLE[None], arc(0.1 * LEAST_PARALLAX_RAD, 20)).points_W_m).all()
    assert WELL.mature.all()
    assert (WELL.parallax_rad >= LEAST_PARALLAX_RAD).all()


def test_an_outlier_leaves_a_mature_point_where_it_is() -> None:
    """A ray far off adds no information, counts as outlier, and a ray that fits takes one off the count."""
    X_WC = arc(0.6, 40)[-1]
    slopes = slopes_of(PLACES, X_WC)
    off = slopes.copy()
    off[3] += 40.0 / FOCAL
    hit = add_rays(WELL, IDS, off, X_WC, AFTER_S, FOCAL, 0.8)
    assert hit.outliers[3] == 1 and hit.outliers.sum() == 1
    assert (hit.views[3], hit.views[4]) == (40, 41)
    assert hit.mature[3]
    np.testing.assert_allclose(hit.points_W_m[3], PLACES[3], atol=1e-9)
    healed = add_rays(hit, IDS, slopes, X_WC, AFTER_S + DT, FOCAL, 0.8)
    assert healed.outliers.sum() == 0


def test_a_point_of_several_outliers_is_dropped() -> None:
    """Fewer keep it, tracked or not; `MOST_OUTLIERS` in a row drop it alone."""
    X_WC, known = arc(0.6, 40)[-1], WELL
    off = slopes_of(PLACES, X_WC)
    off[3] += 40.0 / FOCAL
    for k in range(MOST_OUTLIERS):
        assert dropped(known, IDS, AFTER_S, 100.0, 1000) is known
        known = add_rays(known, IDS, off, X_WC, AFTER_S + DT * k, FOCAL, 0.8)
    rest = dropped(known, IDS, AFTER_S, 100.0, 1000)
    np.testing.assert_array_equal(rest.ids, np.delete(IDS, 3))
    np.testing.assert_array_equal(rest.points_W_m, np.delete(known.points_W_m, 3, axis=0))


def test_a_corner_that_slides_does_not_become_mature() -> None:
    """Where an upright near edge crosses a far one in the picture no place is mature, though the parallax is large."""
    near, fixed, known = np.array([0.5, 0.0]), np.array([0.5, 0.05, 1.3]), empty_map()
    foot, way = np.array([1.0, 0.0, 1.5]), np.array([0.0, 0.7, -0.7])
    for k in range(40):
        X_WC = looking(np.array([0.0, 0.01 * (k - 20), 1.1 + 0.08 * np.sin(0.5 * k)]), np.array([0.7, 0.0, 1.4]))
        # The plane through the camera and the near edge cuts the far edge where the corner is seen.
        level = near - X_WC.p_m[:2]
        normal = np.array([-level[1], level[0], 0.0])
        corner = foot + way * (normal @ (X_WC.p_m - foot)) / (normal @ way)
        slopes = slopes_of(np.array([corner, fixed]), X_WC)
        known = add_rays(known, np.array([1, 2]), slopes, X_WC, DT * k, FOCAL, 0.8)
        assert not known.mature[0]
    assert known.parallax_rad[0] > 3.0 * LEAST_PARALLAX_RAD
    assert known.mature[1]


@given(st.permutations(range(12)), st.integers(1, 11))
@settings(max_examples=15, deadline=None)
def test_the_order_of_features_does_not_matter(order: list[int], parted: int) -> None:
    """Any order of a picture's features, in one call or in two, gives the same map, sorted by number."""
    ids, places, order_ = 100 - 3 * np.arange(12), PLACES[:12], np.array(order)
    std_m = np.linspace(0.002, 0.004, 12)
    one, other = empty_map(), empty_map()
    for k, X_WC in enumerate(arc(0.5, 4)):
        slopes = slopes_of(places, X_WC)
        one = add_rays(one, ids, slopes, X_WC, DT * k, FOCAL, 0.8, std_m)
        for part in (order_[:parted], order_[parted:]):
            other = add_rays(other, ids[part], slopes[part], X_WC, DT * k, FOCAL, 0.8, std_m[part])
    np.testing.assert_array_equal(one.ids, np.sort(ids))
    for name in PointMap.__dataclass_fields__:
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-7, atol=1e-7, err_msg=name)
    np.testing.assert_allclose(one.points_W_m, places[::-1], atol=1e-9)


def test_rows_are_those_of_the_numbers() -> None:
    """Numbers in any order have their rows, others -1; an empty map has none."""
    np.testing.assert_array_equal(WELL.rows(np.array([34, 9, 10, 35, 12])), [24, -1, 0, -1, 2])
    np.testing.assert_array_equal(empty_map().rows(np.array([3, 1])), [-1, -1])
    assert len(WELL.rows(np.zeros(0, np.int64))) == 0
    assert len(empty_map()) == 0 and not len(empty_map().mature)


@pytest.mark.parametrize("which", [IDS % 2 == 0, np.array([24, 3, 11])])
def test_joined_maps_have_the_points_of_both(which: BoolArray | IntArray) -> None:
    """A map that was parted and joined is the map, sorted by number; with an empty one nothing changes."""
    part, rest = (
        WELL.chosen(which),
        WELL.chosen(np.delete(np.arange(len(IDS)), which if which.dtype != np.bool_ else np.flatnonzero(which))),
    )
    for both in (joined(part, rest), joined(rest, part), joined(WELL, empty_map()), joined(empty_map(), WELL)):
        for name in PointMap.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(both, name), getattr(WELL, name))


def test_known_places_are_of_all_points_that_have_one() -> None:
    """Points that can be computed are known before they are mature; those whose rays do not cross are not."""
    distance = float(np.linalg.norm(MIDDLE - np.array([0.0, 0.0, 1.0])))
    known = mapped(PLACES, arc(0.8 * LEAST_PARALLAX_RAD * distance, 20))
    known = add_rays(known, np.array([3, 60]), np.zeros((2, 2)), arc(0.6, 2)[0], 20 * DT, FOCAL, 0.8)
    ids, places = known.known_places()
    assert 0 < len(ids) < len(known)
    assert not known.mature[known.rows(ids)].all()
    assert not {3, 60} & set(ids.tolist())
    np.testing.assert_array_equal(ids, known.ids[~np.isnan(known.points_W_m).any(axis=1)])
    np.testing.assert_array_equal(places, known.points_W_m[known.rows(ids)])
    assert [len(part) for part in empty_map().known_places()] == [0, 0]


def test_points_are_solved_from_their_information() -> None:
    """What a map's rays add up to gives its places and deviations; no parallax gives none, many misses no maturity."""
    camera = arc(0.6, 40)[-1].p_m
    places, std = solved(WELL.A, WELL.b, WELL.e, WELL.weight, WELL.parallax_rad, camera)
    np.testing.assert_allclose(places, PLACES, atol=1e-9)
    np.testing.assert_allclose(std, WELL.std_m)
    narrow, never = solved(WELL.A, WELL.b, WELL.e, WELL.weight, np.zeros(len(WELL)), camera)
    assert np.isnan(narrow).all()
    assert np.isinf(never).all()
    missed, unsure = solved(WELL.A, WELL.b, WELL.e + 2.0 * WELL.weight, WELL.weight, WELL.parallax_rad, camera)
    np.testing.assert_allclose(missed, PLACES, atol=1e-9)
    assert np.isinf(unsure).all()


@pytest.mark.parametrize("which", [IDS % 2 == 0, np.array([0, 7, 20])])
def test_chosen_points_keep_all_that_is_known_of_them(which: BoolArray | IntArray) -> None:
    """Every field is that of the chosen rows, and further rays go to the right ones."""
    some = WELL.chosen(which)
    for name in PointMap.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(some, name), getattr(WELL, name)[which])
    X_WC = arc(0.6, 40)[0]
    more = add_rays(some, IDS, slopes_of(PLACES, X_WC), X_WC, AFTER_S, FOCAL, 0.8)
    np.testing.assert_array_equal(more.views, np.where(np.isin(IDS, some.ids), 41, 1))


def test_points_keep_the_direction_from_which_they_were_first_seen() -> None:
    """The first ray stays the first."""
    first = arc(0.6, 40)[0]
    np.testing.assert_allclose(WELL.first_W, ray_directions(slopes_of(PLACES, first), first), atol=1e-12)


def test_the_newest_points_are_kept() -> None:
    """Beyond the largest number the oldest go; what is not tracked goes if not mature, or if seen long ago."""
    known, cameras, nobody = empty_map(), arc(0.6, 40)[::13], np.zeros(0, np.int64)
    for k in range(10):
        for j, X_WC in enumerate(cameras):
            ids = np.array([2 * k, 2 * k + 1])
            known = add_rays(known, ids, slopes_of(PLACES[ids], X_WC), X_WC, 10.0 * k + DT * j, FOCAL, 0.8)
    assert known.mature.all()
    assert dropped(known, nobody, 100.0, 200.0, 20) is known
    np.testing.assert_array_equal(dropped(known, nobody, 100.0, 200.0, 6).ids, np.arange(14, 20))
    np.testing.assert_array_equal(dropped(known, nobody, 100.0, 35.0, 20).ids, np.arange(14, 20))
    np.testing.assert_array_equal(dropped(known, np.array([0, 5]), 100.0, 35.0, 20).ids, [0, 5, *range(14, 20)])
    fresh = add_rays(known, np.array([50]), np.zeros((1, 2)), cameras[0], 100.0, FOCAL, 0.8)
    assert 50 in dropped(fresh, np.array([50]), 100.0, 200.0, 100).ids
    np.testing.assert_array_equal(dropped(fresh, nobody, 100.0, 200.0, 100).ids, known.ids)


def test_information_fades() -> None:
    """A point that has moved while nobody looked is found at its new place once it is seen for long enough."""
    way = np.array([0.01, 0.0, 0.0])
    later = mapped(PLACES + way, arc(0.6, 60), WELL, AFTER_S + 300.0)
    np.testing.assert_allclose(later.points_W_m, PLACES + way, atol=2e-4)


def test_a_map_in_another_frame_has_its_points_there_and_the_same_misses() -> None:
    """What is solved from the moved information is the moved point; further rays there give what they gave here."""
    X_VW = Pose(np.array([0.3, -1.0, 2.0]), quat_from_euler(0.2, -0.3, 1.0))
    rng = np.random.default_rng(5)
    places, poses = (
        rng.uniform([0.6, -0.2, 1.3], [1.0, 0.2, 1.6], (20, 3)),
        [looking(np.array([0.0, y, 1.0]), np.array([0.8, 0.0, 1.5])) for y in np.linspace(-0.3, 0.3, 8)],
    )
    ids = np.arange(20)

    def mapped(known: PointMap, frame: Pose, some: slice) -> PointMap:
        for k, X_WC in list(enumerate(poses))[some]:
            slopes = slopes_of(places, X_WC) + 1e-4 * np.random.default_rng(k).normal(size=(20, 2))
            known = add_rays(known, ids, slopes, frame @ X_WC, float(k), CAMERA.focal_px, 0.8)
        return known

    here = mapped(empty_map(), Pose(np.zeros(3), quat_from_euler(0.0, 0.0, 0.0)), slice(0, 6))
    there = here.moved(X_VW)
    np.testing.assert_allclose(there.points_W_m, X_VW.apply(here.points_W_m), atol=1e-9)
    on, gone_on = (
        mapped(here, Pose(np.zeros(3), quat_from_euler(0.0, 0.0, 0.0)), slice(6, 8)),
        mapped(there, X_VW, slice(6, 8)),
    )
    np.testing.assert_allclose(gone_on.points_W_m, X_VW.apply(on.points_W_m), atol=1e-8)
    np.testing.assert_allclose(gone_on.std_m, on.std_m, rtol=1e-6)
    np.testing.assert_array_equal(gone_on.mature, on.mature)
