"""Words and marks on pictures: one typeface, a few sizes, the report's dark colours."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageDraw, ImageFont

PAPER, CARD, LINE = (11, 19, 23), (19, 31, 37), (42, 59, 67)
INK, MUTED, TEAL, CORAL, SAND, GOOD = (
    (230, 238, 240),
    (150, 171, 179),
    (94, 195, 212),
    (240, 133, 92),
    (220, 178, 87),
    (92, 199, 154),
)

Rgb = tuple[int, int, int]
Box = tuple[int, int, int, int]


@cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which comes with matplotlib, so that pictures look alike on every machine."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size)


def write(
    draw: ImageDraw.ImageDraw,
    place: tuple[float, float],
    text: str,
    size: int = 14,
    colour: Rgb = INK,
    *,
    bold: bool = False,
    anchor: str = "ls",
) -> float:
    """Write a line of text and give its width in pixels; `anchor` as Pillow has it, "ls" being left on the baseline."""
    face = font(size, bold)
    draw.text(place, text, font=face, fill=colour, anchor=anchor)
    return float(draw.textlength(text, font=face))


def ellipsized(text: str, width: float, size: int, bold: bool = False) -> str:
    """The text, its end replaced by an ellipsis if it is wider than `width` pixels."""
    face = font(size, bold)
    if face.getlength(text) <= width:
        return text
    while text and face.getlength(text + "…") > width:
        text = text[:-1]
    return text.rstrip() + "…"


def paste(page: Pictures.Image, picture: NDArray[np.uint8], box: Box, radius: int = 8) -> None:
    """Put an RGB picture into a box (left, top, right, bottom) with round corners; it must have the box's size."""
    size = (box[2] - box[0], box[3] - box[1])
    page.paste(Pictures.fromarray(np.ascontiguousarray(picture)), box[:2], _corners(size, radius))


@cache
def _corners(size: tuple[int, int], radius: int) -> Pictures.Image:
    # Drawn four times as large, since Pillow's shapes have hard edges.
    large = Pictures.new("L", (4 * size[0], 4 * size[1]), 0)
    ImageDraw.Draw(large).rounded_rectangle((0, 0, 4 * size[0] - 1, 4 * size[1] - 1), 4 * radius, fill=255)
    return large.resize(size, Pictures.Resampling.LANCZOS)


def curve(page: Pictures.Image, box: Box, x: NDArray[np.float64], y: NDArray[np.float64], colour: Rgb) -> None:
    """Draw a smooth line over a faint area in a box; x and y run from 0 to 1, y upward."""
    width, height = box[2] - box[0], box[3] - box[1]
    layer = Pictures.new("RGBA", (3 * width, 3 * height), (*colour, 0))
    draw = ImageDraw.Draw(layer)
    points = [(3 * width * float(a), 3 * (height - 2) * (1.0 - float(b)) + 3) for a, b in zip(x, y, strict=True)]
    if len(points) > 1:
        draw.polygon([(points[0][0], 3 * height), *points, (points[-1][0], 3 * height)], fill=(*colour, 46))
        draw.line(points, fill=(*colour, 255), width=5, joint="curve")
    small = layer.resize((width, height), Pictures.Resampling.LANCZOS)
    page.paste(small, box[:2], small)
