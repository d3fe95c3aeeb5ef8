"""The operator's picture says what the bench found, and where."""

import pytest

from wakewise.errors import InputError
from wakewise.reports.operator import draw_operator


def result():
    keys = ("disturbance_reduction_pct", "velocity_deviation_pct")
    more = ("velocity_deviation_planned_pct", "velocity_deviation_floor_pct")
    sweep = {f"{w:g}": dict.fromkeys(keys + more, 10.0 + w) for w in (1.0, 2.0, 5.0, 10.0, 20.0)}
    return {"w_track": sweep, "w_track_over": sweep}


def test_both_courses_and_every_weight_are_drawn(tmp_path):
    """Two panels, five weights on each axis, four lines each with a name."""
    path = tmp_path / "operator.svg"
    draw_operator(result(), path)
    text = path.read_text()
    assert text.count("<!-- w_track -->") == 2
    for words in ("<!-- 1 -->", "<!-- 20 -->", "<!-- velocity deviation -->", "<!-- disturbance lower by -->"):
        assert words in text


def test_an_unknown_ending_is_refused(tmp_path):
    """The message names the endings that can be drawn; nothing is left behind."""
    with pytest.raises(InputError, match=r"\.png"):
        draw_operator(result(), tmp_path / "operator.gif")
    assert not list(tmp_path.iterdir())
