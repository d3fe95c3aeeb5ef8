"""What `wakewise reconstruct --write` leaves besides the model: textures, orthophoto, LAS, extent by halves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars

if TYPE_CHECKING:
    from wakewise.core.arrays import Array
    from wakewise.vision.reconstruction import Model

KINDS = ("texture", "ortho", "las", "extent")
WriteOption = Annotated[
    list[str] | None,
    typer.Option("--write", metavar="KIND", help="Also write texture (OBJ and GLB with a picture), ortho (orthophoto "
                 "and heights), las (points), extent (area, volume, rugosity, and how they repeat); may be repeated.",
                 show_default=False),
]  # fmt: skip
Remake = Callable[[Path, Path, Mapping[str, "Array"], Any], "Model"]


def check_kinds(kinds: list[str] | None, until: str | None) -> None:
    """Refuse kinds that there are not, or that need what was not asked for.

    Raises
    ------
    InputError
        Says which, and what is allowed.
    """
    for kind in kinds or []:
        if kind not in KINDS:
            raise InputError(f"--write {kind}: allowed are {', '.join(KINDS)}")
        if until == "sparse" or (until == "dense" and kind in ("texture", "extent")):
            needed = "a surface" if kind in ("texture", "extent") else "dense points"
            raise InputError(f"--write {kind}: needs {needed}, which --until {until} or --no-mesh leaves out")


def write_outputs(kinds: list[str] | None, out: Path, photos: Path, model: Model, remake: Remake) -> list[str]:
    """Write them; a line on each."""
    lines = []
    for kind in dict.fromkeys(kinds or []):
        with ProgressBars().stage(kind) as progress:
            if kind == "texture":
                from wakewise.vision.texturing.atlas import write_atlas

                seen = write_atlas(out, photos, out, progress)
                lines.append(f"texture: {100 * seen:.0f} % of the triangles are in photos; textured.obj, textured.glb")
            elif kind == "ortho":
                from wakewise.vision.texturing.orthophoto import write_orthophoto

                facts = write_orthophoto(out, photos, out, progress=progress)
                lines.append(
                    f"orthophoto: {facts['columns']} x {facts['rows']} px of {shown_length(facts['cell'], model)}"
                )
            elif kind == "las":
                from wakewise.vision.reconstruction import read_cloud
                from wakewise.vision.reconstruction.las import write_las

                write_las(out / "dense.las", read_cloud(out / "dense.ply"))
                lines.append(f"points: {model.dense_points} in dense.las")
            else:
                lines += _extent(out, photos, model, remake, progress)
    return lines


def shown_length(value: float, model: Model) -> str:
    """A length of the model in mm, or in its units where it has no scale."""
    return f"{1e3 * value:.3g} mm" if model.point_spacing_mm is not None else f"{value:.3g} units"


def _extent(out: Path, photos: Path, model: Model, remake: Remake, progress: Any) -> list[str]:
    import shutil
    import tempfile

    from wakewise.vision.reconstruction.registered_photos import camera_centres
    from wakewise.vision.reconstruction.split_half_check import FIGURES, measure_halves

    names = sorted(camera_centres(out / "sparse"))

    def make(half: list[str], folder: Path, places: Mapping[str, Array]) -> None:
        with tempfile.TemporaryDirectory(prefix=".half-", dir=out) as scratch:
            chosen = Path(scratch) / "photos"
            for name in half:
                (chosen / name).parent.mkdir(parents=True, exist_ok=True)
                try:
                    (chosen / name).symlink_to((photos / name).resolve())
                except OSError:  # a disk without links
                    shutil.copy(photos / name, chosen / name)
            remake(chosen, folder, places, progress)

    metric = model.point_spacing_mm is not None
    said = measure_halves(out, names, make, metric=metric)
    unit = "m" if metric else "units"
    powers = {"area": f" {unit}²", "plan_area": f" {unit}²", "rugosity": "", "volume": f" {unit}³"}
    return [
        f"{key.replace('_', ' ')}: {said[key]['whole']:.4g}{powers[key]}, halves of the photos differ by "
        + ("–" if said[key]["repeat_pct"] is None else f"{said[key]['repeat_pct']:.1f} %")
        for key in FIGURES
    ]
