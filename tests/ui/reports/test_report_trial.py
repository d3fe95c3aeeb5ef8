"""Laws of reading a trial folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import trimesh
import yaml

from wakewise.ui.reports.report import report_page
from wakewise.ui.reports.trial import read_trial

pytestmark = pytest.mark.usefixtures("undrawn")


def test_a_whole_folder_is_read_whole(made_up: Path) -> None:
    """Nothing is missing, poses and positions come in as they were written."""
    trial = read_trial(made_up)
    assert not trial.missing
    assert (trial.method, trial.seed, trial.bed_z_m) == ("wake-aware", "7", 1.5)
    assert len(trial.photographs) == len(trial.planned) == 14
    steps = pl.read_parquet(made_up / "steps.parquet")
    np.testing.assert_array_equal(trial.positions("true")[:, 1], steps["true_y_m"].to_numpy())
    shot = trial.photographs[3]
    row = pl.read_csv(made_up / "images.csv").row(3, named=True)
    assert shot.X_WC_true is not None
    np.testing.assert_allclose(shot.X_WC_true.p_m, [row["true_x_m"], row["true_y_m"], row["true_z_m"]])


def test_columns_that_hold_nothing_are_absent(made_up: Path, tmp_path: Path) -> None:
    """A column of NaN says as little as no column."""
    folder = tmp_path / "trial"
    shutil.copytree(made_up, folder, ignore=shutil.ignore_patterns("images", "*.ply"))
    steps = pl.read_parquet(folder / "steps.parquet").with_columns(turbidity_per_m=pl.lit(float("nan")))
    steps.write_parquet(folder / "steps.parquet")
    trial = read_trial(folder)
    assert trial.column("turbidity_per_m") is None
    assert trial.column("never_recorded") is None
    assert trial.column("exposing") is not None


def test_the_bed_is_the_tanks_however_large_the_target(made_up: Path, tmp_path: Path) -> None:
    """A scenario whose target has a size_m of its own leaves the tank its size, in the bed's depth and in the scene."""
    trimesh.creation.icosphere(2, 0.1).export(tmp_path / "ball.ply")
    target = {"kind": str(tmp_path / "ball.ply"), "size_m": 0.25}
    folder = rewritten(made_up, tmp_path, target=target, tank={"size_m": [7, 4, 1.7]})
    trial = read_trial(folder)
    assert trial.bed_z_m == 1.7
    assert trial.settings is not None
    assert trial.settings.tank.size_m == (7.0, 4.0, 1.7)


def test_a_method_or_part_from_outside_is_named_and_hides_no_setting(made_up: Path, tmp_path: Path) -> None:
    """Settings are read all the same; the package's own methods are not called foreign."""
    assert read_trial(made_up).outside == ""
    folder = rewritten(
        made_up,
        tmp_path,
        method="mylab.steering:make",
        overrides={"estimator": "mylab.Filter"},
        tank={"size_m": [6, 5, 1.6]},
    )
    (folder / "metrics.json").unlink()
    trial = read_trial(folder)
    assert trial.method == "mylab.steering:make"
    assert trial.outside == "controller from outside: mylab.steering:make; estimator replaced: mylab.Filter"
    page = report_page(trial)
    assert "run the script that gave them" in page and "wakewise scan" not in page.split('id="again"')[1]
    assert trial.bed_z_m == 1.6


def test_settings_that_cannot_be_read_are_a_gap_not_a_guess(made_up: Path, tmp_path: Path) -> None:
    """A scenario of another version leaves the settings out and says so; the bed is then the target's foot."""
    trial = read_trial(rewritten(made_up, tmp_path, tank={"size_m": [6, 5]}))
    assert trial.settings is None
    assert "tank.size_m" in trial.missing["scenario.yaml"]
    assert trial.truth is not None
    assert trial.bed_z_m == trial.truth.vertices_m[:, 2].max()


def rewritten(made_up: Path, tmp_path: Path, **changes: object) -> Path:
    """A copy of the made-up trial with other settings."""
    folder = tmp_path / "rewritten"
    shutil.copytree(made_up, folder, ignore=shutil.ignore_patterns("images", "*.html"))
    tree = yaml.safe_load((folder / "scenario.yaml").read_text())
    (folder / "scenario.yaml").write_text(yaml.safe_dump(tree | changes, sort_keys=False))
    return folder
