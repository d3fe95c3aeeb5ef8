"""Work of a campaign's trials: fly a scenario and judge the water, or make its whole trial with photographs and model.

A study adds to a flight what a scenario file cannot say: *setup* functions change its parts (route, start, pilot) and
*probes* watch its steps and give figures of their own. Both are named as `package.module:name` in the campaign or in
the settings of a trial. All other figures are those of `wakewise scan` (see `wakewise.experiments.trials.metrics`).
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sized
from contextlib import contextmanager
from pathlib import Path
from typing import Any, SupportsFloat

import numpy as np
import polars as pl

from wakewise.core.errors import InputError, WakewiseError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import TruthProvider
from wakewise.core.plugins import reason_of
from wakewise.experiments.campaigns.task import Figures, WorkProgress, function_named
from wakewise.experiments.trials.metrics import UNITS, MetricsCollector, add_reference_values
from wakewise.operation import Parts, Scenario, fly
from wakewise.operation.flight_log import timings_of
from wakewise.operation.flying import WATER_EVERY_S
from wakewise.operation.loop import Step
from wakewise.operation.plugin_adapter import is_builtin
from wakewise.operation.scenario import check_scenario
from wakewise.scene.missions import SETTLING
from wakewise.vision.evaluation import flight_figures

HOVER_ONLY = "hover_only"
"""Figure of a flight that ended before its first leg: what it gives is of the settling hover."""
FLY = f"{__name__}:fly_stage"
MODEL = f"{__name__}:model_stage"
_FLIGHT = ("steps.parquet", "metrics.json", "scenario.yaml")
"""What stays of a trial of which only figures are kept, beside a few pictures."""
_STAGES = ("compile", "plan", "fly", "photograph", "reconstruct", "evaluate", "mesh", "colours")
_LOADING = 50  # first steps, whose solve times are those of loading


class FlightProbe:
    """Watches a flight and gives figures of it; derive from it and name the class under `probes`.

    It is made as `Probe(parts, folder, **arguments)` before the first step; `folder` is the trial's, for files that a
    probe leaves.
    """

    def __init__(self, parts: Parts, folder: Path) -> None:
        self.parts, self.folder = parts, folder

    def step(self, step: Step, truth_provider: TruthProvider | None) -> None:
        """Look at one control step; `truth_provider` is the true world, None of a real vehicle."""

    def figures(self, steps: pl.DataFrame) -> Mapping[str, Any]:
        """Figures by name, from all steps of the flight (`settled` leaves out its settling)."""
        del steps
        return {}


def fly_stage(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:
    """Figures of one flight: the water at the target, errors, energy, and those of probes; no photograph is made.

    `settings` hold `scenario` (see `scenario_of`) and may hold `setup` and `probes` (names with their arguments),
    `duration_s` (only the first part), `water_every_s` and `keep` ("none" leaves no steps.parquet). With a setup the
    route is not checked against bed and target: whoever makes a route keeps it clear.
    """
    began, worked = time.monotonic(), time.process_time()
    parts, gathered = flight_parts(settings)
    setup = settings.get("setup") or {}
    probes: dict[str, FlightProbe] = {}
    for name, own in (settings.get("probes") or {}).items():
        probes[f"probe {name}"] = _called(f"probe {name}", function_named(name, "probe"), parts, folder, **own)

    def watch(step: Step, truth_provider: TruthProvider | None) -> None:
        for who, probe in probes.items():
            _called(who, probe.step, step, truth_provider)

    flight = fly(
        parts,
        checked=not setup,
        duration_s=settings.get("duration_s"),
        water_every_s=settings.get("water_every_s") or WATER_EVERY_S,
        watch=watch if probes else None,
        progress=progress,
    )
    judged = settled(flight.steps)
    gathering = MetricsCollector()
    flown = flight_figures(judged)
    gathering.add(flown)
    if not setup:
        add_reference_values(gathering, flight.parts, judged)
    solve_ms = timings_of(flight.recorder.log.frame().lazy())["solve_ms"].to_numpy()
    solve_ms = solve_ms[min(_LOADING, len(solve_ms) // 2) :]
    gathering.add({"solve_ms_median": float(np.median(solve_ms)), "solve_ms_p99": float(np.percentile(solve_ms, 99))})
    if setup or probes:  # a study may show figures of a flight that tables of campaigns do not have
        gathered |= flown
    if (flight.steps["leg"] == SETTLING).all():
        gathered[HOVER_ONLY] = 1.0
    for who, probe in probes.items():
        more = _figures(who, _called(who, probe.figures, flight.steps))
        taken = more.keys() & {HOVER_ONLY, "wall_s", "cpu_s", *gathering.figures, *gathered}
        if taken and not is_builtin(probe):  # studies of our own packages measure some of a flight's figures anew
            raise InputError(f"{who}: gave {', '.join(sorted(taken))}, which are there already; give other names")
        gathered |= more
    gathering.add({"wall_s": time.monotonic() - began, "cpu_s": time.process_time() - worked})
    if settings.get("keep") != "none":
        with whole_file(folder / "steps.parquet") as path:
            flight.steps.write_parquet(path, compression="zstd")
    return _plain(gathering.figures) | gathered


def flight_parts(settings: Mapping[str, Any]) -> tuple[Parts, dict[str, Any]]:
    """Parts of the flight that settings of a trial describe, and figures that its setup functions gave."""
    gathered: dict[str, Any] = {}
    parts = scenario_of(settings).parts()
    for name, arguments in (settings.get("setup") or {}).items():
        changed = _called(f"setup {name}", function_named(name, "setup"), parts, **arguments)
        parts, more = changed if isinstance(changed, tuple) and len(changed) == 2 else (changed, {})
        if not isinstance(parts, Parts):
            raise InputError(f"setup {name}: gave {type(parts).__name__}, must give the parts of a flight")
        gathered |= _figures(f"setup {name}", more)
    return parts, gathered


def _called(who: str, function: Callable[..., Any], /, *given: Any, **own: Any) -> Any:
    """What a setup function or a probe gives; what it raises is told with its name."""
    try:
        return function(*given, **own)
    except Exception as fault:  # whatever foreign code raises; failures of the computer stay its cause
        raise InputError(f"{who}: {fault if isinstance(fault, WakewiseError) else reason_of(fault)}") from fault


def _figures(who: str, given: Any) -> dict[str, Any]:
    """Figures that a setup function or a probe gave, which a trial can keep."""
    named = given if isinstance(given, Mapping) else {"": given}
    for name, value in named.items():
        is_number = isinstance(value, SupportsFloat) and not isinstance(value, Sized)
        if not name or not (is_number or isinstance(value, str | None)):
            found = f"{name} {type(value).__name__}".strip()
            raise InputError(f"{who}: gave {found}; must give figures by name, each a number, a word or None")
    return dict(named)


def settled(steps: pl.DataFrame) -> pl.DataFrame:
    """Steps from the first leg on; all steps of a flight that ended before."""
    judged = steps.filter(pl.col("leg") != SETTLING)
    return judged if judged.height else steps


def model_stage(settings: Mapping[str, Any], folder: Path, progress: WorkProgress) -> Figures:
    """Figures of a whole trial: flight, photographs, model, and the model against the truth."""
    from wakewise.experiments.campaigns.pictures import keep_pictures  # needs the extras, which flights do without
    from wakewise.experiments.trials.trial import run_trial

    keep = settings["keep"]
    trial = folder / "trial"
    parts, gathered = flight_parts(settings)
    if keep != "all":
        parts = parts.replace(**{"reconstruction.mesh": False})
    figures = _plain(run_trial(parts, trial, _Stages(progress))) | gathered
    keep_pictures(parts.target, trial, folder)
    if keep != "all":
        for entry in trial.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            elif entry.name not in _FLIGHT:
                entry.unlink(missing_ok=True)
    return figures


def scenario_of(settings: Mapping[str, Any]) -> Scenario:
    """The scenario of a trial: `scenario` holds all of its fields, or dotted ones over a `preset`."""
    fields = dict(settings["scenario"])
    preset = settings.get("preset")
    return Scenario.preset(preset, **fields) if preset else check_scenario(fields, "trial")


def _plain(figures: Mapping[str, Any]) -> dict[str, float | str | None]:
    """Figures with a unit and a definition, numbers as such."""
    return {
        key: value if value is None or isinstance(value, str) else float(value)
        for key, value in figures.items()
        if key in UNITS and key not in ("method", "seed")
    }


class _Stages:
    """Shows the stages of a trial as one progress."""

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
        """A stage that an earlier run made changes nothing."""
