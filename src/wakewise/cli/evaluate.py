"""`wakewise evaluate`: a cloud against a true mesh."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from wakewise.cli.console import print_json, print_table, shown
from wakewise.cli.options import Json

Cloud = Annotated[Path, typer.Argument(help="Reconstructed points or mesh (PLY), in metres.")]
Reference = Annotated[Path, typer.Option("--reference", help="True surface, a mesh in the same frame and metres.")]
Bed = Annotated[
    float | None,
    typer.Option("--bed-z", metavar="M", help="Height of the bed (z down); what is near it does not count.",
                 show_default=False),
]  # fmt: skip
NoIcp = Annotated[bool, typer.Option("--no-icp", help="Do not refine the alignment before measuring.")]


def evaluate(cloud: Cloud, reference: Reference, bed_z: Bed = None, no_icp: NoIcp = False, json: Json = False) -> None:
    """Measure a model against the truth: accuracy, completeness, F-score."""
    from wakewise.evaluation import Crop, evaluate_surface
    from wakewise.reconstruction import read_cloud
    from wakewise.targets import read_mesh

    score = evaluate_surface(read_cloud(cloud).points_m, read_mesh(reference), crop=Crop(bed_z_m=bed_z), icp=not no_icp)
    figures = dataclasses.asdict(score)
    if json:
        why = {key: "camera positions were not given" for key, value in figures.items() if value is None}
        print_json(figures | {"why": why})
        return
    from rich.table import Table

    table = Table(title=f"{cloud} against {reference}")
    table.add_column("figure")
    table.add_column("value", justify="right")
    for key, value in figures.items():
        table.add_row(key, shown(value))
    print_table(table)
