"""`wakewise campaign`: many trials from one file, run, resumed, looked at."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.core.checks import counted
from wakewise.ui.cli.console import ProgressBars, answer, format_value, interval, print_table
from wakewise.ui.cli.options import Json, listed

if TYPE_CHECKING:
    from wakewise.experiments.campaigns.engines import TrialExecutor
    from wakewise.experiments.campaigns.table import Results

app = typer.Typer(
    help="Campaigns: methods x targets x worlds x seeds from one file, resumable, on one computer or a cluster."
)

Folder = Annotated[Path, typer.Argument(help="Folder of a campaign, or its file where --out was not given.")]


@app.command("run")
def run_campaign(
    file: Annotated[Path, typer.Argument(help="Campaign YAML file; `wakewise campaign example` prints one.")],
    engine: Annotated[str, typer.Option(help="processes, or dask for more than one computer.")] = "processes",
    scheduler: Annotated[
        str | None,
        typer.Option(
            metavar="ADDR",
            help="dask: address of a running scheduler, such as tcp://10.0.0.1:8786, or its scheduler file; a cluster "
            "on this computer if not given.",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Trials at once; one per core if not given. Each has its share of the cores.")
    ] = None,
    timeout: Annotated[
        float | None, typer.Option(metavar="S", help="End a trial that takes longer; else the file's.")
    ] = None,
    memory: Annotated[
        float | None, typer.Option(metavar="MB", help="End a trial that takes more; else the file's.")
    ] = None,
    retries: Annotated[
        int | None, typer.Option(help="Tries after a process that died or was ended; else the file's.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the campaign; runs/NAME if not given.")] = None,
    again: Annotated[bool, typer.Option("--again", help="Try trials anew that have failed.")] = False,
    json: Json = False,
) -> None:
    """Make the trials of a campaign that are not made yet.

    Stopped by Ctrl-C or killed, the same command goes on; what is finished is kept. A second one on the same folder
    takes what the first is not at. Trials that fail are kept with their reason.
    """
    from wakewise.core.errors import EnvironmentFailure, InputError
    from wakewise.core.files import child_path
    from wakewise.core.jit.precompile import compile_kernels
    from wakewise.core.optional_dependencies import need
    from wakewise.experiments.campaigns import load_campaign, planned_trials, run
    from wakewise.experiments.campaigns.definition import keep_campaign
    from wakewise.experiments.campaigns.run import check_bounds
    from wakewise.experiments.campaigns.store import RESUME_HINT
    from wakewise.experiments.campaigns.table import group_table, results, status
    from wakewise.operation.flying import FLIGHT_JOBS

    chosen = _engine(engine, scheduler, workers)
    campaign = load_campaign(file)
    timeout_s = campaign.timeout_s if timeout is None else timeout
    memory_MB = campaign.memory_MB if memory is None else memory
    tries = campaign.retries if retries is None else retries
    check_bounds(timeout_s, memory_MB, tries)
    jobs: tuple[str, ...] = FLIGHT_JOBS
    if campaign.stages == "model":
        need("a campaign of `stages: model`", "photos", "logs")
        from wakewise.experiments.trials.trial import JOBS

        jobs = JOBS
    bars = ProgressBars()
    with bars.stage("plan") as progress:
        progress(0, 1, "checking every combination")
        trials = planned_trials(campaign, str(file))
    folder = out or child_path(Path("runs"), campaign.name, f"{file}: name")
    keep_campaign(folder, campaign, trials)
    with bars.stage("compile") as progress:  # else each of the workers would
        compile_kernels(jobs, progress)
    with bars.stage("trials") as progress:
        outcomes = run(
            [one.task for one in trials],
            folder,
            chosen,
            timeout_s=timeout_s,
            memory_MB=memory_MB,
            retries=tries,
            progress=progress,
            again=again,
        )
    found = results(folder)
    groups = group_table(found)
    place = f"folder: {folder}; `wakewise campaign page {folder}` writes a page with the comparison and pictures"
    result = status(found) | {"folder": str(folder), "groups": groups}
    answer(json, result, partial(_show_groups, found, groups), place)
    unmade = [one for one in outcomes if one.figures is None and one.how == "computer"]
    if unmade:
        raise EnvironmentFailure(
            f"{folder}: {len(unmade)} of {counted(len(outcomes), 'trial')} could not be made, the first: "
            f"{unmade[0].task.name}: {unmade[0].reason}; {RESUME_HINT}"
        )
    if found.count("done") == 0 and found.count("failed"):
        raise InputError(f"{file}: every trial failed, the first: {status(found)['failures'][0]['reason']}")


@app.command("status")
def show_status(folder: Folder, json: Json = False) -> None:
    """How many trials are done, at work, waiting and failed, and why those failed that did."""
    from wakewise.experiments.campaigns.table import results, status

    told = status(results(_folder(folder)))
    counts = (
        f"{told['name']}: {told['done']} of {counted(told['trials'], 'trial')} done, {told['running']} at work, "
        f"{told['waiting']} waiting, {told['failed']} failed"
    )
    words = f"{counted(told['attempts'], 'attempt')}; {counted(told['drivers'], 'run')} at it now"
    if told["trial_s"] is not None:
        words += f"; {told['trial_s']:.0f} s a trial"
    if told["others"]:
        words += f"; in the folder, no more the file's: {counted(told['others'], 'trial')}"
    answer(json, told, counts, words, partial(_show_failures, told["failures"]))


@app.command("table")
def show_table(
    folder: Folder,
    by: Annotated[
        str,
        typer.Option(
            help="Group by these, with commas between: method, target, world, vehicle, variation, seed; all that "
            "differ but the seed if not given.",
            show_default=False,
        ),
    ] = "",
    figures: Annotated[
        str, typer.Option(help="Figures to show, with commas between; the main ones if not given.", show_default=False)
    ] = "",
    write: Annotated[Path | None, typer.Option(help="Write all trials, a row each, as .parquet or .csv.")] = None,
    json: Json = False,
) -> None:
    """Each group's figures: mean and 95 % interval over its trials; failures with their reasons."""
    from wakewise.experiments.campaigns.table import failures, group_table, results, write_table

    found = results(_folder(folder))
    groups = group_table(found, listed(by), listed(figures))
    if write is not None:
        write_table(found, write)
    result = {"name": found.plan.name, "groups": groups, "failures": failures(found)}
    answer(json, result, partial(_show_groups, found, groups))


