"""`wakewise cockpit`: what cannot be served or flown is refused in one line before anything is left behind."""

import socket
from pathlib import Path

import pytest

from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_port_that_is_taken_is_refused(capsys: Capsys) -> None:
    """Exit code 2, one line that names it and what to do; no folder is made."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert run(["cockpit", "--no-browser", "--port", str(port)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.strip().splitlines()
    assert f"--port {port}" in line
    assert "give another --port" in line
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--port", "70000"], ["--port", "65535"]),
        (["--host", "no.such.host.invalid", "--port", "0"], ["no.such.host.invalid", "give another"]),
        (["--world", "moon"], ["moon"]),
        (["--preset", "huge"], ["huge", "quick"]),
        (["gone.yaml"], ["gone.yaml", "no such file"]),
        (["--set", "pilot=operater"], ["operater"]),
    ],
)
def test_what_cannot_be_flown_is_refused(arguments: list[str], words: list[str], capsys: Capsys) -> None:
    """Exit code 2 and one line with what was found."""
    assert run(["cockpit", "--no-browser", *arguments]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    for word in words:
        assert word in lines[-1], lines
    assert not Path("runs").exists()
