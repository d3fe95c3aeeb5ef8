"""`wakewise --help`: commands by what they are for, each once; -h; and shells may complete them."""

import os
import subprocess
import sys

import pytest

from wakewise.ui.cli.commands import PANELS
from wakewise.ui.cli.main import _COMMANDS, _commands, run

COMPLETE = "import sys; from wakewise.ui.cli.main import main; sys.argv = ['wakewise']; main()"


def test_every_command_stands_in_one_panel(capsys: pytest.CaptureFixture[str]) -> None:
    """The five panels hold all commands, each once, and the help shows them so."""
    assert run(["--help"]) == 0
    text = capsys.readouterr().out
    names = [name for panel, name, _ in _COMMANDS if panel in PANELS]
    assert sorted(names) == sorted(_commands().commands) and len(set(names)) == len(names)
    assert len(PANELS) == 5
    for here, following in zip(PANELS, [*PANELS[1:], None], strict=True):
        start = text.index(f"\n{here}:\n")
        section = text[start : text.index(f"\n{following}:\n") if following else None]
        shown = [line.split()[0] for line in section.splitlines()[2:] if line.strip()]
        assert shown == [name for panel, name, _ in _COMMANDS if panel == here]


@pytest.mark.parametrize("words", [[], ["scan"], ["vehicle"], ["campaign", "run"]])
def test_h_is_help(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """-h says what --help says, of every command."""
    said = []
    for option in ("-h", "--help"):
        assert run([*words, option]) == 0
        said.append(capsys.readouterr().out)
    assert said[0] == said[1] and "Usage: " in said[0]


def test_help_as_a_word_is_help(capsys: pytest.CaptureFixture[str]) -> None:
    """`wakewise help` and `wakewise help scan` say what --help says."""
    for words in ([], ["scan"]):
        assert run(["help", *words]) == run([*words, "--help"]) == 0
        said = capsys.readouterr().out
        assert said[: len(said) // 2] == said[len(said) // 2 :]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["allocate", "--points", "nix"], "wakewise: Missing option '--pose'.\n"),
        (["cockpit", "--mapping", "nix"], "wakewise: nix: cannot be read as YAML (No such file or directory)\n"),
        (
            ["allocate", "--points", "nix", "--pose", *"000000", "--wrench", *"100000"],
            "wakewise: --points nix: cannot be read as CSV, No such file or directory\n",
        ),
    ],
)
def test_what_is_missing_is_said_in_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Without an error number, and with the name of what is missing once."""
    assert run(words) == 2
    assert capsys.readouterr().err == said


def test_a_shell_can_complete_commands() -> None:
    """Asked as bash asks, the command names those that begin so."""
    asked = os.environ | {"_WAKEWISE_COMPLETE": "complete_bash", "COMP_WORDS": "wakewise re", "COMP_CWORD": "1"}
    done = subprocess.run([sys.executable, "-c", COMPLETE], env=asked, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["reconstruct", "reproduce"]


@pytest.mark.parametrize(
    ("command", "option", "count", "words"),
    [
        ("allocate", "--wrench", 6, "X Y Z K M N"),
        ("allocate", "--pose", 6, "X Y Z ROLL PITCH YAW"),
        ("tank probe", "--pose", 6, "X Y Z ROLL PITCH YAW"),
    ],
)
def test_too_few_numbers_are_told_by_how_many_are_needed(
    command: str, option: str, count: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The option after them is taken for a number by the parser; what is said is how many numbers are needed."""
    given = [*command.split(), option, *["1"] * (count - 1), "--points", "p.csv"]
    assert run(given) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and f"{option}: needs {count} numbers, {words}" in said


@pytest.mark.parametrize("group", ["link", "photos", "world"])
def test_a_group_without_a_command_says_which_there_are(capfd, group: str) -> None:
    """Its help on standard error, with exit code 2."""
    assert run([group]) == 2
    told = capfd.readouterr()
    assert told.out == ""
    assert f" {group} [OPTIONS] COMMAND" in told.err.splitlines()[0] and "Commands:" in told.err
