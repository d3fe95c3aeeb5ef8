"""The bench of an onboard computer: what it measures and what it projects."""

from __future__ import annotations

import pytest

from wakewise_benchmarks import onboard
from wakewise_benchmarks.registry import BENCHES


def test_times_are_of_one_process_and_projected_by_a_factor(capsys: pytest.CaptureFixture[str]) -> None:
    """Four seconds: positive times, p99 above the median, and five times each in the projection."""
    told = onboard.fly(4.0)
    assert "onboard" in BENCHES
    assert 0.0 < told["allocator_us_median"] <= told["allocator_us_p99"]
    assert 0.0 < told["plan_ms_median"] <= told["plan_ms_p99"]
    assert told["projected_5x"]["plan_ms_p99"] == pytest.approx(5.0 * told["plan_ms_p99"])
    assert told["projected_5x"]["late_pct"] >= told["late_pct"]
    assert told["memory_MB"] > 50.0
    onboard.show_onboard(told)
    printed = capsys.readouterr().out
    assert "5 times slower (projected): allocation" in printed
