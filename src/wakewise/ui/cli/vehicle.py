"""`wakewise vehicle`: the library, and what Wakewise knows about a vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.ui.cli import vehicle_import, vehicle_thruster, vehicle_trim
from wakewise.ui.cli.console import answer, print_json, print_table
from wakewise.ui.cli.options import (
    Json,
    MatrixRows,
    SkipMissing,
    ThrustDirection,
    VehicleFrame,
    XacroArguments,
    XacroPackages,
    check_file,
)
from wakewise.ui.cli.vehicle_import import foreign_vehicle

app = typer.Typer(help="Vehicles: list, show, check, import; their thrusters.")
app.command("import")(vehicle_import.import_file)
app.command("thruster")(vehicle_thruster.thruster)
app.command("lag")(vehicle_thruster.lag)
app.command("trim")(vehicle_trim.trim)

Name = Annotated[str, typer.Argument(help="Library name, vehicle file, or a file that `vehicle import` can read.")]


@app.command("list")
def list_vehicles(json: Json = False) -> None:
    """List the library: thrusters, rank, and whether each vehicle can fly or what its file lacks."""
    from wakewise.robot.vehicles import allocation_rank, draft_names, load_draft, summary_line

    drafts = [load_draft(name) for name in draft_names()]
    rows = [
        {
            "name": draft.name,
            "title": draft.title,
            "thrusters": len(draft.thruster_names),
            "rank": allocation_rank(draft),
            "can_fly": not draft.missing,
            "missing": list(draft.missing),
        }
        for draft in drafts
    ]
    width = max(len(draft.name) for draft in drafts)
    answer(json, {"vehicles": rows}, *(f"{draft.name:<{width}}  {summary_line(draft)}" for draft in drafts))


@app.command("show")
def show(
    vehicle: Name = "paper",
    out: Annotated[
        Path | None, typer.Option(help="Also write a drawing (.svg) or a page (.html) to this file.")
    ] = None,
    drawing: Annotated[Path | None, typer.Option(help="Also write an SVG drawing to this file.")] = None,
    frame: VehicleFrame = "auto",
    thrust_direction: ThrustDirection = "auto",
    package: XacroPackages = None,
    arg: XacroArguments = None,
    skip_missing: SkipMissing = False,
    rows: MatrixRows = None,
    json: Json = False,
) -> None:
    """Show a vehicle: thrusters, rank, what redundancy it has, limits, where the figures are from."""
    from wakewise.core.errors import InputError
    from wakewise.core.files import write_text
    from wakewise.robot.vehicles import describe, parameters
    from wakewise.ui.reports.vehicle import drawing_svg, vehicle_page

    draft = foreign_vehicle(vehicle, frame, thrust_direction, package, arg, skip_missing, rows)
    facts = describe(draft)
    check_file(out)
    check_file(drawing, "--drawing")
    if out is not None:
        if out.suffix not in (".svg", ".html"):
            raise InputError(f"--out {out}: allowed are files that end in .svg or .html")
        write_text(out, drawing_svg(draft) if out.suffix == ".svg" else vehicle_page(draft))
    if drawing is not None:
        write_text(drawing, drawing_svg(draft))
    if json:
        print_json(facts)
        return
    typer.echo(f"{draft.title}\n")
    _print_thrusters(facts)
    table = [[p.quantity, p.value or "missing", p.unit, "estimate" if p.estimate else ""] for p in parameters(draft)]
    print_table("t", ["quantity", "value", "unit", ""], table, "parameters")
    _print_allocation(facts)
    for group in facts["provenance"]:
        typer.echo(f"source of {group['group'].replace('_', ' ')}: {' '.join(group['source'].split())}")
    typer.echo(f"source: {facts['source']}")
    typer.echo(f"does not claim: {facts['does_not_claim']}")
    _print_lacks(facts)
    for path in (out, drawing):
        if path is not None:
            typer.echo(f"written: {path}")


@app.command("check")
def check(
    vehicle: Name,
    matrix: Annotated[
        str | None,
        typer.Option(
            metavar="FILE",
            help="Allocation matrix to compare with the geometry: YAML, six lines of numbers, motor factors as CSV, "
            "or the word ardusub for ArduSub's frame.",
        ),
    ] = None,
    frame: VehicleFrame = "auto",
    thrust_direction: ThrustDirection = "auto",
    package: XacroPackages = None,
    arg: XacroArguments = None,
    skip_missing: SkipMissing = False,
    rows: MatrixRows = None,
    json: Json = False,
) -> None:
    """Check a vehicle's thrusters: rank, null space, achievable wrench, single failures, stated matrix."""
    from wakewise.robot.importers import compare_with
    from wakewise.robot.vehicles import check_report

    own_rows = rows if matrix is None else None
    draft = foreign_vehicle(vehicle, frame, thrust_direction, package, arg, skip_missing, own_rows)
    facts = check_report(draft, None if matrix is None else compare_with(draft, matrix, rows))
    if json:
        print_json(facts)
        return
    typer.echo(f"{draft.title}\n")
    _print_allocation(facts)
    table = [[failure["thruster"], failure["name"], failure["rank"], failure["words"]] for failure in facts["failures"]]
    print_table("t", ["", "thruster", "rank", "what is left"], table, "if one thruster fails")
    found = facts["mixing"]
    if found is not None:
        typer.echo(f"{found['stated_by']}: {found['agree']} of {found['compared']} entries agree with the geometry")
        for entry in facts["mixing_disagreements"]:
            typer.echo(f"  {entry['text']}")
        for note in found["notes"]:
            typer.echo(f"  note: {note}")
        for line in found["commands"]:
            typer.echo(f"  command: {line}")
    _print_lacks(facts)


def _print_thrusters(facts: dict[str, Any]) -> None:
    if not facts["thrusters"]:
        typer.echo("its file holds a matrix, but no places of thrusters")
        return
    rows = [
        [
            t["number"],
            t["name"],
            *(f"{value:z.3f}" for value in t["position_m"]),
            " ".join(f"{value:+z.3f}" for value in t["axis"]),
            t["max_forward_N"],
            t["max_reverse_N"],
        ]
        for t in facts["thrusters"]
    ]
    columns = ["", "name", "x m", "y m", "z m", "force axis", "forward N", "reverse N"]
    print_table("ttnnntn", columns, rows, "thrusters (body frame: x forward, y right, z down)")


def _print_allocation(facts: dict[str, Any]) -> None:
    typer.echo(f"rank {facts['rank']} of 6, {facts['actuation']}")
    typer.echo(f"null space of dimension {len(facts['null_space'])}{':' if facts['null_space'] else ''}")
    for vector in facts["null_space"]:
        thrusts = " ".join(f"{value:+z.3f}" for value in vector["thrusts"])
        typer.echo(f"  {vector['name']}: {thrusts}  ({vector['words']})")
    wrench = facts["achievable_wrench"]
    if wrench is None:
        typer.echo(f"achievable wrench: not known, {facts['why']['achievable_wrench']}")
        return
    columns = ["axis", "lowest", "highest", "unit", "lowest, others free", "highest, others free"]
    keys = ("lowest", "highest", "unit", "lowest_others_free", "highest_others_free")
    rows = [[axis, *(w[key] for key in keys)] for axis, w in wrench.items()]
    print_table("tnntn", columns, rows, "achievable wrench, the other five axes at zero")


def _print_lacks(facts: dict[str, Any]) -> None:
    if facts["missing"]:
        typer.echo(f"missing, so it cannot fly: {', '.join(facts['missing'])}")
    for note in facts["notes"]:
        typer.echo(f"note: {' '.join(note.split())}")
