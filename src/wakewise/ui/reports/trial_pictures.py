"""Pictures of each method's worst trial: photographs 0, 5 and 10 s after the first, and the model with its errors."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from wakewise.core.arrays import Array
from wakewise.experiments.campaigns.pictures import MODEL, photographs_of
from wakewise.experiments.campaigns.summary import ComparisonMetric, Place, worst_trials
from wakewise.ui.reports.page import error_scale, panel
from wakewise.ui.reports.svg_style import data_uri, error_colours
from wakewise.ui.reports.text import number
from wakewise.ui.reports.views import SIDES, ViewBounds, draw_cloud
from wakewise.vision.image_decoding import read_picture

PIXELS = 260
_SHEET = ("north", "east", "above")
"""Sides of a model that a sheet has room for, by the last word of their names."""
_ROW_IN, _WIDE_IN, _DPI, _QUALITY = 1.75, 9.0, 100, 82


def worst_panels(measure: ComparisonMetric, places: Sequence[Place], store: Path) -> str:
    """The worst trial of each method in each world: what its camera saw, and its model; empty where none was kept."""
    parts = []
    for world in dict.fromkeys(place["world"] for place in places):
        worst = worst_trials(measure, world, places)
        if not any(
            (store / place["folder"] / MODEL).is_file() or photographs_of(store / place["folder"])
            for place in worst.values()
        ):
            continue
        seen = before_after(worst, store)
        if seen:
            parts.append(panel(f"Before and after, {world}", "Each method's worst trial.", "", seen))
        scale = error_scale("error (mm)")
        title = f"Worst models, {world}"
        parts.append(panel(title, "Coloured by distance to the true surface.", scale, models(worst, store)))
    return "".join(parts)


def before_after(worst: Mapping[str, Mapping[str, Any]], store: Path) -> str:
    """A row of photographs per method of its worst trial; empty where none was taken."""
    rows = []
    for method, place in worst.items():
        cells = []
        for after_s, path in photographs_of(store / place["folder"]):
            try:
                source = data_uri(path.read_bytes(), "image/jpeg")
            except OSError:
                continue
            said = f"{method}, {after_s:.1f} s after the first photograph"
            cells.append(
                f'<figure><button type="button" class="photo" data-facts="{escape(said, quote=True)}">'
                f'<img alt="{escape(said, quote=True)}" src="{source}"></button>'
                f"<figcaption>{after_s:.1f} s</figcaption></figure>"
            )
        if cells:
            rows.append(f'<p class="sheet-leg">{escape(method)}<span>{escape(_trial(place))}</span></p>')
            rows.append(f'<div class="columns">{"".join(cells)}</div>')
    return "".join(rows)


def models(worst: Mapping[str, Mapping[str, Any]], store: Path) -> str:
    """The model of each method's worst trial from five sides, coloured by error; or why there is none."""
    rows = []
    for method, place in worst.items():
        rows.append(f'<p class="sheet-leg">{escape(method)}<span>{escape(_trial(place))}</span></p>')
        drawn = _views(store / place["folder"] / MODEL)
        if drawn is None:
            rows.append(f'<p class="missing"><b>No model</b>: {escape(str(place["reason"] or "none was kept"))}.</p>')
            continue
        cells = "".join(
            f'<figure><img alt="{escape(method)} {view.name}" src="{source}">'
            f"<figcaption>{view.name}</figcaption></figure>"
            for source, view in zip(drawn, SIDES, strict=True)
        )
        rows.append(f'<div class="views">{cells}</div>')
    return "".join(rows)


def sheet(worst: Mapping[str, Mapping[str, Any]], store: Path) -> bytes | None:
    """The same on one JPEG, a row for each method: two photographs, the model from three sides; None of no trials."""
    if not any((store / place["folder"]).is_dir() for place in worst.values()):
        return None
    figure = Figure(figsize=(_WIDE_IN, _ROW_IN * len(worst)), dpi=_DPI, facecolor="white")
    panels = figure.subplots(len(worst), 2 + len(_SHEET), squeeze=False, width_ratios=[1.5, 1.5, 1, 1, 1])
    for row, (method, place) in zip(panels, worst.items(), strict=True):
        for axes in row:
            axes.axis("off")
        row[0].set_title(f"{method} \N{EN DASH} {_trial(place)}", loc="left", fontsize=8.5, color="#12252d")
        taken = photographs_of(store / place["folder"])
        for axes, (after_s, path) in zip(row[:2], taken[:: max(1, len(taken) - 1)], strict=False):
            image = read_picture(path, cv2.IMREAD_COLOR_RGB)
            if image is not None:
                axes.imshow(image)
                axes.text(4, image.shape[0] - 8, f"{after_s:.1f} s", fontsize=7.5, color="white")
        drawn = _views(store / place["folder"] / MODEL)
        if drawn is None:
            reason = str(place["reason"] or "none was kept")
            why = f"no model: {reason.removeprefix('no model: ')}"
            row[2].text(0.0, 0.5, why, wrap=True, fontsize=7.5, color="#b72f3c", transform=row[2].transAxes)
            continue
        shown = {view.name.split()[-1]: source for view, source in zip(SIDES, drawn, strict=True)}
        for axes, side in zip(row[2:], _SHEET, strict=True):
            axes.imshow(_on_white(shown[side]))
    figure.subplots_adjust(left=0.005, right=0.995, bottom=0.01, top=1.0 - 0.25 / (_ROW_IN * len(worst)), wspace=0.02)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="jpeg", pil_kwargs={"quality": _QUALITY})
    return buffer.getvalue()


def _views(path: Path) -> list[str] | None:
    """A model from all sides, as PNG data URIs; None where none was kept."""
    if not path.is_file():
        return None
    with np.load(path) as kept:
        points, errors = kept["points_m"].astype(np.float64), kept["error_mm"].astype(np.float64)
    return draw_cloud(points, error_colours(1e-3 * errors), SIDES, ViewBounds.around(points), PIXELS)


def _on_white(source: str) -> Array:
    """A PNG data URI as colours on white, (h, w, 3), 0 to 1."""
    content = np.frombuffer(base64.b64decode(source.partition(",")[2]), dtype=np.uint8)
    image = np.asarray(cv2.imdecode(content, cv2.IMREAD_UNCHANGED), dtype=np.float64) / 255.0
    alpha = image[..., 3:]
    return np.asarray(image[..., 2::-1] * alpha + (1.0 - alpha))


def _trial(place: Mapping[str, Any]) -> str:
    rmse = place["figures"].get("rmse_mm")
    target = "" if place["target"].startswith("the ") else f"{place['target']}, "
    said = f"{place['world']}, {target}seed {place['seed']}"
    return said if rmse is None else f"{said}: {number(rmse)} mm RMSE"
