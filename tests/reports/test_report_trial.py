"""Laws of reading a trial folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import polars as pl
from hypothesis import given
from hypothesis import strategies as st

from wakewise.reports.trial import find_setting, read_trial


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


def test_the_setting_nearest_to_the_root_is_found() -> None:
    """A name deep in one branch does not hide the same name higher up."""
    tree = {"a": {"b": {"seed": 1}}, "c": {"seed": 2}}
    assert find_setting(tree, ("seed",)) == 2
    assert find_setting(tree, ("none",)) is None


@given(st.recursive(st.none() | st.integers() | st.text(), lambda s: st.lists(s) | st.dictionaries(st.text(), s)))
def test_any_tree_can_be_searched(tree: object) -> None:
    """Searching never fails, whatever a YAML file holds."""
    assert find_setting(tree, ("a name that is not there",)) is None
