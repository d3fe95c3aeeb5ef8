"""What people look at rather than measure: the film, photographs without the water's colour, the model in its own."""

from __future__ import annotations

from html import escape
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.ui.reports.page import panel
from wakewise.ui.reports.svg_style import data_uri
from wakewise.ui.reports.text import number
from wakewise.ui.reports.trial import Photograph, Trial, TrialMesh
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.imaging.sensor import srgb_encode
from wakewise.vision.texturing.colour import WaterFit, fit_water, remove_water, white_balanced
from wakewise.vision.texturing.photo_colours import RangeMaps
from wakewise.vision.texturing.textured import read_textured

FILMS = {"film.mp4": "video/mp4", "film.webm": "video/webm", "film.webp": "image/webp"}
MOST_FILM_BYTES = 2_400_000
"""A larger film stays beside the page, which shows it from there: a page is mailed around."""
SHOWN = 3
WIDTH = 560


def film_html(trial: Trial) -> str:
    """The trial's film, inside the page if it is not too large; empty if none was made."""
    for name, kind in FILMS.items():
        path = trial.folder / name
        if not path.is_file():
            continue
        inside = path.stat().st_size <= MOST_FILM_BYTES
        source = data_uri(path.read_bytes(), kind) if inside else name
        beside = "" if inside else f" It lies beside this page as {name}."
        said = "film of the scan"
        if kind.startswith("video"):
            shown = (
                f'<video controls muted loop playsinline preload="metadata" src="{source}" aria-label="{said}"></video>'
            )
        else:
            shown = f'<img alt="{said}" src="{source}">'
        return (
            f'<figure class="film">{shown}<figcaption>The flight as a film. The wash is the tank\'s own water, driven '
            f"once more by the thrusts on record; tracers show it and change nothing.{beside}</figcaption></figure>"
        )
    return ""


def colours_html(trial: Trial) -> str:
    """A few photographs as taken and with the water's colour taken away; empty if none can be read."""
    shots = [shot for shot in trial.photographs if shot.path.is_file()]
    if not shots:
        return ""
    picks = [shots[round((i + 0.5) / SHOWN * (len(shots) - 1))] for i in range(min(SHOWN, len(shots)))]
    ranges, fit = _water(trial.folder, picks)
    cells = []
    for shot in picks:
        image = _read(shot.path)
        if image is None:
            continue
        range_m = ranges.get(shot.name)
        after = white_balanced(image) if fit is None or range_m is None else remove_water(image, range_m, fit)
        cells.append(_pair(shot, image, after))
    if not cells:
        return ""
    how = "The colour cast is taken away and the contrast stretched; depths are not known, so this is no physics."
    if fit is not None:
        red, green, blue = (number(float(v)) for v in fit.signal_per_m)
        how = (
            "Veil and attenuation of the water, fitted to these photographs and the model's depths, are undone "
            f"({red}, {green}, {blue} /m in red, green, blue, lamps' fall-off included)."
        )
    return panel(
        "In the colours of the scene", f"For people only; nothing is measured on them. {how}", "", "".join(cells)
    )


def coloured_model(trial: Trial) -> tuple[TrialMesh, Array] | None:
    """The model in the photographs' colours, world NED, and sRGB colours 0 to 1, shape (n, 3); None without one."""
    path = trial.folder / "mesh.glb"
    if not path.is_file():
        return None
    try:
        vertices, faces, colours = read_textured(path)
    except (ValueError, KeyError, IndexError):
        return None
    # Back from x east, y up, z south.
    east, up, south = vertices.T
    surface = TrialMesh(vertices_m=np.column_stack([-south, east, trial.bed_z_m - up]), faces=faces)
    return surface, srgb_encode(colours)


def _water(folder: Path, shots: list[Photograph]) -> tuple[dict[str, NDArray[np.float32]], WaterFit | None]:
    """Ranges in a few photographs by name, as the trial's model has them, and the water fitted to them.

    None where there is no model, no ranges of a photograph that the model does not know.
    """
    if not (folder / "sparse" / "images.bin").is_file():
        return {}, None
    try:
        depths = RangeMaps.read(folder)
        ranges: dict[str, NDArray[np.float32]] = {}
        pairs = []
        for shot in shots:
            image = _read(shot.path)
            if image is not None and depths.knows(shot.name, image.shape[:2]):
                ranges[shot.name] = depths.ranges_m(shot.name, image.shape[:2])
                pairs.append((image, ranges[shot.name]))
        return ranges, fit_water(pairs)
    except (InputError, StageError):
        return {}, None


def _pair(shot: Photograph, before: NDArray[np.uint8], after: NDArray[np.uint8]) -> str:
    figures = []
    for picture, words in ((before, "as taken"), (after, "water undone")):
        said = f"{shot.name}, {shot.time_s:.1f} s, {words}"
        figures.append(
            f'<figure><button type="button" class="photo" data-facts="{escape(said, quote=True)}">'
            f'<img alt="{escape(said, quote=True)}" src="{_embedded(picture)}"></button>'
            f"<figcaption>{escape(said)}</figcaption></figure>"
        )
    return f'<div class="columns pair">{"".join(figures)}</div>'


def _embedded(picture: NDArray[np.uint8]) -> str:
    if picture.shape[1] > WIDTH:
        height = max(1, round(WIDTH * picture.shape[0] / picture.shape[1]))
        picture = np.asarray(cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA), np.uint8)
    jpeg = cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 84])[1]
    return data_uri(jpeg.tobytes(), "image/jpeg")


def _read(path: Path) -> NDArray[np.uint8] | None:
    image = read_picture(path)
    return None if image is None else np.ascontiguousarray(image[..., ::-1])
