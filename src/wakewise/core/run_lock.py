"""Who is at work in a folder: names for what is half-done, what the killed left behind, one run at a time."""

from __future__ import annotations

import os
import re
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from wakewise.core.errors import InputError

LOCK = ".lock"
_LEFT = re.compile(r"\..+\.w(\d+)-([0-9a-f]+)\.[a-z0-9_]{8}(\.\w+)?")
_held: set[tuple[Path, int]] = set()


def temporary_prefix(stem: str) -> str:
    """How the name of a temporary file or folder of this process begins, to which eight random characters are added."""
    return f".{stem}.w{os.getpid()}-{start_of(os.getpid()):x}."


def remove_stale(folder: Path) -> None:
    """Remove from a folder, and the folders in it, what `temporary_prefix` named in processes that have ended since."""
    for left in (*folder.glob(".*"), *folder.glob("*/.*")):
        named = _LEFT.fullmatch(left.name)
        if named is None or is_running(int(named[1]), int(named[2], 16)):
            continue
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left, ignore_errors=True)
        else:
            with suppress(OSError):
                left.unlink()


def is_running(pid: int, start: int) -> bool:
    """Whether a process is there and is the one that started then; its number alone may be another's by now."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OverflowError:
        return False
    except PermissionError:  # another user's
        pass
    return start_of(pid) in (start, 0)


@contextmanager
def exclusive_run(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder while the block runs; begin by sweeping what killed ones left.

    The lock ends with its process, however that ends; the file that stays behind is taken over by the next run. A
    block inside another of the same thread and folder is let be.

    Raises InputError if another process or thread is at it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mine = (folder.resolve(), threading.get_ident())
    if mine in _held:
        yield
        return
    handle = _take(folder)
    _held.add(mine)
    try:
        remove_stale(folder)
        yield
    finally:
        _held.discard(mine)
        (folder / LOCK).unlink(missing_ok=True)
        os.close(handle)


def _take(folder: Path) -> int:
    """Open and lock the folder's lock file; who holds it stands in it."""
    path = folder / LOCK
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            if not _locked(handle):
                pid = os.read(handle, 100).decode(errors="replace").split(" ")[0] or "unknown"
                raise InputError(
                    f"--out {folder}: another run is at it (pid {pid}); wait for its end or give another --out"
                )
            with suppress(FileNotFoundError):
                if os.fstat(handle).st_ino == path.stat().st_ino:
                    os.truncate(handle, 0)
                    os.write(handle, f"{os.getpid()} {boot_id()}\n".encode())
                    return handle
        except BaseException:
            os.close(handle)
            raise
        os.close(handle)  # its holder removed it between the opening and the locking


def _locked(handle: int) -> bool:
    """Lock an open file; where a file system or the system knows no locks, all goes on without."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def start_of(pid: int) -> int:
    """When a process started, in the kernel's ticks; 0 where the system does not say, -1 if it has ended.

    One that has ended has a number still while nobody has asked how.
    """
    try:
        facts = Path("/proc", str(pid), "stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return 0
    words = facts.rpartition(")")[2].split()
    return -1 if words[0] in ("Z", "X") else int(words[19])


def boot_id() -> str:
    """Which start of the computer this is."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="utf-8").strip()
    except OSError:
        return "-"
