"""What a figure of the paper is, and the figures themselves."""

import math
from pathlib import Path

import pytest
import yaml

from wakewise_paper.reproduction.claim import CLAIMS, TABLES, UNKNOWN, UNMEASURED, UNQUOTED, PublishedFigure

EVERY = [(name, claim) for name, claims in CLAIMS.items() for claim in claims]


def _claim(**told):
    return PublishedFigure(**{"method": "m", "figure": "f", "title": "t", "unit": "", "said": "", "how": "h"} | told)


@pytest.mark.parametrize(("side", "better", "worse"), [("less", 1.0, 3.0), ("more", 3.0, 1.0)])
def test_a_claim_is_met_on_its_side_and_at_its_value(side, better, worse):
    """Equal is met; nothing measured is neither."""
    claim = _claim(paper=2.0, side=side)
    assert (claim.met(better), claim.met(2.0), claim.met(worse), claim.met(None)) == (True, True, False, None)


def test_what_is_not_quoted_is_judged_by_what_is_asked_or_not_at_all():
    """A direction can be asked where the number is not known."""
    assert _claim(paper=None, side="more", asked=0.0).met(5.0) is True
    assert _claim(paper=None, side="none").met(5.0) is None
    assert _claim(paper=2.0, side="more", asked=9.0).bar == 2.0


def test_every_table_of_the_paper_has_its_claims():
    """All but the comparison, whose cells are not quoted."""
    assert set(CLAIMS) == set(TABLES)
    assert [name for name, claims in CLAIMS.items() if not claims] == ["comparison"]


@pytest.mark.parametrize(("name", "claim"), EVERY)
def test_a_number_of_the_paper_is_finite_and_one_that_is_not_known_says_so(name, claim):
    """And each says how it is measured, and against whom a difference is."""
    assert claim.how and claim.title
    assert (claim.than is not None) == (claim.reading == "less_pct")
    if claim.paper is None:
        assert claim.said and (claim.side == "none" or claim.asked is not None), (name, claim.title)
    else:
        assert math.isfinite(claim.paper) and claim.said != UNQUOTED


def test_the_figures_that_the_records_quote_are_among_them():
    """Values, with their method, as the paper's tables and sections have them."""
    known = {
        (name, c.method, c.figure, c.than): c.paper
        for name, c in EVERY
        if c.paper is not None and c.reading not in ("made_pct", "more_pct")
    }
    rmse = {m: known["dynamic", m, "rmse_mm", None] for m in ("manual", "mpc", "mpc-smooth", "wake-aware")}
    assert rmse == {"manual": 8.7, "mpc": 4.3, "mpc-smooth": 2.8, "wake-aware": 1.9}
    assert known["dynamic", "wake-aware", "completeness_pct", None] == 94.8
    assert known["success", "wake-aware", "success", None] == 98.5
    assert known["station", "wake-aware", "position_rmse_mm", None] == 2.1
    assert known["station", "dp-paper", "position_rmse_mm", None] == 2.3
    energy = {m: known["station", m, "energy_kJ", None] for m in ("dp-paper", "wake-aware")}
    assert energy == {"dp-paper": 16.2, "wake-aware": 11.2}
    rivals = ("energy_kJ", "roll_pitch_rms_deg", "target_speed_mean_m_s")
    assert {f: known["station", "wake-aware", f, "dp-paper"] for f in rivals} == dict(
        zip(rivals, (31.0, 45.0, 67.0), strict=True)
    )
    assert {than for table, _, f, than in known if table == "station" and f in rivals} == {None, "dp-paper"}
    parts = ("wake-aware", "mpc", "linear", "six thrusters")
    assert [known["ablation", m, "rmse_mm", None] for m in parts] == [1.9, 4.1, 3.2, 3.8]
    assert [known["ablation", m, "success", None] for m in parts] == [100.0, 65.0, 75.0, 70.0]
    assert known["sediment", "wake-aware", "target_speed_mean_m_s", "mpc"] == 62.0
    shares = {m: known["dynamic", m, "success", None] for m in ("manual", "mpc", "mpc-smooth", "wake-aware")}
    assert shares == {"manual": 0.0, "mpc": 45.0, "mpc-smooth": 85.0, "wake-aware": 98.3}
    seen = [known["dynamic", m, "features_per_image", None] for m in ("manual", "mpc", "mpc-smooth", "wake-aware")]
    assert seen == [156.0, 342.0, 448.0, 523.0]
    whole = {m: known["dynamic", m, "completeness_pct", None] for m in ("manual", "mpc", "mpc-smooth", "wake-aware")}
    assert whole == {"manual": 34.2, "mpc": 68.5, "mpc-smooth": 87.0, "wake-aware": 94.8}
    assert known["success", "mpc", "success", None] == 45.0
    assert known["solver", "wake-aware", "ms_mean", None] == 45.0
    assert known["wake", "paper", "r2_core", None] == 0.99
    assert known["operator", "wake-aware, w_track 5", "velocity_deviation_pct", None] == 15.0
    shares = 100.0 * (1.0 - 0.06 / 0.18)
    assert known["flow", "wake-aware", "piv_speed_m_s", "mpc"] == pytest.approx(shares, abs=0.5)
    assert UNKNOWN


