"""Commands about photographs and models: what they print, and what they refuse in one line."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from wakewise.ui.cli.main import run
from wakewise.ui.cli.reconstruct_options import scale_lines

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
        (["evaluate", "model.ply", "--reference", "away.ply"], 1, "--bed-z"),
        (["evaluate", "model.ply", "--reference", "truth.ply", "--bed-z", "-1"], 2, "--bed-z"),
        (["evaluate", "model.ply", "--reference", "truth.ply", "--thresholds", "1,x"], 2, "--thresholds 'x'"),
        (["evaluate", ".", "--reference", "truth.ply"], 2, "is no file of points; give one such as dense.ply"),
        (["evaluate", "model.glb", "--reference", "truth.ply"], 2, "is no file of points"),
        (["evaluate", "mm.ply", "--reference", "truth.ply"], 2, "a model must be in metres"),
        (["evaluate", "model.ply", "--reference", "truth.ply", "--colours", "errors.obj"], 2, "must end in .ply"),
        (["calibrate", "gone"], 2, "holds no photos"),
        (["calibrate", ".", "--board", "eleven"], 2, "COLUMNSxROWS"),
        (["calibrate", ".", "--marker-mm", "9"], 2, "markers must"),
        (["reconstruct", ".", "--set", "magic=1"], 2, "no such field"),
        (["photo-robustness", "--levels", "silt"], 2, "FACTOR=A,B"),
        (["photo-robustness", "--levels", "fog=0,1"], 2, "fog"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(arguments: list[str], code: int, words: str, capsys: Capsys) -> None:
    """Bad input is exit code 2, a model of something else is 1; no traceback, nothing on standard output."""
    ball("truth.ply", 0.06)
    ball("model.ply", 0.06)
    ball("mm.ply", 60.0)
    ball("away.ply", 0.06, 0.5)
    ball("model.glb", 0.06)
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


def test_a_small_object_is_judged_by_its_size_and_faults_are_said(capsys: Capsys) -> None:
    """A ball of 36 mm that is 0.3 mm too large: complete at 3 mm, not at a hundredth of itself; both meshes' faults."""
    ball("truth.ply", 0.018)
    mesh = trimesh.load("truth.ply", process=False)
    twice = np.concatenate([mesh.faces, mesh.faces[:5]])
    trimesh.Trimesh(mesh.vertices, twice, process=False).export("truth.ply")
    ball("model.ply", 0.0183)
    assert run(["evaluate", "model.ply", "--reference", "truth.ply", "--no-icp", "--json"]) == 0
    said = capsys.readouterr()
    found = json.loads(said.out)
    assert found["completeness_pct"] == 100.0
    by_size = {round(100 * one["threshold_mm"] / found["extent_mm"], 2): one for one in found["shares"]}
    assert set(by_size) == {0.25, 0.5, 1.0}
    assert by_size[0.25]["accuracy_pct"] < 1.0 and by_size[1.0]["accuracy_pct"] > 99.0
    assert found["reference_faults"]["duplicate_faces"] == 5 and found["model_faults"]["duplicate_faces"] == 0
    assert "5 faces come twice" in said.err and "--thresholds" in said.err


def test_the_bed_of_a_trial_is_that_of_its_scenario(capsys: Capsys) -> None:
    """Sand in the cloud counts as error without the bed's depth, and not with the scenario beside the model."""
    truth = trimesh.creation.icosphere(4, 0.06)
    truth.apply_translation([0, 0, 0.95])
    truth.export("truth.ply")
    on_ball = np.asarray(truth.vertices)
    sand = np.random.default_rng(0).uniform([-0.09, -0.09, 0.999], [0.09, 0.09, 1.001], (len(on_ball), 3))
    trimesh.PointCloud(np.concatenate([on_ball, sand])).export("dense.ply")
    arguments = ["evaluate", "dense.ply", "--reference", "truth.ply", "--no-icp", "--json"]
    assert run(arguments) == 0
    without = json.loads(capsys.readouterr().out)
    assert run([*arguments, "--bed-z", "1"]) == 0
    given = json.loads(capsys.readouterr().out)
    assert given["rmse_mm"] < 0.1 < without["rmse_mm"]
    Path("scenario.yaml").write_text("tank: {size_m: [3.0, 3.0, 1.0]}\n")
    assert run(arguments) == 0
    found = capsys.readouterr()
    assert json.loads(found.out) == given and "1 m, from scenario.yaml" in found.err
    Path("scenario.yaml").write_text("tank: {size_m: [3.0, 3.0, 2.5]}\n")
    assert run(arguments) == 0
    found = capsys.readouterr()
    assert json.loads(found.out) == without and "2.5 m, not in this model: not used" in found.err
    Path("scenario.yaml").write_text("tank: {size_m: [3.0, 3.0, 0.05]}\n")
    assert run(arguments) == 2
    assert "--bed-z" in capsys.readouterr().err


def test_a_model_without_scale_says_what_gives_one() -> None:
    """One line that names the options."""
    (line,) = scale_lines(SimpleNamespace(scale=None, scale_bars=None, scale_fixes=None))
    assert line.startswith("scale: none; --bar, --fixes")
    assert scale_lines(SimpleNamespace(scale=1.0, scale_bars=None, scale_fixes=None)) == []


def test_a_cloud_is_a_reference_too(capsys: Capsys) -> None:
    """Points without faces, in millimetres: measured point to point, with the spacing beside it."""
    ball("mesh.ply", 60.0)
    trimesh.PointCloud(trimesh.load("mesh.ply", process=False).vertices).export("scan.ply")
    ball("model.ply", 0.06)
    arguments = ["evaluate", "model.ply", "--reference", "scan.ply", "--unit-m", "0.001", "--thresholds", "2,4"]
    assert run([*arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["accuracy_median_mm"] < 0.01 and found["reference_spacing_mm"] > 1.0
    assert [one["threshold_mm"] for one in found["shares"]] == [2.0, 4.0]
    assert set(found) - {"why", "units", "definitions"} == set(found["definitions"])
    assert run([*arguments]) == 0
    assert "within 2 mm: " in capsys.readouterr().out
    assert run(["evaluate", "model.ply", "--reference", "scan.ply"]) == 2
    assert "suspicious scale" in capsys.readouterr().err
