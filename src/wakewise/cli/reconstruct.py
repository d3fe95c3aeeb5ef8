"""`wakewise reconstruct`: photographs to a model."""

from __future__ import annotations

from contextlib import suppress
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
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="FIELD=VALUE", help="Change one setting of the reconstruction, such as "
                 "matching=sequential (docs/scenario.md lists them); may be repeated."),
]  # fmt: skip
Camera = Annotated[
    Path | None,
    typer.Option("--camera", help="Camera to begin with: COLMAP's cameras.txt or a folder that holds it, such as a "
                 "trial's.", show_default=False),
]  # fmt: skip
Region = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option("--region", metavar="X Y Z R", help="Dense points only within R of this place, m, in the references' "
                 "frame.", show_default=False),
]  # fmt: skip
NoMesh = Annotated[bool, typer.Option("--no-mesh", help="Stop at the dense cloud.")]


def reconstruct_photos(
    photos: Photos,
    out: Out = Path("runs/photos"),
    reference_cameras: References = None,
    focal_px: Focal = None,
    camera: Camera = None,
    region: Region = None,
    sets: Sets = None,
    no_mesh: NoMesh = False,
    json: Json = False,
) -> None:
    """Turn a folder of photographs into a sparse model, a dense cloud and a mesh.

    Stages that are done are skipped. Without reference cameras the model has no scale.
    """
    from wakewise.extras import need

    need("wakewise reconstruct", "photos")
    import numpy as np

    from wakewise.operation.scenario import check_scenario, parse_overrides
    from wakewise.reconstruction import read_lens, read_reference_cameras, reconstruct

    changes = ({"mesh": False} if no_mesh else {}) | parse_overrides(sets or [])
    settings = check_scenario({"reconstruction": changes}, "--set").reconstruction
    references = read_reference_cameras(reference_cameras) if reference_cameras else None
    with Bars().stage("reconstruct") as progress:
        model = reconstruct(
            photos,
            out,
            settings,
            focal_px=focal_px,
            lens=read_lens(camera) if camera else None,
            reference_positions=references,
            region=(np.array(region[:3]), region[3]) if region else None,
            progress=progress,
        )
    figures = model.summary()
    if settings.mesh:
        from wakewise.errors import StageError
        from wakewise.likeness.textured import write_textured

        with Bars().stage("colours") as progress, suppress(StageError):
            write_textured(out, photos, out / "mesh.glb", progress=progress)
    if model.duplicates:
        typer.echo(f"wakewise: {model.duplicates} photos are copies of others and were left out", err=True)
    if model.registered_images < model.images:
        left = model.images - model.registered_images
        typer.echo(f"wakewise: {left} of {model.images} photos found no place: they show something else or too little",
                   err=True)  # fmt: skip
    if model.suspicion is not None:
        typer.echo(f"wakewise: {model.suspicion}", err=True)
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
