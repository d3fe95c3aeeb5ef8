"""The bench of the dynamics says why a figure is missing, and finds the public programs' accelerations."""

import os
from pathlib import Path

import pytest

from wakewise_benchmarks.dynamics import ORACLE, oracle_figures

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[3] / "shared" / "data"))


def test_without_reference_data_the_figure_is_null_and_says_why(tmp_path: Path) -> None:
    for data, said in ((None, "no folder"), (tmp_path, ORACLE)):
        got = oracle_figures(data)
        assert got["oracle_rel_error_max"] is None
        assert said in got["why"]["oracle_rel_error_max"]


def test_with_reference_data_the_accelerations_agree() -> None:
    if not (DATA / "dynamics" / ORACLE).is_file():
        pytest.skip(f"{ORACLE} is not here; set WAKEWISE_DATA")
    assert oracle_figures(DATA)["oracle_rel_error_max"] < 1e-9
