"""The ledger: what stages cost adds up over sittings."""

from pathlib import Path

import pytest

from wakewise.experiments.trials.stages import StageCosts


def test_costs_add_up_also_when_a_stage_is_cut_short(tmp_path: Path) -> None:
    """A stage that was interrupted and run again has cost the sum of both."""
    ledger = StageCosts(tmp_path / "stages.json")
    with pytest.raises(KeyboardInterrupt), ledger.account("fly"):
        raise KeyboardInterrupt
    first = ledger.read()["fly"]["wall_s"]
    with ledger.account("fly"):
        sum(range(100_000))
    with ledger.account("evaluate"):
        pass
    costs = ledger.read()
    assert costs["fly"]["wall_s"] > first >= 0.0
    assert ledger.total("cpu_s") == pytest.approx(costs["fly"]["cpu_s"] + costs["evaluate"]["cpu_s"])
