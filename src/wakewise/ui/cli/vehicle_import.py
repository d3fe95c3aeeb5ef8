"""`wakewise vehicle import`: a vehicle file of another project, what it says, and what it does not."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import answer, format_value, print_table
from wakewise.ui.cli.options import (
    Force,
    Json,
    MatrixRows,
    SkipMissing,
    ThrustDirection,
    VehicleFrame,
    XacroArguments,
    XacroPackages,
    check_file,
    pairs,
)

if TYPE_CHECKING:
    from wakewise.robot.vehicles import VehicleDraft
    from wakewise.robot.vehicles.mixing import MatrixComparison


def import_file(
    file: Annotated[
        Path,
        typer.Argument(
            help="URDF, xacro, Gazebo SDF, Stonefish .scn, YAML with a matrix; or a vehicle file to complete."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="Write what was found as a vehicle file, what a flight needs beside as comments to fill in."),
    ] = None,
    frame: VehicleFrame = "auto",
    thrust_direction: ThrustDirection = "auto",
    matrix: Annotated[
        Path | None, typer.Option(help="Matrix that the project ships, to hold against the geometry.")
    ] = None,
    package: XacroPackages = None,
    arg: XacroArguments = None,
    skip_missing: SkipMissing = False,
    rows: MatrixRows = None,
    like: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Estimate what is missing after this vehicle, scaled by mass; each such group is marked estimate: "
            "true.",
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Import a vehicle file of another project; say what it holds, what was decided, and what is missing.

    docs/vehicle-file.md explains every field of what --out writes.
    """
    from wakewise.core.files import write_text
    from wakewise.robot.vehicles import blank_fields, completed, draft_yaml, load_draft
    from wakewise.robot.vehicles.mixing import compare_matrix

    check_file(out, "--out", force)
    if out is not None and out.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out {out}: must end in .yaml, by which a vehicle file is known")
    found = foreign_vehicle(str(file), frame, thrust_direction, package, arg, skip_missing, rows, matrix)
    draft = found if like is None else completed(found, load_draft(like))
    comparison = None
    if draft.thrusters and draft.shipped_matrix is not None:
        comparison = compare_matrix(draft, draft.shipped_matrix, str(matrix or file))
    if out is not None:
        write_text(out, draft_yaml(draft, blank_fields(draft)))
    answer(json, _facts(draft, comparison, out), partial(_show, found, draft, comparison, out))


def foreign_vehicle(
    vehicle: str,
    frame: str,
    thrust_direction: str,
    package: list[str] | None,
    arg: list[str] | None,
    skip_missing: bool,
    rows: str | None,
    matrix: Path | None = None,
) -> VehicleDraft:
    """The vehicle of a name or file, read as the options of the same names say."""
    from wakewise.robot.importers import find_vehicle

    return find_vehicle(
        vehicle,
        convention=frame,
        thrust=thrust_direction,
        matrix=matrix,
        packages={name: Path(folder) for name, folder in pairs("--package", "NAME=DIR", package).items()},
        arguments=pairs("--arg", "NAME:=VALUE", arg),
        skip_missing=skip_missing,
        rows=rows,
    )


def _note(draft: VehicleDraft, topic: str) -> str | None:
    return next((note.removeprefix(topic) for note in draft.notes if note.startswith(topic)), None)


def _facts(draft: VehicleDraft, comparison: MatrixComparison | None, out: Path | None) -> dict[str, Any]:
    from wakewise.robot.vehicles import allocation_rank

    has_matrix = bool(draft.thrusters) or draft.shipped_matrix is not None
    numbers = {name: value for name, value, _ in _numbers(draft)}
    return {
        "name": draft.name,
        "source": draft.source,
        "frame": _note(draft, "frame: "),
        "thrust_direction": _note(draft, "thrust direction: "),
        "thrusters": [
            {
                "name": t.name,
                "position_m": t.p_BT_m.tolist(),
                "axis": t.axis_B.tolist(),
                "max_forward_N": t.max_forward_N,
                "max_reverse_N": t.max_reverse_N,
                "disk_area_m2": t.disk_area_m2,
                "time_constant_s": t.time_constant_s,
            }
            for t in draft.thrusters
        ],
        **numbers,
        "allocation_matrix": draft.allocation_matrix.tolist() if has_matrix else None,
        "rank": allocation_rank(draft) if has_matrix else None,
        "missing": list(draft.missing),
        "mixing_disagreements": None
        if comparison is None
        else [
            {"thruster": d.name, "axis": d.row, "stated": d.stated, "geometry": d.geometry, "fault": d.fault}
            for d in comparison.disagreements
        ],
        "notes": list(draft.notes),
        "why": _why(has_matrix, comparison),
        "out": None if out is None else str(out),
    }


