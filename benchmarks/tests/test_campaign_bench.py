"""The bench of campaigns measures what it says, on little."""

from __future__ import annotations

from pathlib import Path

import pytest

from wakewise.core.errors import StageError
from wakewise.experiments.campaigns import ProcessExecutor
from wakewise.experiments.trials.timing import BenchOptions
from wakewise_benchmarks import campaign


@pytest.mark.slow
def test_little_lies_between_trials_and_many_are_listed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Less than a second each, where a trial takes a minute."""
    monkeypatch.setattr(campaign, "EMPTY", 8)
    assert campaign.between_trials_s(tmp_path / "empty", ProcessExecutor(1)) < 0.9
    told = campaign.list_many(tmp_path / "many", 50)
    assert set(told) == {"list_50_s", "list_50_cpu_s", "list_50_anew_s"}


@pytest.mark.slow
def test_without_what_a_trial_needs_the_reason_stands_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Null with a reason, and the rest is measured."""
    monkeypatch.setattr(campaign, "EMPTY", 2)
    monkeypatch.setattr(campaign, "MANY", 20)
    monkeypatch.setattr(campaign, "has", lambda extra: False)
    found = campaign.run(BenchOptions())
    assert found["trial_s"] is None
    assert "pip install" in found["why"]["trial_s"]
    assert found["list_20_s"] > 0.0
    assert found["between_trials_dask_s"] is None


def test_a_trial_that_fails_is_no_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The bench says so."""
    monkeypatch.setitem(
        __import__("wakewise.experiments.campaigns.definition", fromlist=["_WORK"])._WORK, "model", "nowhere:none"
    )
    with pytest.raises(StageError, match="cannot be loaded"):
        campaign.standard_trials(tmp_path / "c", ProcessExecutor(1))
