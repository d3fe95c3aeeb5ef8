"""Film, contact sheet, photographs with the water's colour removed, and the model in the photographs' colours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, StageError
from wakewise.operation.finding.find_parts import read_found
from wakewise.ui.reports.page import collapsible_section, panel, parts, template
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
LEAST_MISSED_PCT = 0.5


def film_html(trial: Trial) -> str:
    """The trial's film, inside the page if it is not too large; empty if none was made."""
    for name, kind in FILMS.items():
        path = trial.folder / name
        if not path.is_file():
            continue
        inside = path.stat().st_size <= MOST_FILM_BYTES
        source = data_uri(path.read_bytes(), kind) if inside else name
        return str(template("trial.html").film(source, kind.startswith("video"), not inside))
    return ""


def found_html(trial: Trial) -> str:
    """What the flight found with its camera, over the picture in which it was accepted; empty if it did not look."""
    try:
        told = read_found(trial.folder)
    except InputError:
        return ""
    if told is None:
        return ""
    orbits = told.get("orbits")  # of a survey, which has no single target
    if orbits is None and (told.get("found_s") is None or told.get("centre_W_m") is None):
        found = told.get("found_s") is not None and told.get("accepted_s", 0.0) is None
        missed = "A target was found and not accepted." if found else "No target was found."
        return str(template("trial.html").found("", missed, ""))
    film, path = trial.folder / "found.webp", trial.folder / "found.png"
    source = data_uri(path.read_bytes(), "image/png") if path.is_file() else ""
    if film.is_file() and film.stat().st_size <= MOST_FILM_BYTES:
        source = data_uri(film.read_bytes(), "image/webp")
    error, std = told.get("centre_error_m"), told.get("centre_std_m")
    words = f"The target was found after {number(told['found_s'])} s"  # before accepted_s, that of the acceptance
    words += "." if told.get("accepted_s") is None else f", and accepted after {number(told['accepted_s'])} s."
    if orbits is not None:
        words = f"Transects were flown over the patch, then close orbits round {len(orbits)} parts of it."
    more = f"At the end its centre was known to {number(1e3 * std)} mm" if std is not None else ""
    if more and error is not None:
        more += f" by the vehicle's own reckoning, and was {number(1e3 * error)} mm from the true place"
    seen = told.get("photographed")
    words_of_seen = "" if seen is None else f" {_photographed_words(seen)}"
    return str(template("trial.html").found(source, words, f"{more}.{words_of_seen}" if more else words_of_seen))


def _photographed_words(seen: Mapping[str, float]) -> str:
    """How much of the mapped surface the photographs saw, and why not the rest."""
    text = f"Photographs saw {number(seen['seen_well_pct'])} % of the mapped surface well"
    left = [
        f"{number(seen[key])} % {why}"
        for key, why in (("unseen_pct", "in none"), ("poorly_pct", "at a slant"), ("seldom_pct", "in too few"))
        if seen[key] >= LEAST_MISSED_PCT
    ]
    return f"{text}; of the rest {', '.join(left)}." if left else f"{text}."


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
    for picture, kind in ((before, "as taken"), (after, "water undone")):
        caption = f"{shot.name}, {shot.time_s:.1f} s, {kind}"
        source = jpeg_uri(np.ascontiguousarray(shrunk(picture, WIDTH)[..., ::-1]), 84)
        figures.append(parts().captioned(parts().photo(source, caption, caption), caption))
    return str(parts().columns(figures, True))


def shrunk(image: NDArray[np.uint8], width: int) -> NDArray[np.uint8]:
    """The image, at most `width` pixels wide."""
    if image.shape[1] <= width:
        return image
    height = max(1, round(width * image.shape[0] / image.shape[1]))
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def jpeg_uri(image: NDArray[np.uint8], quality: int) -> str:
    """JPEG data URI of a BGR image."""
    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    return data_uri(cv2.imencode(".jpg", image, options)[1].tobytes(), "image/jpeg")


def thumbnail(path: Path, width: int = 128) -> NDArray[np.uint8] | None:
    """A small RGB picture of a photograph as it lies in the file; None if that is no image."""
    image = read_picture(path, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
    return None if image is None else np.ascontiguousarray(shrunk(image, width)[..., ::-1])


def _read(path: Path) -> NDArray[np.uint8] | None:
    image = read_picture(path)
    return None if image is None else np.ascontiguousarray(image[..., ::-1])


BUDGET_BYTES = 4_000_000
"""Rough size of all embedded photographs together; many photographs are embedded smaller."""
WIDTHS = (960, 800, 640, 480, 320)
QUALITY = 82
BYTES_PER_PIXEL = 0.16
"""Of underwater photographs at this quality; only used to choose a width."""


@dataclass(frozen=True)
class Extremes:
    """Indices of the sharpest and the least sharp photograph, None without a record of sharpness."""

    sharpest: int | None
    worst: int | None


def extremes(photographs: tuple[Photograph, ...]) -> Extremes:
    """Find the sharpest and the least sharp photograph."""
    known = [(shot.sharpness, i) for i, shot in enumerate(photographs) if shot.sharpness is not None]
    if len(known) < 2:
        return Extremes(None, None)
    return Extremes(sharpest=max(known)[1], worst=min(known)[1])


def embed(shot: Photograph, width: int) -> str | None:
    """JPEG data URI of a photograph, at most `width` pixels wide; None if the file is missing or no image."""
    image = read_picture(shot.path) if shot.path.is_file() else None
    return None if image is None else jpeg_uri(shrunk(image, width), QUALITY)


def embedded_width(count: int) -> int:
    """Width at which this many photographs fit the page."""
    fitting = (width for width in WIDTHS if count * width * width * 0.75 * BYTES_PER_PIXEL <= BUDGET_BYTES)
    return next(fitting, WIDTHS[-1])


def contact_sheet(trial: Trial, leg_of: dict[int, str]) -> str:
    """HTML of all photographs in the order they were taken, by leg; `leg_of` names the leg of every index."""
    shots = trial.photographs
    width = embedded_width(len(shots))
    marked = extremes(shots)
    groups: list[tuple[str, list[Markup]]] = []
    for i, shot in enumerate(shots):
        leg = leg_of.get(i, "")
        if not groups or groups[-1][0] != leg:
            groups.append((leg, []))
        groups[-1][1].append(_photo(shot, i, marked, width))
    sheets = []
    for leg, found in groups:
        sheet = parts().sheet(found)
        count = f"{len(found)} photograph{'s' if len(found) > 1 else ''}"
        sheets.append(collapsible_section(leg, sheet, count) if leg else str(sheet))
    return "".join(sheets)


def _turbidity(per_m: float) -> str:
    """A figure with what matters to an eye: over half a metre, 0.001 /m takes half a thousandth of the light."""
    return "< 0.001" if 0.0 < per_m < 0.001 else number(per_m, 2)


def _photo(shot: Photograph, index: int, marked: Extremes, width: int) -> Markup:
    kind = "sharpest" if index == marked.sharpest else "worst" if index == marked.worst else ""
    tag = "least sharp" if kind == "worst" else kind
    time = f"{shot.time_s:.1f}"
    sharpness = "" if shot.sharpness is None else f"sharpness {number(shot.sharpness)}"
    turbidity = "" if shot.turbidity_per_m is None else f"turbidity {_turbidity(shot.turbidity_per_m)} /m"
    details = template("trial.html").photo_details(time, sharpness, turbidity)
    facts = " · ".join(one for one in (shot.name, f"{time} s", sharpness, turbidity, kind) if one)
    made: Markup = parts().photo(embed(shot, width), shot.name, facts, kind, tag, details)
    return made