def _of(table, figure, **told):
    """The only claim of a table with this figure and these fields."""
    (found,) = (
        c
        for name, c in EVERY
        if name == table and c.figure == figure and all(getattr(c, key) == value for key, value in told.items())
    )
    return found


def test_results_that_are_stated_in_the_text_alone_are_among_them():
    """Largest roll and pitch, silt, valid models and reductions as the paper words them, each with its section."""
    most = [_of("station", "roll_pitch_max_deg", method=method) for method in ("wake-aware", "dp-paper")]
    assert [c.paper for c in most] == [1.2, 2.1] and most[0].side == "less" and "Gentle Stability" in most[0].where
    silt = _of("sediment", "rmse_mm", reading="more_pct")
    assert (silt.paper, silt.side, silt.worlds, silt.against) == (40.0, "less", ("caco3",), "pump-tank")
    made = {m: _of("dynamic", "rmse_mm", method=m, reading="made_pct") for m in ("manual", "mpc-smooth", "wake-aware")}
    assert [c.paper for c in made.values()] == [0.0, 85.0, 100.0]
    less = [_of("dynamic", "rmse_mm", than=than) for than in ("manual", "mpc")]
    assert [c.paper for c in less] == [78.2, 55.0] and all(c.where for c in less)
    assert _of("solver", "ms_mean", method="wake-aware").sd == 12.0
    spread = {m: _of("dynamic", "rmse_mm", method=m, reading="mean", itt=False).sd for m in ("manual", "wake-aware")}
    assert spread == {"manual": 3.2, "wake-aware": 0.4}


@pytest.mark.parametrize(("name", "claim"), [pair for pair in EVERY if pair[1].paper is not None])
def test_every_number_of_the_paper_has_its_table_or_section(name, claim):
    """Or the figure that it stands in."""
    assert any(word in claim.where for word in ("table", "section", "figure")), (name, claim.title)


def test_results_without_a_measure_here_are_listed_with_the_reason():
    """With value and place."""
    assert UNMEASURED and all("section" in one or "figure" in one for one in UNMEASURED)
    assert all("Not measured here: " in one for one in UNMEASURED)


def test_the_baseline_is_the_method_that_the_paper_compares_with():
    """A quoted difference has its own; what is held against another method here keeps the paper's."""
    assert _of("dynamic", "rmse_mm", than="manual").baseline == "manual"
    assert _of("station", "energy_kJ", than="dp").baseline == "dp-paper"
    assert _of("sediment", "rmse_mm", reading="more_pct").baseline == "wake-aware in clear water"
    assert _of("solver", "ms_mean", method="wake-aware").baseline is None


def test_the_paper_is_named_where_readers_and_citers_look():
    """Title and authors stand in README, CITATION.cff and the page of the tables."""
    root = Path(__file__).parents[4]
    for name in ("README.md", "CITATION.cff", "docs/reproduce.md"):
        text = " ".join((root / name).read_text(encoding="utf-8").split())
        assert "Disturbance-Aware Motion Planning for Over-Actuated Underwater Vehicles" in text, name
        assert all(author in text for author in ("Gao", "Xu", "Liu", "Cai")), name
    cited = yaml.safe_load((root / "CITATION.cff").read_text(encoding="utf-8"))["references"]
    assert [author["family-names"] for author in cited[0]["authors"]] == ["Gao", "Xu", "Liu", "Cai"]
