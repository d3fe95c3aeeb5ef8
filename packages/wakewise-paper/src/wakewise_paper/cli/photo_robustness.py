"""`wakewise photo-robustness`: models from ever worse photographs, until there is none."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, answer, print_table, write_page
from wakewise.ui.cli.options import Json, Preset, Sets, TargetName

Levels = Annotated[
    list[str] | None,
    typer.Option("--levels", metavar="FACTOR=A,B,...", help="Levels of silt (mg/L), blur (px) or particles (1/m3); "
                 "may be repeated, and then only these factors are looked at.", show_default=False),
]  # fmt: skip


def degrade(
    preset: Preset = "quick",
    target: TargetName = None,
    levels: Levels = None,
    out: Annotated[Path, typer.Option(help="Folder of the study; what is done there is not done again.")] = Path(
        "runs/degradation"
    ),
    sets: Sets = None,
    json: Json = False,
) -> None:
    """Photograph a target through more and more silt, blur and particles; a plot and a table per factor.

    Each factor goes on until no model comes about, which is reported as such.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise photo-robustness", "photos", "reports")
    from wakewise.operation import load_scenario
    from wakewise.ui.cli.options import overrides
    from wakewise_paper.photo_robustness import FACTORS, degrade
    from wakewise_paper.reports.operator_bench_plot import plot_degradation

    changes = overrides(sets, seed=None, vehicle=None, target=target, target_size=None)
    scenario = load_scenario(preset, None, changes)
    rows = degrade(scenario, out, dict(_levels(word) for word in levels) if levels else None, ProgressBars())
    for name in {row["factor"]: None for row in rows}:
        factor = FACTORS[name]
        some = [row for row in rows if row["factor"] == name]
        write_page(f"{name}.png", partial(plot_degradation, some, factor.title, factor.unit, out / f"{name}.png"))
    keys = ("level", "rmse_mm", "completeness_pct", "completeness_visible_pct", "registered_images", "inlier_matches")
    cells = [(f"{row['factor']}, {row['unit']}", *(row[key] for key in keys), row["failure"] or "") for row in rows]
    title = f"{scenario.target.kind} coral, {preset} preset"
    table = partial(print_table, "t", ("factor", *keys, "failure"), cells, title)
    answer(json, {"rows": rows}, table, f"table and plots: {out}")


def _levels(word: str) -> tuple[str, tuple[float, ...]]:
    name, equals, text = word.partition("=")
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if not (equals and values):
        raise InputError(f"--levels: '{word}', must be FACTOR=A,B,... such as silt=0,20,40")
    return name.strip(), values
