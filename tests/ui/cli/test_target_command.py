"""`wakewise target show` says what a target is and writes what was asked; bad input ends in one line and code 2."""

import json

import numpy as np
import pytest
import trimesh

from wakewise.scene.targets import load_mesh, read_vertex_scores
from wakewise.ui.cli.main import run


@pytest.fixture
def ball(tmp_path):
    """A ball of 10 cm as a file."""
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(subdivisions=4, radius=0.05).export(path)
    return path


def test_facts_of_a_ball_are_those_of_a_ball(ball, capsys):
    """Size, area, volume, thickness and total weight in JSON; nothing on it is delicate."""
    assert run(["target", "show", str(ball), "--points", "40", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(facts["size_m"], 0.1, rtol=1e-3)
    assert facts["area_m2"] == pytest.approx(4 * np.pi * 0.05**2, rel=0.01)
    assert facts["volume_m3"] == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.01)
    assert facts["watertight"] is True
    assert facts["thickness_m"]["p50"] == pytest.approx(0.1, rel=0.01)
    assert facts["delicate_share_pct"] == 0.0
    assert (facts["region_points"], facts["region_on_surface"]) == (40, 13)


def test_marks_are_shown_and_written_and_read_back(ball, tmp_path, capsys):
    """A mark on the top makes the top delicate in figures, in the coloured PLY and when that is loaded again."""
    marks, out = tmp_path / "marks.csv", tmp_path / "coloured.ply"
    marks.write_text("x_m,y_m,z_m,radius_m,weight\n0,0,0.1,0.03,0.9\n")
    options = ["--marks", str(marks), "--gain", "2", "--points", "20", "--out", str(out), "--json"]
    assert run(["target", "show", str(ball), *options]) == 0
    share = json.loads(capsys.readouterr().out)["delicate_share_pct"]
    # A cap cut by a ball of radius r about a point of the surface has the area pi r^2.
    assert share == pytest.approx(100 * 0.03**2 / (4 * 0.05**2), rel=0.1)
    written = load_mesh(out)
    np.testing.assert_allclose(written.vertices_m, load_mesh(ball).vertices_m, atol=1e-6)
    scores = read_vertex_scores(out, written)
    top = np.linalg.norm(written.vertices_m - [0, 0, 0.1], axis=1) < 0.03
    np.testing.assert_allclose(scores, np.where(top, 0.9, 0.0), atol=1e-6)
    colours = np.asarray(trimesh.load(out, process=False).visual.vertex_colors)
    assert len(np.unique(colours, axis=0)) == 2
    assert run(["target", "show", str(out), "--points", "20", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["delicate_share_pct"] == pytest.approx(share)


@pytest.mark.slow
def test_a_page_and_a_picture_are_written(ball, tmp_path, capsys):
    """The page names no host; the picture is SVG; the table names thickness and share."""
    page, picture = tmp_path / "t.html", tmp_path / "t.svg"
    for out in (page, picture):
        assert run(["target", "show", str(ball), "--points", "30", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "thickness (mm)" in shown
    assert "watertight" in shown
    text = page.read_text()
    assert text.count("<svg") == 3
    assert "http" not in text.replace("http-equiv", "")
    assert "from the east" in text
    assert "<svg" in picture.read_text()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--out", "x.png"], "allowed: .html, .svg, .ply"),
        (["--marks", "absent.csv"], "no such file"),
        (["--points", "1"], "allowed 2 to 10000"),
        (["--gain", "-1"], "allowed 0 to 100"),
    ],
)
def test_bad_options_end_in_one_line(ball, capsys, options, said):
    """Exit code 2, nothing on standard output, one line on standard error."""
    assert run(["target", "show", str(ball), *options]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert said in printed.err
    assert printed.err.count("\n") == 1


def test_an_unknown_target_is_refused(capsys, tmp_path):
    """Neither a coral's name nor a file."""
    assert run(["target", "show", str(tmp_path / "nothing.ply")]) == 2
    assert "no such file" in capsys.readouterr().err


@pytest.mark.slow
def test_a_soft_target_tells_how_it_bends(ball, capsys):
    """Stems, frequency and the tip's way in four streams, which grows with the stream; a file's mesh has none of it."""
    assert run(["target", "show", "gorgonian", "--points", "20", "--json"]) == 0
    sway = json.loads(capsys.readouterr().out)["sway"]
    assert sway["stems"] == 1
    assert 0.5 < sway["frequency_Hz"] < 2.0
    ways = list(sway["tip_mm"].values())
    assert ways == sorted(ways)
    assert ways[1] / ways[0] == pytest.approx(81.0, rel=0.05)  # drag goes with the square, as long as little bends
    assert ways[3] / ways[1] < 25.0
    assert run(["target", "show", str(ball), "--points", "20", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sway"] is None
