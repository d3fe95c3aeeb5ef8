"""An error that lasts: its spread, its memory, and that asking often changes neither."""

import numpy as np
import pytest

from wakewise.simulation.tank.sensors import GaussMarkovProcess


def walks(every_s, *, sigma=0.004, lasts_s=20.0, seconds=100.0, many=300):
    """Values at each look, shape (many, looks, 3)."""
    times = np.arange(0.0, seconds + 1e-9, every_s)
    rng = np.random.default_rng(3)
    return np.array(
        [[one.at(t) for t in times] for one in (GaussMarkovProcess(sigma, lasts_s, r) for r in rng.spawn(many))]
    )


@pytest.mark.parametrize("every_s", [0.5, 10.0])
def test_the_spread_is_the_stated_one_from_the_first_value_on(every_s):
    """At the start and after five times its memory, looked at often or seldom: sigma within 8 %."""
    values = walks(every_s)
    for k in (0, -1):
        assert values[:, k].std() == pytest.approx(0.004, rel=0.08)


def test_it_forgets_as_stated():
    """Correlation after one memory is 1/e within 0.06, after five next to none; axes are strangers."""
    values = walks(10.0)
    start = values[:, 0].ravel()

    def kinship(k):
        return np.corrcoef(start, values[:, k].ravel())[0, 1]

    assert kinship(2) == pytest.approx(np.exp(-1.0), abs=0.06)
    assert abs(kinship(10)) < 0.1
    assert abs(np.corrcoef(values[:, -1, 0], values[:, -1, 1])[0, 1]) < 0.15


def test_no_spread_is_no_error():
    """Sigma zero stays zero."""
    assert not walks(1.0, sigma=0.0, many=2, seconds=5.0).any()
