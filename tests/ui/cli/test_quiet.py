"""`--quiet` hides progress, and nothing else; a bare `wakewise` says what to do next."""

import pytest

from wakewise.ui.cli import console
from wakewise.ui.cli.console import ProgressBars, quiet_progress
from wakewise.ui.cli.main import run


@pytest.fixture(autouse=True)
def fresh_console():
    """A console of this test's standard error."""
    console._stderr.cache_clear()
    yield
    console._stderr.cache_clear()


@pytest.mark.parametrize("quiet", [False, True])
def test_stages_are_shown_unless_quiet(capfd, monkeypatch: pytest.MonkeyPatch, quiet: bool) -> None:
    """Neither a bar, nor life signs, nor the line at the end; a stage that was done is not told of either."""
    monkeypatch.setattr(console, "HEARTBEAT_S", 0.01)
    with quiet_progress(quiet):
        with ProgressBars().stage("work") as progress:
            progress(1, 2, "half")
        ProgressBars().skipped("more")
    assert (capfd.readouterr().err == "") is quiet


@pytest.mark.parametrize("words", [["vehicle", "show", "paper", "--quiet"], ["--quiet", "vehicle", "show", "paper"]])
def test_quiet_stands_anywhere_and_results_are_the_same(capfd, words: list[str]) -> None:
    """Before and after the name of the command; the table is that of the command without it."""
    assert run(["vehicle", "show", "paper"]) == 0
    shown = capfd.readouterr().out
    assert run(words) == 0
    assert capfd.readouterr().out == shown


def test_errors_are_told_all_the_same(capfd) -> None:
    """Exit code 2 and one line."""
    assert run(["vehicle", "show", "submarine-of-nobody", "--quiet"]) == 2
    assert capfd.readouterr().err.count("\n") == 1


def test_a_bare_call_says_what_to_do_next(capfd) -> None:
    """Help, then the first command to try; asked-for help ends with the commands."""
    assert run([]) == 0
    bare = capfd.readouterr().out
    assert run(["--help"]) == 0
    asked = capfd.readouterr().out
    assert bare.startswith(asked.rstrip()) and "Next: `wakewise scan`" in bare and "Next:" not in asked
