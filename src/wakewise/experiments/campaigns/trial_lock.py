"""Who is at a trial: a claim in its folder, taken by one process at a time and taken over where its holder is gone.

A claim says host, boot, process and when that process started, so that a number given anew, or a computer started anew,
is not taken for its holder. Of holders on other computers only the heartbeat is seen: the claim's time of change, which
is only ever compared with itself, so that no clock has to be right.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from wakewise.core.run_lock import boot_id, is_running, start_of, temporary_prefix

CLAIM = "claim.json"
_TAKING_OVER = ".taking-over"


@dataclass(frozen=True)
class LockHolder:
    """A process: where, in which run of that computer, its number, and when it started (kernel ticks; 0 unknown)."""

    host: str
    boot: str
    pid: int
    start: int

    @property
    def is_here(self) -> bool:
        """Whether it is one of this computer, so that it can be asked for."""
        return self.host == _host()

    @property
    def is_gone(self) -> bool:
        """Whether it is known to be gone; of another computer's this is never known."""
        return self.is_here and (self.boot != boot_id() or not is_running(self.pid, self.start))


def this_process() -> LockHolder:
    """The one that asks."""
    return LockHolder(_host(), boot_id(), os.getpid(), start_of(os.getpid()))


def holder_of(folder: Path) -> LockHolder | None:
    """Claim on a trial's folder; None if there is none, or if it cannot be read."""
    try:
        return LockHolder(**json.loads((folder / CLAIM).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def heartbeat_of(folder: Path) -> int | None:
    """Time stamp of the claim's last heartbeat, for comparing with itself only; None without a claim."""
    try:
        return (folder / CLAIM).stat().st_mtime_ns
    except OSError:
        return None


def renew_lock(folder: Path) -> None:
    """Show that the holder of a claim is alive."""
    with suppress(OSError):
        os.utime(folder / CLAIM)


def acquire_lock(folder: Path, abandoned_beat: int | None = None) -> bool:
    """Claim a trial's folder for this process; False if another has it.

    `abandoned_beat` is a heartbeat that was seen not to change for so long that its holder on another computer counts
    as gone.
    """
    mine = folder / (temporary_prefix(CLAIM) + os.urandom(4).hex() + ".json")
    mine.write_text(json.dumps(asdict(this_process())), encoding="utf-8")
    try:
        try:
            os.link(mine, folder / CLAIM)  # fails where there is one; what is there is whole
            return True
        except FileExistsError:
            pass
        except FileNotFoundError:  # the holder has swept it away: it is at work
            return False
        with _one_at_a_time(folder.parent):
            if not _is_left(folder, abandoned_beat):
                return False
            with suppress(FileNotFoundError):
                mine.replace(folder / CLAIM)
                return True
            return False
    finally:
        mine.unlink(missing_ok=True)


def owns_lock(folder: Path) -> bool:
    """Whether this process holds the claim still."""
    return holder_of(folder) == this_process()


def release_lock(folder: Path) -> None:
    """Give the claim back, if this process holds it."""
    if owns_lock(folder):
        (folder / CLAIM).unlink(missing_ok=True)


def _is_left(folder: Path, abandoned_beat: int | None) -> bool:
    """Whether a claim's holder is gone."""
    if not (folder / CLAIM).exists():
        return True
    holder = holder_of(folder)
    if holder is None or holder.is_gone:  # claims are written whole: an unreadable one is a damaged file
        return True
    return not holder.is_here and abandoned_beat is not None and heartbeat_of(folder) == abandoned_beat


@contextmanager
def _one_at_a_time(folder: Path) -> Iterator[None]:
    """Hold others off while a claim is taken over: between the look at it and its replacement no other may do so."""
    path = folder / _TAKING_OVER
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        with suppress(ImportError, OSError):  # systems, and file systems, without locks
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX)
        with suppress(FileNotFoundError):
            if os.fstat(handle).st_ino == path.stat().st_ino:
                break
        os.close(handle)  # its holder removed it between the opening and the locking
    try:
        yield
    finally:
        with suppress(OSError):  # Windows removes no open file
            path.unlink(missing_ok=True)
        os.close(handle)


@cache
def _host() -> str:
    """Name of the computer, or of the container in it: process numbers mean something within one of these only."""
    try:
        space = str(Path("/proc/self/ns/pid").readlink())
    except OSError:
        space = ""
    return f"{platform.node()} {space}".strip()
