"""`wakewise scan`: fly, photograph, reconstruct, evaluate, report."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli import options
from wakewise.ui.cli.console import ProgressBars, no_report, print_json, print_table, unique_reasons, unit_suffix

if TYPE_CHECKING:
    from wakewise.operation import Scenario


_HEADLINES = (
    "success",
    "rmse_mm",
    "completeness_pct",
    "completeness_visible_pct",
    "f_score",
    "registered_images",
    "target_speed_mean_m_s",
    "exposure_speed_mean_m_s",
    "bed_speed_p95_m_s",
    "turbidity_mean_per_m",
    "position_rmse_mm",
    "energy_kJ",
    "solve_ms_median",
    "collisions",
    "wall_s",
)


def scan(
    scenario: options.ScenarioFile = None,
    preset: options.Preset = "quick",
    out: options.Out = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="dp, no-forward-jets, weighted-pseudo-inverse, manual, manual-careful, ardusub, pseudo-inverse, "
            "mpc, mpc-smooth, linear, allocation-only, "
            "wake-aware, a plug-in, or package.module:make."
        ),
    ] = None,
    target: options.TargetName = None,
    target_size: options.TargetSize = None,
    vehicle: options.Vehicle = None,
    world: options.World = None,
    seed: options.Seed = None,
    sets: options.Sets = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Go on with what a folder holds, as its scenario.yaml says: a trial cut short, a flight by hand.",
        ),
    ] = None,
    json: options.Json = False,
) -> None:
    """Fly layered orbits round a target, photograph it, reconstruct it, measure the model, write a report.

    Stages that are done are skipped, so running the same command again continues where it stopped; --resume needs no
    more than the folder.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise scan", "photos", "reports", "logs")
    from wakewise.api import trial
    from wakewise.core.errors import InputError
    from wakewise.operation import load_scenario, read_scenario

    changes = options.overrides(
        sets, seed=seed, vehicle=vehicle, target=target, target_size=target_size, method=method, world=world
    )
    if resume is None:
        resolved = load_scenario(preset, scenario, changes)
        folder = out or options.default_folder(resolved, resolved.method)
    else:
        if scenario is not None or out is not None or changes:
            raise InputError("--resume: goes on as the folder says, so give nothing beside it but --json")
        resolved, folder = read_scenario(resume / "scenario.yaml"), resume
    result = trial(resolved, folder, ProgressBars(), print_json if json else partial(_print_figures, resolved))
    if no_report(result.report_fault) and not json:
        typer.echo(f"report: {result.report}")


def _print_figures(scenario: Scenario, figures: dict[str, Any]) -> None:
    """The headlines of a trial as a table, and why some are missing."""
    rows = [(key, figures[key], unit_suffix(key, figures["units"][key])) for key in _HEADLINES]
    title = f"{scenario.method}, {Path(scenario.target.kind).stem}, seed {scenario.seed}"
    print_table("tnt", ("figure", "value", "unit"), rows, title)
    for line in unique_reasons(figures["why"], _HEADLINES):
        typer.echo(line)
