"""Laws of the model of many workers, and what it is made of."""

from __future__ import annotations

from pathlib import Path

import pytest

from wakewise_benchmarks import campaign_scaling
from wakewise_benchmarks.campaign_scaling import ScalingModel, claims, waited_s

MODEL = ScalingModel(between_s=0.1, driver_s=0.004, claim_s=0.006, per_worker_s=1e-6)


def test_more_workers_make_more_until_what_takes_turns_bounds_them():
    """Below saturation each worker adds its trials; at it the two bounds are equal; beyond it none is gained."""
    limit = MODEL.saturates_at(10.0)
    assert MODEL.rate_per_s(10, 10.0) == pytest.approx(10 * MODEL.rate_per_s(1, 10.0))
    assert limit / 10.1 == pytest.approx(1.0 / MODEL.serial_s(limit), rel=2e-3)
    assert MODEL.rate_per_s(2 * limit, 10.0) < MODEL.rate_per_s(limit, 10.0)
    assert MODEL.efficiency_pct(100, 10.0) == pytest.approx(100.0 * 10.0 / 10.1)
    assert 5 * limit < MODEL.saturates_at(100.0) < 10 * limit


def test_a_claim_takes_time_and_bytes_and_waiting_for_many_costs_the_driver(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """A ticket names its trial's folder, so that it has at least as many bytes; waiting costs less than 1 ms each."""
    monkeypatch.setattr(campaign_scaling, "CLAIMS", 3)
    took_s, size = claims(tmp_path)
    assert 0.0 < took_s < 1.0
    assert size > len(str(tmp_path))
    assert 0.0 < waited_s() < 1e-3
