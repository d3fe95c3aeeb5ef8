"""Compiles kernels before they are asked for, several beside each other in processes of their own.

Which kernels a job calls from Python, and with which types, stands in kernels.json (tools/list_kernels.py writes it);
what they call in turn is compiled with them. What is not listed is compiled when it is first called, as ever.
"""

from __future__ import annotations

import gc
import json
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from wakewise.core.errors import InputError
from wakewise.core.jit.cache_dir import VARIABLE, can_be_written, is_interpreted, user_cache
from wakewise.core.subprocesses import start_python

TypeWords = str | list[Any] | dict[str, list[Any]]
LIST = Path(__file__).with_name("kernels.json")
JOBS = ("plan", "fly", "photograph", "reconstruct", "more")
"""In the order in which a scan needs them; "more" is what other commands call."""

_SELDOM = 100_000  # new objects, where Python's own figure is 700
_DONE, _FAILED, _KILLED = "done", "failed", "its process ended"


@dataclass(frozen=True, kw_only=True)
class KernelEntry:
    """A kernel as it is called from Python.

    Parameters
    ----------
    name : str
        Its full name, as in wakewise.planning.kernels.horizon.
    types : tuple
        Of its arguments, in the words of `wakewise.core.jit.kernel_cache.type_of`.
    job : str
        The first of `JOBS` that calls it.
    cost_s : float
        What compiling it took, alone on one core, where the list was written: for bars and for the order only.
    """

    name: str
    types: tuple[TypeWords, ...]
    job: str
    cost_s: float


@dataclass(frozen=True, kw_only=True)
class PrecompileResult:
    """What was done: how many kernels were compiled (or found), and what went amiss, a line each."""

    kernels: int
    amiss: tuple[str, ...] = ()


@cache
def listed() -> tuple[KernelEntry, ...]:
    """All kernels of the list."""
    rows = json.loads(LIST.read_text(encoding="utf-8"))
    return tuple(KernelEntry(name=r["name"], types=tuple(r["types"]), job=r["job"], cost_s=r["cost_s"]) for r in rows)


def kernels_of_jobs(jobs: Iterable[str]) -> tuple[KernelEntry, ...]:
    """Kernels of some jobs, those of the earliest job first.

    Raises
    ------
    InputError
        If there is no job of that name.
    """
    wanted = tuple(jobs)
    for job in wanted:
        if job not in JOBS:
            raise InputError(f"job {job!r}: no such job, allowed {', '.join(JOBS)}")
    return tuple(kernel for job in JOBS if job in wanted for kernel in listed() if kernel.job == job)


def is_warm(jobs: Sequence[str] = JOBS) -> bool:
    """Whether the jobs were done with the sources, and the Numba, that are here now; nothing is to be done without."""
    return is_interpreted() or all(_note(job).exists() for job in jobs if kernels_of_jobs([job]))


_tried: set[str] = set()


class BackgroundCompilation:
    """Compiling in the background, from the moment that it is made; what is there already is only read.

    Jobs that this process has tried before are not tried again.

    Parameters
    ----------
    jobs : sequence of str
        Some of `JOBS`; they are done in their order.
    processes : int, optional
        How many compile beside each other; as many as there are cores for this process if not given, up to four.
    """

    def __init__(self, jobs: Sequence[str] = JOBS, processes: int | None = None) -> None:
        cold = [job for job in JOBS if job in jobs and job not in _tried and not is_warm([job])]
        _tried.update(cold)
        self._waiting: queue.SimpleQueue[KernelEntry] = queue.SimpleQueue()
        self._left = {job: len(kernels_of_jobs([job])) for job in cold}
        self._cost = {job: sum(kernel.cost_s for kernel in kernels_of_jobs([job])) for job in cold}
        self._spent = dict.fromkeys(cold, 0.0)
        self._total = sum(self._left.values())
        self._amiss: dict[str, list[str]] = {job: [] for job in cold}
        self._change = threading.Condition()
        self._fault = ""
        self._workers: list[subprocess.Popen[str]] = []
        for job in cold:
            for kernel in sorted(kernels_of_jobs([job]), key=lambda kernel: -kernel.cost_s):
                self._waiting.put(kernel)
        count = min(processes or min(_cores(), 4), self._total)
        self._running = count
        for _ in range(count):
            threading.Thread(target=self._serve, daemon=True).start()

    def wait(self, jobs: Sequence[str] = JOBS, progress: Callable[..., None] | None = None) -> PrecompileResult:
        """Wait until some of the jobs are done; `progress` is called as `(done, total, note)`, in seconds of work."""
        try:
            with self._change:
                while self._running and not self.is_done(jobs):
                    if progress is not None:
                        done, total = (sum(of.get(job, 0.0) for job in jobs) for of in (self._spent, self._cost))
                        progress(done, total, f"compiling kernels, {self._running} side by side; only this time")
                    self._change.wait(0.5)
        except BaseException:
            self.stop()
            raise
        amiss = [line for job in jobs if job in JOBS for line in (self._amiss.get(job) or _noted(job))]
        failed = sum(map(len, self._amiss.values()))
        return PrecompileResult(
            kernels=self._total - sum(self._left.values()) - failed,
            amiss=tuple([*amiss, self._fault] if self._fault else amiss),
        )

    def is_done(self, jobs: Sequence[str]) -> bool:
        """Whether there is nothing left to compile of some jobs."""
        return not any(self._left.get(job) for job in jobs)

    def stop(self) -> None:
        """Compile nothing further; what is being compiled is given up."""
        with self._change:
            while self._next() is not None:
                pass
            for worker in self._workers:
                worker.kill()

    def _serve(self) -> None:
        """Hand kernels to one process, each when the last is done."""
        try:
            with start_python("-m", __name__, text=True) as worker:
                with self._change:
                    self._workers.append(worker)
                assert worker.stdin is not None
                assert worker.stdout is not None
                while (kernel := self._next()) is not None and worker.poll() is None:
                    self._finish(kernel, _asked(kernel, worker.stdin, worker.stdout))
                worker.stdin.close()
        except OSError as fault:
            self._fault = f"no process to compile in: {fault}"
        finally:
            with self._change:
                self._running -= 1
                self._change.notify_all()

    def _next(self) -> KernelEntry | None:
        try:
            return self._waiting.get_nowait()
        except queue.Empty:
            return None

    def _finish(self, kernel: KernelEntry, answer: str) -> None:
        with self._change:
            if not answer.startswith(_DONE):
                reason = answer.removeprefix(_FAILED).strip() or _KILLED
                self._amiss[kernel.job].append(f"{kernel.name}: {reason}")
            self._left[kernel.job] -= 1
            self._spent[kernel.job] += kernel.cost_s
            if not self._left[kernel.job] and not any(line.endswith(_KILLED) for line in self._amiss[kernel.job]):
                _take_note(kernel.job, self._amiss[kernel.job])
            self._change.notify_all()


