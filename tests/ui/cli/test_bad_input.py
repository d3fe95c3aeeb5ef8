"""Bad input ends with exit code 2 and one line; no traceback, nothing half-written."""

from pathlib import Path

import pytest

from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]


def said(capsys: Capsys, *arguments: str) -> str:
    """Run a command that must be refused; return the one line it says."""
    assert run(list(arguments)) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, captured.err
    assert "Traceback" not in captured.err
    return lines[0]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--target", "gone.ply"], ["gone.ply", "no such file"]),
        (["--target", "empty.ply"], ["empty.ply", "empty"]),
        (["--target", "prose.ply"], ["prose.ply", "not a readable PLY mesh"]),
        (["--target", "prose.txt"], ["prose.txt", "not a mesh format", ".ply"]),
        (["--vehicle", "submarine"], ["submarine", "paper", "bluerov2-heavy"]),
        (["--method", "magic"], ["magic", "dp", "wake-aware"]),
        (["--preset", "huge"], ["huge", "quick", "standard"]),
        (["--set", "tank.silty=0"], ["tank.silty", "no such field"]),
        (["--set", "mission.standoff_m=-0.5"], ["mission.standoff_m", "-0.5"]),
        (["--set", "mission.elevations_deg=[2]", "--set", "mission.views=[12]"], ["elevations_deg", "floor"]),
        (["--set", "mission.standoff_m=2.9"], ["mission.standoff_m"]),
        (["--set", "tank.silt.load_kg_m2=-1"], ["tank.silt.load_kg_m2", "-1"]),
        (["--set", "silt"], ["--set", "FIELD=VALUE"]),
        (["gone.yaml"], ["gone.yaml", "no such file"]),
        (["--nonsense"], ["nonsense"]),
        (["--seed", "one"], ["--seed", "integer"]),
    ],
)
def test_a_scan_that_cannot_be_flown_is_refused(arguments: list[str], words: list[str], capsys: Capsys) -> None:
    """The line names the file or field, what was found and what is allowed; the output folder is not made."""
    Path("empty.ply").touch()
    Path("prose.ply").write_text("call me Ishmael\n" * 50)
    Path("prose.txt").write_text("call me Ishmael\n")
    line = said(capsys, "scan", "--out", "result", *arguments)
    for word in words:
        assert word in line, line
    assert not Path("result").exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({}, ["photos"]),
        ({"a.txt": b"words"}, ["photos"]),
        ({"a.jpg": b"words", "b.jpg": b"more", "c.jpg": b"even more"}, ["a.jpg"]),
    ],
)
def test_photos_that_are_none_are_refused(content: dict[str, bytes], words: list[str], capsys: Capsys) -> None:
    """An empty folder, a folder of text and text in disguise are refused by name."""
    Path("photos").mkdir()
    for name, data in content.items():
        Path("photos", name).write_bytes(data)
    line = said(capsys, "reconstruct", "photos", "--out", "result")
    for word in words:
        assert word in line, line
    assert not Path("result").exists()
    assert "gone" in said(capsys, "reconstruct", "gone", "--out", "result")


def test_a_folder_that_holds_another_trial_is_left_alone(capsys: Capsys) -> None:
    """Running another scenario into the same folder is refused, with the field that differs."""
    from wakewise.operation import load_scenario
    from wakewise.operation.trial_folder import write_or_check_scenario

    write_or_check_scenario(Path("result"), load_scenario("quick", None, {}))
    before = Path("result/scenario.yaml").read_bytes()
    line = said(capsys, "scan", "--out", "result", "--seed", "9")
    assert "another trial" in line
    assert "seed 1, now 9" in line
    assert Path("result/scenario.yaml").read_bytes() == before
    assert [path.name for path in Path("result").iterdir()] == ["scenario.yaml"]
    line = said(capsys, "scan", "--out", "result", "--set", "tank.current.velocity_m_s=[0.1, 0, 0]")
    assert 'randomize.tank.jets.half_width_growth {"uniform": [0.094, 0.177]}, now not set' in line


def test_comparing_nothing_or_the_same_twice_is_refused(capsys: Capsys) -> None:
    """Method names must exist and differ."""
    assert "--methods" in said(capsys, "compare", "--methods", "dp,dp")
    assert "magic" in said(capsys, "compare", "--methods", "dp,magic")


def test_a_vehicle_that_does_not_exist_is_refused(capsys: Capsys) -> None:
    """The line lists the vehicles there are."""
    assert "bluerov2-heavy" in said(capsys, "vehicle", "show", "submarine")


CUT = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("prose.ply", b"call me Ishmael\n" * 40),
        ("prose.txt", b"call me Ishmael\n" * 40),
        ("prose.obj", b"\x00\xff" * 40),
        ("empty.ply", b""),
        ("short.ply", CUT.format(10**12).encode() + b"0 0 0\n"),
        ("less.ply", CUT.format(3).encode() + b"0 0 0\n0 0 1\n"),
    ],
)
@pytest.mark.parametrize("as_model", [True, False])
def test_what_holds_no_model_is_refused_in_words(name: str, data: bytes, as_model: bool, capsys: Capsys) -> None:
    """As the model or as the reference: the file is named, and no name of an exception of ours or others is shown."""
    import trimesh

    Path(name).write_bytes(data)
    trimesh.creation.icosphere(subdivisions=2, radius=0.1).export("ball.ply")
    one, other = (name, "ball.ply") if as_model else ("ball.ply", name)
    line = said(capsys, "evaluate", one, "--reference", other)
    assert name in line
    assert "Error" not in line
    assert "Exception" not in line
    if name in ("short.ply", "less.ply"):
        assert "was cut short, promises" in line or "no faces" in line


def test_points_in_ascii_that_are_all_there_are_read(capsys: Capsys) -> None:
    """A whole ASCII file is no broken promise, blank lines, comments and faces included."""
    from wakewise.core.size_limits import broken_ply

    Path("whole.ply").write_text(CUT.format(2) + "0 0 0\n\n0 0 1\n")
    Path("other.txt").write_text("nothing of the kind\n")
    assert broken_ply(Path("whole.ply")) is None
    assert broken_ply(Path("other.txt")) is None
    assert capsys.readouterr().out == ""
