"""From trials to rows, on figures made up for the purpose."""

import numpy as np
import pytest

from wakewise.experiments.campaigns.definition import PlannedTrial
from wakewise.experiments.campaigns.task import Task, TrialOutcome
from wakewise_paper.reproduction.claim import ORDER, PublishedFigure
from wakewise_paper.reproduction.rows import CompletedTrial, TableTrials, once_rows, table_rows

KEYS = ["method", "target", "figure", "paper", "ours", "low", "high", "n", "met"]


def made(method, seed, figures, *, target="brain", world="pump-tank", reason=None, attempts=1):
    """A trial that became these figures."""
    task = Task(name=f"{method}/{target}/{seed}", work="m:f", settings={"seed": seed}, sources=())
    plan = PlannedTrial(task=task, factors={"world": world, "method": method, "target": target, "seed": seed})
    return CompletedTrial(plan, TrialOutcome(task=task, figures=figures, reason=reason, attempts=attempts, took_s=1.0))


def claim(reading="mean", **told):
    """A claim of ours."""
    base = {"method": "ours", "figure": "rmse_mm", "title": "RMSE", "unit": "mm", "paper": 2.0, "said": "2 mm"}
    return PublishedFigure(**base | {"side": "less", "how": "h", "reading": reading} | told)


def rows_of(claims, trials):
    """Rows in one world."""
    return table_rows(claims, {"pump-tank": TableTrials(trials)})


def test_a_row_begins_with_the_keys_that_are_promised():
    """And a single trial has no interval, with the reason."""
    (row,) = rows_of([claim()], [made("ours", 1, {"rmse_mm": 1.5})])
    assert list(row)[:9] == KEYS
    assert (row["ours"], row["low"], row["n"], row["met"], row["sure"]) == (1.5, None, 1, True, None)
    assert "single" in row["why"]["low"]


def test_met_is_sure_only_with_the_whole_interval():
    """Means alike, spreads not."""
    tight = [made("ours", k, {"rmse_mm": 1.5 + 0.01 * k}) for k in range(1, 9)]
    loose = [made("ours", k, {"rmse_mm": 0.1 if k % 2 else 2.9}) for k in range(1, 9)]
    missed = [made("ours", k, {"rmse_mm": 2.5 + 0.01 * k}) for k in range(1, 9)]
    told = [(row["met"], row["sure"]) for trials in (tight, loose, missed) for row in rows_of([claim()], trials)]
    assert told == [(True, True), (True, False), (False, True)]


def test_failures_are_left_out_or_count_as_the_worst_and_are_counted():
    """As the paper does, and as it should."""
    trials = [made("ours", 1, {"rmse_mm": 1.0}), made("ours", 2, {"rmse_mm": None, "failure": "no model"})]
    trials.append(made("ours", 3, None, reason="fell over"))
    plain, itt = rows_of([claim(), claim(itt=True)], trials)
    assert (plain["ours"], plain["n"], plain["failed"]) == (1.0, 1, 2)
    assert (itt["ours"], itt["n"]) == (pytest.approx((1.0 + 20.0 + 20.0) / 3.0), 3)


def test_what_a_budget_left_undone_is_no_failure():
    """A trial that was never begun says nothing of its method."""
    undone = made("ours", 2, None, reason="not finished", attempts=0)
    (row,) = rows_of([claim(itt=True)], [made("ours", 1, {"rmse_mm": 1.0}), undone])
    assert (row["ours"], row["n"], row["failed"]) == (1.0, 1, 0)


def test_a_difference_is_over_pairs_alone_and_tested():
    """A seed that only one of them has is no pair; p-values are corrected over the table."""
    rng = np.random.default_rng(1)
    trials = [made("ours", k, {"rmse_mm": 1.0 + 0.1 * rng.normal()}) for k in range(1, 11)]
    trials += [made("theirs", k, {"rmse_mm": 2.0 + 0.1 * rng.normal()}) for k in range(2, 13)]
    less = claim("less_pct", than="theirs", paper=40.0, side="more", unit="%")
    other = claim("less_pct", than="theirs", paper=None, asked=0.0, side="more", title="again")
    first, second = rows_of([less, other], trials)
    assert first["n"] == 9 and first["ours"] == pytest.approx(50.0, abs=5.0)
    assert first["low"] < first["ours"] < first["high"] and first["met"] is True
    assert first["p_t"] < 1e-6 and first["p_holm"] == pytest.approx(2.0 * first["p_t"])
    assert (first["improvement"], second["met"]) == (1.0, True)


def test_a_share_has_an_exact_interval():
    """Of none failed it does not say that none will."""
    trials = [made("ours", k, {"success": 1.0}) for k in range(1, 6)]
    (row,) = rows_of([claim("share_pct", figure="success", paper=98.5, side="more")], trials)
    assert (row["ours"], row["met"], row["sure"]) == (100.0, True, False)
    assert row["low"] == pytest.approx(100.0 * 0.025**0.2)