def _why(has_matrix: bool, comparison: MatrixComparison | None) -> dict[str, str]:
    why = {"unknown values": "null where the file says nothing; see missing"}
    if not has_matrix:
        why["rank"] = "the file holds neither thrusters nor a matrix"
    if comparison is None:
        why["mixing_disagreements"] = "needs thruster geometry and a stated matrix; give one with --matrix"
    return why


def _numbers(draft: VehicleDraft) -> list[tuple[str, Any, str]]:
    """Field, value as JSON holds it, and the value as people read it, in the unit that a vehicle file has."""
    from wakewise.robot.vehicles.draft import VEHICLE_WORDS

    rows: list[tuple[str, Any, str]] = []
    for name in [name for name in VEHICLE_WORDS if name != "X_BC"]:
        value = getattr(draft, name)
        if value is None:
            rows.append((name, None, "—"))
        elif isinstance(value, int | float):
            rows.append((name, value, f"{math.degrees(value) if name.endswith('_rad') else value:.6g}"))
        else:
            shown = _row(value) if value.ndim == 1 else _row(value.diagonal()) + " (diagonal)"
            rows.append((name, value.tolist(), shown))
    return rows


def _row(values: Any) -> str:
    return "  ".join(f"{value:.5g}" for value in values)


def _is_estimate(draft: VehicleDraft, field: str) -> bool:
    """Whether the file's own record of sources calls a field an estimate; a record that names fields means those."""
    group, _, name = field.partition(".")
    told = [o.source.partition(": an estimate") for o in draft.provenance if o.estimate and o.group == group]
    return any(not colon or name in fields.rpartition("; ")[2].split(", ") for fields, colon, _ in told)


def _show(found: VehicleDraft, draft: VehicleDraft, comparison: MatrixComparison | None, out: Path | None) -> None:
    from wakewise.robot.vehicles.draft import THRUSTER_FIELDS, VEHICLE_WORDS

    typer.echo(f"{draft.title}\n")
    fields = []
    for name, value, text in _numbers(draft):
        guessed = getattr(found, name) is None or _is_estimate(draft, VEHICLE_WORDS[name][1][0])
        whence = "missing" if value is None else "estimate" if guessed else "file"
        fields.append((", ".join(VEHICLE_WORDS[name][1]), text, whence))
    print_table("t", ("field", "value", "from"), fields, "vehicle (body frame: x forward, y right, z down)")
    if draft.thrusters:
        rows = []
        for t, own in zip(draft.thrusters, found.thrusters or (None,) * len(draft.thrusters), strict=True):
            axis = " ".join(f"{value:+z.3f}" for value in t.axis_B)
            limits = [
                f"~{format_value(value)}"
                if value is not None
                and (getattr(own, name, None) is None or _is_estimate(draft, THRUSTER_FIELDS[name]))
                else value
                for name, value in ((name, getattr(t, name)) for name in THRUSTER_FIELDS)
            ]
            rows.append((t.name, *(f"{v:z.3f}" for v in t.p_BT_m), axis, *limits))
        columns = ("name", "x m", "y m", "z m", "force axis", "forward N", "reverse N", "disk m2", "lag s")
        print_table("tnnntn", columns, rows, "thrusters (~: estimate)")
    for note in draft.notes:
        typer.echo(f"  {note}")
    typer.echo(f"missing: {', '.join(draft.missing) or 'nothing'}")
    if comparison is not None:
        typer.echo(f"stated matrix: {comparison.agree} of {comparison.compared} entries agree with the geometry")
        for line in (*(disagreement.text for disagreement in comparison.disagreements), *comparison.notes):
            typer.echo(f"  {line}")
    for origin in [origin for origin in draft.provenance if origin.estimate]:
        typer.echo(f"estimate: {origin.group.replace('_', ' ')}: {' '.join(origin.source.split())}")
    if out is not None:
        how = "; its fields marked Missing are to be filled in (docs/vehicle-file.md)" if draft.missing else ""
        typer.echo(f"written: {out}{how}")
