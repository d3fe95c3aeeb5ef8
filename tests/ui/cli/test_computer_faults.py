"""What the computer does not allow ends with one line and exit code 1; SIGTERM ends as tidily as Ctrl-C."""

import io
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from wakewise.core.errors import EnvironmentFailure
from wakewise.ui.cli import main as command
from wakewise.ui.cli.main import run

Capsys = pytest.CaptureFixture[str]
Monkeypatch = pytest.MonkeyPatch


def wakewise(*arguments: str, stdout: object, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run the installed command's entry point in a process of its own."""
    code = "from wakewise.ui.cli.main import main; main()"
    words = [sys.executable, "-c", code, *arguments]
    return subprocess.run(words, stdout=stdout, stderr=subprocess.PIPE, text=True, env=env, check=False)


@pytest.mark.parametrize(
    "arguments",
    [
        ["vehicle", "list"],
        pytest.param(["vehicle", "show", "paper"], marks=pytest.mark.slow),
        ["vehicle", "show", "paper", "--json"],
    ],
)
def test_a_full_standard_output_is_one_line(arguments: list[str]) -> None:
    """Whether the text is short enough to be written only at the end or not: exit code 1, one line, no traceback."""
    with Path("/dev/full").open("w") as full:
        done = wakewise(*arguments, stdout=full)
    assert (done.returncode, done.stderr) == (1, "wakewise: cannot write: the disk is full\n")


def test_a_reader_that_went_away_is_no_fault() -> None:
    """As after `| head`: exit code 1, not a word."""
    read, write = os.pipe()
    os.close(read)
    done = wakewise("vehicle", "list", stdout=write)
    os.close(write)
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.slow
def test_an_output_without_signs_shows_the_rest() -> None:
    """A terminal of ASCII alone gets a question mark for a sign that it lacks, not an error at the end."""
    done = wakewise("vehicle", "show", "paper", stdout=subprocess.PIPE, env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert (done.returncode, done.stderr) == (0, "")
    assert "thruster" in done.stdout
    assert done.stdout.isascii()


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [["scan", "--out", "file/x"], ["target", "show", "branching", "--points", "30", "--out", "file/x.html"]],
)
def test_a_place_that_cannot_be_written_is_one_line(
    arguments: list[str], capsys: Capsys, tmp_path: Path, monkeypatch: Monkeypatch
) -> None:
    """An output folder below a file: exit code 1 and a line that names it."""
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    assert run(arguments) == 1
    said = capsys.readouterr().err
    assert said.startswith("wakewise: file")
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (PermissionError(13, "Permission denied", "runs"), "runs: Permission denied"),
        (OSError(28, "No space left on device"), "cannot write: the disk is full"),
        (MemoryError("Unable to allocate 214 GiB"), "out of memory (Unable to allocate 214 GiB)"),
        (EnvironmentFailure("match: the disk of x is full"), "match: the disk of x is full"),
        (ValueError("parquet: underlying IO error: No space left on device (os error 28)"), "the disk is full"),
        (RuntimeError("cannot cache function 'cost': no locator available"), "NUMBA_CACHE_DIR"),
    ],
)
def test_the_computers_faults_are_told_in_one_line(
    fault: Exception, words: str, capsys: Capsys, monkeypatch: Monkeypatch
) -> None:
    """A permission, room on the disk, memory: exit code 1; a fault of the program itself keeps its traceback."""

    def fail(**_: object) -> None:
        raise fault

    monkeypatch.setattr(command, "_commands", lambda: fail)
    assert run([]) == 1
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1

    def break_down(**_: object) -> None:
        raise ValueError("a mistake of ours")

    monkeypatch.setattr(command, "_commands", lambda: break_down)
    with pytest.raises(ValueError, match="of ours"):
        run([])


ENDED = """
import sys, time
from wakewise.vision import reconstruction
from wakewise.ui.cli.main import main
from wakewise.core.files import whole_file

def work(photos, out, *_, **__):
    with whole_file(out / "database.db"):
        print("ready", flush=True)
        time.sleep(60)

reconstruction.reconstruct = work
sys.argv[1:] = ["reconstruct", "photos", "--out", "model"]
main()
"""


def test_sigterm_ends_tidily(tmp_path: Path) -> None:
    """After COLMAP has been loaded, too: exit code 143, one line, no stack of C++, no file half-written."""
    process = subprocess.Popen(
        [sys.executable, "-c", ENDED], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    assert [path.name for path in (tmp_path / "model").iterdir() if path.name.startswith(".database.")]
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=30)
    assert process.returncode == 143
    assert said == "wakewise: stopped; what was finished is kept, run the same command again to go on\n"
    assert [path.name for path in (tmp_path / "model").iterdir()] == ["reconstruct.log"]


def test_loading_colmap_leaves_sigterm_to_its_owner() -> None:
    """A script of one's own that uses the library ends at once and quietly on SIGTERM, as any Python does."""
    code = "import os, signal, wakewise.vision.reconstruction; os.kill(os.getpid(), signal.SIGTERM)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (-signal.SIGTERM, "")


def test_a_stream_of_ones_own_is_let_be(monkeypatch: Monkeypatch) -> None:
    """Where standard output is no terminal or file, as in a test, the command does not touch its settings."""
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    monkeypatch.setattr(sys, "argv", ["wakewise", "--version"])
    before = signal.getsignal(signal.SIGTERM)
    try:
        with pytest.raises(SystemExit) as ended:
            command.main()
    finally:
        signal.signal(signal.SIGTERM, before)
    assert ended.value.code == 0
