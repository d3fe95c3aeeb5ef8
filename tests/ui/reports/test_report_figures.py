"""Laws of the plots and of their way into the page."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from wakewise.ui.reports.figures import (
    exposure_times,
    legs,
    outlines,
    position_error_m,
    thrust_columns,
    water_over_time,
)
from wakewise.ui.reports.media import embedded_width, extremes
from wakewise.ui.reports.svg_style import inline_svg, new_figure, style_axes, thinned
from wakewise.ui.reports.trial import read_trial


@given(hnp.arrays(np.float64, st.integers(1, 400), elements=st.floats(-1e6, 1e6)), st.integers(1, 40))
def test_a_thinned_line_keeps_its_extremes(y: np.ndarray, buckets: int) -> None:
    """However few points are kept, the highest and the lowest are among them, in order of time."""
    x = np.arange(len(y), dtype=float)
    x_kept, y_kept = thinned(x, y, buckets)
    assert (y_kept.min(), y_kept.max()) == (y.min(), y.max())
    assert (np.diff(x_kept) > 0).all()
    assert len(x_kept) <= max(2 * buckets, 1)


def test_an_inline_svg_follows_the_page() -> None:
    """Colours become CSS variables, size is left to the page, nothing names a host."""
    figure = new_figure(3, 2)
    axes = figure.subplots()
    style_axes(axes, x="time (s)")
    axes.plot([0, 1], [0, 1])
    svg = inline_svg(figure, "a line")
    assert "var(--muted)" in svg
    assert "#010a" not in svg
    assert "http" not in svg
    assert not re.search(r"<svg[^>]*\s(width|height)=", svg)
    assert set(re.findall(r'href="#([^"]+)"', svg)) <= set(re.findall(r'\sid="([^"]+)"', svg))


def test_the_outline_of_a_square_is_the_square() -> None:
    """Area and corners are kept to a pixel."""
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2.0]])
    (line,) = outlines(square, np.array([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose([line.min(axis=0), line.max(axis=0)], [[0, 0], [2, 2]], atol=2 * 2 / 700)


def test_legs_follow_one_another_without_gaps(made_up: Path) -> None:
    """Each leg starts where the one before ends, and all exposures are known."""
    trial = read_trial(made_up)
    spans = list(legs(trial))
    assert [a[2] for a in spans[:-1]] == [b[1] for b in spans[1:]]
    assert spans[0][0] == "orbit 20 deg"
    assert len(exposure_times(trial)) == 14
    assert thrust_columns(trial) == [f"thrust_{i}_N" for i in range(1, 9)]


def test_position_error_is_the_distance(made_up: Path) -> None:
    """Against the definition, and absent where one of the two was not recorded."""
    trial = read_trial(made_up)
    error = position_error_m(trial, "true", "goal")
    assert error is not None
    assert error[5] == pytest.approx(np.linalg.norm(trial.positions("true")[5] - trial.positions("goal")[5]))
    assert position_error_m(trial, "true", "dreamt") is None


def test_every_record_gets_a_row(made_up: Path) -> None:
    """Target, bed, disturbance, turbidity and position stand one above the other."""
    figure = water_over_time(read_trial(made_up))
    assert figure is not None
    assert len(figure.axes) == 5


def test_the_sharpest_and_the_least_sharp_are_found(made_up: Path) -> None:
    """By the recorded sharpness."""
    shots = read_trial(made_up).photographs
    marked = extremes(shots)
    values = [shot.sharpness for shot in shots]
    assert values[marked.sharpest] == max(values)
    assert values[marked.worst] == min(values)
    assert extremes(shots[:1]).sharpest is None


@given(st.integers(0, 5000), st.integers(0, 5000))
def test_more_photographs_are_embedded_smaller(a: int, b: int) -> None:
    """Never larger, and never so small that nothing can be seen."""
    few, many = sorted((a, b))
    assert embedded_width(few) >= embedded_width(many) >= 320
