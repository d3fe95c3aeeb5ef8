"""`vehicle check` and `show` read another project's file as `import` does, and no name or folder breaks a command."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wakewise.core.errors import InputError
from wakewise.ui.cli.vehicle import app

TWO = "tam: [[1,0],[0,1],[0,0],[0,0],[0,0],[0.5,-0.5]]\n"
XACRO = """<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arg name="x" default="1"/>
<link name="base_link"/>
<link name="thruster_1"/><joint name="j" type="fixed"><parent link="base_link"/><child link="thruster_1"/>
<origin xyz="$(arg x) 2 0" rpy="0 0 0"/></joint></robot>"""


def run(*arguments: str | Path) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exception is not None:
        raise result.exception
    return result.stdout


@pytest.mark.parametrize("command", ["check", "show", "import"])
def test_every_command_takes_frame_direction_and_arguments(tmp_path: Path, command: str) -> None:
    """And reads the same vehicle with them."""
    path = tmp_path / "r.xacro"
    path.write_text(XACRO)
    notes = json.loads(run(command, path, "--frame", "FRD", "--thrust-direction", "-y", "--arg", "x:=3", "--json"))[
        "notes"
    ]
    assert any(note.startswith("frame: FRD") and "told" in note for note in notes)
    assert any("along -y of each thruster's own frame" in note for note in notes)
    assert not any("x:='1'" in note for note in notes)


def test_show_places_the_thruster_where_the_options_say(tmp_path: Path) -> None:
    path = tmp_path / "r.xacro"
    path.write_text(XACRO)
    options = ("--frame", "FRD", "--thrust-direction", "-y", "--arg", "x:=3", "--json")
    (thruster,) = json.loads(run("show", path, *options))["thrusters"]
    assert thruster["position_m"] == [3.0, 2.0, 0.0] and thruster["axis"] == [0.0, -1.0, 0.0]


@pytest.mark.parametrize(
    ("options", "match"),
    [
        (["--frame", "FLU"], "vehicle bluerov2-heavy: needs no frame"),
        (["--thrust-direction", "reversed"], "needs no thrust direction"),
        (["--arg", "x:=1"], "needs no arguments"),
        (["--arg", "x=1"], "--arg x=1: allowed is NAME:=VALUE"),
    ],
)
def test_options_for_foreign_files_are_refused_for_our_own(options: list[str], match: str) -> None:
    for command in ("check", "show"):
        with pytest.raises(InputError, match=match):
            run(command, "bluerov2-heavy", *options)


@pytest.mark.parametrize("command", ["check", "show", "import"])
@pytest.mark.parametrize("name", ["[/red]", "[bold]b", "\\", "[b]\\", "a\\tb", "\\e[31mred"])
def test_names_are_words_and_not_markup(tmp_path: Path, command: str, name: str) -> None:
    """What looks like markup is shown as it stands; a control character is not."""
    path = tmp_path / "m.yaml"
    quoted = f'"{name}"' if name[-1] != "\\" else f"'{name}'"
    path.write_text(f"thrusters:\n- {{name: {quoted}, position: [1,0,0], direction: [1,0,0]}}\n")
    text = run(command, path)
    assert "\x1b" not in text
    if name[0] == "[" and command != "check":
        assert name in text


@pytest.mark.parametrize("command", ["check", "show", "import"])
def test_a_folder_is_no_vehicle(tmp_path: Path, command: str) -> None:
    for folder in (tmp_path, tmp_path / "a.yaml", tmp_path / "a.urdf"):
        folder.mkdir(exist_ok=True)
        with pytest.raises(InputError, match=r"is a folder|not a file"):
            run(command, folder)


def test_folders_are_refused_where_a_file_is_to_be_written(tmp_path: Path) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(TWO)
    for command, option in (("import", "--out"), ("show", "--out"), ("show", "--drawing")):
        with pytest.raises(InputError, match=f"{option} .* is a folder"):
            run(command, path, option, tmp_path)


@pytest.mark.parametrize("text", ["tam: [[],[],[],[],[],[]]", "tam: []", "tam: [[]]", ""])
def test_an_empty_matrix_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "m.yaml"
    path.write_text(text)
    for arguments in (("check", path), ("import", path), ("check", "bluerov2-heavy", "--matrix", path)):
        with pytest.raises(InputError, match=r"m.yaml"):
            run(*arguments)


def test_what_is_questioned_is_said_and_the_vehicle_is_read(tmp_path: Path) -> None:
    """A doubt is no refusal: the command ends well."""
    path = tmp_path / "rov_6dof.yaml"
    path.write_text(TWO)
    for command in ("check", "show", "import"):
        assert "QUESTIONED: the name rov_6dof claims 6 axes" in run(command, path)
