"""Work of a campaign's trials: fly a scenario and judge the water, or make its whole trial with photographs and model.

Figures are those of `wakewise scan` (see `wakewise.experiments.trials.metrics`).
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.files import whole_file
from wakewise.experiments.campaigns.task import Figures, WorkProgress
from wakewise.experiments.trials.metrics import UNITS, MetricsCollector, add_reference_values
from wakewise.operation import Scenario, fly
from wakewise.operation.flight_log import timings_of
from wakewise.operation.scenario import check_scenario
from wakewise.scene.missions import SETTLING
from wakewise.vision.evaluation import flight_figures

_FLIGHT = ("steps.parquet", "metrics.json", "scenario.yaml")
"""What stays of a trial of which only figures are kept, beside a few pictures."""
_STAGES = ("compile", "plan", "fly", "photograph", "reconstruct", "evaluate", "mesh", "colours")
_LOADING = 50  # first steps, whose solve times are those of loading


def fly_stage(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:
    """Figures of one flight: the water at the target, errors, energy; no photograph is made."""
    began, worked = time.monotonic(), time.process_time()
    flight = fly(scenario_of(settings), progress=progress)
    judged = flight.steps.filter(pl.col("leg") != SETTLING)
    gathering = MetricsCollector()
    gathering.add(flight_figures(judged))
    add_reference_values(gathering, flight.parts, judged)
    solve_ms = timings_of(flight.recorder.log.frame().lazy())["solve_ms"].to_numpy()
    solve_ms = solve_ms[min(_LOADING, len(solve_ms) // 2) :]
    gathering.add({"solve_ms_median": float(np.median(solve_ms)), "solve_ms_p99": float(np.percentile(solve_ms, 99))})
    gathering.add({"wall_s": time.monotonic() - began, "cpu_s": time.process_time() - worked})
    with whole_file(folder / "steps.parquet") as path:
        flight.steps.write_parquet(path, compression="zstd")
    return _plain(gathering.figures)


def model_stage(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:
    """Figures of a whole trial: flight, photographs, model, and the model against the truth."""
    from wakewise.experiments.campaigns.pictures import keep_pictures  # needs the extras, which flights do without
    from wakewise.experiments.trials.trial import run_trial

    scenario = scenario_of(settings)
    keep = settings["keep"]
    trial = folder / "trial"
    parts = (scenario if keep == "all" else scenario.replace(**{"reconstruction.mesh": False})).parts()
    figures = _plain(run_trial(parts, trial, _Stages(progress)))
    keep_pictures(parts.target, trial, folder)
    if keep != "all":
        for entry in trial.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            elif entry.name not in _FLIGHT:
                entry.unlink(missing_ok=True)
    return figures


def scenario_of(settings: Mapping[str, Any]) -> Scenario:
    """The scenario that a trial's settings hold."""
    return check_scenario(dict(settings["scenario"]), "trial")


def _plain(figures: Mapping[str, Any]) -> dict[str, float | str | None]:
    """Figures with a unit and a definition, numbers as such."""
    return {
        key: value if value is None or isinstance(value, str) else float(value)
        for key, value in figures.items()
        if key in UNITS and key not in ("method", "seed")
    }


class _Stages:
    """Tells of a trial's stages as one progress."""

    def __init__(self, progress: WorkProgress) -> None:
        self._progress = progress

    @contextmanager
    def stage(self, name: str) -> Iterator[WorkProgress]:
        """Hand on how far a stage is."""
        place = _STAGES.index(name) if name in _STAGES else 0

        def advance(done: float, total: float, note: str = "") -> None:
            share = done / total if total else 0.0
            self._progress(place + share, len(_STAGES), f"{name} {note}".strip())

        yield advance

    def skipped(self, name: str) -> None:
        """Nothing to tell."""
