"""`wakewise calibrate`: a camera from photographs of a ChArUco board."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, answer, format_value, print_table
from wakewise.ui.cli.options import Json

Out = Annotated[
    Path | None,
    typer.Option("--out", help="File for the camera, which `wakewise reconstruct --camera` reads: JSON with all "
                 "figures, or .txt, COLMAP's cameras.txt.", show_default=False),
]  # fmt: skip


def calibrate(
    photos: Annotated[Path, typer.Argument(help="Folder of photographs of one ChArUco board.")],
    board: Annotated[str, typer.Option(metavar="COLUMNSxROWS", help="Squares across and down.")] = "11x8",
    square_mm: Annotated[float, typer.Option(help="Side of a square.")] = 8.0,
    marker_mm: Annotated[float, typer.Option(help="Side of a marker.")] = 6.0,
    model: Annotated[
        str, typer.Option(help="pinhole, opencv (4 coefficients, as COLMAP's), radial (5) or rational (8).")
    ] = "radial",
    out: Out = None,
    json: Json = False,
) -> None:
    """Calibrate a camera, also behind a flat port: focal length, distortion, and the residual of every lens model."""
    from wakewise.core.optional_dependencies import need

    need("wakewise calibrate", "photos")
    from wakewise.core.files import write_json, write_text
    from wakewise.vision.reconstruction import CalibrationBoard
    from wakewise.vision.reconstruction import calibrate as solve
    from wakewise.vision.reconstruction.photos.calibration import cameras_txt

    if out is not None and out.is_dir():
        raise InputError(f"--out {out}: a folder is there, a file is needed (.json, or .txt for COLMAP's cameras.txt)")
    columns, cross, rows = board.lower().partition("x")
    if not (cross and columns.isdigit() and rows.isdigit()):
        raise InputError(f"--board: '{board}', must be COLUMNSxROWS such as 11x8")
    with ProgressBars().stage("calibrate"):
        squares = CalibrationBoard(
            columns=int(columns), rows=int(rows), square_m=1e-3 * square_mm, marker_m=1e-3 * marker_mm
        )
        found = solve(photos, squares, model)
    figures = found.summary()
    if out is not None and out.suffix.lower() == ".txt":
        write_text(out, cameras_txt(found))
    elif out is not None:
        write_json(out, figures)
    cells: list[tuple[str, Any]] = []
    for key, value in figures.items():
        if isinstance(value, dict):
            cells += [(f"{key}: {name}", each) for name, each in value.items()]
        else:
            cells.append((key, ", ".join(map(format_value, value)) if isinstance(value, list) else value))
    camera = None if out is None else f"camera: {out}; reconstruct PHOTOS --camera {out} begins with it"
    table = partial(print_table, "tn", ("figure", "value"), cells, str(photos))
    answer(json, figures, table, camera)
