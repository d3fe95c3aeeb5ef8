"""Two runs never share a folder, and what a killed one left does not stay."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.core.run_lock import LOCK, exclusive_run, is_running, remove_stale, temporary_prefix

HOLD = """
import sys, time
from pathlib import Path
from wakewise.core.files import whole_file, whole_folder
from wakewise.core.run_lock import exclusive_run
folder = Path(sys.argv[1])
with exclusive_run(folder), whole_file(folder / "a.db"), whole_folder(folder / "images" / "b"):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path: Path):
    """Another process at work in tmp_path / "run"."""
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path / "run")], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    yield process, tmp_path / "run"
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_second_run_is_refused_and_touches_nothing(holder: tuple[subprocess.Popen[str], Path]) -> None:
    """The message names the folder and the process; what that one has half-done stays."""
    process, folder = holder
    before = sorted(folder.rglob("*"))
    with pytest.raises(InputError, match=rf"run: another run is at it \(pid {process.pid}\)"), exclusive_run(folder):
        pass
    remove_stale(folder)
    assert sorted(folder.rglob("*")) == before
    assert len(before) == 4  # the lock, a file, a folder with a folder


def test_what_a_killed_run_left_is_taken_over(holder: tuple[subprocess.Popen[str], Path]) -> None:
    """After kill -9 the lock is free and everything half-done goes; other hidden files are nobody's business."""
    process, folder = holder
    process.send_signal(signal.SIGKILL)
    process.wait()
    others = [folder / ".keep", folder / "images" / ".000.json", folder / ".a.w1-z.abcdefgh.db"]
    for other in others:
        other.touch()
    assert len([path for path in folder.rglob(".*") if path not in others]) == 3
    with exclusive_run(folder):
        assert sorted(folder.rglob(".*")) == sorted([*others, folder / LOCK])
        assert (folder / LOCK).read_text().split()[0] == str(os.getpid())
    assert sorted(folder.rglob(".*")) == sorted(others)


def test_a_run_inside_a_run_is_the_same_one(tmp_path: Path) -> None:
    """A block inside another passes and leaves the lock to it; afterwards the folder is empty, also after a failure."""
    with pytest.raises(RuntimeError), exclusive_run(tmp_path):
        with exclusive_run(tmp_path / "."):
            pass
        assert (tmp_path / LOCK).exists()
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


def test_ones_own_half_done_files_are_not_swept(tmp_path: Path) -> None:
    """A process that sweeps while it writes keeps what it writes."""
    with whole_file(tmp_path / "x.png") as temporary:
        remove_stale(tmp_path)
        temporary.write_text("x")
    assert (tmp_path / "x.png").read_text() == "x"


def test_a_number_used_again_is_another_process() -> None:
    """A process is known by its number and its start; one that ended, or has another start, does not run."""
    me = temporary_prefix("x").split(".w")[1].rstrip(".")
    pid, start = me.split("-")
    assert is_running(int(pid), int(start, 16))
    assert not is_running(int(pid), int(start, 16) + 1)
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    assert not is_running(ended.pid, 1)
    assert not is_running(10**30, 1)


def test_many_that_begin_at_once_take_turns_or_are_refused(tmp_path: Path) -> None:
    """Of six processes that try again and again, never two are inside."""
    code = (
        "import sys, time\nfrom pathlib import Path\nfrom wakewise.core.errors import InputError\n"
        "from wakewise.core.run_lock import exclusive_run\n"
        "folder, end, inside = Path(sys.argv[1]), time.time() + 1.5, 0\n"
        "while time.time() < end:\n"
        "    try:\n"
        "        with exclusive_run(folder):\n"
        "            (folder / 'inside').touch(exist_ok=False)\n"
        "            (folder / 'inside').unlink()\n"
        "            inside += 1\n"
        "    except InputError:\n"
        "        pass\n"
        "print(inside)"
    )
    many = [
        subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, text=True)
        for _ in range(6)
    ]
    counts = [int(process.communicate()[0]) for process in many]
    assert [process.returncode for process in many] == [0] * 6
    assert sum(counts) > 50
    assert list(tmp_path.iterdir()) == []
