"""A process that makes trials: tickets come as lines of JSON, a line goes back for each.

It claims the trial's folder, notes the attempt, works, and writes the figures last. It ends with its driver,
however that ended, so no process stays behind. What the work prints goes into the trial's log.
"""

from __future__ import annotations

import faulthandler
import json
import os
import platform
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from wakewise.core.errors import FULL, EnvironmentFailure, environment_failure, is_full
from wakewise.core.files import write_json
from wakewise.experiments.campaigns import attempt_log, trial_lock
from wakewise.experiments.campaigns.store import FIGURES, LOG, TRIAL, WORK, write_figures
from wakewise.experiments.campaigns.task import Work, WorkProgress, function_named, source_version

_GRACE_S = 10.0
"""Grace after its time, after which a process that was not ended ends itself."""
_PACKAGES = ("wakewise", "numpy", "scipy", "numba", "pycolmap", "embreex", "small-gicp")


@dataclass(frozen=True, kw_only=True)
class AttemptRequest:
    """One attempt to be made at a trial.

    `place` is the trial's folder; `trial` is `Task.plain()`; `driver` a file that is there as long as the driver wants
    the attempt; `abandoned_beat` as in `trial_lock.acquire_lock`; `version` the sources that the trial is to be made
    with, others are refused; `cwd` where the driver was started, for files and modules that a trial names from there.
    """

    place: str
    trial: dict[str, Any]
    timeout_s: float | None = None
    memory_MB: float | None = None
    driver: str = ""
    abandoned_beat: int | None = None
    version: str = ""
    cwd: str = ""


def run_attempt(
    ticket: AttemptRequest, send: WorkProgress, quiet: bool = True, begun: Callable[[], None] = lambda: None
) -> dict[str, Any]:
    """Make one attempt in this process, and say how it ended: `how` (or "held", "known"), `reason`, `took_s`.

    `quiet` sends what the work prints into the trial's log, for the whole process; `begun` is called when the trial is
    claimed and the attempt noted.
    """
    place = Path(ticket.place)
    began = time.monotonic()
    held = False
    try:
        place.mkdir(parents=True, exist_ok=True)
        held = trial_lock.acquire_lock(place, ticket.abandoned_beat)
        if not held:
            return {"how": "held", "reason": None, "took_s": 0.0}
        if (place / FIGURES).exists():  # another driver was faster
            return {"how": "known", "reason": None, "took_s": 0.0}
        for left in place.glob(".*"):  # half-written by a killed holder; who holds the claim is alone here
            with suppress(OSError):
                left.unlink()
        if not (place / TRIAL).exists():
            write_json(place / TRIAL, ticket.trial | {"versions": _versions()}, lasting=True)
        attempt_log.begin(place, **asdict(trial_lock.this_process()))
        begun()
        told = _tried(ticket, place, send, quiet)
        told["took_s"] = time.monotonic() - began
        with suppress(OSError):  # a full disk: the driver reports it
            attempt_log.end(place, told["how"], told["reason"], told["took_s"])
        return told
    except OSError as fault:
        failure = environment_failure(fault) or fault
        return {"how": "computer", "reason": _in_a_line(failure), "took_s": time.monotonic() - began}
    finally:
        if held:
            with suppress(OSError):
                trial_lock.release_lock(place)


def _tried(ticket: AttemptRequest, place: Path, send: WorkProgress, quiet: bool) -> dict[str, Any]:
    """The work itself, and what came of it."""
    began = time.monotonic()
    try:
        with _logged(place / LOG, ticket.timeout_s) if quiet else nullcontext():
            folder = place / WORK
            folder.mkdir(exist_ok=True)
            _check_version(ticket)
            work: Work = function_named(ticket.trial["work"])
            figures = work(ticket.trial["settings"], folder, send)
            if not trial_lock.owns_lock(place):
                raise EnvironmentFailure("another computer took the trial over: this one was not heard of for too long")
            write_figures(place, figures, time.monotonic() - began)
    except Exception as fault:  # whatever the work raises is the trial's outcome, unless the computer is at fault
        failure = environment_failure(fault)
        if failure is not None:
            return {"how": "computer", "reason": _in_a_line(failure)}
        return {"how": "error", "reason": f"{type(fault).__name__}: {' '.join(str(fault).split())}"}
    return {"how": "done", "reason": None}


def _check_version(ticket: AttemptRequest) -> None:
    """Refuse to make a trial with other sources than its key says."""
    here = source_version(tuple(ticket.trial["sources"]))
    if ticket.version and here != ticket.version:
        raise EnvironmentFailure(
            f"{platform.node()} has other sources of Wakewise ({here[:8]}, wanted {ticket.version[:8]})"
        )


def _in_a_line(failure: Exception) -> str:
    """A failure of the computer in a line; a full disk, whichever error reports it, in the same words."""
    return FULL if is_full(failure) else " ".join(str(failure).split()) or type(failure).__name__


@contextmanager
def _logged(path: Path, timeout_s: float | None) -> Iterator[None]:
    """What the block prints, and what a crash says, goes into a file.

    Well after its time the process ends itself, even where the interpreter's lock is never given back.
    """
    with path.open("a", encoding="utf-8", errors="replace") as log:
        sys.stdout.flush()
        sys.stderr.flush()
        os.dup2(log.fileno(), 1)
        os.dup2(log.fileno(), 2)
        faulthandler.enable(log)
        if timeout_s is not None:
            faulthandler.dump_traceback_later(timeout_s + _GRACE_S, exit=True, file=log)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
            faulthandler.disable()
            with suppress(OSError):
                sys.stdout.flush()
                sys.stderr.flush()
            with Path(os.devnull).open("wb") as nowhere:
                os.dup2(nowhere.fileno(), 1)
                os.dup2(nowhere.fileno(), 2)


def _versions() -> dict[str, str]:
    """Of what makes the figures."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in _PACKAGES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _main() -> None:
    """Answer tickets until the pipe closes."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    tickets: queue.SimpleQueue[str] = queue.SimpleQueue()

    def listen() -> None:
        for line in sys.stdin:
            tickets.put(line)
        if hasattr(os, "killpg"):  # helpers of the work with it: this process leads a group of its own
            os.killpg(0, signal.SIGKILL)
        os._exit(1)

    def tell(message: dict[str, Any]) -> None:
        answers.write(json.dumps(message) + "\n")
        answers.flush()

    said = 0.0

    def send(done: float, total: float, note: str = "") -> None:
        nonlocal said
        if time.monotonic() - said > 0.5:
            said = time.monotonic()
            tell({"progress": [float(done), float(total), str(note)]})

    threading.Thread(target=listen, daemon=True).start()
    while True:
        ticket = AttemptRequest(**json.loads(tickets.get()))
        tell({"report": run_attempt(ticket, send, begun=lambda: tell({"begun": True}))})


if __name__ == "__main__":
    _main()