def compile_kernels(
    jobs: Sequence[str] = JOBS, progress: Callable[..., None] | None = None, processes: int | None = None
) -> PrecompileResult:
    """Compile all kernels of some jobs, unless they are there; returns when that is done.

    Raises
    ------
    InputError
        If there is no job of that name.
    """
    kernels_of_jobs(jobs)
    return BackgroundCompilation(jobs, processes).wait(jobs, progress)


def _asked(kernel: KernelEntry, to: IO[str], back: IO[str]) -> str:
    """What the process answers that was asked to compile a kernel; nothing if it is gone."""
    try:
        to.write(json.dumps({"name": kernel.name, "types": kernel.types}) + "\n")
        to.flush()
        return back.readline()
    except OSError:
        return ""


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _note(job: str) -> Path:
    """File that is there once a job is done; its name holds what its kernels were made from."""
    given = os.environ.get(VARIABLE)
    beside = Path(__file__).parent / "__pycache__"
    place = Path(given) if given else beside if can_be_written(beside) else user_cache(os.environ)
    return place / f"wakewise-{job}-{_made_from(job)}.warm"


def _take_note(job: str, amiss: Sequence[str]) -> None:
    """Write the note; it holds a line for each kernel that cannot be compiled, as where an extra is missing."""
    path = _note(job)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        half = path.with_suffix(f".{os.getpid()}")
        half.write_text("".join(f"{line}\n" for line in amiss), encoding="utf-8")
        half.replace(path)
    except OSError:  # then it is looked through again the next time, which takes a second
        return


def _noted(job: str) -> list[str]:
    try:
        return _note(job).read_text(encoding="utf-8").splitlines()
    except OSError:
        return []


@cache
def _made_from(job: str) -> str:
    """Digest of the sources of a job's kernels, of Numba's version and of the processor."""
    import llvmlite.binding as llvm
    import numba

    from wakewise.core.jit.kernel_cache import digest

    root = Path(__file__).resolve().parents[2]
    whole = sha256(f"{numba.__version__} {sys.version_info[:2]} {llvm.get_host_cpu_name()}".encode())
    for kernel in kernels_of_jobs([job]):
        whole.update(f"{kernel.name} {kernel.types}".encode())
    for module in sorted({kernel.name.rpartition(".")[0] for kernel in kernels_of_jobs([job])}):
        whole.update(digest(root.joinpath(*module.split(".")[1:]).with_suffix(".py")))
    return whole.hexdigest()[:16]


def _compile_what_is_asked(asked: Iterable[str], answers: IO[str]) -> None:
    """Compile the kernels that lines of JSON name, and answer each line with one."""
    from wakewise.core.jit.kernel_cache import type_from

    # Looking for garbage is a fifth of Numba's time in Python; done seldom, it costs memory that goes with the process.
    gc.freeze()
    gc.set_threshold(_SELDOM)
    for line in asked:
        task: dict[str, Any] = json.loads(line)
        module, _, name = task["name"].rpartition(".")
        try:
            getattr(import_module(module), name).compile(tuple(type_from(words) for words in task["types"]))
            answer = _DONE
        except Exception as fault:  # one kernel that fails must not end the others; it is reported
            answer = f"{_FAILED} {type(fault).__name__}: {' '.join(str(fault).split())[:300]}"
        answers.write(answer + "\n")
        answers.flush()


if __name__ == "__main__":
    _compile_what_is_asked(sys.stdin, sys.stdout)
