"""The exceptions that Wakewise raises; the command line turns them into one line and exit code 2."""

from __future__ import annotations

import errno
import os
import re
from pathlib import Path


class WakewiseError(Exception):
    """Base of every error that Wakewise raises on purpose."""


class InputError(WakewiseError):
    """What the user gave cannot be used: the message names the file or field, what was found and what is allowed."""


class StageError(WakewiseError):
    """A stage of a trial could not finish on valid input, such as photographs that do not register."""


class EnvironmentFailure(WakewiseError):  # noqa: N818  (no error of the program)
    """The computer did not let a stage finish: a full disk, no permission, a file that went away.

    Says nothing about the input, so no result is made of it: the same command, given room, does the stage again.
    """


class MissingExtra(WakewiseError, ImportError):  # noqa: N818  (it is what is missing, as pip names it)
    """A package is needed that is no part of the core: the message says by whom, which, and how it is installed."""


class FileFailure(EnvironmentFailure, OSError):  # noqa: N818  (as above)
    """A file or folder that the operating system did not let be read or written; has `errno` and `filename`."""

    def __str__(self) -> str:
        where = "" if self.filename is None else f"{self.filename}: "
        return f"{where}{self.strerror}"


STRICT = "WAKEWISE_STRICT"
"""Environment variable: with 1, guards raise mistakes of the program instead of flying a fallback."""


def is_strict() -> bool:
    """Whether guards of simulated flights raise what is no error of Wakewise (WAKEWISE_STRICT=1).

    A guard keeps a vehicle in the water under control whatever a controller or planner raises. In a simulation that
    hides mistakes: the flight goes on with the fallback. Where a world does not wait, as with a real vehicle, the
    variable is not heeded.
    """
    return os.environ.get(STRICT, "0").strip() not in ("", "0")


FULL = "the disk is full"
NO_MEMORY = "out of memory"
_WORDS = dict.fromkeys((errno.ENOSPC, errno.EDQUOT, errno.EFBIG), FULL) | {errno.ENOMEM: NO_MEMORY}
# Whatever met these, and however it was told, it was no fault of the input.
_NEVER_INPUT = {*_WORDS, errno.EIO, errno.EROFS, errno.EMFILE, errno.ENFILE, errno.ESTALE}
_NUMBERED = re.compile(r"\(os error (\d+)\)|\[Errno (\d+)\]")
_FULL = re.compile("the disk (of .+ )?is full")
# What libraries say of the same in words of their own: SQLite, C++, OpenCV, PyTorch, Numba.
_SAID = {
    **{os.strerror(number): number for number in (*_NEVER_INPUT, errno.EACCES, errno.EPERM)},
    "database or disk is full": errno.ENOSPC,
    "std::bad_alloc": errno.ENOMEM,
    "Insufficient memory": errno.ENOMEM,
    "failed to map segment from shared object": errno.ENOMEM,
}
_PLACELESS = {
    "no locator available": "compiled code can be kept nowhere; set NUMBA_CACHE_DIR to a folder that can be written"
}
# A reader, a peer or a child that went away: no file, and told by those who met it.
_OTHERS_ENDED = (ConnectionError, BlockingIOError, ChildProcessError, InterruptedError, TimeoutError)


def environment_failure(fault: BaseException, place: Path | None = None) -> EnvironmentFailure | None:
    """The failure of the computer that an exception tells of, however a library wrapped it; None if it tells of none.

    A full disk, a lack of memory, a disk that cannot be read and the like are found in the exception and in those that
    it was raised from, by number (`OSError`, Rust's "os error 28") or by words. That a file is missing or not allowed
    may be the fault of the input: that counts only where no error of Wakewise says so.

    `place`: what was being written, for the message where the exception names no file.
    """
    seen: set[int] = set()
    cause: BaseException | None = fault
    judged = False  # an error of Wakewise has said what it means
    while cause is not None and id(cause) not in seen:
        seen.add(id(cause))
        if isinstance(cause, EnvironmentFailure):
            return cause
        judged |= isinstance(cause, WakewiseError)
        number = _number(cause)
        if number is not None and (number in _NEVER_INPUT or not judged):
            return _failure(cause, number, place)
        words = next((said for known, said in _PLACELESS.items() if known in str(cause)), None)
        if words is not None:
            return EnvironmentFailure(words)
        judged |= cause.__cause__ is None  # what was merely being handled may be another matter
        cause = cause.__cause__ or cause.__context__
    return None


def is_full(fault: BaseException) -> bool:
    """Whether an exception tells that a file had no room."""
    found = environment_failure(fault)
    if found is None:
        return False
    if isinstance(found, OSError):
        return _WORDS.get(found.errno or 0) == FULL
    return bool(_FULL.search(str(found))) or (found.__cause__ is not None and is_full(found.__cause__))


def _number(fault: BaseException) -> int | None:
    """Number of the operating system's error that an exception tells of itself; 0 where it is one without a number."""
    if isinstance(fault, MemoryError):
        return errno.ENOMEM
    if isinstance(fault, _OTHERS_ENDED):
        return None
    if isinstance(fault, OSError) and fault.errno:
        return fault.errno
    text = str(fault)
    numbered = _NUMBERED.search(text)
    if numbered:
        return int(numbered[1] or numbered[2])
    unsaid = 0 if isinstance(fault, OSError) else None
    return next((number for words, number in _SAID.items() if words in text), unsaid)


def _failure(fault: BaseException, number: int, place: Path | None) -> EnvironmentFailure:
    """The failure of that number, in a line."""
    if number == errno.ENOMEM:
        told = " ".join(str(fault).split())
        return EnvironmentFailure(f"{NO_MEMORY} ({told})" if isinstance(fault, MemoryError) and told else NO_MEMORY)
    named = fault.filename if isinstance(fault, OSError) else None
    words = _WORDS.get(number) or (os.strerror(number) if number else " ".join(str(fault).split()))
    where = named if named is not None else place
    return FileFailure(number, words, None if where is None else str(where))
