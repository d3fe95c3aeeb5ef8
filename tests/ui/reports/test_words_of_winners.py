"""No method is ahead that the pairs do not tell apart; large differences are ratios; a count says of which world."""

import re
from dataclasses import replace
from importlib import resources

import pytest
from test_campaign_page import campaign

from wakewise.experiments.campaigns.summary import MethodSummary, summarize
from wakewise.experiments.campaigns.table import ComparisonMetric
from wakewise.ui.reports.campaign import campaign_page
from wakewise.ui.reports.methods_compared import cost_text, winner_text
from wakewise.ui.reports.page import legend_entry, missing, prose, scene_box
from wakewise.ui.reports.text import duration, percent
from wakewise_paper.reports.reproduction import sentences
from wakewise_paper.reproduction.claim import setup_of


def judged(low=5.0, high=15.0, trials=12, less=10.0, ours=0.9, theirs=1.0, rival="mpc-smooth"):
    """A comparison of two methods."""
    return MethodSummary(
        world="mud", figure="rmse_mm", words="mm RMSE", means={"wake-aware": ours, "mpc-smooth": theirs},
        winner="wake-aware", rival=rival, less_pct=less, interval_pct=None if low is None else (low, high), p_t=0.2,
        improvement=0.7,
        energy_ratio=1.0, failed={}, trials=trials,
    )  # fmt: skip


def test_a_difference_is_stated_with_its_interval_and_its_pairs():
    """Of 20 pairs or more without a mark; of fewer it is preliminary."""
    told = "wake-aware: 0.900 mm RMSE, 10 % less than mpc-smooth ({} pairs; interval 5 to 15 %){}."
    assert winner_text(judged(trials=20)) == told.format(20, "")
    assert winner_text(judged(trials=12)) == told.format(12, ", preliminary (n < 20)")


def test_a_figure_of_which_more_is_better_is_more_than_the_next_best():
    """Up to three times in percent, beyond as a ratio."""
    more = replace(judged(less=122.0, low=100.0, high=150.0, trials=30), less_is_better=False)
    assert "122 % more than mpc-smooth (30 pairs; interval 100 to 150 %)" in winner_text(more)
    far = replace(more, less_pct=310.0, interval_pct=(250.0, 400.0))
    assert "4.10 times as much as mpc-smooth (30 pairs; interval 3.50 to 5 times)" in winner_text(far)


def test_less_than_a_third_is_a_ratio():
    """And no percentage stands beside it."""
    said = winner_text(judged(less=88.0, low=85.0, high=91.0))
    assert "0.120 times as much as mpc-smooth (12 pairs; interval 0.0900 to 0.150 times)" in said and "%" not in said


@pytest.mark.parametrize(
    ("one", "told"),
    [
        (judged(low=-2.69, high=3.0), "not told apart: {} (12 pairs; interval -2.69 to 3 %)."),
        (judged(low=0.0), "not told apart: {} (12 pairs; interval 0 to 15 %)."),
        (judged(low=-1.0, trials=3), "too few pairs: {} (3 pairs; interval -1 to 15 %)."),
        (judged(trials=5), "too few pairs: {} (5 pairs; interval 5 to 15 %)."),
        (judged(trials=1, low=None), "too few pairs: {} (1 pair; no interval)."),
    ],
)
def test_neither_is_ahead_where_the_interval_contains_zero_or_pairs_are_few(one, told):
    """Both figures stand there with the number of pairs, and neither is less than the other."""
    said = winner_text(one)
    assert said == told.format("wake-aware 0.900, mpc-smooth 1 mm RMSE")
    assert "best" not in said and "less" not in said


def test_the_price_of_less_wash_counts_silt():
    """Silt between camera and target stands beside energy; what is alike, or was not measured, is left out."""
    assert cost_text(replace(judged(), silt_ratio=1.81)) == (
        "wake-aware takes as much energy as mpc-smooth. Silt between camera and target: 1.81 times that of mpc-smooth. "
        "No trial failed."
    )
    assert "Silt" not in cost_text(judged()) + cost_text(replace(judged(), silt_ratio=1.0))
    places = [
        {"world": "mud", "method": method, "target": "brain", "seed": seed, "reason": None}
        | {"figures": {"rmse_mm": rmse, "energy_kJ": 2.0, "ray_optical_depth": silt * seed}}
        for seed in (1, 2)
        for method, rmse, silt in (("dp", 1.0, 0.1), ("wake-aware", 0.9, 0.3))
    ]
    found = summarize(ComparisonMetric("rmse_mm", "mm RMSE", 1.0, True), "mud", places)
    assert found is not None and found.silt_ratio == pytest.approx(3.0) and found.energy_ratio == pytest.approx(1.0)


def test_a_campaigns_page_puts_no_method_ahead_by_two_pairs(tmp_path):
    """Headline and table say that the pairs are too few."""
    page = campaign_page(campaign(seeds=2), tmp_path)
    assert "less than" not in page and "too few pairs: " in page


@pytest.mark.parametrize(
    ("less", "ends", "told"),
    [
        (31.0, (26.0, 35.0), ("31 %", "(26 to 35)")),
        (-81.0, None, ("-81 %", "")),
        (66.0, (60.0, 66.6), ("66 %", "(60 to 66.6)")),
        (88.0, None, ("0.120 times as much", "")),
        (60.0, (50.0, 70.0), ("0.400 times as much", "(0.300 to 0.500 times)")),
        (-200.0, (-200.0, -100.0), ("-200 %", "(-200 to -100)")),
        (-276.0, None, ("3.76 times as much", "")),
        (-11990.0, (-363079.0, -3492.0), ("121 times as much", "(35.9 to 3632 times)")),
        (-50.0, (-900.0, 10.0), ("1.50 times as much", "(0.900 to 10 times)")),
        (None, None, ("–", "")),
    ],
)
def test_beyond_a_factor_of_three_a_difference_is_a_ratio(less, ends, told):
    """Less or more; value and interval have one form."""
    assert percent(less, ends) == told


