"""Colours of the report and the way from a matplotlib figure to an inline SVG that follows the page's theme.

Figures are drawn in stand-in colours; in the SVG each is replaced by a CSS variable, so that light, dark and print
share one drawing.
"""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure

from wakewise.core.arrays import Array

# Stand-in colour: CSS variable. Odd values that nothing else will use.
INK, MUTED, LINE, CARD = "#010a01", "#010a02", "#010a03", "#010a04"
TEAL, CORAL, SAND, VIOLET, SLATE = "#010a11", "#010a12", "#010a13", "#010a14", "#010a15"
SERIES = (TEAL, CORAL, VIOLET, SAND, SLATE)
DASHES: tuple[str | tuple[int, tuple[int, ...]], ...] = ("-", (0, (5, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))
"""Line styles beside `SERIES`, so that lines are told apart in greyscale."""
_VARIABLES = {
    INK: "--ink", MUTED: "--muted", LINE: "--line", CARD: "--card",
    TEAL: "--s1", CORAL: "--s2", VIOLET: "--s3", SAND: "--s4", SLATE: "--s5",
}  # fmt: skip

ERROR_LIMIT_MM = 3.0
"""Errors are coloured from zero to this; what is beyond has a colour of its own."""
ERROR_STOPS = ("#f4efe2", "#f9dc9a", "#f4ab4e", "#e36b35", "#b72f3c")
OVER_LIMIT = "#5c0f35"
NOT_COVERED = "#23469a"
NOT_COUNTED = "#a3adb0"
ERROR_MAP: Colormap = LinearSegmentedColormap.from_list("error", ERROR_STOPS)


def error_colours(error_m: Array, beyond: str = OVER_LIMIT) -> Array:
    """Colours from 0 to 1, shape (n, 3), of errors in metres, shape (n,); `beyond` is the colour over the limit."""
    scaled = 1e3 * error_m / ERROR_LIMIT_MM
    colours = np.asarray(ERROR_MAP(np.clip(scaled, 0.0, 1.0)))[:, :3]
    colours[scaled > 1.0] = rgb(beyond)
    return colours


def rgb(colour: str) -> Array:
    """Red, green and blue from 0 to 1, shape (3,), of "#rrggbb"."""
    return np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty, transparent figure; sizes are on paper, the page scales it."""
    return Figure(figsize=(width_in, height_in), facecolor="none", layout="constrained")


def style_axes(axes: Axes, *, x: str = "", y: str = "", grid: Literal["x", "y", "both", ""] = "y") -> None:
    """Give axes the quiet look of the report: two spines, a light grid, labels with units."""
    axes.set_facecolor("none")
    for side, spine in axes.spines.items():
        spine.set_visible(side in ("left", "bottom"))
        spine.set_color(LINE)
    axes.tick_params(colors=MUTED, labelsize=9, length=3, width=0.8)
    if grid:
        axes.grid(axis=grid, color=LINE, linewidth=0.7)
    axes.set_axisbelow(True)
    if x:
        axes.set_xlabel(x, color=MUTED, fontsize=9.5)
    if y:
        axes.set_ylabel(y, color=MUTED, fontsize=9.5)


def add_legend(axes: Axes, **options: object) -> None:
    """Add a legend without a frame, in the ink of the page, if anything is labelled."""
    if axes.get_legend_handles_labels()[0]:
        settings: dict[str, object] = {"frameon": False, "fontsize": 9, "labelcolor": MUTED, "handlelength": 1.4}
        axes.legend(**(settings | options))


def inline_svg(figure: Figure, title: str) -> str:
    """SVG text of a figure to put into a page: no prolog, no metadata, colours from the page.

    `title` is read out to those who cannot see, and sets the ids of this figure apart from those of others.
    """
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    # Namespaces mean nothing inside HTML, and without them the page names no host at all.
    text = re.sub(r'\sxmlns(:\w+)?="[^"]*"', "", text)
    text = text.replace("xlink:href", "href")
    mark = re.sub(r"\W+", "-", title) + "-"
    renamed = {old: f"{mark}{i}" for i, old in enumerate(dict.fromkeys(re.findall(r'\sid="([^"]+)"', text)))}
    text = re.sub(r'(\sid=")([^"]+)(")', lambda m: m[1] + renamed[m[2]] + m[3], text)
    text = re.sub(r'(href="#)([^"]+)(")', lambda m: m[1] + renamed.get(m[2], m[2]) + m[3], text)
    text = re.sub(r"(url\(#)([^)]+)(\))", lambda m: m[1] + renamed.get(m[2], m[2]) + m[3], text)
    for colour, variable in _VARIABLES.items():
        text = text.replace(colour, f"var({variable})")
    # Two decimals of a point are a fiftieth of a pixel; the rest is weight. Factors in transforms keep theirs.
    text = re.sub(r'\sd="[^"]+"', lambda m: re.sub(r"(\d\.\d{2})\d+", r"\1", m[0]), text)
    # matplotlib's style would reach the whole page; page.css has the same for plots alone.
    text = re.sub(r"<style.*?</style>", "", text, flags=re.DOTALL)
    box = re.search(r'viewBox="[^"]*"', text)
    return f'<svg role="img" aria-label="{title}" {box[0] if box else ""}>' + text[text.index(">") + 1 :]


def data_uri(content: bytes, kind: str) -> str:
    """A data URI, such as for kind "image/jpeg"."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def thinned(x: Array, y: Array, buckets: int = 900) -> tuple[Array, Array]:
    """A line of at most 2 * `buckets` points that keeps the lowest and the highest value of every bucket."""
    if len(x) <= 2 * buckets:
        return x, y
    edges = np.linspace(0, len(x), buckets + 1).astype(int)
    rows: list[int] = []
    for start, stop in pairwise(edges):
        part = y[start:stop]
        if np.isfinite(part).any():
            rows += sorted({start + int(np.nanargmin(part)), start + int(np.nanargmax(part))})
    return x[rows], y[rows]


def css_gradient(stops: Sequence[str]) -> str:
    """CSS for a colour bar from left to right."""
    return f"linear-gradient(90deg, {', '.join(stops)})"
