"""Splitting a sum among threads changes neither a byte nor what is computed."""

import threading

import numpy as np
import pytest

from wakewise.tank import chunks
from wakewise.tank.chunks import over_points


@pytest.mark.parametrize("n", [0, 1, 383, 384, 1000, 5003])
@pytest.mark.parametrize("cores", [1, 2, 3])
def test_every_point_is_taken_once(monkeypatch, n, cores):
    """Whatever the number of points and cores, each row is written exactly once, whole blocks of 64 but the last."""
    monkeypatch.setattr("os.cpu_count", lambda: cores)
    points, out, lengths, lock = np.arange(3.0 * n).reshape(n, 3), np.zeros((n, 3)), [], threading.Lock()

    def kernel(some, result):
        result += 2.0 * some + 1.0
        with lock:
            lengths.append(len(some))

    over_points(kernel, points, out, chunks._THREADED_PAIRS)
    np.testing.assert_array_equal(out, 2.0 * points + 1.0)
    assert sum(lengths) == n
    assert sum(length % chunks._BLOCKS != 0 for length in lengths) <= 1


def test_an_error_in_a_piece_is_told(monkeypatch):
    """What a kernel raises comes out of the call, whichever thread it happened on."""
    monkeypatch.setattr("os.cpu_count", lambda: 2)

    def kernel(some, result):
        if some[0, 0] > 0.5:
            raise ValueError("no such point")
        result += some

    points = np.linspace(0.0, 1.0, 3 * 2000).reshape(2000, 3)
    with pytest.raises(ValueError, match="no such point"):
        over_points(kernel, points, np.zeros_like(points), chunks._THREADED_PAIRS)
