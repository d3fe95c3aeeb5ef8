"""StageCosts: what stages cost adds up over runs."""

from pathlib import Path

import pytest

from wakewise.experiments.trials.stages import StageCosts


def test_costs_add_up_also_when_a_stage_is_cut_short(tmp_path: Path) -> None:
    """A stage that was interrupted and run again has cost the sum of both."""
    stage_costs = StageCosts(tmp_path / "stages.json")
    with pytest.raises(KeyboardInterrupt), stage_costs.account("fly"):
        raise KeyboardInterrupt
    first = stage_costs.read()["fly"]["wall_s"]
    with stage_costs.account("fly"):
        sum(range(100_000))
    with stage_costs.account("evaluate"):
        pass
    costs = stage_costs.read()
    assert costs["fly"]["wall_s"] > first >= 0.0
    assert stage_costs.total("cpu_s") == pytest.approx(costs["fly"]["cpu_s"] + costs["evaluate"]["cpu_s"])
