"""Splitting a sum among threads changes neither a byte nor what is computed."""

import multiprocessing
import os
import threading

import numpy as np
import pytest

from wakewise.simulation.water import induction
from wakewise.simulation.water.induction import over_points


@pytest.mark.parametrize("n", [0, 1, 383, 384, 1000, 5003])
@pytest.mark.parametrize("cores", [1, 2, 3])
def test_every_point_is_taken_once(monkeypatch, n, cores):
    """Whatever the number of points and cores, each row is written exactly once, whole groups of 256 but the last."""
    monkeypatch.setattr(induction, "cores", lambda: cores)
    points, out, lengths, lock = np.arange(3.0 * n).reshape(n, 3), np.zeros((n, 3)), [], threading.Lock()

    def kernel(some, result):
        result += 2.0 * some + 1.0
        with lock:
            lengths.append(len(some))

    over_points(kernel, points, out, induction._THREADED_PAIRS)
    np.testing.assert_array_equal(out, 2.0 * points + 1.0)
    assert sum(lengths) == n
    assert sum(length % induction._BLOCKS != 0 for length in lengths) <= 1


def test_an_error_in_a_piece_is_told(monkeypatch):
    """What a kernel raises comes out of the call, whichever thread it happened on."""
    monkeypatch.setattr(induction, "cores", lambda: 2)

    def kernel(some, result):
        if some[0, 0] > 0.5:
            raise ValueError("no such point")
        result += some

    points = np.linspace(0.0, 1.0, 3 * 2000).reshape(2000, 3)
    with pytest.raises(ValueError, match="no such point"):
        over_points(kernel, points, np.zeros_like(points), induction._THREADED_PAIRS)


def _sum_in_child(queue):
    points = np.ones((5000, 3))
    out = np.zeros_like(points)
    over_points(lambda some, result: np.copyto(result, 2.0 * some), points, out, induction._THREADED_PAIRS)
    queue.put(float(out.sum()))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_forked_child_has_threads_of_its_own(monkeypatch):
    """After sums on threads in the parent, a forked child sums as well instead of waiting for threads it has not."""
    monkeypatch.setattr(induction, "cores", lambda: 3)
    forking = multiprocessing.get_context("fork")
    queue = forking.Queue()
    _sum_in_child(queue)
    assert queue.get(timeout=20) == 30000.0
    child = forking.Process(target=_sum_in_child, args=(queue,))
    child.start()
    try:
        assert queue.get(timeout=20) == 30000.0
    finally:
        child.kill()
        child.join()
