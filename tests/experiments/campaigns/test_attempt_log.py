"""A file of attempts is only ever added to, and what a kill left of a line is no harm."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.experiments.campaigns import attempt_log
from wakewise.experiments.campaigns.attempt_log import ATTEMPTS, Attempts, gather_attempts, read_attempts


def test_attempts_are_counted_and_the_last_end_is_told(tmp_path: Path) -> None:
    """Begun counts all, failed those that are tried again; an end by the user is no failure."""
    assert read_attempts(tmp_path) == Attempts()
    for how in ("died", "stopped", "late"):
        attempt_log.begin(tmp_path, pid=1)
        attempt_log.end(tmp_path, how, f"because {how}", 2.5)
    told = read_attempts(tmp_path)
    assert told == Attempts(begun=3, failed=2, how="late", reason="because late", took_s=2.5)
    assert told.is_failure(1)
    assert not told.is_failure(2)


def test_an_exception_is_final_and_anew_forgets_it(tmp_path: Path) -> None:
    """The same seed would raise it again, unless somebody says otherwise."""
    attempt_log.begin(tmp_path)
    attempt_log.end(tmp_path, "error", "it does not fit", 0.1)
    assert read_attempts(tmp_path).is_failure(100)
    attempt_log.clear_failures(tmp_path)
    told = read_attempts(tmp_path)
    assert not told.is_failure(0)
    assert told.begun == 1


@pytest.mark.parametrize("cut", range(1, 40))
def test_a_line_that_was_cut_off_hides_no_other(tmp_path: Path, cut: int) -> None:
    """However much of the last line is lost, the lines before and after it count."""
    attempt_log.begin(tmp_path)
    attempt_log.end(tmp_path, "died", None, 1.0)
    path = tmp_path / ATTEMPTS
    path.write_bytes(path.read_bytes()[:-cut])
    attempt_log.begin(tmp_path)
    attempt_log.end(tmp_path, "done", None, 1.0)
    told = read_attempts(tmp_path)
    assert told.how == "done"
    assert told.begun == 2


@given(st.binary(max_size=300))
def test_any_bytes_are_read(text: bytes) -> None:
    """A damaged file gives what can be told from it, and no exception."""
    told = gather_attempts(text)
    assert told.begun >= 0


@given(st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=9), lambda x: st.lists(x, max_size=3)))
def test_lines_of_another_kind_are_passed_over(value: object) -> None:
    """JSON that says something else is no attempt."""
    import json

    told = gather_attempts(f"{json.dumps({'event': value, 'how': value})}\n{json.dumps(value)}\n".encode())
    assert told == Attempts()
