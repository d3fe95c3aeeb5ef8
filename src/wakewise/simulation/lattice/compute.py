"""From a case to its mean field: runs the lattice, leaves checkpoints, and resumes from them."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from wakewise.core.interfaces import Progress, no_progress
from wakewise.simulation.lattice.cases import LatticeCase, case_hash
from wakewise.simulation.lattice.laws import figures
from wakewise.simulation.lattice.meanfield import MeanField, mean_field
from wakewise.simulation.lattice.run import LatticeRun

WATCH_EVERY = 0.3
"""Time between samples of the averages, in D / U0."""

_CHECKPOINT_S = 300.0


def compute_run(
    case: LatticeCase, cache: Path | None = None, progress: Progress = no_progress, device: str = "cpu"
) -> LatticeRun:
    """Run a case to its end.

    Parameters
    ----------
    case : LatticeCase
    cache : Path or None
        Folder for a checkpoint every five minutes, from which a run that was stopped goes on; it is left there, so that
        a finished run need not be repeated. None keeps nothing.
    progress : Progress
    device : str
        As `LatticeRun`. A run may go on on another device than it began.

    Raises
    ------
    StageError
        If the flow blows up.
    """
    path = cache / f"{case.name}-{case.cells_per_D}-{case_hash(case)}.npz" if cache else None
    run = LatticeRun.restored(case, path, device) if path else LatticeRun(case, device)
    stride = max(1, run.steps_at(WATCH_EVERY))
    saved = time.monotonic()
    unfinished = run.steps_done < run.steps_total
    while run.steps_done < run.steps_total:
        run.advance(min(stride, run.steps_total - run.steps_done))
        run.watch()
        progress(run.steps_done, run.steps_total, f"{case.name}, {case.cells_per_D} cells per D")
        if path and time.monotonic() - saved > _CHECKPOINT_S:
            run.save(path)
            saved = time.monotonic()
    if path and unfinished:
        run.save(path)
    return run


def compute_mean_field(
    case: LatticeCase, cache: Path | None = None, progress: Progress = no_progress, device: str = "cpu"
) -> MeanField:
    """Mean field of a case with its figures; arguments as `compute_run`."""
    run = compute_run(case, cache, progress, device)
    table = mean_field(run)
    return replace(table, figures=figures(table))
