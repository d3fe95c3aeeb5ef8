"""`wakewise evaluate`: a cloud, mesh or splats against a reference; rendered views against photographs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise.core.checks import finite_number
from wakewise.core.errors import InputError, StageError
from wakewise.ui.cli.console import answer, print_table
from wakewise.ui.cli.options import Json

if TYPE_CHECKING:
    from wakewise.core.arrays import Array

Cloud = Annotated[
    Path | None,
    typer.Argument(help="Points, mesh or Gaussian splats (PLY), in metres; none with --views.", show_default=False),
]
Reference = Annotated[
    Path | None,
    typer.Option("--reference", help="True surface in the same frame and metres: a mesh, or a cloud such as a laser "
                 "scan's.", show_default=False),
]  # fmt: skip
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
    typer.Option("--bed-z", metavar="M", help="Depth of the bed (z down), near which nothing counts; if not given, "
                 "that of scenario.yaml beside the model.", show_default=False),
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
Thresholds = Annotated[
    str | None,
    typer.Option("--thresholds", metavar="LIST", help="Distances at which shares are counted: mm, as 0.5,1,2, or "
                 "percent of the truth's extent, as 0.5%,1%; 0.25%,0.5%,1% if not given.", show_default=False),
]  # fmt: skip
Views = Annotated[
    Path | None,
    typer.Option("--views", metavar="FOLDER", help="Rendered views, named like the photographs of --photos.",
                 show_default=False),
]  # fmt: skip
Photos = Annotated[
    Path | None,
    typer.Option("--photos", metavar="FOLDER", help="Photographs that the views are compared with.",
                 show_default=False),
]  # fmt: skip
Split = Annotated[
    Path | None,
    typer.Option("--split", metavar="JSON", help="export.json, whose held-out photographs must each have a view; all "
                 "views that have a photograph if not given.", show_default=False),
]  # fmt: skip
Opacity = Annotated[
    float | None,
    typer.Option("--opacity", min=0.0, max=1.0, help="Splats: least opacity that counts as surface; 0.5.",
                 show_default=False),
]  # fmt: skip
Frame = Annotated[
    str, typer.Option("--frame", help="Axes of the model: reference, or nerfstudio (z up) with a reference in NED.")
]
Dataparser = Annotated[
    Path | None,
    typer.Option("--dataparser", metavar="JSON", help="dataparser_transforms.json of a nerfstudio run, whose turn, "
                 "shift and scale are undone.", show_default=False),
]  # fmt: skip
MeshSamples = Annotated[
    int | None,
    typer.Option("--mesh-samples", min=100, help="Take so many points of a mesh's triangles, evenly by area, instead "
                 "of its vertices.", show_default=False),
]  # fmt: skip
Figures = tuple[dict[str, Any], dict[str, tuple[str, str]]]
"""Values and what they are: unit and definition by key."""
SPACING_M = 0.4e-3
BED_REACH_M = 0.02
"""Distance of a scenario's bed from a model's points above which the model has other axes, or is of something else."""
"""Of the points that stand for a Gaussian: half of the cell that a model is thinned to."""


def evaluate(
    cloud: Cloud = None,
    reference: Reference = None,
    depth_maps: Depths = None,
    cameras: Cameras = None,
    bed_z: Bed = None,
    unit_m: Unit = 1.0,
    thresholds: Thresholds = None,
    no_icp: NoIcp = False,
    colours: Colours = None,
    views: Views = None,
    photos: Photos = None,
    split: Split = None,
    opacity: Opacity = None,
    frame: Frame = "reference",
    dataparser: Dataparser = None,
    mesh_samples: MeshSamples = None,
    json: Json = False,
) -> None:
    """Measure a model against the truth: accuracy, completeness, F-score, each figure defined beside it.

    Models of other programs are scored alike: splats (3D Gaussian splatting's PLY), meshes and clouds of fields. With
    --views, rendered views are compared with photographs: PSNR, SSIM, LPIPS.
    A model that is no model of the reference is a failure, never a figure.
    """
    if views is not None or photos is not None or split is not None:
        if cloud is not None or views is None or photos is None:
            raise InputError("evaluate: views need --views FOLDER and --photos FOLDER, and no model")
        _print_views(views, photos, split, json)
        return
    if cloud is None:
        raise InputError("evaluate: give a model (PLY), or --views FOLDER with --photos FOLDER")
    if frame not in ("reference", "nerfstudio"):
        raise InputError(f"--frame: '{frame}', allowed are reference, nerfstudio")
    if (reference is None) == (depth_maps is None):
        raise InputError("evaluate: give either --reference MESH or CLOUD, or --depth-maps NPZ with --cameras FOLDER")
    if cloud.is_dir() or (cloud.suffix.lower() == ".glb" and mesh_samples is None):
        raise InputError(f"{cloud}: is no file of points; give one such as dense.ply or mesh.ply")
    if colours is not None and colours.suffix.lower() != ".ply":
        raise InputError(f"--colours {colours}: must end in .ply")
    if not unit_m > 0.0:
        raise InputError(f"--unit-m {unit_m:g}: must be above 0")
    if depth_maps is not None and thresholds is not None:
        raise InputError("--thresholds: depth maps have their own, 5, 10, 20 and 50 mm")
    points, about = _points(
        cloud, reference, unit_m, opacity, frame == "nerfstudio" or dataparser is not None, dataparser, mesh_samples
    )
    if reference is None:
        figures, definitions = _against_depths(points, depth_maps, cameras)
    else:
        bed_z = _bed_of_trial(cloud, points) if bed_z is None else finite_number(bed_z, "--bed-z")
        try:
            figures, definitions, aligned, error_mm = _against_reference(
                cloud, points, reference, cameras, bed_z, unit_m, thresholds, not no_icp
            )
        except StageError as fault:
            from wakewise.vision.evaluation import ScaleError

            if isinstance(fault, ScaleError):
                raise InputError(f"{fault} The reference's unit: --unit-m; a model must be in metres") from None
            hint = "; if the model holds the bed that the object stands on, say where: --bed-z" if bed_z is None else ""
            raise StageError(f"{fault}{hint}; model and reference must be in metres and have the same axes") from None
        if colours is not None:
            _write_errors(colours, aligned, error_mm)
    _remark(figures)
    if about:
        from wakewise.vision.evaluation import SPLAT_DEFINITIONS

        figures, definitions = figures | about, definitions | SPLAT_DEFINITIONS
    why = {key: "camera positions were not given (--cameras)" for key, value in figures.items() if value is None}
    why |= {key: "ICP was not requested" for key in why if key.startswith("icp_")}
    why |= {key: "the model is no mesh" for key in why if key == "model_faults"}
    shares = (
        f"within {share['threshold_mm']:.3g} mm: {share['accuracy_pct']:.1f} % of the model, "
        f"{share['completeness_pct']:.1f} % of the truth, F {share['f_score']:.1f}"
        for share in figures.get("shares", ())
    )
    _print_figures(json, f"{cloud} against {reference or depth_maps}", figures, why, definitions, {}, *shares)


def _bed_of_trial(model: Path, points_m: Array) -> float | None:
    """Depth of the bed by the scenario beside a trial's model, None without one or where the model ends above it."""
    scenario = model.parent / "scenario.yaml"
    if not scenario.is_file():
        return None
    import numpy as np

    from wakewise.operation import read_scenario

    try:
        bed_z = read_scenario(scenario).tank.size_m[2]
    except InputError as fault:
        raise InputError(f"{fault}; --bed-z gives the bed's depth instead") from None
    low, high = np.percentile(points_m[:, 2], (0.1, 99.9))
    if not low - BED_REACH_M <= bed_z <= high + BED_REACH_M:
        typer.echo(
            f"wakewise: {scenario} has its bed at z = {bed_z:g} m, not in this model: not used (--bed-z)", err=True
        )
        return None
    typer.echo(f"wakewise: bed at z = {bed_z:g} m, from {scenario} (--bed-z)", err=True)
    return bed_z


def _points(
    cloud: Path,
    reference: Path | None,
    unit_m: float,
    opacity: float | None,
    nerfstudio: bool,
    dataparser: Path | None,
    mesh_samples: int | None,
) -> tuple[Array, dict[str, Any]]:
    """Points of a cloud, a mesh or splats in the frame of the reference; figures of the splats."""
    import numpy as np

    from wakewise.vision.evaluation import Crop, nerfstudio_frame, read_splats, sample_surface
    from wakewise.vision.evaluation.trained_models import OPACITY
    from wakewise.vision.reconstruction import read_cloud

    similarity = nerfstudio_frame(dataparser) if nerfstudio else None
    splats = read_splats(cloud)
    if splats is None:
        if opacity is not None:
            raise InputError(f"--opacity: goes with splats only, {cloud} holds none")
        if mesh_samples is None:
            points = read_cloud(cloud).points_m
        else:
            from wakewise.scene.targets import read_mesh

            points = sample_surface(read_mesh(cloud), Crop(), np.random.default_rng(0), mesh_samples).points_m
        return points if similarity is None else similarity.apply(points), {}
    if mesh_samples is not None:
        raise InputError(f"--mesh-samples: goes with meshes only, {cloud} holds splats")
    splats = splats if similarity is None else splats.moved(similarity)
    corners = splats.centres_m if reference is None else unit_m * read_cloud(reference).points_m
    low, high = corners.min(axis=0), corners.max(axis=0)
    reach = 0.1 * float(np.linalg.norm(high - low))  # what ICP may move it by, and what counts beside the truth
    least = OPACITY if opacity is None else opacity
    points, about = splats.surface(least, SPACING_M, low - reach, high + reach)
    if not len(points):
        raise StageError(f"{cloud}: none of its {about['splats']} splats about the reference has opacity {least:g}")
    return points, about


def _print_views(views: Path, photos: Path, split: Path | None, json: bool) -> None:
    from wakewise.vision.evaluation import VIEW_DEFINITIONS, read_split, score_views

    scores = score_views(views, photos, None if split is None else read_split(split))
    _print_figures(
        json, f"{views} against {photos}", scores.figures(), scores.why, VIEW_DEFINITIONS, instead=scores.why
    )


def _remark(figures: dict[str, Any]) -> None:
    """Faults of the meshes, and thresholds that say nothing of so small a thing, on standard error."""
    from wakewise.vision.evaluation.cloud_to_surface import USEFUL_PCT, MeshFaults

    for key, name in (("reference_faults", "reference"), ("model_faults", "model")):
        for words in MeshFaults(**figures[key]).words() if figures.get(key) else ():
            typer.echo(f"wakewise: {name}: {words}", err=True)
    extent = figures.get("extent_mm")
    if extent is not None and "completeness_pct" in figures and 0.01 * USEFUL_PCT * extent < 3.0:
        typer.echo(
            f"wakewise: 3 mm are {300.0 / extent:.0f} % of this object's {extent:.0f} mm: completeness_pct, f_score "
            "and success say little, see the shares (--thresholds)",
            err=True,
        )


def _write_errors(path: Path, points: Array, error_mm: Array) -> None:
    import numpy as np

    from wakewise.vision.evaluation import error_colours
    from wakewise.vision.reconstruction import OrientedPointCloud, write_cloud

    none = np.zeros_like(points)
    write_cloud(path, OrientedPointCloud(points_m=points, normals=none, colours=error_colours(error_mm)))


def _against_reference(
    cloud: Path,
    points: Array,
    reference: Path,
    cameras: Path | None,
    bed_z: float | None,
    unit_m: float,
    thresholds: str | None,
    icp: bool,
) -> tuple[dict[str, Any], dict[str, tuple[str, str]], Array, Array]:
    """Figures, definitions, the aligned model and its errors in mm; the reference is a cloud if it has no faces."""
    from wakewise.core.optional_dependencies import need

    need("wakewise evaluate", "photos", only=("embreex", "small_gicp"))
    import numpy as np

    from wakewise.scene.targets import read_mesh
    from wakewise.scene.targets.mesh import READABLE_SUFFIXES, FacelessFileError
    from wakewise.vision.evaluation import (
        CLOUD_DEFINITIONS,
        MESH_REFERENCE_DEFINITIONS,
        SURFACE_DEFINITIONS,
        Crop,
        compare_clouds,
        compare_surface,
        extent_m,
        mesh_faults,
        read_thresholds,
    )
    from wakewise.vision.reconstruction import read_cloud, read_reference_cameras

    mesh = None
    if reference.suffix.lower() in READABLE_SUFFIXES or not reference.is_file():
        with suppress(FacelessFileError):
            mesh = read_mesh(reference)
    if mesh is None:
        if cameras is not None:
            raise InputError(f"--cameras: what they saw of {reference} is not known, it has no faces")
        truth = unit_m * read_cloud(reference).points_m
        wanted = read_thresholds(thresholds, 1e3 * extent_m(truth))
        found = compare_clouds(points, truth, wanted, bed_z_m=bed_z, icp=icp)
        figures = dataclasses.asdict(found.score) | {"shares": [dataclasses.asdict(one) for one in found.shares]}
        return figures, CLOUD_DEFINITIONS, found.points_W_m, found.error_mm
    if unit_m != 1.0:
        mesh = dataclasses.replace(mesh, vertices_m=unit_m * mesh.vertices_m)
    centres = np.array(list(read_reference_cameras(cameras).values())) if cameras else None
    extent_mm = 1e3 * extent_m(mesh.vertices_m)
    wanted = read_thresholds(thresholds, extent_mm)
    try:
        compared = compare_surface(
            points, mesh, crop=Crop(bed_z_m=bed_z), camera_centres_W_m=centres, icp=icp, thresholds_mm=wanted
        )
    except InputError as fault:
        raise InputError(f"{fault}; --bed-z {bed_z:g} is its height, z down" if bed_z is not None else fault) from None
    own: dict[str, int] | None = None
    with suppress(InputError):
        own = dataclasses.asdict(mesh_faults(read_mesh(cloud)))
    more = {
        "extent_mm": extent_mm,
        "shares": [dataclasses.asdict(one) for one in compared.shares],
        "reference_faults": dataclasses.asdict(mesh_faults(mesh)),
        "model_faults": own,
    }
    definitions = SURFACE_DEFINITIONS | MESH_REFERENCE_DEFINITIONS
    return dataclasses.asdict(compared.score) | more, definitions, compared.points_W_m, compared.error_mm


def _against_depths(points: Array, depth_maps: Path | None, cameras: Path | None) -> Figures:
    from wakewise.vision.evaluation import DEPTH_DEFINITIONS, compare_depths, read_depth_views

    if depth_maps is None or cameras is None:
        raise InputError("--depth-maps: needs --cameras FOLDER with the .camera files that the maps belong to")
    return dataclasses.asdict(compare_depths(points, read_depth_views(depth_maps, cameras))), DEPTH_DEFINITIONS


def _print_figures(
    json: bool,
    title: str,
    figures: dict[str, Any],
    why: Mapping[str, str],
    definitions: Mapping[str, tuple[str, str]],
    instead: Mapping[str, str],
    *lines: str,
) -> None:
    """Print the figures: with `json` with units, definitions and why some are null, else as a table and lines.

    The table has the definition of each figure, or what `instead` says of it.
    """
    units = {key: unit for key, (unit, _) in definitions.items()}
    texts = {key: text for key, (_, text) in definitions.items()}
    rows = [
        (key, value, instead.get(key) or texts[key])
        for key, value in figures.items()
        if not isinstance(value, (list, dict)) and key != "model_faults"
    ]
    table = partial(print_table, "tnt", ("figure", "value", "what it is"), rows, title)
    answer(json, figures | {"why": why, "units": units, "definitions": texts}, table, *lines)
