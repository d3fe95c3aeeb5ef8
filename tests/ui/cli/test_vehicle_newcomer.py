"""A vehicle of another project goes from its URDF to its first flight by docs/vehicle-file.md alone."""

import re
import shlex
from pathlib import Path

import pytest

import wakewise as ww
from wakewise.core.errors import InputError
from wakewise.ui.cli.main import run

PAGE = (Path(__file__).parents[3] / "docs" / "vehicle-file.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    """The page's first block of code in a language."""
    found = re.search(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


def own_urdf() -> str:
    """Eight thrusters without a plugin, a collision box, a camera link: what a student's robot has."""
    parts = []
    level = [(0.156, 0.111), (0.156, -0.111), (-0.156, 0.111), (-0.156, -0.111)]
    upright = [(0.12, 0.218), (0.12, -0.218), (-0.12, 0.218), (-0.12, -0.218)]
    places = [(x, y, -0.05, f"0 0 {0.785398 if x * y < 0 else -0.785398}") for x, y in level]
    places += [(x, y, 0.0, "0 -1.570796 0") for x, y in upright]
    for number, (x, y, z, rpy) in enumerate(places, start=1):
        parts.append(
            f'<link name="thruster{number}_link"/><joint name="thruster{number}_joint" type="continuous">'
            f'<parent link="base_link"/><child link="thruster{number}_link"/>'
            f'<origin xyz="{x} {y} {z}" rpy="{rpy}"/><axis xyz="1 0 0"/></joint>'
        )
    return f"""<?xml version="1.0"?>
<robot name="my_rov">
  <link name="base_link">
    <inertial><origin xyz="0 0 -0.02"/><mass value="11"/><inertia ixx="0.21" iyy="0.25" izz="0.25"/></inertial>
    <collision><geometry><box size="0.46 0.58 0.25"/></geometry></collision>
  </link>
  <link name="camera_link"/>
  <joint name="camera_joint" type="fixed">
    <parent link="base_link"/><child link="camera_link"/><origin xyz="0.21 0 0.02"/>
  </joint>
  {"".join(parts)}
</robot>
"""


@pytest.fixture(autouse=True)
def _at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my_rov.urdf").write_text(own_urdf(), encoding="utf-8")


def test_the_commands_of_the_page_make_a_vehicle_that_can_fly(capsys: pytest.CaptureFixture[str]) -> None:
    """Size and camera are the URDF's, the rest are estimates and marked; before that one message names all it lacks."""
    for line in block("").splitlines():
        words = shlex.split(line, comments=True)[1:]
        if words[0] == "scan" or words[1] == "trim":
            continue  # a whole trial; the flight below is its first part. Trim has tests of its own
        assert run(words) == 0, line
        if words[1] == "import" and "--like" not in words:
            with pytest.raises(InputError) as caught:
                ww.load_vehicle(words[words.index("--out") + 1])
            for field in (
                "displaced_volume_m3",
                "rotation_kg_m2",
                "quadratic_N_m_s2",
                "horizontal_fov_deg",
                "diameter_m",
            ):
                assert field in str(caught.value)
    assert "estimate" in capsys.readouterr().out
    whole = ww.load_vehicle("my_whole_rov.yaml")
    assert whole.size_m.tolist() == [0.46, 0.58, 0.25]
    assert whole.X_BC.p_m.tolist() == [0.21, 0.0, -0.02]
    assert whole.mass_kg == 11.0
    marked = {p.group for p in whole.provenance if p.estimate}
    assert marked >= {"buoyancy", "added_mass", "damping", "thruster_limits", "thruster_disk", "camera_lens"}
    assert "camera_mount" not in marked
    assert "inertia" not in marked


@pytest.mark.slow
def test_the_python_of_the_page_flies_it(capsys: pytest.CaptureFixture[str]) -> None:
    """Two seconds near its way, with no fallback and no collision."""
    assert run(shlex.split("vehicle import my_rov.urdf --out my_whole_rov.yaml --like bluerov2-heavy")) == 0
    capsys.readouterr()
    exec(block("python"), {})
    said = capsys.readouterr().out
    assert "water at the target" in said
    assert "fallbacks" not in said
    assert "collisions" not in said
    off_mm = float(re.findall(r"([\d.]+) mm off its way", said)[0])
    assert off_mm < 60.0


@pytest.mark.parametrize("path", ["my_rov.txt", "out"])
def test_a_vehicle_file_that_could_not_be_found_again_is_not_written(
    path: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("out").mkdir()
    assert run(["vehicle", "import", "my_rov.urdf", "--out", path]) == 2
    assert path in capsys.readouterr().err
    assert not Path("my_rov.txt").exists()


def test_a_file_that_exists_is_replaced_only_where_it_is_asked(capsys: pytest.CaptureFixture[str]) -> None:
    """Its own input, above all: what somebody filled in by hand stays."""
    Path("mine.yaml").write_text("name: mine\n", encoding="utf-8")
    words = ["vehicle", "import", "my_rov.urdf", "--out", "mine.yaml"]
    assert run(words) == 2
    assert capsys.readouterr().err == (
        "wakewise: --out mine.yaml: exists; give another name, or --force to replace it\n"
    )
    assert Path("mine.yaml").read_text(encoding="utf-8") == "name: mine\n"
    assert run([*words, "--force"]) == 0
    assert "my_rov" in Path("mine.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("bluerov2heavy", "did you mean bluerov2-heavy?"),
        ("Paper", "did you mean paper?"),
        ("nofile.urdf", "nofile.urdf: no such file"),
        ("nofile.yaml", "nofile.yaml: no such file"),
        ("there/nofile", "there/nofile: no such file"),
        ("nofile", "not in the library, allowed bluerov2,"),
    ],
)
@pytest.mark.parametrize("command", ["check", "show", "import"])
def test_a_vehicle_that_is_not_there_has_a_guess_or_is_no_file(
    command: str, name: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A name with a slash or an ending is meant as a file, any other as one of the library."""
    assert run(["vehicle", command, name]) == 2
    assert words in capsys.readouterr().err
