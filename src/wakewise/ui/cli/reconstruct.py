"""`wakewise reconstruct`: photographs to a model, with a log file of options, stages, messages and result."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wakewise import __version__
from wakewise.ui.cli.console import ProgressBars, answer, print_table
from wakewise.ui.cli.options import Json, pairs
from wakewise.ui.cli.reconstruct_options import (
    BarOption,
    BarsFile,
    Crop,
    FixesOption,
    LookOption,
    MasksOption,
    UntilOption,
    WriteOption,
    check_kinds,
    frames_of,
    look_first,
    request_of,
    scale_lines,
    write_outputs,
    write_report_of,
)

if TYPE_CHECKING:
    from wakewise.core.interfaces import Progress
    from wakewise.vision.reconstruction import Lens, Model


NAME = "reconstruct.log"


class RunLog:
    """Lines with the time, appended to `out/reconstruct.log`; nothing is written before the folder is there."""

    def __init__(self, out: Path) -> None:
        self._path = out / NAME
        self._waiting = [f"wakewise {__version__}: {' '.join(sys.argv[1:])}"]
        self._stage = ""

    def say(self, line: str) -> None:
        """Add a line."""
        self._waiting.append(line)
        if self._path.parent.is_dir():
            now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%SZ")
            with self._path.open("a", encoding="utf-8") as file:
                file.writelines(f"{now}  {' '.join(each.split())}\n" for each in self._waiting)
            self._waiting = []

    def watching(self, progress: Progress) -> Progress:
        """The same progress, with a line whenever the work changes."""

        def tell(done: float, total: float, note: str = "") -> None:
            if note != self._stage:
                self._stage = note
                self.say(f"{note} ...")
            progress(done, total, note)

        return tell


@contextmanager
def logged(out: Path) -> Iterator[RunLog]:
    """A log that also records a failure, which is raised again."""
    log = RunLog(out)
    try:
        yield log
    except BaseException as fault:
        log.say("stopped by the user" if isinstance(fault, KeyboardInterrupt) else f"failed: {fault}")
        raise


MOST_NAMED = 5
"""Photos that are named one by one on the screen; the JSON has all."""
COARSE_CELL = 2.2
"""Cell of the mesh, in point spacings, above which it is told: only its bound across the subject makes it so."""
Photos = Annotated[Path, typer.Argument(help="Folder of photographs (JPEG, PNG, TIFF or BMP), or a film.")]
Out = Annotated[
    Path | None,
    typer.Option("--out", help="Folder for the model; runs/NAME of the photographs' if not given.", show_default=False),
]
References = Annotated[
    Path | None,
    typer.Option(
        "--reference-cameras",
        help="Known camera positions: a folder of .camera files or a CSV with name,x_m,y_m,z_m. They give scale.",
        show_default=False,
    ),
]
Known = Annotated[
    Path | None,
    typer.Option("--cameras", help="Known poses and lenses: COLMAP's model, nerfstudio's transforms.json, a CSV "
                 "with name,x_m,y_m,z_m,qw,qx,qy,qz (and width,height,fx,fy,cx,cy) or a folder of .camera files. They "
                 "stay as they are; with --set known_cameras=priors the photos correct them.", show_default=False),
]  # fmt: skip
Focal = Annotated[
    float | None, typer.Option("--focal-px", help="Focal length in pixels; from EXIF if not given.", show_default=False)
]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="FIELD=VALUE", help="Change one setting of the reconstruction, such as "
                 "matching=sequential (docs/scenario.md lists them); may be repeated."),
]  # fmt: skip
Camera = Annotated[
    list[str] | None,
    typer.Option("--camera", metavar="[LENS=]PATH", help="Camera to begin with: what `wakewise calibrate --out` wrote, "
                 "COLMAP's cameras.txt, or a folder that holds it, such as a trial's. LENS: of the photos of that name "
                 "(--lens, a folder of photos, or as lenses are listed in the result); may be repeated.",
                 show_default=False),
]  # fmt: skip
LensOption = Annotated[
    list[str] | None,
    typer.Option("--lens", metavar="NAME=PATTERN", help="Photos that share a lens, such as left='L_*': else EXIF, "
                 "folders and sizes tell them apart; may be repeated.", show_default=False),
]  # fmt: skip
Region = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option("--region", metavar="X Y Z R", help="Dense points only within R of this place, m, in the references' "
                 "frame.", show_default=False),
]  # fmt: skip
NoMesh = Annotated[bool, typer.Option("--no-mesh", help="Stop at the dense cloud.")]


def reconstruct_photos(
    photos: Photos,
    out: Out = None,
    reference_cameras: References = None,
    cameras: Known = None,
    focal_px: Focal = None,
    camera: Camera = None,
    lens: LensOption = None,
    region: Region = None,
    sets: Sets = None,
    no_mesh: NoMesh = False,
    bar: BarOption = None,
    bars: BarsFile = None,
    fixes: FixesOption = None,
    masks: MasksOption = None,
    crop: Crop = None,
    until: UntilOption = None,
    look: LookOption = False,
    write: WriteOption = None,
    json: Json = False,
) -> None:
    """Turn a folder of photographs into a sparse model, a dense cloud and a mesh.

    Stages that are done are skipped. Without reference cameras, bars or fixes the model has no scale. What a verdict
    means and how to photograph is in docs/photographs.md; scale, masks, films and outputs are in docs/scale.md.
    """
    from wakewise.core.optional_dependencies import need

    need("wakewise reconstruct", "photos")
    import numpy as np

    from wakewise.operation.scenario import check_scenario, parse_overrides
    from wakewise.vision.reconstruction import (
        ReconstructionRequest,
        read_known_cameras,
        read_reference_cameras,
        reconstruct,
    )

    changes = ({"mesh": False} if no_mesh else {}) | parse_overrides(sets or [])
    settings = check_scenario({"reconstruction": changes}, "--set").reconstruction
    check_kinds(write, "dense" if no_mesh and until is None else until)
    request = request_of(bar, bars, masks, crop, until, fixes, photos)
    # Whatever was given is read before anything is made, whether this run needs it or not.
    lenses, patterns = _lenses(camera), pairs("--lens", "NAME=PATTERN such as left='L_*'", lens) or None
    references = read_reference_cameras(reference_cameras) if reference_cameras else None
    known = read_known_cameras(cameras) if cameras else None
    out = out or Path("runs") / (photos.resolve().name if photos.is_dir() else photos.stem)
    photos = frames_of(photos, out)
    if look:
        look_first(photos, out, settings.threads, json)
        return
    for line in output_folder(photos):
        typer.echo(f"wakewise: {line}", err=True)
    made = partial(reconstruct, settings=settings, focal_px=focal_px, lens=lenses, lens_patterns=patterns)
    with logged(out) as log, ProgressBars().stage("reconstruct") as progress:
        model = made(
            photos,
            out,
            reference_positions=references,
            known=known,
            region=(np.array(region[:3]), region[3]) if region else None,
            request=request,
            progress=log.watching(progress),
        )
    figures = model.summary()
    if model.mesh_faces is not None:
        from wakewise.core.errors import StageError
        from wakewise.vision.texturing.textured import write_textured

        with ProgressBars().stage("colours") as progress, suppress(StageError):
            write_textured(out, photos, out / "mesh.glb", progress=progress)
    for line in remarks(model):
        typer.echo(f"wakewise: {line}", err=True)
    for line in (*remarks(model), *scale_lines(model), verdict(model)):
        log.say(line)
    write_report_of(out, photos)

    def remake(half: Path, folder: Path, places: Any, tell: Any) -> Model:
        kept = ReconstructionRequest(masks=masks, crop=request.crop)
        return made(half, folder, reference_positions=places, request=kept, progress=tell)

    for line in write_outputs(write, out, photos, model, remake):
        log.say(line)
        typer.echo(line, err=json)
    rows = [
        (key, value)
        for key, value in figures.items()
        if isinstance(value, (int, float)) or (value is None and key not in ("suspicion", "poses_refused"))
    ]
    table = partial(print_table, "tn", ("figure", "value"), rows, str(photos))
    answer(json, figures, table, *scale_lines(model), verdict(model), f"model: {out}")


def verdict(model: Model) -> str:
    """Whether the model deserves trust, in a sentence."""
    if model.warnings:
        return "verdict: doubtful, " + "; ".join(model.warnings)
    return (
        f"verdict: sound, {model.registered_images} of {model.images} photos at {model.reprojection_px:.2f} px "
        f"({model.reprojection_uncut_px:.2f} px with the observations that were cut, {model.cut_pct:.1f} %)"
    )


def output_folder(photos: Path) -> list[str]:
    """What lies among the photographs and is not read, said before the long work."""
    from wakewise.vision.reconstruction.photos.photo_folder import unsupported_files

    found = unsupported_files(photos) if photos.is_dir() else {}
    kinds = ", ".join(f"{count} of {kind}" for kind, count in found.items())
    return [f"files that are not read: {kinds}; photos must be JPEG, PNG, TIFF or BMP, save them as such"] * bool(kinds)


def remarks(model: Model) -> list[str]:
    """What a user should know besides the figures, a line each."""
    from wakewise.vision.reconstruction.outputs.meshing import FINER

    out = []
    if model.duplicates:
        out.append(f"{model.duplicates} photos are copies of others and were left out")
    if model.lenses_split:
        out.append("photos that seemed to share a lens do not; each lens was given its own")
    if len(model.lenses) > 1:
        out += [f"lens {one['name']}, {one['focal_px']:.0f} px: {_some(one['photos'])}" for one in model.lenses]
    if model.registered_images < model.images:
        left = model.images - model.registered_images
        out.append(f"{left} of {model.images} photos found no place: they show something else or too little")
        for one in model.left_out[:MOST_NAMED]:
            best = (
                one.get("why") or f"{one['matches']} matches with {one['partner']}"
                if one["partner"]
                else "matches none"
            )
            out.append(f"  {one['name']}: {best}")
        if len(model.left_out) > MOST_NAMED:
            out.append(f"  and {len(model.left_out) - MOST_NAMED} more, see left_out in reconstruction.json")
    if len(model.sub_models) > 1:
        others = " and ".join(str(count) for count in model.sub_models[1:])
        out.append(f"the photos fell apart: {others} photos make models of their own; photograph what is between")
    if model.suspicion is not None:
        out.append(model.suspicion)
    if model.mesh_cell_mm and model.point_spacing_mm and model.mesh_cell_mm > COARSE_CELL * model.point_spacing_mm:
        out.append(
            f"the mesh has cells of {model.mesh_cell_mm:.2g} mm, the points are {model.point_spacing_mm:.2g} mm apart: "
            f"thin parts are broken or lost; {FINER}"
        )
    return out


def _some(names: list[str]) -> str:
    return ", ".join(names) if len(names) <= MOST_NAMED else f"{', '.join(names[:3])} ... {names[-1]} ({len(names)})"


def _lenses(given: list[str] | None) -> Lens | dict[str, Lens] | None:
    """One lens of all photos, or lenses by name."""
    from wakewise.vision.reconstruction import read_lens

    if not given:
        return None
    if len(given) == 1 and ("=" not in given[0] or Path(given[0]).exists()):
        return read_lens(Path(given[0]))
    return {
        name: read_lens(Path(path))
        for name, path in pairs("--camera", "LENS=PATH such as left=left/cameras.txt", given).items()
    }
