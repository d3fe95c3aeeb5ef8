"""The bench of what flies: each method's step is timed in a loop that it flies itself."""

import pytest

from wakewise_benchmarks import planner
from wakewise_benchmarks.planner import goal_at


@pytest.mark.slow
@pytest.mark.parametrize("method", ["allocation-only", "wake-aware"])
def test_a_step_is_timed_after_its_warm_up(monkeypatch, method):
    """The median is no longer than the 99th percentile, and a method that plans has steps that take longer."""
    monkeypatch.setattr(planner, "SECONDS", 1.6)
    found = planner.flown_step(method, goal_at, 3.0)
    assert 0.0 < found["ms_median"] <= found["ms_p99"]
    assert found["ms_planning_median"] >= found["ms_median"]
