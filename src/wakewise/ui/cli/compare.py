"""`wakewise compare`: methods side by side on the same seed."""

from __future__ import annotations

from typing import Annotated

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli import options
from wakewise.ui.cli.console import ProgressBars, no_report, print_json, print_table, unit_suffix

_ROWS = (
    "success",
    "rmse_mm",
    "completeness_pct",
    "target_speed_mean_m_s",
    "exposure_speed_mean_m_s",
    "bed_speed_p95_m_s",
    "turbidity_mean_per_m",
    "disturbance_flown",
    "position_rmse_mm",
    "path_rmse_mm",
    "velocity_deviation_pct",
    "energy_kJ",
    "sign_flips_per_s",
    "solve_ms_median",
)


def compare(
    scenario: options.ScenarioFile = None,
    methods: Annotated[str, typer.Option(help="Comma-separated; ratios are to the first.")] = "dp,wake-aware",
    preset: options.Preset = "quick",
    out: options.Out = None,
    target: options.TargetName = None,
    target_size: options.TargetSize = None,
    vehicle: options.Vehicle = None,
    world: options.World = None,
    seed: options.Seed = None,
    sets: options.Sets = None,
    json: options.Json = False,
) -> None:
    """Fly the same mission with each method in the same water, and set the outcomes side by side."""
    from wakewise.core.optional_dependencies import need

    need("wakewise compare", "photos", "reports", "logs")
    from wakewise import api
    from wakewise.experiments.trials import UNITS
    from wakewise.operation import load_scenario

    names = options.listed(methods)
    if len(names) != len(set(names)) or len(names) < 2:
        hint = f"; one alone is `wakewise scan --method {names[0]}`" if len(names) == 1 else ""
        raise InputError(f"--methods: '{methods}', must be two or more different names such as dp,wake-aware{hint}")
    changes = options.overrides(sets, seed=seed, vehicle=vehicle, target=target, target_size=target_size, world=world)
    scenarios = {name: load_scenario(preset, scenario, changes | {"method": name}) for name in names}
    folder = out or options.default_folder(scenarios[names[0]], "compare")
    result = api.compare(scenarios, folder, ProgressBars())
    figures = result.figures
    if json:
        print_json(figures)
        no_report(result.report_fault)
        return
    rows = [(key, *(figures["methods"][name][key] for name in names), unit_suffix(key, UNITS[key])) for key in _ROWS]
    rows += [
        (f"{key} ratio", *(figures["ratios"][name][key] for name in names), f"to {names[0]}")
        for key in figures["ratios"][names[0]]
        if key != "why"
    ]
    title = f"{scenarios[names[0]].name}, seed {scenarios[names[0]].seed}"
    print_table("t" + "n" * len(names) + "t", ("figure", *names, "unit"), rows, title)
    if no_report(result.report_fault):
        typer.echo(f"report: {result.report}")
