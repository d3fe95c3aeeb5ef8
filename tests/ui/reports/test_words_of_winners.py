"""Nobody is called best whom the trials do not show to be; ratios are told as such; a count says of which worlds."""

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


def judged(low=5.0, high=15.0, trials=12, less=10.0, ours=0.9, theirs=1.0, rival="mpc-smooth"):
    """A comparison of two methods."""
    return MethodSummary(
        world="mud", figure="rmse_mm", words="mm RMSE", means={"wake-aware": ours, "mpc-smooth": theirs},
        winner="wake-aware", rival=rival, less_pct=less, interval_pct=None if low is None else (low, high), p_t=0.2,
        improvement=0.7,
        energy_ratio=1.0, failed={}, trials=trials,
    )  # fmt: skip


def test_best_is_who_is_surely_better():
    """With enough pairs and an interval that holds no zero."""
    assert winner_text(judged()) == (
        "wake-aware is best with 0.900 mm RMSE, 10 % (5 to 15) better than mpc-smooth; "
        "sure, the interval does not hold zero."
    )


@pytest.mark.parametrize(
    ("one", "why"),
    [
        (judged(low=-2.69, high=3.0, less=0.258), "undecided, the interval holds zero"),
        (judged(low=0.0), "undecided, the interval holds zero"),
        (judged(low=-1.0, trials=3), "3 pairs are too few to be sure"),
        (judged(trials=1, low=None), "one trial each: no interval"),
    ],
)
def test_no_difference_is_shown_where_it_may_be_chance(one, why):
    """Both figures stand there, and nobody is called best."""
    said = winner_text(one)
    assert said.startswith("no difference shown: wake-aware 0.900, mpc-smooth 1 mm RMSE") and said.endswith(f"{why}.")
    assert "best" not in said


def test_few_pairs_that_agree_are_told_as_what_came_out():
    """An interval without zero of a few pairs: who came out better, and that it is not sure."""
    assert winner_text(judged(trials=3)) == (
        "wake-aware came out better: wake-aware 0.900, mpc-smooth 1 mm RMSE, 10 % (5 to 15) apart; "
        "3 pairs are too few to be sure."
    )


def test_the_price_of_less_wash_counts_silt():
    """Silt between camera and target stands beside energy; what is alike, or was not measured, is left out."""
    assert cost_text(replace(judged(), silt_ratio=1.81)) == (
        "It takes as much energy as mpc-smooth. Silt between camera and target: 1.81 times that of mpc-smooth. "
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


def test_a_page_calls_nobody_best_whom_few_trials_favour(tmp_path):
    """Headline and table."""
    page = campaign_page(campaign(seeds=2), tmp_path)
    assert "is best" not in page and "2 pairs are too few to be sure" in page


@pytest.mark.parametrize(
    ("less", "ends", "told"),
    [
        (31.0, (26.0, 35.0), ("31 %", "(26 to 35)")),
        (-81.0, None, ("-81 %", "")),
        (-200.0, (-200.0, -100.0), ("-200 %", "(-200 to -100)")),
        (-276.0, None, ("3.76 times as much", "")),
        (-11990.0, (-363079.0, -3492.0), ("121 times as much", "(35.9 to 3632 times)")),
        (-50.0, (-900.0, 10.0), ("1.50 times as much", "(0.900 to 10 times)")),
        (None, None, ("–", "")),
    ],
)
def test_beyond_a_factor_of_three_a_difference_is_a_ratio(less, ends, told):
    """Value and interval alike."""
    assert percent(less, ends) == told


def test_rows_of_the_papers_tables_tell_ratios_so():
    """In tables and in sentences; rows of another kind keep their unit."""
    row = {"reading": "less_pct", "ours": -11990.0, "low": -363079.0, "high": -3492.0, "unit": "%", "world": "field",
           "target": None, "n": 21, "figure": "silt", "method": "wake-aware"}  # fmt: skip
    assert sentences.our_value(row) == "121 times as much" and sentences.interval(row) == "35.9 to 3632 times"
    assert sentences._place(row) == "field: 121 times as much (35.9 to 3632 times), n = 21"
    assert sentences.our_value(row | {"reading": "mean", "ours": 4.0, "unit": "mm"}) == "4 mm"


def row(world, met, figure="wash", paper=60.0):
    """A row of a table, judged."""
    return {"world": world, "met": met, "sure": None, "paper": paper, "method": "wake-aware", "figure": figure}


def test_a_count_of_what_is_met_says_in_which_worlds():
    """In the same sentence, with the count of the paper's own set-up; what is of no world says nothing of worlds."""
    rows = [
        row("pump-tank", False),
        row("payload", True),
        row("pump-tank", True, "rmse"),
        row("payload", False, "late"),
    ]
    said = sentences.met_of({"station": rows})
    assert said == (
        "2 of 3 figures that the paper quotes are met in any world at all, and 1 of 2 in pump-tank, the paper's own "
        "set-up"
    )
    assert sentences.met_of({"solver": [row("-", True)]}) == "1 of 1 figure that the paper quotes is met"


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
