"""Whole trials: photographs, model, report; and several of them side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wakewise.core.checks import callable_of, has_methods, path_of, quoted
from wakewise.core.errors import InputError
from wakewise.core.files import child_path
from wakewise.core.optional_dependencies import need

if TYPE_CHECKING:
    from wakewise.experiments.trials import ProgressListener
    from wakewise.operation import Parts, Scenario


_EXTRAS = ("photos", "reports", "logs")


@dataclass(frozen=True)
class Result:
    """What a trial or a comparison left: its folder, its figures (see docs/conventions.md), its report.

    A report that could not be written is None, and `report_fault` says why.
    """

    folder: Path
    figures: dict[str, Any]
    report: Path | None
    report_fault: str | None = None


def trial(
    flight: Parts | Scenario,
    folder: str | Path,
    watch: ProgressListener | None = None,
    told: Callable[[dict[str, Any]], None] | None = None,
) -> Result:
    """Fly, photograph, reconstruct, evaluate and report; what is done already is skipped.

    Parameters
    ----------
    flight : Parts or Scenario
    folder : path
        Where everything goes; a trial that was cut off goes on there.
    watch : Watch, optional
        Is told how far each stage is.
    told : callable, optional
        Called with the figures as soon as they are known; mesh and report are made after that.

    Raises
    ------
    InputError
        If the parts do not fit each other, or the folder holds another trial.
    StageError
        If a stage cannot finish.
    MissingExtra
        Without the extras `photos`, `reports` and `logs`; all that is missing is named before anything is made.

    Examples
    --------
    >>> import wakewise as ww
    >>> scenario = ww.Scenario.preset("quick", **{"mission.views": [8, 6, 4]})
    >>> ww.trial(scenario, "runs/few")  # doctest: +SKIP
    """
    need("ww.trial", *_EXTRAS)
    from wakewise.experiments.trials import SilentProgress, run_trial
    from wakewise.experiments.trials.stages import report_attempt
    from wakewise.ui.reports import PageParts, begin_report, write_report

    place, draft = path_of(folder, "folder"), PageParts()
    watch = SilentProgress() if watch is None else has_methods(watch, ("stage",), "watch", "watch")
    if told is not None:
        callable_of(told, "told")
    with_parts = _early(lambda missing: begin_report(place, draft, missing))
    figures = run_trial(flight, place, watch, told, with_parts)
    report = None
    with report_attempt() as attempt, watch.stage("report") as progress:
        report = write_report(place, draft)
        progress(1, 1)
    return Result(place, figures, report, attempt.fault)


def compare(
    flights: Mapping[str, Parts | Scenario], folder: str | Path, watch: ProgressListener | None = None
) -> Result:
    """One trial for each flight, in its own folder, and their outcomes side by side; ratios are to the first.

    Parameters
    ----------
    flights : mapping
        Name to parts or scenario; the same seed gives all of them the same water.
    folder : path
    watch : Watch, optional

    Raises
    ------
    InputError, StageError, MissingExtra
        As `trial`.

    Examples
    --------
    >>> import wakewise as ww
    >>> parts = ww.Scenario.preset("quick").parts()
    >>> flights = {"dp": parts.replace(method="dp"), "ours": parts}
    >>> ww.compare(flights, "runs/both").figures["ratios"]["ours"]  # doctest: +SKIP
    """
    need("ww.compare", *_EXTRAS)
    from wakewise.experiments.trials import SilentProgress, compare_methods
    from wakewise.experiments.trials.stages import report_attempt
    from wakewise.ui.reports import PageParts, begin_report, write_comparison, write_report

    if not isinstance(flights, Mapping):
        raise InputError(f"flights: {quoted(flights)}, must be names with parts or scenarios")
    if len(flights) < 2:
        raise InputError(f"compare: {len(flights)} flights, at least two are needed to compare; one alone is a `trial`")
    place = path_of(folder, "folder")
    for name in flights:
        if not isinstance(name, str):
            raise InputError(f"flights: {quoted(name)}, must be a name")
        child_path(place, name, "compare")
    watch = SilentProgress() if watch is None else has_methods(watch, ("stage",), "watch", "watch")
    drafts = {name: PageParts() for name in flights}
    with_parts = _early(lambda name, lacks: begin_report(place / name, drafts[name], lacks))
    figures = compare_methods(flights, place, watch, with_parts)
    report = None
    with report_attempt() as attempt, watch.stage("report") as progress:
        for name in flights:
            write_report(place / name, drafts.pop(name))
        report = write_comparison({name: place / name for name in flights}, place)
        progress(1, 1)
    return Result(place, figures, report, attempt.fault)


def _early(begin: Callable[..., None]) -> Callable[..., None]:
    """What makes parts of a report while the trial still runs, which it must not end: `write_report` tells of it."""
    from wakewise.experiments.trials.stages import report_attempt

    def parts(*given: str) -> None:
        with report_attempt():
            begin(*given)

    return parts
