"""The photographs of the bench show what they should, and its extrapolation follows known laws."""

from __future__ import annotations

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.vision.reconstruction.dense.dense_points import MOST_POINTS
from wakewise_benchmarks import large_photos
from wakewise_benchmarks.large_photos import extrapolated, pairs_of_many


def test_a_camera_that_looks_down_sees_the_place_below_it_in_the_middle():
    """A point below the camera is in the middle of the photograph at every height; one beside it by f / distance."""
    for height_m in (0.0, 0.4):
        H = large_photos._homography(np.array([1.0, 2.0, large_photos.ABOVE_M]), np.eye(3), height_m)
        (u, v, w), (u2, _, w2) = H @ [1000.0, 2000.0, 1.0], H @ [1100.0, 2000.0, 1.0]
        assert (u / w, v / w) == pytest.approx((2000.0, 1500.0))
        assert abs(u2 / w2 - u / w) == pytest.approx(3600.0 * 0.1 / (large_photos.ABOVE_M - height_m))


def test_time_and_memory_of_many_follow_from_two_counts():
    """A time for each photograph and pair, mapping by its power, memory by its line.

    That of fusion is a line over the points until there are as many as there may be; of stereo what its stores lack.
    """

    def part(n: int, memory_MB: float) -> dict[str, object]:
        cpu_s = {"features": 2.0 * n, "matches": 0.1 * n * (n - 1) / 2, "mapping": 0.01 * n**2}
        return {"cpu_s": cpu_s, "memory_MB": {"features": 900.0, "mapping": memory_MB}}

    found = {}
    for n in (10, 20):
        memory_MB = {"stereo": 500.0, "fusion": 600.0 + 10.0 * n}
        dense = {"cpu_s": {"stereo": 3.0 * n}, "memory_MB": memory_MB, "dense_points": 100_000 * n}
        found[str(n)] = {"sparse": part(n, 1000.0 + n), "dense": dense, "pycolmap": part(n, 900.0)}
    told = extrapolated(found, 500)
    assert told["memory_500_MB"] == pytest.approx(1500.0)
    for one in found.values():
        one["dense"]["memory_MB"]["fusion"] += 1000.0
    at_most = 1000.0 + 600.0 + 10.0 * MOST_POINTS / 100_000
    assert extrapolated(found, 500)["memory_500_MB"] == pytest.approx(at_most)
    for one in found.values():
        one["dense"]["memory_MB"] |= {"stereo": 3000.0}
    stereo = 3000.0 + 250.0 + 480 * large_photos.SMALL_MB
    assert extrapolated(found, 500)["memory_500_MB"] == pytest.approx(stereo)
    assert told["pycolmap_memory_500_MB"] == pytest.approx(900.0)
    assert told["cpu_500_s"] == pytest.approx(1000.0 + 0.1 * pairs_of_many(500) + 2500.0 + 1500.0)
    assert told["pycolmap_cpu_500_s"] == pytest.approx(1000.0 + 0.1 * 500 * 499 / 2 + 2500.0)
    assert extrapolated({"10": found["10"]}, 500)["cpu_500_s"] is None


def test_numbers_of_photographs_out_of_range_are_refused():
    """Two photographs are no model with a third view."""
    with pytest.raises(InputError, match="photographs: 2, allowed 3 to 5000"):
        BenchOptions(photographs=(2, 10))
