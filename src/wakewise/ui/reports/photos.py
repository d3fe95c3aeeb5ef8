"""The contact sheet: every photograph, small enough for one page file, large enough to judge."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

import cv2

from wakewise.ui.reports.page import collapsible_section
from wakewise.ui.reports.svg_style import data_uri
from wakewise.ui.reports.text import number
from wakewise.ui.reports.trial import Photograph, Trial
from wakewise.vision.image_decoding import read_picture

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
    if not shot.path.is_file():
        return None
    image = read_picture(shot.path)
    if image is None:
        return None
    if image.shape[1] > width:
        height = max(1, round(width * image.shape[0] / image.shape[1]))
        image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, QUALITY, cv2.IMWRITE_JPEG_OPTIMIZE, 1])[1]
    return data_uri(jpeg.tobytes(), "image/jpeg")


def embedded_width(count: int) -> int:
    """Width at which this many photographs fit the page."""
    for width in WIDTHS:
        if count * width * width * 0.75 * BYTES_PER_PIXEL <= BUDGET_BYTES:
            return width
    return WIDTHS[-1]


def contact_sheet(trial: Trial, leg_of: dict[int, str]) -> str:
    """HTML of all photographs in the order they were taken, by leg; `leg_of` names the leg of every index."""
    shots = trial.photographs
    width = embedded_width(len(shots))
    marked = extremes(shots)
    groups: list[tuple[str, list[str]]] = []
    for i, shot in enumerate(shots):
        leg = leg_of.get(i, "")
        if not groups or groups[-1][0] != leg:
            groups.append((leg, []))
        groups[-1][1].append(_photo(shot, i, marked, width))
    parts = []
    for leg, found in groups:
        sheet = f'<div class="sheet">{"".join(found)}</div>'
        count = f"{len(found)} photograph{'s' if len(found) > 1 else ''}"
        parts.append(collapsible_section(leg, sheet, count) if leg else sheet)
    return "".join(parts)


def _turbidity(per_m: float) -> str:
    """A figure with what matters to an eye: over half a metre, 0.001 /m takes half a thousandth of the light."""
    return "< 0.001" if 0.0 < per_m < 0.001 else number(per_m, 2)


def _photo(shot: Photograph, index: int, marked: Extremes, width: int) -> str:
    kind = "sharpest" if index == marked.sharpest else "worst" if index == marked.worst else ""
    tag = {
        "sharpest": '<span class="tag">sharpest</span>',
        "worst": '<span class="tag worst">least sharp</span>',
        "": "",
    }
    sharpness = "" if shot.sharpness is None else f"sharpness {number(shot.sharpness)}"
    turbidity = "" if shot.turbidity_per_m is None else f"turbidity {_turbidity(shot.turbidity_per_m)} /m"
    facts = [f"<b>{shot.time_s:.1f} s</b>", sharpness, turbidity]
    lines = "".join(f"<span>{fact}</span>" for fact in facts if fact)
    said = " · ".join(f for f in (shot.name, f"{shot.time_s:.1f} s", sharpness, turbidity, kind) if f)
    source = embed(shot, width)
    if source is None:
        return f'<div class="photo gone"><div class="empty">no image file</div><span class="facts">{lines}</span></div>'
    return (
        f'<button type="button" class="photo {kind}" data-facts="{escape(said, quote=True)}">'
        f'<img alt="{escape(shot.name, quote=True)}" src="{source}">{tag[kind]}'
        f'<span class="facts">{lines}</span></button>'
    )
