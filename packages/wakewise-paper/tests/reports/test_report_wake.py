"""The page on wake models: every flow and model is on it, gaps say why, plots exist for all flows."""

from __future__ import annotations

from dataclasses import replace

import pytest

from wakewise_paper.reports.wake import decays, main_flow, profiles, scatters, wake_page
from wakewise_paper.wake_validation import ValidationOptions, figures, validate


@pytest.fixture(scope="module")
def result():
    whole = validate(ValidationOptions(quick=True))
    return replace(whole, flows=whole.flows[:2])


@pytest.fixture(scope="module")
def page(result):
    return wake_page(result, figures(result))


def test_the_page_names_every_model_and_flow(result, page):
    """Each is in the tables, with the paper's own figures beside them."""
    for name in (*result.verdicts, *(flow.name for flow in result.flows), *result.absent):
        assert name in page
    assert "0.99" in page
    assert "0.82" in page
    assert "cannot be shown" in page


def test_the_page_says_that_the_printed_formula_fails(page):
    """It does so under its headline and flow by flow."""
    assert "does not describe" in page
    assert "Where the printed formula fails" in page


@pytest.mark.slow
def test_the_headline_says_which_model_to_use(result, page):
    """The model whose worst R2 over flows and regions is best; other figures, another answer; none good, no advice."""
    assert "Use jet-fitted." in page[page.index("<h1") : page.index("</h1>")]
    values = figures(result)
    for cell in values["models"]["linear"].values():
        if cell["r2_core"] is not None:
            cell["r2_core"] = cell["r2_wake"] = 0.9999
    assert "Use linear." in wake_page(result, values)
    for cells in values["models"].values():
        for cell in cells.values():
            if cell["r2_core"] is not None:
                cell["r2_core"] = -2.0
    assert "No model fits every flow" in wake_page(result, values)


def test_every_flow_is_explained_where_it_is_first_named(result, page):
    """The lead of the first table says what each flow is; a hopeless R2 is not spelt out in the head."""
    lead = page[page.index('id="table"') : page.index("<table")]
    for flow in figures(result)["flows"].values():
        assert flow["title"] in lead
    assert "below −1" in page[: page.index("<main")]


@pytest.mark.slow
def test_a_formula_that_would_hold_is_not_called_a_failure(result):
    """The verdict follows the figures: with good ones in their place the headline turns."""
    values = figures(result)
    for cell in values["models"]["paper"].values():
        if cell["r2_core"] is not None:
            cell["r2_core"] = cell["r2_wake"] = 0.97
    page = wake_page(result, values)
    assert "does not describe" not in page
    assert "Where the printed formula fails" not in page


def test_plots_have_a_panel_for_every_model_or_flow(result):
    """Scatter: one panel per model. Profile and decay: one per flow, with the flow and all models in it."""
    flow = main_flow(figures(result))
    assert [axes.get_title(loc="left") for axes in scatters(result, flow).axes] == list(result.verdicts)
    for figure in (profiles(result), decays(result)):
        shown = [axes for axes in figure.axes if axes.get_visible()]
        assert [axes.get_title(loc="left") for axes in shown] == [each.name for each in result.flows]
        assert len(shown[0].lines) == 1 + len(result.verdicts)
