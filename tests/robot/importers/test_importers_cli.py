"""`wakewise vehicle import` says what it found, what it decided, what is missing and what disagrees."""

import json
from pathlib import Path

import pytest
import typer
from test_importers_formats import SDF, THRUSTERS
from typer.testing import CliRunner

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_draft
from wakewise.ui.cli.vehicle_import import import_file

app = typer.Typer()
app.command()(import_file)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "rov.sdf"
    path.write_text(SDF.replace("PLUGINS", THRUSTERS))
    return path


def run(*arguments: str | Path) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exception is not None:
        raise result.exception
    return result.stdout


def test_json_holds_the_facts_and_nulls_with_a_why(file: Path) -> None:
    """One object: thrusters, frame, direction, missing; what is unknown is null."""
    facts = json.loads(run(file, "--json"))
    assert facts["name"] == "rov"
    assert len(facts["thrusters"]) == 2 and facts["rank"] == 2
    assert facts["frame"].startswith("FLU") and "joint axis" in facts["thrust_direction"]
    assert facts["added_mass"] is None and "added mass" in facts["missing"]
    assert facts["mixing_disagreements"] is None and "--matrix" in facts["why"]["mixing_disagreements"]


def test_words_name_each_disagreement(file: Path, tmp_path: Path) -> None:
    """A shipped matrix with one wrong sign is told by row and thruster."""
    matrix = tmp_path / "tam.yaml"
    # left pushes to port, right pushes aft (FLU); the yaw of the right one has the wrong sign.
    matrix.write_text("tam: [[0,-1],[1,0],[0,0],[0,0],[0,0],[0,0.3]]")
    text = run(file, "--matrix", matrix)
    assert "11 of 12 entries agree" in text
    assert "row yaw, thruster 2 (right)" in text and "sign wrong" in text
    assert "missing: size, displaced volume" in text
    facts = json.loads(run(file, "--matrix", matrix, "--json"))
    assert [(d["thruster"], d["axis"]) for d in facts["mixing_disagreements"]] == [("right", "yaw")]


def test_what_the_file_says_is_told_apart_from_estimates(file: Path) -> None:
    """Each field has the name that a vehicle file has for it, and whether it is the file's, an estimate or missing."""
    told = run(file, "--like", "bluerov2-heavy")
    rows = {row[0].partition(",")[0]: row[2] for row in _cells(told) if len(row) == 3}
    assert rows["body.mass_kg"] == rows["camera_lens.horizontal_fov_deg"] == "file"
    assert rows["added_mass.translation_kg"] == "estimate"
    assert [row[-1] for row in _cells(told) if row[0] == "left"] == ["~0.0287"]
    rows = {row[0].partition(",")[0]: row[2] for row in _cells(run(file)) if len(row) == 3}
    assert rows["added_mass.translation_kg"] == "missing"
    whole = file.with_name("whole.yaml")
    run(file, "--like", "bluerov2-heavy", "--out", whole)
    again = run(whole)  # the file that was written says itself what of it is an estimate
    rows = {row[0].partition(",")[0]: row[2] for row in _cells(again) if len(row) == 3}
    assert rows["body.mass_kg"] == "file" and rows["added_mass.translation_kg"] == "estimate"
    assert [row[-1][:1] for row in _cells(again) if row[0] == "left"] == ["~"]


def _cells(told: str) -> list[list[str]]:
    """The cells of the rows of all tables."""
    return [[cell.strip() for cell in line.strip("│").split("│")] for line in told.splitlines() if line[:1] == "│"]


def test_out_is_a_vehicle_file(file: Path, tmp_path: Path) -> None:
    """What is written can be read as a draft."""
    out = tmp_path / "new" / "rov.yaml"
    assert f"written: {out}" in run(file, "--out", out)
    assert [t.name for t in load_draft(str(out)).thrusters] == ["left", "right"]


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (["--frame", "ENU"], "frame 'ENU': allowed auto, FLU, FRD"),
        (["--thrust-direction", "up"], "thrust direction 'up': allowed"),
        (["--package", "nodir"], "--package nodir: allowed is NAME=DIR"),
        (["--package", "a=/does/not/exist"], "package a: .* is not a folder"),
        (["--arg", "a=1"], "--arg a=1: allowed is NAME:=VALUE"),
        (["--arg", "a:=1"], "has no xacro arguments"),
        (["--matrix", "/does/not/exist"], "not found or not a file"),
    ],
)
def test_options_that_make_no_sense_are_refused(file: Path, options: list[str], match: str) -> None:
    """Before anything is written."""
    with pytest.raises(InputError, match=match):
        run(file, *options)
