"""`wakewise tank probe` as a user runs it: its keys, and one line with exit code 2 for bad input."""

import json

import numpy as np
import pytest

from wakewise.ui.cli.main import run

NAMES = ",".join(f"thrust_{i + 1}_N" for i in range(8))
PUSH = ",".join(["1"] * 8)


@pytest.fixture
def files(tmp_path):
    (tmp_path / "t.csv").write_text(f"time_s,{NAMES}\n0,{PUSH}\n1,{PUSH}\n2,{PUSH}\n")
    (tmp_path / "p.csv").write_text("x_m,y_m,z_m\n0.3,0,0.2\n0,0.2,0.5\n")
    return ["--thrusts", str(tmp_path / "t.csv"), "--points", str(tmp_path / "p.csv")]


def _probe(*arguments):
    return run(["tank", "probe", "--vehicle", "paper", "--pose", "0", "0", "0.2", "0", "0", "0.5", *arguments])


def test_json_has_the_keys_that_were_promised(files, capsys):
    """times_s, velocities_m_s (time x point x 3) and the figures made of them, with a floor and without."""
    for more in ([], ["--floor", "1.0", "--turbulence", "--seed", "3"]):
        assert _probe(*files, *more, "--json") == 0
        found = json.loads(capsys.readouterr().out)
        assert found["times_s"] == [0.0, 1.0, 2.0]
        u = np.array(found["velocities_m_s"])
        assert u.shape == (3, 2, 3)
        speeds = np.linalg.norm(u, axis=2)
        assert found["speed_mean_m_s"] == pytest.approx(speeds.mean())
        assert found["speed_p95_m_s"] == pytest.approx(np.quantile(speeds, 0.95))


def test_the_answer_can_be_written(files, tmp_path, capsys):
    """As arrays or as the same JSON object; a table goes to the screen."""
    assert _probe(*files, "--every", "0.5", "--out", str(tmp_path / "u.npz")) == 0
    with np.load(tmp_path / "u.npz") as data:
        assert data["velocities_m_s"].shape == (5, 2, 3)
    assert "95th percentile" in capsys.readouterr().out
    assert _probe(*files, "--out", str(tmp_path / "u.json"), "--json") == 0
    assert json.loads((tmp_path / "u.json").read_text()) == json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--out", "u.foo"], "--out u.foo: must end in .json or .npz"),
        (["--out", "u"], "--out u: must end in .json or .npz"),
        (["--floor", "0.3"], "below the floor"),
        (["--target", "brain"], "give --floor"),
        (["--flow", "magic"], "allowed are parcels, lattice"),
        (["--every", "0"], "more than 0"),
        (["--every", "50"], "go on for 2 s only"),
        (["--floor", "1.5", "--target", "branching", "--pose", "0", "0", "1.3", "0", "0", "0"], "inside the target"),
        (["--flow", "lattice", "--swirl"], "need parcels"),
        (["--points", "nowhere.csv"], "no such file"),
        (["--pose", "0", "0", "0", "0", "0", "90"], "radians"),
        (["--pose", "0", "0", "nan", "0", "0", "0"], "finite"),
        (["--vehicle", "submarine"], "not in the library"),
    ],
)
def test_bad_input_is_one_line_and_code_2(files, capsys, more, words):
    """Each fault is named."""
    assert _probe(*files, *more) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


def test_thrusts_beyond_the_thrusters_are_refused(files, tmp_path, capsys):
    """With file, row, thruster and what it gives."""
    (tmp_path / "t.csv").write_text(f"time_s,{NAMES}\n0,{PUSH}\n1,500{PUSH[1:]}\n2,{PUSH}\n")
    assert _probe(*files) == 2
    said = capsys.readouterr().err
    assert "t.csv row 2: 500 N for" in said
    assert "allowed -42 to 53.55 N" in said


def test_what_the_lattice_does_not_know_is_null(files, tmp_path, capsys):
    """Not zero, with a reason; the figures are of the points that are known, and null if there are none."""
    assert _probe(*files, "--flow", "lattice", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["why"] == {}
    (tmp_path / "p.csv").write_text("x_m,y_m,z_m\n9,9,9\n")
    assert _probe(*files, "--flow", "lattice", "--json", "--out", str(tmp_path / "u.npz")) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["velocities_m_s"] == [[[None] * 3]] * 3
    assert found["speed_mean_m_s"] is found["speed_p95_m_s"] is None
    assert "outside the boxes" in found["why"]["speed_mean_m_s"]
    with np.load(tmp_path / "u.npz") as data:
        assert np.isnan(data["velocities_m_s"]).all()
    assert _probe(*files, "--flow", "lattice") == 0
    assert "not known at any of the points" in capsys.readouterr().out
