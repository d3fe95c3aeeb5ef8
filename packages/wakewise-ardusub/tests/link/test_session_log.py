"""The journal: whole lines, whatever ends the program."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise_ardusub.link.session_log import SessionLog, read_journal

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)


@given(told=st.dictionaries(st.text("abc", min_size=1, max_size=3), VALUES, max_size=4))
@settings(max_examples=100, deadline=None)
def test_whatever_is_told_is_one_line_of_json(told, tmp_path_factory):
    """Any values give one line that JSON can read, with time and event first."""
    path = tmp_path_factory.mktemp("journal") / "journal.jsonl"
    journal = SessionLog(path)
    journal.write("news", **told)
    journal.close()
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") == 1
    line = json.loads(text, parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert list(line)[:3] == ["t_s", "utc_s", "event"]
    assert set(line) == {"t_s", "utc_s", "event", *told}


def test_arrays_and_numbers_that_are_none(tmp_path):
    """Arrays become lists, what is not finite null."""
    journal = SessionLog(tmp_path / "j.jsonl", clock=lambda: 1.5, wall=lambda: 2.0)
    journal.write("pose", p=np.array([1.0, math.nan]), n=np.int64(3))
    journal.close()
    lines, count_bad = read_journal(tmp_path / "j.jsonl")
    assert count_bad == 0
    assert lines == [{"t_s": 1.5, "utc_s": 2.0, "event": "pose", "p": [1.0, None], "n": 3}]


def test_a_killed_program_leaves_every_line_that_it_wrote(tmp_path):
    """Killed by -9 in the middle of writing: each line is whole, and as many are there as were said to be written."""
    path = tmp_path / "journal.jsonl"
    code = (
        "import sys\nfrom pathlib import Path\nfrom wakewise_ardusub.link.session_log import SessionLog\n"
        "journal = SessionLog(Path(sys.argv[1]))\n"
        "k = 0\nwhile True:\n    journal.write('line', k=k)\n    print(k, flush=True)\n    k += 1\n"
    )
    said = 0
    with subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        while said < 200:
            said = int(process.stdout.readline())
        process.kill()
    lines, count_bad = read_journal(path)
    assert count_bad == 0
    assert [line["k"] for line in lines] == list(range(len(lines)))
    assert len(lines) > said >= 200


def test_a_line_cut_short_is_left_out_and_what_follows_is_not(tmp_path):
    """What a power cut leaves of a line is counted; a journal that goes on after it loses nothing more."""
    path = tmp_path / "journal.jsonl"
    first = SessionLog(path)
    first.write("one")
    first.close()
    path.write_bytes(path.read_bytes() + b'{"t_s": 3, "ev')
    second = SessionLog(path)
    second.write("two")
    second.close()
    lines, count_bad = read_journal(path)
    assert [line["event"] for line in lines] == ["one", "two"]
    assert count_bad == 1


def test_a_full_disk_is_counted_and_does_not_end_the_session(tmp_path):
    """Lines that cannot be written are lost, and said to be."""
    journal = SessionLog(tmp_path / "j.jsonl")
    os.close(journal._file)
    journal._file = os.open("/dev/full", os.O_WRONLY)
    journal.write("news")
    assert journal.lost == 1
    journal.close()


def test_no_journal_is_said_in_one_line(tmp_path):
    """Reading one that is not there names it."""
    with pytest.raises(InputError, match=r"nothing\.jsonl: cannot be read, the journal of a session is needed"):
        read_journal(tmp_path / "nothing.jsonl")
