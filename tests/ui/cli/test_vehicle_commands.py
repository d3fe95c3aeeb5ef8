"""`wakewise vehicle`: list, show and check, for the library, for files, and for what is not there."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from wakewise.robot.vehicles import draft_names, load_draft
from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]
DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))


def facts(capsys: Capsys, *words: str) -> dict[str, object]:
    assert run(["vehicle", *words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def refusal(capsys: Capsys, *words: str) -> str:
    assert run(["vehicle", *words]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.count("\n") == 1
    return shown.err


def test_the_list_names_every_vehicle_with_what_it_lacks(capsys: Capsys) -> None:
    assert run(["vehicle", "list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(draft_names())
    assert "cannot fly, lacks size" in lines[list(draft_names()).index("orca")]
    rows = facts(capsys, "list")["vehicles"]
    assert isinstance(rows, list)
    assert [row["name"] for row in rows if not row["can_fly"]] == ["orca"]


@pytest.mark.parametrize("name", ["paper", "orca", "bluerov2"])
def test_the_check_says_what_it_must(capsys: Capsys, name: str) -> None:
    found = facts(capsys, "check", name)
    assert {"thrusters", "rank", "null_space", "mixing_disagreements", "missing", "failure_rank"} <= set(found)
    assert found["rank"] == (5 if name == "bluerov2" else 6)
    assert found["missing"] == list(load_draft(name).missing)
    assert run(["vehicle", "check", name]) == 0
    shown = capsys.readouterr().out
    assert "horizontal squeeze" in shown
    assert ("under-actuated" in shown) == (name == "bluerov2")


def test_the_check_prints_the_entry_that_disagrees(capsys: Capsys, tmp_path: Path) -> None:
    wrong = load_draft("paper").allocation_matrix.copy()
    wrong[3, 2] *= -1.0
    path = tmp_path / "mine.csv"
    np.savetxt(path, wrong, delimiter=",")
    assert run(["vehicle", "check", "paper", "--matrix", str(path)]) == 0
    line = "row roll, thruster 3 (rear right horizontal): file says +0.03536, geometry says -0.03536, sign wrong"
    assert line in capsys.readouterr().out
    assert run(["vehicle", "check", "bluerov2-heavy", "--matrix", "ardusub"]) == 0
    assert "48 of 48 entries agree" in capsys.readouterr().out


def test_a_file_of_another_project_can_be_checked_at_once(capsys: Capsys) -> None:
    path = DATA / "vehicle_models" / "bluerov2_gz" / "models" / "bluerov2_heavy" / "model.sdf"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    found = facts(capsys, "check", str(path))
    assert (found["thrusters"], found["rank"], found["mixing_disagreements"]) == (8, 6, [])


def test_show_writes_a_drawing_or_a_page(capsys: Capsys, tmp_path: Path) -> None:
    for name in ("v.svg", "v.html"):
        assert run(["vehicle", "show", "orca", "--out", str(tmp_path / name)]) == 0
    assert "missing, so it cannot fly: size" in capsys.readouterr().out
    assert (tmp_path / "v.svg").read_text().startswith("<svg")
    assert (tmp_path / "v.html").read_text().startswith("<!doctype html>")


def test_what_cannot_be_is_refused_in_one_line(capsys: Capsys, tmp_path: Path) -> None:
    assert "allowed bluerov2, " in refusal(capsys, "check", "submarine")
    assert "no such file" in refusal(capsys, "check", "paper", "--matrix", str(tmp_path / "none.csv"))
    assert "--out x.png: allowed" in refusal(capsys, "show", "paper", "--out", "x.png")
    assert "--package a: allowed is NAME=DIR" in refusal(capsys, "show", "paper", "--package", "a")
    (tmp_path / "seven.csv").write_text("\n".join(6 * ["1,2,3,4,5,6,7"]))
    assert "shape (6, 7), allowed (6, 8)" in refusal(capsys, "check", "paper", "--matrix", str(tmp_path / "seven.csv"))
    (tmp_path / "empty.sdf").write_text("<sdf/>")
    assert "empty.sdf" in refusal(capsys, "check", str(tmp_path / "empty.sdf"))
