"""Kernels are kept where they can be: beside the source, in the user's cache, or in a folder for temporary files."""

import os
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from wakewise.core.jit.cache_dir import VARIABLE, can_be_written, needs_folder, private_folder, select_cache_folder


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with two subpackages."""
    for room in ("a", "b"):
        (tmp_path / "package" / room).mkdir(parents=True)
    return tmp_path / "package"


def test_only_where_nothing_can_be_written_a_folder_is_needed(package: Path) -> None:
    """Beside the source is enough, so is the user's cache, so is a folder that the user gave."""
    home = {"HOME": "/home/me"}
    assert not needs_folder(package, home, lambda _: True)
    assert needs_folder(package, home, lambda _: False)
    assert not needs_folder(package, home | {VARIABLE: "/mine"}, lambda _: False)
    assert not needs_folder(package, home, lambda path: path == Path("/home/me/.cache/numba"))
    elsewhere = home | {"XDG_CACHE_HOME": "/scratch"}
    assert not needs_folder(package, elsewhere, lambda path: path == Path("/scratch/numba"))
    assert needs_folder(package, home, lambda path: path == package / "a" / "__pycache__")


def test_a_place_can_be_written_if_what_stands_there_can(tmp_path: Path) -> None:
    """A folder that is still to be made counts by the one that it would stand in; below a file nothing can stand."""
    assert can_be_written(tmp_path / "not" / "yet")
    (tmp_path / "file").touch()
    assert not can_be_written(tmp_path / "file" / "below")
    assert not can_be_written(Path("/proc/self"))


def test_a_home_that_cannot_be_looked_into_is_no_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a service with the HOME of another user: that is no error, whatever asking for it raises."""

    def refused(_: Path) -> bool:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "exists", refused)
    assert not can_be_written(Path("/home/of-another/.cache/numba"))


def test_a_user_who_cannot_read_the_home_imports_and_runs(tmp_path: Path) -> None:
    """A service whose HOME is another user's: kernels go to the folder for temporary files."""
    source = Path(sys.modules["wakewise"].__file__ or "").parents[1]
    home, tmp = tmp_path / "home", tmp_path / "tmp"
    home.mkdir(mode=0o700)
    tmp.mkdir()
    tmp.chmod(0o777)
    code = "import wakewise.allocation, wakewise.core.jit.cache_dir as c; print(c.CHOSEN)"
    words = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", sys.executable, "-c", code]
    environment = os.environ | {"HOME": str(home), "TMPDIR": str(tmp), "PYTHONPATH": str(source)}
    for name in (VARIABLE, "XDG_CACHE_HOME"):
        environment.pop(name, None)
    for folder in (tmp_path, *tmp_path.parents):  # of the test's own, which only its user may enter
        if "pytest" in folder.as_posix():
            folder.chmod(0o711)
    if not shutil.which("setpriv") or subprocess.run([*words[:4], "true"], check=False, capture_output=True).returncode:
        pytest.skip("another user can be taken by root alone")
    done = subprocess.run(words, cwd=tmp, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{tmp / 'wakewise-kernels-65534'}\n"


def test_the_folder_is_the_users_alone(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has mode 0700 and is the same the next time; one that others may write to, or a link, is not trusted."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    first = private_folder()
    assert first is not None
    assert stat.S_IMODE(first.stat().st_mode) == 0o700
    assert private_folder() == first
    first.chmod(0o777)
    other = private_folder()
    assert other is not None
    assert other != first
    assert stat.S_IMODE(other.stat().st_mode) == 0o700
    first.rmdir()
    first.symlink_to(other)
    assert private_folder() not in {first, other, None}


def test_numba_is_told(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder goes to the environment, and to Numba itself where that was imported before."""
    import numba

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("wakewise.core.jit.cache_dir.can_be_written", lambda _: False)
    monkeypatch.setattr(numba.config, "CACHE_DIR", "")
    environment = {"HOME": "/home/me"}
    folder = select_cache_folder(package, environment)
    assert environment[VARIABLE] == numba.config.CACHE_DIR == str(folder)
    assert select_cache_folder(package, {VARIABLE: "/mine"}) is None


def test_importing_wakewise_is_quick_and_settles_it_first() -> None:
    """`import wakewise` loads neither NumPy nor Numba."""
    code = "import sys, wakewise; print([m for m in ('numpy', 'numba') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.slow
def test_a_read_only_installation_compiles_all_the_same(tmp_path: Path) -> None:
    """With neither package nor home writable, kernels go to the folder for temporary files, and the command says so."""
    source = Path(sys.modules["wakewise"].__file__ or "").parents[1]
    (tmp_path / "home").mkdir()
    (tmp_path / "tmp").mkdir()
    script = (
        f"mount --bind {source} {source} && mount -o remount,bind,ro {source} && mount --bind {tmp_path}/home "
        f"{tmp_path}/home && mount -o remount,bind,ro {tmp_path}/home && exec {sys.executable} -c "
        "'from wakewise.ui.cli.main import main; main()' vehicle show paper"
    )
    if subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode:
        pytest.skip("needs the right to mount")
    environment = os.environ | {
        "HOME": str(tmp_path / "home"),
        "TMPDIR": str(tmp_path / "tmp"),
        "PYTHONPATH": str(source),
    }
    for name in (VARIABLE, "XDG_CACHE_HOME"):
        environment.pop(name, None)
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", script], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("\n") == 1
    assert "compiled code is kept in" in done.stderr
    assert [path.name for path in (tmp_path / "tmp").iterdir()] == [f"wakewise-kernels-{os.getuid()}"]
