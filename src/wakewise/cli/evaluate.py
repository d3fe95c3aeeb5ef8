"""`wakewise evaluate`: a cloud against a true mesh or against depth maps of surveyed cameras."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.cli.console import print_json, print_table, shown
from wakewise.cli.options import Json
from wakewise.errors import InputError

if TYPE_CHECKING:
    from wakewise.arrays import Array

Cloud = Annotated[Path, typer.Argument(help="Reconstructed points or mesh (PLY), in metres.")]
Reference = Annotated[
    Path | None,
    typer.Option("--reference", help="True surface, a mesh in the same frame and metres.", show_default=False),
]
Depths = Annotated[
    Path | None,
    typer.Option("--depth-maps", help="True depths instead: an .npz file with an array depth (n, h, w), m.",
                 show_default=False),
]  # fmt: skip
Cameras = Annotated[
    Path | None,
    typer.Option("--cameras", help="Camera positions (.camera folder or CSV name,x_m,y_m,z_m): with a mesh for what "
                 "was visible; with depth maps, the .camera folder they belong to.", show_default=False),
]  # fmt: skip
Bed = Annotated[
    float | None,
    typer.Option("--bed-z", metavar="M", help="Height of the bed (z down); what is near it does not count.",
                 show_default=False),
]  # fmt: skip
NoIcp = Annotated[bool, typer.Option("--no-icp", help="Do not refine the alignment before measuring.")]
Colours = Annotated[
    Path | None,
    typer.Option("--colours", metavar="PLY", help="Write the cloud coloured by error: blue 0, green 1.5, red 3 mm.",
                 show_default=False),
]  # fmt: skip
Unit = Annotated[
    float,
    typer.Option("--unit-m", metavar="M", help="Length of the reference's unit in metres: 0.001 for millimetres."),
]


def evaluate(
    cloud: Cloud,
    reference: Reference = None,
    depth_maps: Depths = None,
    cameras: Cameras = None,
    bed_z: Bed = None,
    unit_m: Unit = 1.0,
    no_icp: NoIcp = False,
    colours: Colours = None,
    json: Json = False,
) -> None:
    """Measure a model against the truth: accuracy, completeness, F-score, each figure defined beside it.

    A model that is no model of the reference is a failure, never a figure.
    """
    from wakewise.reconstruction import read_cloud

    if (reference is None) == (depth_maps is None):
        raise InputError("evaluate: give either --reference MESH or --depth-maps NPZ with --cameras FOLDER")
    if not unit_m > 0.0:
        raise InputError(f"--unit-m {unit_m:g}: must be above 0")
    points = read_cloud(cloud).points_m
    if reference is not None:
        figures, definitions = _against_mesh(points, reference, cameras, bed_z, unit_m, not no_icp, colours)
    else:
        figures, definitions = _against_depths(points, depth_maps, cameras)
    if json:
        why = {key: "camera positions were not given (--cameras)" for key, value in figures.items() if value is None}
        why |= {key: "ICP was not wished for" for key in why if key.startswith("icp_")}
        units = {key: unit for key, (unit, _) in definitions.items()}
        print_json(
            figures | {"why": why, "units": units, "definitions": {k: text for k, (_, text) in definitions.items()}}
        )
        return
    from rich.table import Table

    table = Table(title=f"{cloud} against {reference or depth_maps}")
    table.add_column("figure")
    table.add_column("value", justify="right")
    table.add_column("what it is")
    for key, value in figures.items():
        table.add_row(key, shown(value), definitions[key][1])
    print_table(table)


def _against_mesh(
    points: Array,
    reference: Path,
    cameras: Path | None,
    bed_z: float | None,
    unit_m: float,
    icp: bool,
    colours: Path | None,
) -> tuple[dict[str, Any], dict[str, tuple[str, str]]]:
    import numpy as np

    from wakewise.extras import need

    need("wakewise evaluate", "photos", only=("embreex", "small_gicp"))
    from wakewise.evaluation import SURFACE_DEFINITIONS, Crop, compare_surface, error_colours, suspicious_scale
    from wakewise.reconstruction import Cloud as Points
    from wakewise.reconstruction import read_reference_cameras, write_cloud
    from wakewise.targets import read_mesh

    mesh = read_mesh(reference)
    if unit_m != 1.0:
        mesh = dataclasses.replace(mesh, vertices_m=unit_m * mesh.vertices_m)
    suspicion = suspicious_scale(points, mesh)
    if suspicion is not None:
        raise InputError(f"{suspicion} (--unit-m)")
    centres = np.array(list(read_reference_cameras(cameras).values())) if cameras else None
    found = compare_surface(points, mesh, crop=Crop(bed_z_m=bed_z), camera_centres_W_m=centres, icp=icp)
    if colours is not None:
        none = np.zeros_like(found.points_W_m)
        write_cloud(colours, Points(points_m=found.points_W_m, normals=none, colours=error_colours(found.error_mm)))
    return dataclasses.asdict(found.score), SURFACE_DEFINITIONS


def _against_depths(
    points: Array, depth_maps: Path | None, cameras: Path | None
) -> tuple[dict[str, Any], dict[str, tuple[str, str]]]:
    from wakewise.evaluation import DEPTH_DEFINITIONS, compare_depths, read_depth_views

    if depth_maps is None or cameras is None:
        raise InputError("--depth-maps: needs --cameras FOLDER with the .camera files that the maps belong to")
    return dataclasses.asdict(compare_depths(points, read_depth_views(depth_maps, cameras))), DEPTH_DEFINITIONS
