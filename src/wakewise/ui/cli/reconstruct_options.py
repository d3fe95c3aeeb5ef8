"""Options of `wakewise reconstruct` besides photographs and cameras, and the outputs of `--write`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from wakewise.core.errors import InputError
from wakewise.ui.cli.console import ProgressBars, answer, write_page

if TYPE_CHECKING:
    from wakewise.core.arrays import Array
    from wakewise.vision.reconstruction import Model, ReconstructionRequest


Until = Literal["sparse", "dense", "mesh"]

BarOption = Annotated[
    list[str] | None,
    typer.Option("--bar", metavar="A,B,LENGTH[,SIGMA]", help="Distance between the middles of targets A and B in m, "
                 "and its uncertainty; gives scale. May be repeated.", show_default=False),
]  # fmt: skip
BarsFile = Annotated[
    Path | None,
    typer.Option("--bars", metavar="FILE", help="YAML file of bars, targets' family and size, ChArUco board "
                 "(docs/scale.md).", show_default=False),
]  # fmt: skip
FixesOption = Annotated[
    str | None,
    typer.Option("--fixes", metavar="FILE|exif", help="Where photos were taken, as GPS or a depth gauge tells it: a "
                 "CSV with name,depth_m and lat_deg,lon_deg or north_m,east_m, or what their EXIF holds; gives scale, "
                 "as sure as it can, where nothing better does.", show_default=False),
]  # fmt: skip
MasksOption = Annotated[
    Path | None,
    typer.Option("--masks", metavar="FOLDER", help="Images named like the photos, black where nothing is to be looked "
                 "at; else the photos' own transparency.", show_default=False),
]  # fmt: skip
Crop = Annotated[
    tuple[float, float, float, float, float, float] | None,
    typer.Option("--crop", metavar="X0 Y0 Z0 X1 Y1 Z1", help="Keep of cloud and mesh what lies in this box, in the "
                 "model's units (m where it has scale).", show_default=False),
]  # fmt: skip
UntilOption = Annotated[Until | None, typer.Option("--until", help="Last stage; mesh if not said.", show_default=False)]

LookOption = Annotated[
    bool, typer.Option("--look", help="Look at the photos only: sharpness, light, overlap, what to shoot again.")
]


def request_of(
    bar: list[str] | None,
    bars: Path | None,
    masks: Path | None,
    crop: tuple[float, float, float, float, float, float] | None,
    until: Until | None,
    fixes: str | None,
    photos: Path,
) -> ReconstructionRequest:
    """All of them, checked; `photos` are those of which fixes are read."""
    from dataclasses import replace

    import numpy as np

    from wakewise.vision.reconstruction import CropBox, ReconstructionRequest
    from wakewise.vision.reconstruction.scale import ScaleBars, exif_fixes, parse_bar, read_bars, read_fixes

    given = None if bars is None else read_bars(bars)
    if bar:
        listed = tuple(parse_bar(words) for words in bar)
        given = ScaleBars(bars=listed) if given is None else replace(given, bars=(*given.bars, *listed))
    if masks is not None and not masks.is_dir():
        raise InputError(f"--masks {masks}: is no folder; masks are images in a folder, named like the photos")
    weak = None if fixes is None else exif_fixes(photos) if fixes == "exif" else read_fixes(Path(fixes))
    return ReconstructionRequest(
        bars=given,
        fixes=weak,
        masks=masks,
        crop=None if crop is None else CropBox(low=np.array(crop[:3]), high=np.array(crop[3:])),
        until=until or "mesh",
    )


def frames_of(photos: Path, out: Path) -> Path:
    """The folder of photographs: what was given, or frames of the film that was given, which are counted."""
    from wakewise.vision.reconstruction.photos.video_frames import is_film, take_frames

    if not is_film(photos):
        return photos
    if (out / "reconstruction.json").is_file() and not (out / "frames").is_dir():
        raise InputError(f"{out}: holds a model of photos, frames of a film need a folder of their own (--out)")
    with ProgressBars().stage("frames") as progress:
        folder, said = take_frames(photos, out, progress)
    for line in said.lines():
        typer.echo(f"wakewise: {line}", err=True)
    return folder


def look_first(photos: Path, out: Path, threads: int, json: bool) -> None:
    """Leave `out/look.html` and `look.json`, and say what to shoot again."""
    from wakewise.core.files import write_json
    from wakewise.core.optional_dependencies import need
    from wakewise.ui.reports.photo_preview import write_look
    from wakewise.vision.reconstruction.quality.photo_preview import preview_photos

    need("wakewise reconstruct --look", "reports")
    if out.resolve() == photos.resolve():
        raise InputError(f"{out}: is the folder of the photos, the look must go elsewhere")
    with ProgressBars().stage("look") as progress:
        look, thumbs = preview_photos(photos, threads, progress)
    write_json(out / "look.json", look.summary())
    page = write_page("page", lambda: write_look(look, thumbs, out / "look.html", photos.resolve().name))
    again = sum(bool(photo.faults) for photo in look.photos)
    counts = f"{len(look.photos)} photos, {look.groups[0]} hang together, {again} to look at again"
    written = f"page: {out / 'look.html'}" if page else None
    answer(json, look.summary(), counts, *(f"  {line}" for line in look.advice), written)


def write_report_of(out: Path, photos: Path) -> None:
    """Leave `out/report.html`; without the packages that it needs, say so."""
    from wakewise.core.optional_dependencies import has, how_to_install

    if not has("reports"):
        typer.echo(f"wakewise: no report, as it needs {how_to_install('reports')}", err=True)
        return
    from wakewise.ui.reports.photo_model import write_model_report

    write_page("report", lambda: write_model_report(out, photos))


def scale_lines(model: Model) -> list[str]:
    """What bars and fixes say, a line each."""
    if model.scale is None and model.scale_bars is None and model.scale_fixes is None:
        return ["scale: none; --bar, --fixes or --reference-cameras give one"]
    return [*_bar_lines(model.scale_bars), *_fix_lines(model.scale_fixes)]


def _fix_lines(said: dict[str, Any] | None) -> list[str]:
    if said is None:
        return []
    sure = "open" if said["uncertainty_pct"] is None else f"uncertain by {said['uncertainty_pct']:.1f} %"
    if said["model_off_pct"] is not None:
        head = f"scale: by fixes, lengths are {said['model_off_pct']:+.1f} % off ({sure})"
        if said["why"] is not None:
            head = f"scale: fixes cannot check it, {said['why']}"
    elif said["used"]:
        north = "" if said["north_known"] else ", which way is north is not known"
        head = f"scale: by fixes of {said['photos']} photos, {sure}; the third axis is down{north}"
    else:
        head = f"scale: none, {said['why']}"
    rms = [
        f"{said[key]:.2g} m {words}"
        for key, words in (("horizontal_rms_m", "horizontally"), ("depth_rms_m", "in depth"))
        if said[key] is not None
    ]
    lines = [head, f"  fixes are off by {', '.join(rms)}, rms"]
    if said["far"]:
        lines.append(f"  {len(said['far'])} fixes do not fit: {', '.join(said['far'][:3])}")
    return lines


def _bar_lines(said: dict[str, Any] | None) -> list[str]:
    if said is None:
        return []
    head = f"scale: by {len(said['bars'])} bars, uncertain by {said['uncertainty_pct']:.3f} %"
    if not said["used"]:
        head = (
            f"scale: from reference cameras; by the bars, lengths are {said['model_off_pct']:+.3f} % off "
            f"(uncertain by {said['uncertainty_pct']:.3f} %)"
        )
    lines = [head.replace("1 bars", "1 bar")]
    for bar in said["bars"]:
        check = "" if bar["check_pct"] is None else f", {bar['check_pct']:+.3f} % from what the others say"
        lines.append(
            f"  bar {bar['name']}: {1e3 * bar['found_m']:.2f} mm, stated {1e3 * bar['length_m']:.2f} ± "
            f"{1e3 * bar['sigma_m']:.2f} mm{check}"
        )
    return lines


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

    Raises InputError, which says which, and what is allowed.
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
                from wakewise.vision.reconstruction.outputs.clouds import write_las

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

    from wakewise.vision.reconstruction.quality.split_half_check import FIGURES, measure_halves
    from wakewise.vision.reconstruction.sfm.registered_photos import camera_centres

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
