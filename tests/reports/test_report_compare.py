"""Laws of the comparison page."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from wakewise.errors import InputError
from wakewise.reports import write_comparison


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
