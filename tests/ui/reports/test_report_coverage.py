"""The report's part on coverage: what it says and what it does without."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from wakewise.ui.reports.model import coverage_html
from wakewise.ui.reports.page import PageParts
from wakewise.ui.reports.trial import Trial, read_trial


@pytest.fixture(scope="module")
def trial(made_up: Path) -> Trial:
    return read_trial(made_up)


def test_the_share_and_the_reasons_are_the_whole(trial: Trial) -> None:
    """What is seen well and what is not, by reason, come to a hundred percent but for rounding; five pictures."""
    html = coverage_html(trial, PageParts())
    shares = [float(found) for found in re.findall(r"(\d+) % (?:of the target|is in no|is only|is shown)", html)]
    assert 98.0 <= sum(shares) <= 102.0
    assert html.count("<img") == 5
    assert "In the model" in html


def test_a_trial_without_poses_or_truth_leaves_a_gap(trial: Trial) -> None:
    """What cannot be shown is named, with what is missing."""
    gap = coverage_html(replace(trial, photographs=()), PageParts())
    assert "cannot be shown" in gap
    gap = coverage_html(replace(trial, truth=None, missing={"truth.ply": "was not written"}), PageParts())
    assert "truth.ply was not written" in gap
