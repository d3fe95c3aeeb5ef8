"""Methods compared in a few words."""

import pytest

from wakewise.experiments.campaigns.definition import CampaignPlan, PlanEntry
from wakewise.experiments.campaigns.summary import summarize, worst_trials
from wakewise.experiments.campaigns.table import ComparisonMetric, Results, TrialRecord, status

RMSE = ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True)


def place(method, seed, rmse, energy=1.0, target="brain", world="pump-tank"):
    """A trial as a page is told of it."""
    figures = {} if rmse is None else {"rmse_mm": rmse, "energy_kJ": energy}
    return {"world": world, "method": method, "target": target, "seed": seed, "folder": "x", "figures": figures,
            "reason": None if rmse is not None else "no model"}  # fmt: skip


def test_who_won_by_how_much_how_sure_and_at_what_price():
    """The best against the second best, over the seeds that all have."""
    places = [place("a", k, 1.0 + 0.01 * k, 2.0) for k in range(1, 8)]
    places += [place("b", k, 2.0 + 0.01 * k, 1.0) for k in range(1, 7)]
    found = summarize(RMSE, "pump-tank", places)
    assert (found.winner, found.rival, found.trials) == ("a", "b", 6)
    assert found.less_pct == pytest.approx(49.2, abs=0.2) and found.energy_ratio == pytest.approx(2.0)
    assert found.sure == "told apart, preliminary (n < 20)" and found.improvement == 1.0


def test_a_method_whose_models_fail_does_not_win_by_its_survivors():
    """A failed trial counts 20 mm, and is counted."""
    places = [place("a", 1, 0.5), place("a", 2, None), place("b", 1, 1.0), place("b", 2, 1.0)]
    found = summarize(RMSE, "pump-tank", places)
    assert (found.winner, found.failed) == ("b", {"a": 1, "b": 0})


def test_one_trial_each_decides_nothing():
    """And says so."""
    found = summarize(RMSE, "pump-tank", [place("a", 1, 1.0), place("b", 1, 2.0)])
    assert found.sure == "too few pairs (1)" and found.interval_pct is None


def test_the_worst_trial_is_one_that_failed_else_the_one_with_the_largest_error():
    """One for each method."""
    places = [place("a", 1, 1.0), place("a", 2, 5.0), place("b", 1, 9.0), place("b", 2, None)]
    worst = worst_trials(RMSE, "pump-tank", places)
    assert {method: one["seed"] for method, one in worst.items()} == {"a": 2, "b": 2}


def test_few_pairs_that_agree_are_not_sure():
    """Five heads in a row come once in sixteen throws of a coin, either way up."""
    few = [place(who, k, rmse) for k in range(1, 6) for who, rmse in (("a", 1.0), ("b", 2.0))]
    found = summarize(RMSE, "pump-tank", few)
    assert found.sure == "too few pairs (5)" and not found.is_sure and found.interval_pct is not None


def test_twenty_pairs_are_no_longer_preliminary():
    """And a difference that goes both ways is not told apart, however many pairs there are."""
    clear = [place(who, k, rmse) for k in range(1, 21) for who, rmse in (("a", 1.0), ("b", 2.0))]
    assert summarize(RMSE, "pump-tank", clear).sure == "told apart"
    mixed = [
        place(who, k, 1.0 + 0.1 * ((k + (who == "b")) % 2) - 0.001 * (who == "a")) for k in range(1, 21) for who in "ab"
    ]
    assert summarize(RMSE, "pump-tank", mixed).sure == "not told apart"


def test_a_trial_that_several_rows_share_counts_once():
    """Two rows of one key are one trial, with its attempts counted once."""

    def record(key, state="done"):
        entry = PlanEntry(key=key, name=key, factors={})
        return TrialRecord(entry=entry, state=state, figures={}, reason=None, attempts=2, took_s=4.0)

    plan = CampaignPlan(name="shared", campaign={}, wakewise="0", sources="0", trials=())
    made = (record("a"), record("a"), record("b", "failed"), record("b", "failed"), record("c", "waiting"))
    told = status(Results(plan=plan, made=made, drivers=0, others=0))
    assert [told[name] for name in ("trials", "done", "failed", "waiting", "attempts")] == [3, 1, 1, 1, 6]
    assert len(told["failures"]) == 1
