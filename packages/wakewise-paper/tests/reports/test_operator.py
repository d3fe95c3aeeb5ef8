"""The operator's picture says what the bench found, and where."""

import pytest

from wakewise.core.errors import InputError
from wakewise_paper.reports.operator_bench_plot import draw_operator

W_TRACKS = ("1", "2", "5", "10", "20")


def result(wash=80.0):
    keys = ("velocity_deviation_pct", "target_speed_reduction_pct", "target_speed_reduction_all_pct")
    sweep = {w: dict(zip(keys, (20.0 - float(w), wash, wash), strict=True)) for w in W_TRACKS}
    worlds = {name: {"w_track": sweep} for name in ("payload", "mud")}
    return {"worlds": worlds, "paper": {"w_track": sweep, "w_track_over": sweep}}


def test_worlds_and_the_papers_own_are_drawn_with_the_claim(tmp_path):
    """Two panels, a line with a name for each world, the ends' weights in figures, the corner that is claimed."""
    path = tmp_path / "operator.svg"
    draw_operator(result(), path)
    text = path.read_text()
    for words in ("payload", "mud", "in front", "above", "1", "20", "the claim, at w_track 5"):
        assert f"<!-- {words} -->" in text
    assert text.count("<!-- the claim, at w_track 5 -->") == 2


def test_a_figure_that_is_missing_leaves_its_mark_out(tmp_path):
    """The rest is drawn."""
    found = result()
    found["worlds"]["mud"]["w_track"] = {"5": dict.fromkeys(found["worlds"]["mud"]["w_track"]["5"])}
    draw_operator(found, tmp_path / "operator.png")
    assert (tmp_path / "operator.png").stat().st_size > 10_000


def test_an_unknown_ending_is_refused(tmp_path):
    """The message names the endings that can be drawn; nothing is left behind."""
    with pytest.raises(InputError, match=r"\.png"):
        draw_operator(result(), tmp_path / "operator.gif")
    assert not list(tmp_path.iterdir())
