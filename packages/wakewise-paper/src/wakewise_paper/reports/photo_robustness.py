"""The degradation study as pictures: one plot per factor, models' error and completeness over its levels."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wakewise.core.files import whole_file

LOG_FROM = 100.0
"""Levels that span more than this factor are drawn on a logarithmic axis."""


def plot_degradation(rows: list[dict[str, Any]], title: str, unit: str, path: Path) -> None:
    """Plot one factor's rows (`studies.degradation.COLUMNS`) into a PNG; a level without a model is marked."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    error, share = figure.subplots(2, 1, sharex=True)
    placed = [row for row in rows if row["level"] is not None]
    good = [row for row in placed if row["failure"] is None]
    for axes, key, scale, style, colour, label in (
        (error, "rmse_mm", 1.0, "o-", "#b2182b", "RMSE"),
        (error, "accuracy_median_mm", 1.0, "s--", "#ef8a62", "median error"),
        (share, "completeness_pct", 1.0, "o-", "#2166ac", "completeness, 3 mm"),
        (share, "completeness_visible_pct", 1.0, "s--", "#67a9cf", "of what was visible"),
        (share, "registered_images", 100.0, "^:", "#4d4d4d", "photographs registered"),
    ):
        of = [row["images"] if scale > 1.0 else 1.0 for row in good]
        points = [
            (row["level"], scale * row[key] / n) for row, n in zip(good, of, strict=True) if row[key] is not None and n
        ]
        axes.plot([x for x, _ in points], [y for _, y in points], style, color=colour, label=label)
    error.set_ylabel("mm")
    share.set_ylabel("%")
    share.set_ylim(0.0, 103.0)
    share.set_xlabel(f"{title}, {unit}")
    for axes in (error, share):
        for row in placed:
            if row["failure"] is not None:
                axes.axvline(row["level"], color="k", lw=1.0, ls="-.", label="no model")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, frameon=False)
    error.set_ylim(0.0, 1.15 * max((row["rmse_mm"] for row in good if row["rmse_mm"] is not None), default=1.0))
    steps = [row["level"] for row in placed if row["level"] > 0.0]
    if len(steps) > 2 and max(steps) > LOG_FROM * min(steps):
        share.set_xscale("symlog", linthresh=min(steps))
    if steps:
        share.set_xlim(-0.03 * max(steps) if share.get_xscale() == "linear" else 0.0, 1.05 * max(steps))
    with whole_file(path) as temporary:
        figure.savefig(os.fspath(temporary), dpi=130)
