"""Ctrl-C that a library swallows, or makes another error of, still ends the command in one line."""

from typing import Any

import pytest

from wakewise.core.errors import InputError
from wakewise.ui.cli import main
from wakewise.ui.cli.console import ProgressBars
from wakewise.ui.cli.signals import INTERRUPTED


def test_work_that_goes_on_after_ctrl_c_is_stopped_at_its_next_word() -> None:
    """Progress after an interrupt raises it again; without one it does not."""
    with ProgressBars().stage("work") as progress:
        progress(0, 2, "note")
    INTERRUPTED.set()
    try:
        with pytest.raises(KeyboardInterrupt), ProgressBars().stage("work") as progress:
            progress(1, 2, "note")
    finally:
        INTERRUPTED.clear()


def _raise(fault: BaseException, cause: BaseException | None) -> Any:
    raise fault from cause


@pytest.mark.parametrize("swallowed", [False, True])
def test_an_error_made_of_ctrl_c_is_exit_130(swallowed: bool, monkeypatch: Any, capsys: Any) -> None:
    """A class half-made when it came gives a RuntimeError with it as its cause; a call back from C keeps no cause."""
    cause = None if swallowed else KeyboardInterrupt()
    monkeypatch.setattr(
        main, "_commands", lambda: lambda **_: _raise(RuntimeError("Error calling __set_name__"), cause)
    )
    if swallowed:
        INTERRUPTED.set()
    try:
        assert main.run([]) == 130
    finally:
        INTERRUPTED.clear()
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "stopped" in said[0]


@pytest.mark.parametrize(("words", "kept"), [(["photos", "pick"], False), (["measure"], False), (["scan"], True)])
def test_only_commands_that_keep_what_was_finished_say_so(
    words: list[str], kept: bool, monkeypatch: Any, capsys: Any
) -> None:
    """A command that writes at its end begins anew."""
    monkeypatch.setattr(main, "_commands", lambda: lambda **_: _raise(KeyboardInterrupt(), None))
    assert main.run(words) == 130
    said = capsys.readouterr().err
    assert ("is kept" in said) is kept and ("begins anew" in said) is not kept


def test_without_ctrl_c_an_error_stays_what_it_is(monkeypatch: Any, capsys: Any) -> None:
    """A fault that nobody foresaw is raised; bad input is exit 2, also in a command that was told to stop."""
    monkeypatch.setattr(main, "_commands", lambda: lambda **_: _raise(RuntimeError("a fault"), None))
    with pytest.raises(RuntimeError, match="a fault"):
        main.run([])
    monkeypatch.setattr(main, "_commands", lambda: lambda **_: _raise(InputError("speed: 7 is too much"), None))
    INTERRUPTED.set()
    try:
        assert main.run([]) == 2
    finally:
        INTERRUPTED.clear()
    assert capsys.readouterr().err == "wakewise: speed: 7 is too much\n"