@app.command("page")
def make_page(
    folder: Folder,
    compare: Annotated[
        str,
        typer.Option(
            help="What is compared: method, target, world, vehicle or variation; the first that differs if not given.",
            show_default=False,
        ),
    ] = "",
    out: Annotated[
        Path | None, typer.Option(help="File or folder to write; campaign.html in its folder if not given.")
    ] = None,
    json: Json = False,
) -> None:
    """Write a page: the first method against the next best, with pairs, interval and cost, and where trials failed."""
    from dataclasses import asdict

    from wakewise.core.optional_dependencies import need
    from wakewise.experiments.campaigns.summary import method_contrasts, paired_groups
    from wakewise.experiments.campaigns.table import results

    need("the page of a campaign", "reports")
    from wakewise.ui.reports import write_campaign

    place = _folder(folder)
    found = results(place)
    page = write_campaign(found, place, out, compare)
    judged = method_contrasts(paired_groups(found, compare))
    glances = [asdict(one) | {"sure": one.sure} for _, one in judged]
    answer(json, {"page": str(page), "glances": glances}, f"page: {page}")


@app.command("example")
def print_example() -> None:
    """Print a campaign file to begin with."""
    from wakewise.experiments.campaigns.definition import example

    typer.echo(example(), nl=False)


def _engine(name: str, scheduler: str | None, workers: int | None) -> TrialExecutor:
    """The engine that the options name.

    Raises InputError if there is none of that name, or the options do not fit.
    """
    from wakewise.core.errors import InputError
    from wakewise.core.settings import guess
    from wakewise.experiments.campaigns.engines import ProcessExecutor

    if name == "dask":
        from wakewise.experiments.campaigns.engines import DaskExecutor

        return DaskExecutor(scheduler, workers)
    if name != "processes":
        raise InputError(f"--engine: '{name}', {guess(name, ['processes', 'dask'])}allowed: processes, dask")
    if scheduler is not None:
        raise InputError("--scheduler: only with --engine dask")
    return ProcessExecutor(workers)


def _folder(path: Path) -> Path:
    """The folder of a campaign, where its file was given."""
    if path.is_file():
        from wakewise.core.files import child_path
        from wakewise.experiments.campaigns import load_campaign

        return child_path(Path("runs"), load_campaign(path).name, f"{path}: name")
    return path


def _show_groups(found: Results, groups: list[dict[str, Any]]) -> None:
    """A row per group, then what failed."""
    from wakewise.experiments.campaigns.summary import hover_words
    from wakewise.experiments.campaigns.table import failures
    from wakewise.experiments.trials import UNITS

    factors = [key for key in groups[0] if key not in ("trials", "done", "failed", "figures")]
    names = list(groups[0]["figures"])
    units = {name: UNITS.get(name, "") for name in names}
    heads = [
        f"{name} [{unit}]" if unit and not name.endswith(unit.replace("/", "_")) else name
        for name, unit in units.items()
    ]
    rows = []
    for group in groups:
        lost = f" ({group['failed']} failed)" if group["failed"] else ""
        cells = [_cell(group["figures"][name]) for name in names]
        rows.append((*(str(group[f]) for f in factors), f"{group['done']}/{group['trials']}{lost}", *cells))
    title = f"{found.plan.name}: {found.count('done')} of {counted(len(found.made), 'trial')}; mean and 95 % interval"
    print_table("T" * len(factors) + "n", (*factors, "trials", *heads), rows, title)
    if hovers := hover_words(found):
        typer.echo(hovers)
    _show_failures(failures(found))


def _cell(figure: dict[str, Any]) -> str:
    mean = format_value(None if figure["mean"] is None else float(figure["mean"]))
    return mean if figure["low"] is None else f"{mean} ({interval(figure['low'], figure['high'])})"


def _show_failures(failed: list[dict[str, Any]]) -> None:
    for one in failed[:20]:
        tried = counted(one["attempts"], "attempt")
        typer.echo(f"failed: {one['name']}: {one['reason']} ({tried}; trials/{one['key']}/log.txt)")
    if len(failed) > 20:
        typer.echo(f"and {len(failed) - 20} more; --json lists all")
