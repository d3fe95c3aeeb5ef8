"""Commands about photographs and models: what they print, and what they refuse in one line."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from wakewise.cli.main import run

Capsys = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def ball(name: str, radius: float, shift: float = 0.0) -> None:
    mesh = trimesh.creation.icosphere(4, radius)
    mesh.apply_translation([shift, 0, 0])
    mesh.export(name)


def test_evaluate_prints_figures_with_their_definitions_and_colours_errors(capsys: Capsys) -> None:
    """One JSON object: every figure has a definition, what is null has a reason; the coloured cloud is written."""
    ball("truth.ply", 0.06)
    ball("model.ply", 0.0605)
    arguments = ["evaluate", "model.ply", "--reference", "truth.ply", "--no-icp", "--colours", "errors.ply", "--json"]
    assert run(arguments) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["rmse_mm"] == pytest.approx(0.5, abs=0.05)
    figures = set(found) - {"why", "units", "definitions"}
    assert figures == set(found["definitions"]) == set(found["units"])
    assert set(found["why"]) == {key for key in figures if found[key] is None}
    colours = np.asarray(trimesh.load("errors.ply").colors)[:, :3]
    assert (colours[:, 2] > 150).all()


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["evaluate", "model.ply"], 2, "either --reference"),
        (["evaluate", "model.ply", "--reference", "mm.ply"], 2, "suspicious scale"),
        (["evaluate", "model.ply", "--reference", "truth.ply", "--unit-m", "0"], 2, "--unit-m"),
        (["evaluate", "model.ply", "--reference", "away.ply"], 1, "0 of its"),
        (["evaluate", "model.ply", "--depth-maps", "d.npz"], 2, "--cameras"),
        (["evaluate", "gone.ply", "--reference", "truth.ply"], 2, "gone.ply"),
        (["calibrate", "gone"], 2, "holds no photos"),
        (["calibrate", ".", "--board", "eleven"], 2, "COLUMNSxROWS"),
        (["calibrate", ".", "--marker-mm", "9"], 2, "markers must"),
        (["reconstruct", ".", "--set", "magic=1"], 2, "no such field"),
        (["degrade", "--levels", "silt"], 2, "FACTOR=A,B"),
        (["degrade", "--levels", "fog=0,1"], 2, "fog"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(arguments: list[str], code: int, words: str, capsys: Capsys) -> None:
    """Bad input is exit code 2, a model of something else is 1; no traceback, nothing on standard output."""
    ball("truth.ply", 0.06)
    ball("model.ply", 0.06)
    ball("mm.ply", 60.0)
    ball("away.ply", 0.06, 0.5)
    assert run(arguments) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert len(captured.err.strip().splitlines()) == 1


def test_a_reference_in_millimetres_is_measured_with_its_unit(capsys: Capsys) -> None:
    """With the unit given the same reference is no longer suspicious."""
    ball("mm.ply", 60.0)
    ball("model.ply", 0.06)
    assert run(["evaluate", "model.ply", "--reference", "mm.ply", "--unit-m", "0.001", "--no-icp", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rmse_mm"] < 0.1
