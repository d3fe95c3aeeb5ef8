"""Laws of the yardsticks: each verdict follows from the figures, and each missing figure takes only its own away."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import polars as pl
import pytest
import yaml

from wakewise.ui.reports.references import (
    against_dp,
    against_grains,
    against_water,
    reference_comparisons,
    yardstick_html,
)
from wakewise.ui.reports.report import report_page
from wakewise.ui.reports.trial import read_trial

pytestmark = pytest.mark.usefixtures("undrawn")

FIGURES = {
    "target_speed_mean_m_s": 0.005,
    "ambient_speed_m_s": 0.04,
    "bed_shear_p95_Pa": 0.02,
    "grain_threshold_Pa": 0.06,
    "disturbance_flown": 0.03,
    "disturbance_least_thrusts": 0.05,
}


def judged(made_up: Path, folder: Path, method: str = "wake-aware", **figures: object) -> Path:
    """A trial without pictures whose figures are those above, some replaced; None takes one away."""
    shutil.copytree(made_up, folder, ignore=shutil.ignore_patterns("*.html", "*.ply", "images"))
    metrics = json.loads((folder / "metrics.json").read_text()) | FIGURES | {"method": method} | figures
    (folder / "metrics.json").write_text(json.dumps(metrics))
    tree = yaml.safe_load((folder / "scenario.yaml").read_text()) | {"method": method}
    tree.pop("versions", None)
    (folder / "scenario.yaml").write_text(yaml.safe_dump(tree))
    return folder


@pytest.mark.parametrize(
    ("own", "verdict", "good"),
    [
        (0.04, "small", True),
        (0.008, "slower than the water itself", True),
        (0.002, "faster", False),
        (0.0, "nothing", None),
    ],
)
def test_wash_is_judged_by_the_waters_own_speed(
    made_up: Path, tmp_path: Path, own: float, verdict: str, good: bool | None
) -> None:
    """Still water would read 0; then the share of the water's own speed decides."""
    found = against_water(read_trial(judged(made_up, tmp_path / "a", ambient_speed_m_s=own)))
    assert found is not None
    assert verdict in found.verdict
    assert found.good is good
    assert "would be 0" in found.sentence


def test_sharing_as_dp_is_called_an_estimate_until_dp_has_flown(made_up: Path, tmp_path: Path) -> None:
    """Alone it has no answer in figures, and says how to get one; beside a flight of dp the measured wash is it."""
    folder = judged(made_up, tmp_path / "wake-aware")
    alone = against_dp(read_trial(folder))
    assert alone is not None
    assert "%" not in alone.verdict and "not measured" in alone.verdict and alone.good is None
    assert "wakewise compare" in alone.sentence and "estimate" in alone.sentence
    judged(made_up, tmp_path / "dp", method="dp", target_speed_mean_m_s=0.01)
    beside = against_dp(read_trial(folder))
    assert beside is not None
    assert beside.verdict == "50 % less wash"
    assert any("measured" in bar.name for bar in beside.bars)
    own = against_dp(read_trial(tmp_path / "dp"))
    assert own is not None
    assert own.good is None


def test_a_dp_flight_of_another_scenario_is_no_yardstick(made_up: Path, tmp_path: Path) -> None:
    """Its settings must differ in the method alone."""
    folder = judged(made_up, tmp_path / "wake-aware")
    other = judged(made_up, tmp_path / "dp", method="dp", target_speed_mean_m_s=0.01)
    tree = yaml.safe_load((other / "scenario.yaml").read_text()) | {"seed": 99}
    (other / "scenario.yaml").write_text(yaml.safe_dump(tree))
    found = against_dp(read_trial(folder))
    assert found is not None
    assert "not measured: dp has not flown" in found.verdict


def test_the_bed_is_judged_by_its_grains_and_by_the_record(made_up: Path, tmp_path: Path) -> None:
    """Below on average and at every step: it stays put. Above for a few steps: said. Above on average: bad."""
    folder = judged(made_up, tmp_path / "a")
    quiet = against_grains(read_trial(folder))
    assert quiet is not None
    assert (quiet.verdict, quiet.good) == ("the bed stays put", True)
    steps = pl.read_parquet(folder / "steps.parquet")
    gusts = pl.Series([0.1 if i % 50 == 0 else 0.01 for i in range(steps.height)])
    steps.with_columns(bed_shear_p95_Pa=gusts).write_parquet(folder / "steps.parquet")
    gusty = against_grains(read_trial(folder))
    assert gusty is not None
    assert (gusty.verdict, gusty.good) == ("grains move now and then", None)
    assert " 2 % of the time" in gusty.sentence
    strong = against_grains(read_trial(judged(made_up, tmp_path / "b", bed_shear_p95_Pa=0.07)))
    assert strong is not None
    assert (strong.verdict, strong.good) == ("grains move", False)


def test_a_trial_without_these_figures_has_fewer_yardsticks_and_no_gap(made_up: Path, tmp_path: Path) -> None:
    """A folder of an earlier version keeps what it can say; with no speed at all the section goes."""
    old = dict.fromkeys(FIGURES) | {"target_speed_mean_m_s": 0.005}
    assert len(reference_comparisons(read_trial(judged(made_up, tmp_path / "a", **old)))) == 1
    assert yardstick_html(read_trial(judged(made_up, tmp_path / "b", **dict.fromkeys(FIGURES)))) == ""


def test_the_answer_comes_first_then_its_yardstick_then_the_model(made_up: Path, tmp_path: Path) -> None:
    """Thumbnails and plots of the flight stand below; the headline names the method, and what came from outside."""
    text = report_page(read_trial(judged(made_up, tmp_path / "a", method="lab.steer:make")))
    marks = ("<h1", 'id="yardstick"', 'id="model"', 'id="flown"', 'id="seen"', 'id="water"', 'id="figures"')
    order = [text.index(mark) for mark in marks]
    assert order == sorted(order)
    assert "Success with lab.steer:make" in text
    assert "Controller from outside: lab.steer:make" in text


def test_a_reason_is_given_once(made_up: Path, tmp_path: Path) -> None:
    """Many figures fail for one reason: it is written out once in the table, and not in every tile."""
    lost = {"rmse_mm": None, "completeness_pct": None, "f_score": None, "registered_images": None, "success": False}
    why = dict.fromkeys(lost, "no model: the sea was black")
    text = report_page(read_trial(judged(made_up, tmp_path / "a", **lost, why=why)))
    assert text.count("no model: the sea was black") == 1
    assert text.count("The sea was black") == 1