def test_rows_of_the_papers_tables_tell_ratios_so():
    """In tables and in sentences; rows of another kind keep their unit."""
    row = {"reading": "less_pct", "ours": -11990.0, "low": -363079.0, "high": -3492.0, "unit": "%", "world": "field",
           "target": None, "n": 21, "figure": "silt", "method": "wake-aware", "met": False, "met_by_all": None,
           "told_apart": True, "preliminary": False, "sure": True}  # fmt: skip
    assert sentences.our_value(row) == "121 times as much" and sentences.interval(row) == "35.9 to 3632 times"
    assert sentences._measured(row) == "121 times as much (35.9 to 3632 times), n = 21"
    assert sentences.our_value(row | {"reading": "mean", "ours": 4.0, "unit": "mm"}) == "4 mm"


def row(world, met, figure="wash", **told):
    """A row of a table, judged."""
    row = {"world": world, "met": met, "sure": None, "paper": 60.0, "method": "wake-aware", "figure": figure,
           "setup": setup_of(world, None), "met_by_all": None, "preliminary": None, "told_apart": None, "ours": 1.0,
           "low": None, "high": None, "n": 30, "reading": "mean"}  # fmt: skip
    return row | told


def test_a_count_of_what_is_met_names_each_world():
    """The paper's own set-up first, then world by world; the circular one says that it is."""
    rows = [
        row("payload", True),
        row("paper", True),
        row("pump-tank", False),
        row("pump-tank", True, "rmse", sure=True, met_by_all=True),
        row("payload", False, "late"),
    ]
    assert sentences.met_of({"station": rows}) == (
        "1 of 2 figures met in the paper's own set-up, pump-tank (1 surely, 1 by every method); 1 of 2 in payload; "
        "1 of 1 in paper (circular)"
    )
    assert sentences.met_of({"solver": [row("-", True)]}) == "1 of 1 figure met without a flight"
    assert sentences.met_of({"station": []}) == "no figure of the paper is judged here"


LESS = {"reading": "less_pct", "ours": 40.0, "low": 30.0, "high": 50.0, "told_apart": True, "sure": True}


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({}, "met"),
        ({"n": 12, "preliminary": True}, "met, preliminary (n = 12)"),
        ({"n": 5, "preliminary": True, "told_apart": False, "sure": False}, "met, too few pairs (n = 5)"),
        ({"low": -3.0, "told_apart": False, "met": False}, "not met, not told apart (30 pairs; interval -3 to 50 %)"),
        ({"low": -3.0, "told_apart": False, "met": None}, "not told apart (30 pairs; interval -3 to 50 %)"),
        ({"met_by_all": True}, "met, by every method here"),
        ({"sure": False}, "met, unsure"),
    ],
)
def test_a_verdict_on_a_difference_says_what_its_pairs_show(told, said):
    """Few, not told apart, preliminary, or met by every method."""
    assert sentences.verdict(row("pump-tank", **({"met": True} | LESS | told))) == said


def test_a_verdict_on_a_mean_needs_no_pairs():
    """But says of a single trial that it is one."""
    assert sentences.verdict(row("payload", False, n=1)) == "not met, one trial"
    assert sentences.verdict(row("payload", True, n=3, sure=False)) == "met, unsure"
    assert sentences.verdict(row("payload", None)) == ""


def test_the_papers_percentage_has_its_factor_beside_it_beyond_three():
    """As it stands in the paper, and as ours is given; the standard deviation follows a mean."""
    quoted = row("payload", True, **LESS, paper_sd=None) | {"paper": 67.0}
    assert sentences.quoted(quoted) == "67 % (0.330 times as much)"
    assert sentences.quoted(quoted | {"paper": 31.0}) == "31 %"
    assert sentences.quoted(row("payload", True, paper_sd=0.4) | {"paper": 1.9}) == "1.9 ± 0.4"
    more = quoted | {"reading": "more_pct", "paper": 40.0, "ours": 310.0, "low": 250.0, "high": 400.0}
    assert sentences.quoted(more) == "40 %" and sentences.our_value(more) == "4.10 times as much"
    assert sentences.interval(more) == "3.50 to 5 times"


@pytest.mark.parametrize(
    ("seconds", "said"), [(0.0, "0 s"), (40.0, "40 s"), (720.0, "12 min"), (12600.0, "3.5 h"), (None, "–")]
)
def test_times_are_in_the_unit_that_people_say(seconds, said):
    """No 0.0 h of trials."""
    assert duration(seconds) == said


def test_code_between_backticks_is_code():
    """On every gap of a page; the words around it are text."""
    assert prose("of `stages: <b>`") == "of <code>stages: &lt;b&gt;</code>"
    assert "<code>stages: model</code>" in missing("pictures", "they are kept of trials of `stages: model`")


def test_a_chip_has_its_colour_wherever_it_stands_and_scenes_follow_the_page(tmp_path):
    """The style does not ask in what it stands; a 3D scene is dark where the page is."""
    style = resources.files("wakewise.ui.reports").joinpath("templates", "page.css").read_text(encoding="utf-8")
    assert re.search(r"^\.chip i \{", style, re.MULTILINE) and ".legend .chip" not in style
    assert '<i style="background:#123456">' in legend_entry("#123456", "seen well")
    config = "window.__VISER_EMBED_CONFIG__={darkMode:false}"
    assert "prefers-color-scheme: dark" in scene_box(f"<html>{config}</html>", "")
