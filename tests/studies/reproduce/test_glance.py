"""A table in a few words."""

import pytest

from wakewise.studies.reproduce.glance import glance, glances, tally, worst_trials


def place(method, seed, rmse, energy=1.0, target="brain", world="pump-tank"):
    """A trial as a page is told of it."""
    figures = {} if rmse is None else {"rmse_mm": rmse, "energy_kJ": energy}
    return {"world": world, "method": method, "target": target, "seed": seed, "folder": "x", "figures": figures,
            "reason": None if rmse is not None else "no model"}  # fmt: skip


def test_who_won_by_how_much_how_sure_and_at_what_price():
    """The best against the second best, over the seeds that all have."""
    places = [place("a", k, 1.0 + 0.01 * k, 2.0) for k in range(1, 7)]
    places += [place("b", k, 2.0 + 0.01 * k, 1.0) for k in range(1, 6)]
    found = glance("dynamic", "pump-tank", places)
    assert (found.winner, found.rival, found.trials) == ("a", "b", 5)
    assert found.less_pct == pytest.approx(49.3, abs=0.2) and found.energy_ratio == pytest.approx(2.0)
    assert found.sure.startswith("sure") and found.improvement == 1.0


def test_a_method_whose_models_fail_does_not_win_by_its_survivors():
    """A failed trial counts 20 mm, and is counted."""
    places = [place("a", 1, 0.5), place("a", 2, None), place("b", 1, 1.0), place("b", 2, 1.0)]
    found = glance("dynamic", "pump-tank", places)
    assert (found.winner, found.failed) == ("b", {"a": 1, "b": 0})


def test_one_trial_each_decides_nothing():
    """And says so."""
    found = glance("dynamic", "pump-tank", [place("a", 1, 1.0), place("b", 1, 2.0)])
    assert "nobody knows" in found.sure and found.interval_pct is None


def test_worlds_are_judged_apart_and_tables_without_methods_not_at_all():
    """A winner in one water is none in another."""
    places = [place("a", 1, 1.0), place("b", 1, 2.0), place("a", 1, 3.0, world="mud"), place("b", 1, 1.0, world="mud")]
    assert [one.winner for one in glances("dynamic", places)] == ["a", "b"]
    assert glances("wake", places) == []


def test_the_worst_trial_is_one_that_failed_else_the_one_with_the_largest_error():
    """One for each method."""
    places = [place("a", 1, 1.0), place("a", 2, 5.0), place("b", 1, 9.0), place("b", 2, None)]
    worst = worst_trials("dynamic", "pump-tank", places)
    assert {method: one["seed"] for method, one in worst.items()} == {"a": 2, "b": 2}


def test_a_figure_counts_once_and_not_for_being_met_in_the_papers_own_water():
    """Three rows of one figure, one met at sea; another met only where the water is the planner's model."""

    def row(world, met, figure="f", paper=1.0, sure=True):
        return {"method": "m", "figure": figure, "paper": paper, "met": met, "sure": sure, "world": world}

    rows = [row("mud", False), row("reef", True), row("paper", True)]
    rows += [row("paper", True, "g"), row("mud", False, "g"), row("mud", True, "h", paper=None)]
    assert tally({"t": rows}) == {"quoted": 2, "met": 1, "surely": 1, "circular": 1}