def test_how_much_repeats_differ_is_within_targets():
    """Two targets of quite different size, each repeated to a tenth."""
    trials = [made("ours", k, {"area_cm2": base * f}, target=t)
              for t, base in (("a", 100.0), ("b", 900.0)) for k, f in ((1, 0.9), (2, 1.1))]  # fmt: skip
    (row,) = rows_of([claim("spread_pct", figure="area_cm2", paper=None, side="none")], trials)
    assert row["ours"] == pytest.approx(100.0 * np.std([0.9, 1.1], ddof=1))
    (alone,) = rows_of([claim("spread_pct", figure="area_cm2", paper=None, side="none")], trials[:1])
    assert alone["ours"] is None and "twice" in alone["why"]["ours"]


def test_the_order_of_methods_is_the_papers_or_is_told():
    """With how often a bootstrap has it."""
    falling = [made(m, k, {"rmse_mm": 9.0 - 2.0 * i + 0.01 * k}) for i, m in enumerate(ORDER) for k in (1, 2, 3)]
    (row,) = rows_of([claim("order", paper=None, side="none")], falling)
    assert (row["met"], row["ours"]) == (True, 100.0)
    rising = [made(m, k, {"rmse_mm": 1.0 + i + 0.01 * k}) for i, m in enumerate(ORDER) for k in (1, 2, 3)]
    (row,) = rows_of([claim("order", paper=None, side="none")], rising)
    assert (row["met"], row["our_order"]) == (False, " > ".join(reversed(ORDER)))


def test_targets_have_rows_of_their_own_where_there_are_several():
    """The paper's mean is of all; of one target none is quoted."""
    trials = [made("ours", 1, {"rmse_mm": 1.0}, target="a"), made("ours", 1, {"rmse_mm": 3.0}, target="b")]
    every, a, b = rows_of([claim()], trials)
    assert (every["target"], every["ours"], every["met"]) == (None, 2.0, True)
    assert [(row["target"], row["ours"], row["paper"], row["met"]) for row in (a, b)] == [
        ("a", 1.0, None, None),
        ("b", 3.0, None, None),
    ]


def test_one_measurement_gives_rows_by_method_and_flow():
    """Names of figures say whose they are; shares come with their counts."""
    figures = {"ours/late_pct": 1.0, "ours/late": 2.0, "ours/plans": 200.0, "paper/oracle/r2_core": -3.0}
    late = claim(figure="late_pct", paper=0.8, unit="%")
    flow = claim(method="paper", figure="r2_core", paper=0.99, side="more")
    first, second = once_rows([late, flow], figures)
    assert (first["n"], first["met"], first["sure"]) == (200, False, False)
    assert first["low"] < 1.0 < first["high"]
    assert (second["target"], second["ours"], second["met"]) == ("oracle", -3.0, False)


def pairs(n, ours, theirs, figure="rmse_mm"):
    """Trials of two methods on n seeds, each value a function of the seed."""
    return [made(who, k, {figure: of(k)}) for k in range(1, n + 1) for who, of in (("ours", ours), ("theirs", theirs))]


LESS = {"than": "theirs", "paper": None, "asked": 0.0, "side": "more", "unit": "%"}


def test_a_difference_whose_interval_contains_zero_is_not_met():
    """Though its mean is on the right side."""
    trials = pairs(20, lambda k: 2.0 + 0.5 * (-1) ** k - 0.05, lambda k: 2.0)
    (row,) = rows_of([claim("less_pct", **LESS)], trials)
    assert row["ours"] > 0.0 > row["low"] and row["n"] == 20
    assert (row["met"], row["told_apart"]) == (False, False) and "contains zero" in row["why"]["met"]


@pytest.mark.parametrize(
    ("n", "sure", "told_apart", "preliminary"),
    [(5, False, False, True), (6, True, True, True), (19, True, True, True), (20, True, True, False)],
)
def test_a_difference_needs_six_pairs_to_be_sure_and_twenty_not_to_be_preliminary(n, sure, told_apart, preliminary):
    """However clear it is."""
    trials = pairs(n, lambda k: 1.0 + 0.01 * k, lambda k: 2.0 + 0.01 * (k % 3))
    (row,) = rows_of([claim("less_pct", **LESS)], trials)
    assert (row["met"], row["n"]) == (True, n)
    assert (row["sure"], row["told_apart"], row["preliminary"]) == (sure, told_apart, preliminary)


def test_a_figure_that_is_no_difference_is_neither_told_apart_nor_preliminary():
    """With the reason."""
    (row,) = rows_of([claim()], pairs(3, lambda k: 1.0, lambda k: 2.0))
    assert (row["told_apart"], row["preliminary"]) == (None, None)
    assert "no difference" in row["why"]["told_apart"] and "no difference" in row["why"]["preliminary"]


