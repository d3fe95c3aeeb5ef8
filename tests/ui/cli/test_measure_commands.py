import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from wakewise.scene.targets import Mesh
from wakewise.ui.cli.main import run
from wakewise.vision.evaluation.measurement import unseen_pct


def colony(path: Path, scale: float = 1.0, seed: int = 0, grown: float = 0.0) -> Path:
    """A bumpy dome of 60 mm on a bed of 200 mm."""
    x = np.linspace(-0.1, 0.1, 121)
    X, Y = np.meshgrid(x, x, indexing="ij")
    r = np.hypot(X, Y)
    bumps = 0.004 * np.sin(150.0 * X + 0.5) * np.sin(130.0 * Y) + grown
    Z = np.where(r < 0.06, np.sqrt(np.maximum(0.06**2 - r**2, 0.0)) * (1.0 + 10.0 * bumps), 0.0)
    Z = Z + np.random.default_rng(seed).normal(0.0, 1e-4, Z.shape)
    i = np.arange(121 * 121).reshape(121, 121)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    vertices = scale * np.stack([X, Y, Z], axis=-1).reshape(-1, 3)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return path


@pytest.mark.parametrize("kind", ["ply", "stl", "obj", "glb"])
def test_a_bare_mesh_of_any_format_is_measured_without_intervals(
    kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """STL repeats vertices, which joins no pieces by itself; each interval is null, and why is said."""
    path, out = colony(tmp_path / f"colony.{kind}"), tmp_path / "colony.json"
    assert run(["measure", str(path), "--json", "--out", str(out)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == json.loads(out.read_text())
    assert found["length_mm"] == pytest.approx(120.0, rel=0.02)
    assert found["length_mm_low"] is None and "photographs" in found["why"]["length_mm_low"]
    assert found["units"]["volume_cm3"] == "cm3" and found["definitions"].keys() == found["units"].keys()


def test_the_unit_of_a_mesh_can_be_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A mesh in millimetres has its size with --unit-m 0.001."""
    assert run(["measure", str(colony(tmp_path / "mm.ply", 1000.0)), "--unit-m", "0.001", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["length_mm"] == pytest.approx(120.0, rel=0.02)


def folder(path: Path, **figures: object) -> Path:
    path.mkdir()
    (path / "reconstruction.json").write_text(json.dumps(figures))
    return path


def bad_inputs(base: Path) -> dict[str, tuple[list[str], str]]:
    """Words of the command, and what the line says."""
    good = str(colony(base / "good.ply"))
    points = base / "points.ply"
    trimesh.PointCloud(np.random.default_rng(0).normal(size=(50, 3))).export(points)
    ball = base / "ball.ply"
    trimesh.creation.icosphere(3, 0.05).export(ball)
    (base / "empty").mkdir()
    (base / "as.json").mkdir()
    unscaled = folder(base / "unscaled", scale=None)
    colony(unscaled / "mesh.ply")
    broken = base / "broken.ply"
    broken.write_bytes((base / "good.ply").read_bytes()[:4000])
    nan = base / "nan.ply"
    data = bytearray((base / "good.ply").read_bytes())
    start = data.index(b"end_header\n") + 11
    data[start : start + 4] = np.float32(np.nan).tobytes()
    nan.write_bytes(bytes(data))
    return {
        "none": (["measure", str(base / "missing.ply")], "no such file"),
        "points": (["measure", str(points)], "without faces"),
        "folder": (["measure", str(base / "empty")], "reconstruction.json"),
        "no mesh": (["measure", str(folder(base / "bare", scale=1.0))], "without --until"),
        "no scale": (["measure", str(unscaled)], "no scale"),
        "no bed": (["measure", str(ball)], "bed"),
        "box": (["measure", good, "--box", "5", "5", "5", "6", "6", "6"], "--box"),
        "nan box": (["measure", good, "--box", "nan", "0", "0", "1", "1", "1"], "--box"),
        "nan": (["measure", str(nan)], "NaN"),
        "cut": (["measure", str(broken)], "cut short"),
        "unit": (["measure", good, "--unit-m", "-1"], "--unit-m"),
        "direction": (["measure", good, "--bed", "0", "0", "0", "0"], "--bed"),
        "scale": (["compare-models", good, str(colony(base / "inches.ply", 39.37))], "give both their scale"),
        "millimetres": (["compare-models", good, str(colony(base / "mm.ply", 1000.0))], "convert one of them"),
        "picture": (["compare-models", good, good, "--out", str(base / "a.jpg")], ".png"),
        "second": (["compare-models", good, str(points)], "without faces"),
        "folder out": (["measure", good, "--out", str(base / "empty")], "empty: is a folder"),
        "folder json": (["compare-models", good, good, "--out", str(base / "as.png")], "as.json: is a folder"),
        "down": (["measure", good, "--bed", "0", "0", "-1", "0.001"], "may point down"),
    }


NAMES = (
    "none", "points", "folder", "no mesh", "no scale", "no bed", "box", "nan box", "nan", "cut", "unit", "direction",
    "scale", "millimetres", "picture", "second", "folder out", "folder json", "down",
)  # fmt: skip


@pytest.fixture(scope="module")
def bad(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, tuple[list[str], str]]]:
    """A folder of what cannot be measured, in which no test leaves anything."""
    folder = tmp_path_factory.mktemp("bad")
    return folder, bad_inputs(folder)


@pytest.mark.parametrize("name", NAMES)
def test_what_cannot_be_measured_is_refused_in_one_line(
    name: str, bad: tuple[Path, dict[str, tuple[list[str], str]]], capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, one line that says what is wrong, and no file."""
    tmp_path, (words, says) = bad[0], bad[1][name]
    before = sorted(tmp_path.rglob("*"))
    out = [] if "--out" in words else ["--out", str(tmp_path / "out.png")]
    assert run([*words, *out]) == 2
    heard = capsys.readouterr()
    lines = [line for line in heard.err.splitlines() if line.startswith("wakewise")]
    assert len(lines) == 1 and says in lines[0], heard.err
    assert heard.out == "" and sorted(tmp_path.rglob("*")) == before


def test_growth_is_shown_in_a_picture_and_told_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The PNG is a picture of some size, the JSON beside it is that of --json, and the verdict says growth."""
    first, second = colony(tmp_path / "a.ply"), colony(tmp_path / "b.ply", seed=1, grown=0.012)
    out = tmp_path / "change.png"
    assert run(["compare-models", str(first), str(second), "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == json.loads(out.with_suffix(".json").read_text())
    assert found["verdict"].startswith("grown by"), found["verdict"]
    assert found["change_mm_low"] < found["change_mm"] < found["change_mm_high"]
    from PIL import Image

    with Image.open(out) as picture:
        assert picture.format == "PNG" and min(picture.size) > 500


def test_a_wrong_scale_is_told_beside_growth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of bare meshes, whose scale is not known: a warning, and a word in the verdict."""
    first, second = colony(tmp_path / "a.ply"), colony(tmp_path / "b.ply", 1.12, seed=1)
    assert run(["compare-models", str(first), str(second), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["scale_found"] == pytest.approx(1.0 / 1.12, rel=0.02)
    assert "would explain it, too" in found["verdict"] and "give both models their scale" in found["warnings"][0]


@pytest.mark.slow
def test_the_same_model_twice_has_not_changed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The table ends with the verdict, and says that bare meshes do not know their scale."""
    path = str(colony(tmp_path / "a.ply"))
    assert run(["compare-models", path, path]) == 0
    shown = capsys.readouterr().out
    assert "verdict: no change can be told" in shown and "scale of" in shown


def warned(path: Path, capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """All warnings of one measurement."""
    assert run(["measure", str(path), *words, "--json"]) == 0
    return " ".join(json.loads(capsys.readouterr().out)["warnings"])


def test_doubtful_figures_have_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A plain dome has none; millimetres taken for metres, and half a dome at the model's end do."""
    good = colony(tmp_path / "good.ply")
    assert warned(good, capsys) == ""
    assert "--unit-m" in warned(colony(tmp_path / "mm.ply", 1000.0), capsys)
    whole = trimesh.load(good, process=False)
    half = whole.faces[(whole.triangles_center[:, 0] > 0.0)]
    trimesh.Trimesh(whole.vertices, half, process=False).export(tmp_path / "half.ply")
    assert "open edges" in warned(tmp_path / "half.ply", capsys)


def test_a_colony_behind_the_faces_has_a_warning_and_up_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A pit, and a dome whose faces are turned; a dome that is upside down as a whole has none."""
    dome = trimesh.load(colony(tmp_path / "dome.ply"), process=False)
    for name, sides, faces, warns in (("pit", -1, 1, True), ("turned", 1, -1, True), ("down", -1, -1, False)):
        path = tmp_path / f"{name}.ply"
        trimesh.Trimesh(dome.vertices * [1, 1, sides], dome.faces[:, ::faces], process=False).export(path)
        assert ("behind the faces" in warned(path, capsys)) is warns, name
        assert run(["measure", str(path)]) == 0
        assert f"0 0 {sides}" in " ".join(capsys.readouterr().out.split())


def test_two_colonies_that_touch_have_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Joined below twice the cut only: the length there is that of both, above that of one."""
    x = np.linspace(-0.15, 0.15, 121)
    X, Y = np.meshgrid(x, x, indexing="ij")
    Z = np.zeros_like(X)
    for middle in (-0.05, 0.045):
        Z = np.maximum(Z, np.sqrt(np.maximum(0.05**2 - (X - middle) ** 2 - Y**2, 0.0)))
    i = np.arange(X.size).reshape(X.shape)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    trimesh.Trimesh(np.stack([X, Y, Z], axis=-1).reshape(-1, 3), faces, process=False).export(tmp_path / "two.ply")
    assert "another colony" in warned(tmp_path / "two.ply", capsys)
    box = ("--box", "0.0", "-0.1", "-0.05", "0.12", "0.1", "0.1", "--colony")
    assert "another colony" not in warned(tmp_path / "two.ply", capsys, *box)


def test_a_mesh_without_an_outside_or_in_coarse_steps_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Faces that turn opposite ways have no volume; map coordinates in single precision have no shape."""
    whole = trimesh.load(colony(tmp_path / "good.ply"), process=False)
    faces = np.array(whole.faces)
    faces[::2] = faces[::2, ::-1]
    trimesh.Trimesh(whole.vertices, faces, process=False).export(tmp_path / "mixed.ply")
    trimesh.Trimesh(whole.vertices + np.array([5e5, 4.2e6, 0.0]), whole.faces, process=False).export(
        tmp_path / "map.ply"
    )
    for name, told in (("mixed.ply", "opposite ways"), ("map.ply", "single precision")):
        assert run(["measure", str(tmp_path / name)]) == 2
        assert told in capsys.readouterr().err


def test_a_surface_without_dense_points_is_filled_in() -> None:
    """Half of a plane has dense points near it: the other half is unseen, but for three edges."""
    plane = trimesh.creation.box((1.0, 1.0, 1e-3)).subdivide_to_size(0.02)
    dense = plane.triangles_center[plane.triangles_center[:, 0] < 0.0]
    share = unseen_pct(Mesh(np.asarray(plane.vertices), np.asarray(plane.faces)), dense)
    assert share == pytest.approx(45.0, abs=5.0)
