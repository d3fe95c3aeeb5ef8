"""Worst trials as one picture: photographs and model of each method."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import cv2
from matplotlib.figure import Figure

from wakewise.experiments.campaigns.pictures import MODEL, photographs_of
from wakewise.ui.reports.methods_compared import model_views, trial_text
from wakewise.ui.reports.views import SIDES, png_pixels
from wakewise.vision.image_decoding import read_picture

_SHEET = ("north", "east", "above")
"""Sides of a model that a sheet has room for, by the last word of their names."""
_ROW_IN, _WIDE_IN, _DPI, _QUALITY = 1.75, 9.0, 100, 82


def model_sheet(worst: Mapping[str, Mapping[str, Any]], store: Path) -> bytes | None:
    """The same on one JPEG, a row for each method: two photographs, the model from three sides; None of no trials."""
    if not any((store / place["folder"]).is_dir() for place in worst.values()):
        return None
    figure = Figure(figsize=(_WIDE_IN, _ROW_IN * len(worst)), dpi=_DPI, facecolor="white")
    panels = figure.subplots(len(worst), 2 + len(_SHEET), squeeze=False, width_ratios=[1.5, 1.5, 1, 1, 1])
    for row, (method, place) in zip(panels, worst.items(), strict=True):
        for axes in row:
            axes.axis("off")
        row[0].set_title(f"{method} \N{EN DASH} {trial_text(place)}", loc="left", fontsize=8.5, color="#12252d")
        taken = photographs_of(store / place["folder"])
        for axes, (after_s, path) in zip(row[:2], taken[:: max(1, len(taken) - 1)], strict=False):
            image = read_picture(path, cv2.IMREAD_COLOR_RGB)
            if image is not None:
                axes.imshow(image)
                axes.text(4, image.shape[0] - 8, f"{after_s:.1f} s", fontsize=7.5, color="white")
        drawn = model_views(store / place["folder"] / MODEL)
        if drawn is None:
            reason = str(place["reason"] or "none was kept")
            why = f"no model: {reason.removeprefix('no model: ')}"
            row[2].text(0.0, 0.5, why, wrap=True, fontsize=7.5, color="#b72f3c", transform=row[2].transAxes)
            continue
        shown = {view.name.split()[-1]: source for view, source in zip(SIDES, drawn, strict=True)}
        for axes, side in zip(row[2:], _SHEET, strict=True):
            rgba = png_pixels(shown[side])
            axes.imshow(rgba[..., :3] * rgba[..., 3:] + (1.0 - rgba[..., 3:]))
    figure.subplots_adjust(left=0.005, right=0.995, bottom=0.01, top=1.0 - 0.25 / (_ROW_IN * len(worst)), wspace=0.02)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="jpeg", pil_kwargs={"quality": _QUALITY})
    return buffer.getvalue()
