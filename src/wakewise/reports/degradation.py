"""The degradation study as pictures: one plot per factor, models' error and completeness over its levels."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from wakewise.files import whole_file

LOG_FROM = 100.0
"""Levels that span more than this factor are drawn on a logarithmic axis."""


def plot_degradation(rows: list[dict[str, Any]], title: str, unit: str, path: Path) -> None:
    """Plot one factor's rows (`studies.degradation.COLUMNS`) into a PNG; a level without a model is marked."""
    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    error, share = figure.subplots(2, 1, sharex=True)
    good = [row for row in rows if row["failure"] is None]
    x = [row["level"] for row in good]
    error.plot(x, [row["rmse_mm"] for row in good], "o-", color="#b2182b", label="RMSE")
    error.plot(x, [row["accuracy_median_mm"] for row in good], "s--", color="#ef8a62", label="median error")
    error.set_ylabel("mm")
    share.plot(x, [row["completeness_pct"] for row in good], "o-", color="#2166ac", label="completeness, 3 mm")
    share.plot(
        x, [row["completeness_visible_pct"] for row in good], "s--", color="#67a9cf", label="of what was visible"
    )
    registered = [100.0 * (row["registered_images"] or 0) / row["images"] for row in good]
    share.plot(x, registered, "^:", color="#4d4d4d", label="photographs registered")
    share.set_ylabel("%")
    share.set_ylim(0.0, 103.0)
    share.set_xlabel(f"{title}, {unit}")
    for axes in (error, share):
        for row in rows:
            if row["failure"] is not None:
                axes.axvline(row["level"], color="k", lw=1.0, ls="-.", label="no model")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8, frameon=False)
    error.set_ylim(0.0, 1.15 * max((row["rmse_mm"] for row in good), default=1.0))
    steps = [row["level"] for row in rows if row["level"] > 0.0]
    if len(steps) > 2 and max(steps) > LOG_FROM * min(steps):
        share.set_xscale("symlog", linthresh=min(steps))
    if steps:
        share.set_xlim(-0.03 * max(steps) if share.get_xscale() == "linear" else 0.0, 1.05 * max(steps))
    with whole_file(path) as temporary:
        figure.savefig(os.fspath(temporary), dpi=130)
