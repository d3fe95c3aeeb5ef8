"""A slot that makes one trial at a time: a process and the thread that supervises it.

The process is ended when it takes too long, takes too much memory, or is not wanted any more; the next attempt gets a
new one. Engines differ only in where slots are: in threads of the driver, or in Dask's workers.

How much memory a process and those that it started have, as the system reports it.
"""

from __future__ import annotations

import json
import math
import os
import queue
import signal
import subprocess
import threading
import time
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wakewise.core.subprocesses import end_process, start_python
from wakewise.experiments.campaigns import attempt_log, trial_lock
from wakewise.experiments.campaigns.store import LOG
from wakewise.experiments.campaigns.worker import AttemptRequest

_PAGE = os.sysconf("SC_PAGE_SIZE") if hasattr(os, "sysconf") else 4096


def memory_MB(pid: int) -> float:
    """Resident memory of a process and its descendants, 10^6 bytes; 0 where the system does not say (no /proc).

    Pages that they share count in each.
    """
    total, waiting = 0, [pid]
    while waiting:
        one = waiting.pop()
        place = Path("/proc", str(one))
        try:
            total += int((place / "statm").read_text().split()[1]) * _PAGE
            for thread in (place / "task").iterdir():
                waiting += map(int, (thread / "children").read_text().split())
        except (OSError, ValueError, IndexError):  # it has ended meanwhile
            continue
    return total / 1e6


_LOOK_S = 0.1
_ASK_S, _BEAT_S = 0.5, 10.0
"""How often a slot looks at its process, checks whether its driver still runs, and shows that it is alive."""
_START_S = 300.0
"""How long a process may take to start and to claim its trial, which is no time of the trial."""
_THREADS = ("OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS")


@dataclass(frozen=True, kw_only=True)
class AttemptReport:
    """How an attempt ended: one of `attempts.How`, "held" (another process is at it) or "known" (it was finished)."""

    key: str
    how: str
    reason: str | None = None
    took_s: float = 0.0


class TrialProcess:
    """One process, started when there is something to do.

    `threads` are of every library in it but OpenBLAS, which has one or as many as the user says.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._process: subprocess.Popen[str] | None = None
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._closed = False

    def attempt(self, ticket: AttemptRequest) -> AttemptReport:
        """Make one attempt; returns when it has ended, whichever way."""
        key, place = ticket.trial["key"], Path(ticket.place)
        process = self._ready(ticket.cwd)
        began = asked = beaten = time.monotonic()
        limit_s = _START_S

        def ended(how: attempt_log.How, reason: str | None = None) -> AttemptReport:
            return self._ended(process, place, key, how, began, reason)

        try:
            assert process.stdin is not None
            process.stdin.write(json.dumps(asdict(ticket)) + "\n")
            process.stdin.flush()
        except OSError:
            return ended("died")
        while True:
            with suppress(queue.Empty):
                line = self._lines.get(timeout=_LOOK_S)
                if line is None:
                    return ended("stopped" if self._closed else "died")
                told = _read(line)
                if "begun" in told:
                    began = time.monotonic()
                    limit_s = ticket.timeout_s if ticket.timeout_s is not None else math.inf
                if "report" in told:
                    return AttemptReport(key=key, **told["report"])
            now = time.monotonic()
            if now - began > limit_s:
                return ended("late", f"took longer than {limit_s:g} s")
            if ticket.memory_MB is not None and (has := memory_MB(process.pid)) > ticket.memory_MB:
                return ended("memory", f"took {has:.0f} MB of memory, allowed {ticket.memory_MB:g}")
            if now - asked > _ASK_S:
                asked = now
                if self._closed or (ticket.driver and not Path(ticket.driver).exists()):
                    return ended("stopped")
            if now - beaten > _BEAT_S:
                beaten = now
                trial_lock.renew_lock(place)

    def close(self) -> None:
        """End the process; an attempt that is under way is reported as stopped."""
        self._closed = True
        if self._process is not None:
            end_process(self._process, group=True)

    def _ready(self, cwd: str) -> subprocess.Popen[str]:
        """The process, started if there is none."""
        if self._process is None or self._process.poll() is not None:
            if self._process is not None:
                end_process(self._process, group=True)
            self._lines = queue.SimpleQueue()
            one = os.environ.get("OPENBLAS_NUM_THREADS", "1")  # unless the user says otherwise, as in the command line
            self._process = start_python(
                "-m",
                "wakewise.experiments.campaigns.worker",
                variables=dict.fromkeys(_THREADS, str(self.threads)) | {"OPENBLAS_NUM_THREADS": one},
                text=True,
                cwd=cwd if cwd and Path(cwd).is_dir() else None,
                new_session=True,  # Ctrl-C is the driver's, which then ends this
            )
            threading.Thread(target=_listen, args=(self._process, self._lines), daemon=True).start()
        return self._process

    def _ended(
        self,
        process: subprocess.Popen[str],
        place: Path,
        key: str,
        how: attempt_log.How,
        began: float,
        reason: str | None,
    ) -> AttemptReport:
        """End the process and note how; what it had claimed is free for others then."""
        end_process(process, group=True)
        if how == "died":
            reason = _words_of(process.returncode, place / LOG)
        took_s = time.monotonic() - began
        holder = trial_lock.holder_of(place)
        if holder is not None and holder.pid == process.pid and holder.is_here:  # else it had not begun, or was done
            with suppress(OSError):
                attempt_log.end(place, how, reason, took_s)
        return AttemptReport(key=key, how=how, reason=reason, took_s=took_s)


_slots: dict[tuple[str, int], TrialProcess] = {}


def attempt(ticket: AttemptRequest, threads: int) -> AttemptReport:
    """Make one attempt in the slot that this thread has for the ticket's driver: what executors are handed."""
    mine = (ticket.driver, threading.get_ident())
    if mine not in _slots:
        _slots[mine] = TrialProcess(threads)
    return _slots[mine].attempt(ticket)


def close_slots(driver: str) -> None:
    """End the processes of all slots of a driver in this process."""
    for one in [one for one in _slots if one[0] == driver]:
        _slots.pop(one).close()


def _listen(process: subprocess.Popen[str], lines: queue.SimpleQueue[str | None]) -> None:
    """Hand on what a process says; None when it has ended."""
    assert process.stdout is not None
    with suppress(ValueError, OSError), process.stdout as answers:
        for line in answers:
            lines.put(line)
    lines.put(None)


def _read(line: str) -> dict[str, Any]:
    try:
        told = json.loads(line)
    except ValueError:
        return {}
    return told if isinstance(told, dict) else {}


def _words_of(code: int | None, log: Path) -> str:
    """Why a process ended, and the last thing that it said."""
    if code is not None and code < 0:
        with suppress(ValueError):
            return f"its process was ended by {signal.Signals(-code).name}{_last_line(log)}"
    return f"its process ended with code {code}{_last_line(log)}"


def _last_line(log: Path) -> str:
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError:
        return ""
    last = next((line.strip() for line in reversed(lines) if line.strip()), "")
    return f": {last[:200]}" if last else ""