def test_a_figure_that_every_method_meets_says_so():
    """One that a single other method misses, or of which a trial of it gave none, does not."""
    (every,) = rows_of([claim()], pairs(3, lambda k: 1.0, lambda k: 1.9))
    (one,) = rows_of([claim()], pairs(3, lambda k: 1.0, lambda k: 2.1))
    (none,) = rows_of([claim()], [made("ours", 1, {"rmse_mm": 1.0}), made("theirs", 1, {"rmse_mm": None})])
    (alone,) = rows_of([claim()], [made("ours", 1, {"rmse_mm": 1.0})])
    assert [row["met_by_all"] for row in (every, one, none, alone)] == [True, False, False, None]
    assert "no other method" in alone["why"]["met_by_all"]


def test_a_difference_that_other_methods_have_as_well_says_so():
    """The method that all are held against is not among them."""
    third = [made("third", k, {"rmse_mm": 1.1 + 0.01 * k}) for k in range(1, 9)]
    trials = [*pairs(8, lambda k: 1.0 + 0.01 * k, lambda k: 4.0), *third]
    told = claim("less_pct", **LESS | {"paper": 60.0})
    assert rows_of([told], trials)[0]["met_by_all"] is True
    assert rows_of([claim("less_pct", **LESS | {"paper": 74.0})], trials)[0]["met_by_all"] is False
    assert rows_of([told], trials[:16])[0]["met_by_all"] is None


def test_planners_and_wake_models_are_held_against_each_other_too():
    """In the same flow."""
    figures = {"ours/tank/r2": 0.9, "theirs/tank/r2": 0.95, "ours/sea/r2": 0.9, "theirs/sea/r2": 0.1}
    rows = once_rows([claim(figure="r2", paper=0.8, side="more")], figures)
    assert {row["setup"]: row["met_by_all"] for row in rows} == {"flow tank": True, "flow sea": False}


def test_a_row_has_baseline_source_and_set_up():
    """The method that the paper compares with, its table or section, and the paper's own set-up or the world's name."""
    told = claim(baseline="mpc", where="table Two", sd=0.4)
    trials = {world: TableTrials([made("ours", 1, {"rmse_mm": 1.0}, world=world)]) for world in ("pump-tank", "reef")}
    own, reef = table_rows([told], trials)
    assert (own["baseline"], own["source"], own["paper_sd"]) == ("mpc", "table Two", 0.4)
    assert (own["setup"], reef["setup"]) == ("the paper's own", "reef")
    (bare,) = rows_of([claim()], [made("ours", 1, {"rmse_mm": 1.0})])
    assert (bare["baseline"], bare["source"]) == (None, None) and bare["why"]["source"] and bare["why"]["baseline"]


def silt_worlds(n, clear=1.0, silted=1.3):
    """The same method in clear water and in silt, on n seeds; its target has another name in each."""
    return {
        world: TableTrials(
            made("ours", k, {"rmse_mm": rmse * (1.0 + 0.01 * k)}, world=world, target=target) for k in range(1, n + 1)
        )
        for world, rmse, target in (("pump-tank", clear, "branching"), ("caco3", silted, "the world's"))
    }


MORE = {"paper": 40.0, "side": "less", "unit": "%", "against": "pump-tank", "worlds": ("caco3",)}


def test_how_much_more_in_silt_is_over_the_same_seeds_in_clear_water():
    """In that world alone, with its interval; less more than the paper's is met."""
    (row,) = table_rows([claim("more_pct", **MORE)], silt_worlds(7))
    assert (row["world"], row["n"], row["met"], row["sure"]) == ("caco3", 7, True, True)
    assert row["ours"] == pytest.approx(30.0) and row["low"] == pytest.approx(30.0)
    (worse,) = table_rows([claim("more_pct", **MORE)], silt_worlds(7, silted=1.5))
    assert worse["met"] is False


def test_without_clear_water_there_is_no_verdict_on_silt():
    """And the row says which world is missing."""
    (row,) = table_rows([claim("more_pct", **MORE)], {"caco3": silt_worlds(3)["caco3"]})
    assert (row["ours"], row["met"]) == (None, None) and "pump-tank" in row["why"]["met"]


def test_the_share_of_models_that_were_made_counts_failures():
    """With an exact interval."""
    trials = [made("ours", k, {"rmse_mm": 1.0}) for k in (1, 2, 3)] + [made("ours", 4, None, reason="fell over")]
    (row,) = rows_of([claim("made_pct", paper=100.0, side="more", unit="%")], trials)
    assert (row["ours"], row["n"], row["failed"], row["met"]) == (75.0, 4, 1, False)
