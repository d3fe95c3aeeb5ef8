"""`wakewise reconstruct`: photographs to a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wakewise.cli.console import Bars, print_json, print_table, shown
from wakewise.cli.options import Json

Photos = Annotated[Path, typer.Argument(help="Folder of photographs (JPEG, PNG or TIFF).")]
Out = Annotated[Path, typer.Option("--out", help="Folder for the model.")]
References = Annotated[
    Path | None,
    typer.Option(
        "--reference-cameras",
        help="Known camera positions: a folder of .camera files or a CSV with name,x_m,y_m,z_m. They give scale.",
        show_default=False,
    ),
]
Focal = Annotated[
    float | None, typer.Option("--focal-px", help="Focal length in pixels; from EXIF if not given.", show_default=False)
]
NoMesh = Annotated[bool, typer.Option("--no-mesh", help="Stop at the dense cloud.")]


def reconstruct_photos(
    photos: Photos,
    out: Out = Path("runs/photos"),
    reference_cameras: References = None,
    focal_px: Focal = None,
    no_mesh: NoMesh = False,
    json: Json = False,
) -> None:
    """Turn a folder of photographs into a sparse model, a dense cloud and a mesh.

    Stages that are done are skipped. Without reference cameras the model has no scale.
    """
    from wakewise.reconstruction import ReconstructionSettings, read_reference_cameras, reconstruct

    references = read_reference_cameras(reference_cameras) if reference_cameras else None
    settings = ReconstructionSettings(mesh=not no_mesh)
    with Bars().stage("reconstruct") as progress:
        model = reconstruct(photos, out, settings, focal_px=focal_px, reference_positions=references, progress=progress)
    figures = model.summary()
    if json:
        print_json(figures)
        return
    from rich.table import Table

    table = Table(title=str(photos))
    table.add_column("figure")
    table.add_column("value", justify="right")
    for key, value in figures.items():
        if isinstance(value, (int, float)) or value is None:
            table.add_row(key, shown(value))
    print_table(table)
    typer.echo(f"model: {out}")
