"""`wakewise vehicle`: the library, and what Wakewise knows about a vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.ui.cli import vehicle_import, vehicle_thruster, vehicle_trim
from wakewise.ui.cli.console import escaped, format_value, print_json, print_table
from wakewise.ui.cli.options import Json

if TYPE_CHECKING:
    from wakewise.robot.vehicles import VehicleDraft

app = typer.Typer(
    help="Vehicles: list, show, check, import; their thrusters.", no_args_is_help=False, rich_markup_mode=None
)
app.command("import")(vehicle_import.import_file)
app.command("thruster")(vehicle_thruster.thruster)
app.command("lag")(vehicle_thruster.lag)
app.command("trim")(vehicle_trim.trim)

Name = Annotated[str, typer.Argument(help="Library name, vehicle file, or a file that `vehicle import` can read.")]
SkipMissing = Annotated[bool, typer.Option("--skip-missing", help="Leave out xacro includes that are not there.")]
Packages = Annotated[
    list[str] | None,
    typer.Option("--package", metavar="NAME=DIR", help="Where a package of a xacro file is; may be repeated."),
]


@app.command("list")
def list_vehicles(json: Json = False) -> None:
    """List the library: thrusters, rank, and whether each vehicle can fly or what its file lacks."""
    from wakewise.robot.vehicles import allocation_rank, draft_names, load_draft, summary_line

    drafts = [load_draft(name) for name in draft_names()]
    if json:
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
        print_json({"vehicles": rows})
        return
    width = max(len(draft.name) for draft in drafts)
    for draft in drafts:
        typer.echo(f"{draft.name:<{width}}  {summary_line(draft)}")


@app.command("show")
def show(
    vehicle: Name = "paper",
    out: Annotated[
        Path | None, typer.Option(help="Also write a drawing (.svg) or a page (.html) to this file.")
    ] = None,
    drawing: Annotated[Path | None, typer.Option(help="Also write an SVG drawing to this file.")] = None,
    frame: vehicle_import.Frame = "auto",
    thrust_direction: vehicle_import.Thrust = "auto",
    package: Packages = None,
    arg: vehicle_import.Arguments = None,
    skip_missing: SkipMissing = False,
    rows: vehicle_import.Rows = None,
    json: Json = False,
) -> None:
    """Show a vehicle: thrusters, rank, what redundancy it has, limits, where the figures are from."""
    from wakewise.core.errors import InputError
    from wakewise.core.files import write_text
    from wakewise.robot.vehicles import describe, parameters
    from wakewise.ui.reports.vehicle import drawing_svg, vehicle_page

    draft = _found(vehicle, frame, thrust_direction, package, arg, rows, skip_missing=skip_missing)
    facts = describe(draft)
    for option, path in (("--out", out), ("--drawing", drawing)):
        if path is not None and path.is_dir():
            raise InputError(f"{option} {path}: is a folder, must be a file")
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
    _print_rows("parameters", ["quantity", "value", "unit", ""], table, left=4)
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
    frame: vehicle_import.Frame = "auto",
    thrust_direction: vehicle_import.Thrust = "auto",
    package: Packages = None,
    arg: vehicle_import.Arguments = None,
    skip_missing: SkipMissing = False,
    rows: vehicle_import.Rows = None,
    json: Json = False,
) -> None:
    """Check a vehicle's thrusters: rank, null space, achievable wrench, single failures, stated matrix."""
    from wakewise.robot.importers import compare_with
    from wakewise.robot.vehicles import check_report

    own_rows = rows if matrix is None else None
    draft = _found(vehicle, frame, thrust_direction, package, arg, own_rows, skip_missing=skip_missing)
    facts = check_report(draft, None if matrix is None else compare_with(draft, matrix, rows))
    if json:
        print_json(facts)
        return
    typer.echo(f"{draft.title}\n")
    _print_allocation(facts)
    table = [[failure["thruster"], failure["name"], failure["rank"], failure["words"]] for failure in facts["failures"]]
    _print_rows("if one thruster fails", ["", "thruster", "rank", "what is left"], table, left=4)
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
            format_value(t["max_forward_N"]),
            format_value(t["max_reverse_N"]),
        ]
        for t in facts["thrusters"]
    ]
    columns = ["", "name", "x m", "y m", "z m", "force axis", "forward N", "reverse N"]
    _print_rows("thrusters (body frame: x forward, y right, z down)", columns, rows, left=2)


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
    rows = [[axis, *(format_value(w[key]) for key in keys)] for axis, w in wrench.items()]
    _print_rows("achievable wrench, the other five axes at zero", columns, rows, left=1)


def _print_lacks(facts: dict[str, Any]) -> None:
    if facts["missing"]:
        typer.echo(f"missing, so it cannot fly: {', '.join(facts['missing'])}")
    for note in facts["notes"]:
        typer.echo(f"note: {' '.join(note.split())}")


def _print_rows(title: str, columns: list[str], rows: list[list[Any]], left: int) -> None:
    """A table whose first `left` columns are words and the others figures."""
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for index, column in enumerate(columns):
        table.add_column(column, justify="left" if index < left or column in ("unit", "force axis") else "right")
    for row in rows:
        table.add_row(*(escaped(str(value)) for value in row))
    print_table(table)


def _found(
    vehicle: str,
    frame: str,
    thrust_direction: str,
    package: list[str] | None,
    arg: list[str] | None,
    rows: str | None,
    *,
    skip_missing: bool,
) -> VehicleDraft:
    from wakewise.robot.importers import find_vehicle

    return find_vehicle(
        vehicle,
        convention=frame,
        thrust=thrust_direction,
        packages=_folders(package),
        arguments=vehicle_import.pairs(arg, ":=", "--arg NAME:=VALUE"),
        skip_missing=skip_missing,
        rows=rows,
    )


def _folders(packages: list[str] | None) -> dict[str, Path]:
    from wakewise.core.errors import InputError

    folders = {}
    for item in packages or []:
        name, equals, folder = item.partition("=")
        if not name or not equals or not folder:
            raise InputError(f"--package {item}: allowed is NAME=DIR")
        folders[name] = Path(folder)
    return folders
