"""What the computer did not allow is told from what was wrong with the input, whichever library met it."""

from __future__ import annotations

import errno
import pickle

import polars as pl
import pytest

from wakewise.core.errors import EnvironmentFailure, FileFailure, InputError, StageError, environment_failure, is_full

NO_ROOM = OSError(errno.ENOSPC, "No space left on device", "x.csv")


def caused(fault: Exception, cause: BaseException) -> Exception:
    """A fault that was raised from another."""
    fault.__cause__ = cause
    return fault


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (NO_ROOM, "x.csv: the disk is full"),
        (OSError(errno.EDQUOT, "Disk quota exceeded"), "the disk is full"),
        (OSError("No space left on device (os error 28)"), "the disk is full"),
        (pl.exceptions.ComputeError("parquet: File out of specification: (os error 28)"), "the disk is full"),
        (RuntimeError("[Errno 28] Error writing bytes to file"), "the disk is full"),
        (RuntimeError("SQLite error: database or disk is full"), "the disk is full"),
        (StageError("match: COLMAP stopped: No space left on device"), "the disk is full"),
        (caused(StageError("match failed"), NO_ROOM), "x.csv: the disk is full"),
        (caused(InputError("v.yaml: cannot be read"), OSError(errno.EIO, "")), "Input/output error"),
        (ValueError("parquet: Read-only file system (os error 30)"), "Read-only file system"),
        (PermissionError(errno.EACCES, "Permission denied", "runs"), "runs: Permission denied"),
        (RuntimeError("cannot open: Permission denied"), "Permission denied"),
        (OSError(errno.EMFILE, "Too many open files"), "Too many open files"),
        (FileNotFoundError(errno.ENOENT, "No such file or directory", "a"), "a: No such file or directory"),
        (MemoryError("Unable to allocate 9 GiB"), "out of memory (Unable to allocate 9 GiB)"),
        (RuntimeError("std::bad_alloc"), "out of memory"),
        (RuntimeError("OpenCV: (-4:Insufficient memory) Failed to allocate 9 bytes"), "out of memory"),
        (ImportError("libceres.so: failed to map segment from shared object"), "out of memory"),
        (RuntimeError("cannot cache function 'cost': no locator available"), "NUMBA_CACHE_DIR"),
    ],
)
def test_failures_of_the_computer_are_found_however_they_are_wrapped(fault: Exception, words: str) -> None:
    """By number, by words, and in what an exception was raised from; the message names the file where one is known."""
    found = environment_failure(fault)
    assert isinstance(found, EnvironmentFailure)
    assert words in str(found)
    assert is_full(fault) is ("the disk is full" in words)


@pytest.mark.parametrize(
    "fault",
    [
        ValueError("a mistake of ours"),
        ZeroDivisionError("nothing to share"),
        InputError("v.yaml: no such file"),
        caused(InputError("v.yaml: no such file"), FileNotFoundError(errno.ENOENT, "No such file", "v.yaml")),
        caused(InputError("v.yaml: cannot be read"), PermissionError(errno.EACCES, "Permission denied", "v.yaml")),
        StageError("too few photographs"),
        BrokenPipeError(errno.EPIPE, "Broken pipe"),
    ],
)
def test_what_is_wrong_with_input_or_program_is_no_failure_of_the_computer(fault: Exception) -> None:
    """A file that the user named and that is not there is the input's fault, and so is any other exception."""
    assert environment_failure(fault) is None
    assert not is_full(fault)


def _divide(one: int, other: int) -> float:
    return one / other


def test_what_was_merely_being_handled_is_no_cause() -> None:
    """A mistake made while a missing file was handled stays a mistake; one made on a full disk is the disk's."""
    for number, is_found in ((errno.ENOENT, False), (errno.ENOSPC, True)):
        try:
            try:
                raise OSError(number, "met before")
            except OSError:
                _divide(1, 0)
        except ZeroDivisionError as fault:
            assert (environment_failure(fault) is not None) is is_found


def test_a_failure_of_a_file_is_an_os_error_too_and_passes_between_processes() -> None:
    """It has number and file, and reads the same after pickling."""
    failure = FileFailure(errno.ENOSPC, "the disk is full", "a.csv")
    again = pickle.loads(pickle.dumps(failure))
    assert isinstance(again, OSError)
    assert (again.errno, again.filename, str(again)) == (errno.ENOSPC, "a.csv", "a.csv: the disk is full")
