"""`wakewise vehicle`: what Wakewise knows about a vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wakewise.cli.console import print_json, print_table, shown
from wakewise.cli.options import Json

app = typer.Typer(help="What Wakewise knows about a vehicle.", no_args_is_help=False, rich_markup_mode=None)

Name = Annotated[str, typer.Argument(help="Library name or path of a vehicle file.")]
Drawing = Annotated[
    Path | None, typer.Option("--drawing", help="Also write an SVG drawing to this file.", show_default=False)
]


@app.command("show")
def show(vehicle: Name = "paper", drawing: Drawing = None, json: Json = False) -> None:
    """Show a vehicle: thrusters, rank, what redundancy it has, limits, where the figures are from."""
    from wakewise.files import write_text
    from wakewise.vehicles import describe, drawing_svg, load_vehicle

    record = load_vehicle(vehicle)
    facts = describe(record)
    if drawing is not None:
        write_text(drawing, drawing_svg(record))
    if json:
        print_json(facts)
        return
    from rich.table import Table

    typer.echo(f"{record.title}\n")
    table = Table(title="thrusters (body frame: x forward, y right, z down)")
    for column in ("name", "x m", "y m", "z m", "force axis", "forward N", "reverse N"):
        table.add_column(column, justify="left" if column in ("name", "force axis") else "right")
    for thruster in record.thrusters:
        axis = " ".join(f"{value:+.3f}" for value in thruster.axis_B)
        place = (f"{value:.3f}" for value in thruster.p_BT_m)
        table.add_row(thruster.name, *place, axis, shown(thruster.max_forward_N), shown(thruster.max_reverse_N))
    print_table(table)
    typer.echo(f"rank {facts['rank']} of 6, null space of dimension {len(facts['null_space'])}:")
    for vector in facts["null_space"]:
        typer.echo(f"  {vector['name']}: " + " ".join(f"{value:+.3f}" for value in vector["thrusts"]))
    typer.echo(f"source: {facts['source']}")
    typer.echo(f"does not claim: {facts['does_not_claim']}")
    if drawing is not None:
        typer.echo(f"drawing: {drawing}")
