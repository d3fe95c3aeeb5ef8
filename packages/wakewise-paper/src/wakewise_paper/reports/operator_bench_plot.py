"""One picture of the operator bench: how closely a pilot is obeyed against how still the target's water is.

The degradation study as pictures: one plot per factor, models' error and completeness over its levels.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wakewise.core.files import whole_file
from wakewise_paper.reports.wash_bench_plot import check_ending

INK, QUIET, PALE = "#22303a", "#8a979d", "#e7f1ef"
COLOURS = ("#1f7a78", "#c65a3a", "#5b8fb0", "#b9923a", "#7d4f9e", "#6a8a3a", "#a04a6a", "#4a5a6a")
ASKED_DEVIATION_PCT, ASKED_REDUCTION_PCT = 15.0, 60.0
"""The paper's claim at w_track = 5."""
CLAIMED = "5"
LOWEST_PCT = -60.0
"""Losses below are drawn at the edge."""


def draw_operator(result: Mapping[str, Any], path: Path) -> None:
    """Draw the answer of `wakewise bench operator` into a file: the tank's worlds, and the paper's own beside them.

    Raises
    ------
    InputError
        If the file's ending is not one of `SUFFIXES`.
    """
    check_ending(path)
    figure = Figure(figsize=(10.5, 4.6), facecolor="white", layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    lines = {name: world["w_track"] for name, world in result["worlds"].items()}
    paper = {"in front": result["paper"]["w_track"], "above": result["paper"]["w_track_over"]}
    most = [_panel(left, lines, "in the tank's worlds"), _panel(right, paper, "in the paper's own water (circular)")]
    left.set_xlim(0.0, max(25.0, 1.08 * max(most)))
    left.set_ylim(LOWEST_PCT - 5.0, 105.0)
    left.set_ylabel("less wash at the target than direct allocation, %", fontsize=8.5, color=INK)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def _at(row: Mapping[str, Any]) -> tuple[float, float] | None:
    """Deviation and reduction of a row, where there was trouble if there was any; None where there is nothing."""
    less = row["target_speed_reduction_pct"]
    less = row.get("target_speed_reduction_all_pct") if less is None else less
    deviation = row["velocity_deviation_pct"]
    return None if less is None or deviation is None else (float(deviation), max(float(less), LOWEST_PCT))


def _panel(axes: Axes, lines: Mapping[str, Mapping[str, Mapping[str, Any]]], words: str) -> float:
    """Draw a line for each world, small marks for the w_tracks of the same flights, a large one for all at 5.

    Returns the largest deviation.
    """
    most = 0.0
    height = 100.0 - ASKED_REDUCTION_PCT
    axes.add_patch(Rectangle((0.0, ASKED_REDUCTION_PCT), ASKED_DEVIATION_PCT, height, color=PALE, zorder=0))
    axes.annotate("the claim, at w_track 5", (0.4, 98.5), fontsize=7.5, color=QUIET, va="top")
    axes.axhline(0.0, color=QUIET, linewidth=0.6)
    for place, (name, sweep) in enumerate(lines.items()):
        colour = COLOURS[place % len(COLOURS)]
        points = [(w, *at) for w, row in sweep.items() if (at := _at(row.get("grid", row))) is not None]
        if points:
            x, y = [point[1] for point in points], [point[2] for point in points]
            axes.plot(x, y, "-o", color=colour, linewidth=1.0, markersize=3.5, alpha=0.6)
            for w_track, at_x, at_y in {points[0], points[-1]}:
                axes.annotate(
                    w_track, (at_x, at_y), textcoords="offset points", xytext=(4, 4), fontsize=7, color=colour
                )
            most = max(most, *x)
        whole = _at(sweep[CLAIMED]) if CLAIMED in sweep else None
        if whole is not None:
            axes.plot(*([value] for value in whole), "o", color=colour, markersize=9, label=name)
            most = max(most, whole[0])
    axes.set_title(words, fontsize=9.5, loc="left", color=INK)
    axes.set_xlabel(
        "velocity deviation, %   (large: all flights at w_track 5; lines: by w_track)", fontsize=8.5, color=INK
    )
    axes.tick_params(labelsize=8, colors=INK)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, frameon=False, loc="lower right")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return most


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
