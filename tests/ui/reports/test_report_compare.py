"""Laws of the comparison page."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from wakewise.core.errors import InputError
from wakewise.experiments.trials.metrics import BETTER
from wakewise.ui.reports import write_comparison

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def rough(made_up: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The made-up trial again, with another method and twice the speed at the target."""
    folder = tmp_path_factory.mktemp("rough") / "dp"
    shutil.copytree(made_up, folder, ignore=shutil.ignore_patterns("report.html", "dense.ply"))
    metrics = json.loads((folder / "metrics.json").read_text())
    metrics["target_speed_mean_m_s"] *= 2
    (folder / "metrics.json").write_text(json.dumps(metrics | {"method": "dp"}))
    return folder


def test_methods_stand_side_by_side_with_ratios_to_the_first(made_up: Path, rough: Path, tmp_path: Path) -> None:
    """Half the speed is the ratio 0.500 and the better value; a method without a model says so."""
    path = write_comparison({"dp": rough, "wake-aware": made_up}, tmp_path)
    text = path.read_text()
    assert path == tmp_path / "comparison.html"
    assert "moved at 0.500 times its speed with dp" in text
    row = text[text.index(">target_speed_mean_m_s<") :].split("</tr>")[0]
    assert row.index("num better") > row.index('class="num"')
    assert "× 0.500" in row
    assert "The model of dp</b> cannot be shown: dense.ply was not written" in text
    assert text.count("data:image/jpeg;base64,") == 6
    for key in json.loads((made_up / "metrics.json").read_text()).keys() - {"why", "definitions"}:
        assert f">{key}</td>" in text


def changed(trial: Path, folder: Path, **figures: object) -> Path:
    """A copy of a trial with other figures."""
    shutil.copytree(trial, folder, ignore=shutil.ignore_patterns("*.html", "*.ply", "images", "steps.parquet"))
    metrics = json.loads((folder / "metrics.json").read_text())
    (folder / "metrics.json").write_text(json.dumps(metrics | figures))
    return folder


def test_the_page_leads_with_verdict_and_names_for_people_and_ends_with_keys(
    made_up: Path, rough: Path, tmp_path: Path
) -> None:
    """Verdict, a short table in plain words, pictures; the long table of machine keys comes last."""
    text = write_comparison({"dp": rough, "wake-aware": made_up}, tmp_path).read_text()
    order = [text.index(mark) for mark in ("<h1", 'id="main"', 'id="model"', 'id="seen"', 'id="water"', 'id="figures"')]
    assert order == sorted(order)
    main = text[order[1] : order[2]]
    assert "wash at the target" in main
    assert "target_speed_mean_m_s" not in text[: order[5]]


def test_one_flight_each_is_called_one_draw(made_up: Path, rough: Path, tmp_path: Path) -> None:
    """Before any figure the page says that a ratio of two single flights claims nothing; one trial has no ratio."""
    text = write_comparison({"dp": rough, "wake-aware": made_up}, tmp_path).read_text()
    assert text.index("One draw.") < text.index('id="main"')
    assert "no interval" in text
    assert "One draw." not in write_comparison({"dp": rough}, tmp_path).read_text()


def test_every_figure_with_a_better_side_has_its_better_value_bold(made_up: Path, tmp_path: Path) -> None:
    """The side comes from the figures' own table, whichever figure it is; where neither side is better none is bold."""
    high = dict.fromkeys(BETTER, 4.0) | {"why": {}}
    low = dict.fromkeys(BETTER, 2.0) | {"why": {}}
    trials = {
        "a": changed(made_up, tmp_path / "a", **high | {"method": "dp"}),
        "b": changed(made_up, tmp_path / "b", **low | {"method": "allocation-only"}),
    }
    text = write_comparison(trials, tmp_path).read_text()
    for key, better in BETTER.items():
        row = text[text.index(f'<td class="key">{key}</td>') :].split("</tr>")[0]
        bold = re.findall(r'<td class="num better">(\d)</td>', row)
        assert bold == ([] if better == "none" or key == "method" else ["2" if better == "less" else "4"]), key


def test_a_worse_estimate_beside_calmer_water_is_explained(made_up: Path, tmp_path: Path) -> None:
    """D above, speed below: one sentence says that D is the wake model's estimate; else there is none."""
    dp = changed(made_up, tmp_path / "dp", disturbance_flown=1.0, disturbance=2.0, target_speed_mean_m_s=0.02)
    calm = changed(made_up, tmp_path / "calm", disturbance_flown=1.23, disturbance=7.0, target_speed_mean_m_s=0.01)
    text = write_comparison({"dp": dp, "calm": calm}, tmp_path).read_text()
    assert "disturbance_flown of calm is 1.23 times as high although its water is calmer" in text
    assert "although its water is calmer" not in write_comparison({"calm": calm, "dp": dp}, tmp_path).read_text()


def test_the_file_may_be_named(made_up: Path, tmp_path: Path) -> None:
    """A path that ends in .html is the file itself; one trial alone is a comparison too."""
    bare = tmp_path / "bare"
    shutil.copytree(made_up, bare, ignore=shutil.ignore_patterns("report.html", "*.ply", "images", "steps.parquet"))
    path = write_comparison({"only": bare}, tmp_path / "deep" / "page.html")
    assert path.name == "page.html"
    assert "cannot be shown: no trial recorded the speed at the target" in path.read_text()


def test_a_comparison_needs_trials(tmp_path: Path) -> None:
    """None, or a folder that is not there, is bad input."""
    for trials in ({}, {"dp": tmp_path / "none"}):
        with pytest.raises(InputError):
            write_comparison(trials, tmp_path)
