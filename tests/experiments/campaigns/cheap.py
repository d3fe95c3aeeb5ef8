"""Work that costs nothing, for the tests of campaigns; run as a script it is a driver of such work."""

from __future__ import annotations

import ctypes
import errno
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise.experiments.campaigns import ProcessExecutor, Task, run

Telling = Callable[..., None]


def add(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Twice the seed, after a while; a line in a file for every time that it was made."""
    time.sleep(settings.get("takes_s", 0.0))
    with (folder / "made.txt").open("a") as file:
        file.write("made\n")
    progress(1, 1, "added")
    return {"twice": 2.0 * settings["seed"]}


def die(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Is killed, the first times, having said something."""
    tries = _tries(folder)
    if tries <= settings["times"]:
        print("about to go", flush=True)
        os.kill(os.getpid(), signal.SIGKILL)
    return {"tries": float(tries)}


def refuse(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Cannot be made."""
    raise ZeroDivisionError("nothing to share")


def hang(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Never ends, and never lets the interpreter go."""
    return {"slept": float(ctypes.PyDLL(None).sleep(1000))}


def swell(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Takes more and more memory."""
    held = []
    while True:
        held.append(b"x" * 20_000_000)
        time.sleep(0.02)


def die_before_the_name(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Is killed, the first time, when its figures are on the disk under a temporary name and before they get theirs."""
    if _tries(folder) == 1:

        def killed(path: Path, target: Path) -> Path:
            assert path.exists()
            os.kill(os.getpid(), signal.SIGKILL)
            return target

        path_class: Any = Path
        path_class.replace = killed
    return {"tries": 2.0}


def no_room(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Its figures do not fit on the disk, until there is room."""
    if not Path(settings["room"]).exists():
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))
    return {f"figure_{i}": 1.0 for i in range(200)}


FAULTS: dict[str, Callable[[Path], object]] = {
    "memory": lambda _: _raise(MemoryError("Unable to allocate 9 GiB")),
    "disk": lambda _: _raise(OSError(errno.EIO, "Input/output error")),
    "rust": lambda _: _raise(RuntimeError("parquet: Read-only file system (os error 30)")),
    "behind": lambda _: _raise(ValueError("cannot go on"), OSError(errno.EMFILE, "Too many open files")),
    "input": lambda _: _raise(InputError("v.yaml: cannot be read"), OSError(errno.ESTALE, "Stale file handle")),
}
"""Failures of the computer as works meet them, by name."""


def _raise(fault: Exception, cause: Exception | None = None) -> None:
    raise fault from cause


def fail(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """The computer fails it, until there is a file that says otherwise."""
    if not Path(settings["room"]).exists():
        FAULTS[settings["fault"]](folder)
    return {"made": 1.0}


def too_large(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Writes a table that does not fit on the disk, until there is room."""
    import numpy as np
    import polars as pl

    if not Path(settings["room"]).exists():
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
    with whole_file(folder / "steps.parquet") as path:
        pl.DataFrame({"x": np.random.default_rng(1).normal(size=10_000)}).write_parquet(path)
    return {"made": 1.0}


def threads(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """How many threads libraries are told to have."""
    return {"threads": float(os.environ["NUMBA_NUM_THREADS"]), "omp": float(os.environ["OMP_NUM_THREADS"])}


def draw(settings: Mapping[str, Any], folder: Path, progress: Telling) -> dict[str, float]:
    """Sums of numbers that the seed draws, in a way that shows every bit."""
    import numpy as np

    numbers = np.random.default_rng(settings["seed"]).normal(size=(300, 300))
    return {"trace": float(np.trace(numbers @ numbers.T)), "root": float(np.sqrt(np.abs(numbers)).sum())}


def _tries(folder: Path) -> int:
    with (folder / "tries").open("a") as file:
        file.write(".")
    return (folder / "tries").stat().st_size


def adding(count: int, takes_s: float = 0.0) -> list[Task]:
    """So many trials of `add`."""
    return [
        Task(
            name=f"add/{seed}",
            work="cheap:add",
            settings={"seed": seed, "takes_s": takes_s},
            sources=("core/files.py",),
        )
        for seed in range(count)
    ]


def one(work: str, **settings: Any) -> Task:
    """A trial of another of these."""
    return Task(name=work, work=f"cheap:{work}", settings=settings, sources=("core/files.py",))


if __name__ == "__main__":
    run(adding(int(sys.argv[2]), float(sys.argv[3])), Path(sys.argv[1]), ProcessExecutor(2), retries=100)
