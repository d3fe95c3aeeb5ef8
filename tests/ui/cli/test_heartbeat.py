"""A long stage into a pipe shows life."""

import re
import time

import pytest

from wakewise.ui.cli import console
from wakewise.ui.cli.console import ProgressBars


def test_a_silent_stage_says_where_it_is_now_and_then(capfd, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines with share, note and minutes while nothing is told, none after the end, and the last says it is done."""
    console._stderr.cache_clear()
    monkeypatch.setattr(console, "HEARTBEAT_S", 0.05)
    with ProgressBars().stage("reconstruct") as progress:
        progress(30, 120, "matches")
        time.sleep(0.4)
    lines = capfd.readouterr().err.splitlines()
    assert len(lines) >= 3
    assert all(re.fullmatch(r"  reconstruct 25 % matches, 0:00 min", line) for line in lines[:-1])
    assert "reconstruct" in lines[-1] and "✓" in lines[-1]
    time.sleep(0.15)
    assert capfd.readouterr().err == ""
    console._stderr.cache_clear()


def test_a_stage_without_a_note_has_no_stray_comma(capfd, monkeypatch: pytest.MonkeyPatch) -> None:
    """Name and minutes alone."""
    console._stderr.cache_clear()
    monkeypatch.setattr(console, "HEARTBEAT_S", 0.05)
    with ProgressBars().stage("mesh"):
        time.sleep(0.2)
    assert capfd.readouterr().err.startswith("  mesh, 0:00 min")
    console._stderr.cache_clear()


def test_a_stage_that_fails_stops_its_heartbeat(capfd, monkeypatch: pytest.MonkeyPatch) -> None:
    """No line after the error."""
    console._stderr.cache_clear()
    monkeypatch.setattr(console, "HEARTBEAT_S", 0.05)
    with pytest.raises(ValueError, match="broken"), ProgressBars().stage("work"):
        raise ValueError("broken")
    time.sleep(0.15)
    assert capfd.readouterr().err == ""
    console._stderr.cache_clear()
