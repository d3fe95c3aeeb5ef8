"""One picture of the operator bench: how closely a pilot is obeyed against how still the target's water is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wakewise.errors import InputError
from wakewise.files import whole_file

SUFFIXES = (".png", ".svg", ".pdf")
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
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: ending '{path.suffix}', allowed {', '.join(SUFFIXES)}")
    figure = Figure(figsize=(10.5, 4.6), facecolor="white", layout="constrained")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    lines = {name: world["w_track"] for name, world in result["worlds"].items()}
    paper = {"in front": result["paper"]["w_track"], "above": result["paper"]["w_track_over"]}
    most = [_panel(left, lines, "in the tank's worlds", "target_speed_reduction_all_pct")]
    most.append(_panel(right, paper, "in the paper's own water (circular)", "target_speed_reduction_pct"))
    left.set_xlim(0.0, max(25.0, 1.08 * max(most)))
    left.set_ylim(LOWEST_PCT - 5.0, 105.0)
    left.set_ylabel("less wash at the target than direct allocation, %", fontsize=8.5, color=INK)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def _panel(axes: Axes, lines: Mapping[str, Mapping[str, Mapping[str, Any]]], words: str, key: str) -> float:
    """Draw one line for each world, a mark for each w_track; returns the largest deviation."""
    most = 0.0
    claim = Rectangle((0.0, ASKED_REDUCTION_PCT), ASKED_DEVIATION_PCT, 100.0 - ASKED_REDUCTION_PCT, color=PALE, zorder=0)
    axes.add_patch(claim)
    axes.annotate("the claim, at w_track 5", (0.4, 98.0), fontsize=7.5, color=QUIET, va="top")
    axes.axhline(0.0, color=QUIET, linewidth=0.6)
    for place, (name, sweep) in enumerate(lines.items()):
        colour = COLOURS[place % len(COLOURS)]
        points = [
            (w_track, float(row["velocity_deviation_pct"]), max(float(row[key]), LOWEST_PCT))
            for w_track, row in sweep.items()
            if row["velocity_deviation_pct"] is not None and row[key] is not None
        ]
        if not points:
            continue
        x, y = [point[1] for point in points], [point[2] for point in points]
        axes.plot(x, y, "-", color=colour, linewidth=1.0, alpha=0.5)
        axes.plot(x, y, "o", color=colour, markersize=4, label=name)
        for w_track, at_x, at_y in points:
            if w_track == CLAIMED:
                axes.plot([at_x], [at_y], "o", color=colour, markersize=9, markerfacecolor="none")
        for w_track, at_x, at_y in (points[0], points[-1])[: len(points)]:
            axes.annotate(w_track, (at_x, at_y), textcoords="offset points", xytext=(5, 4), fontsize=7, color=colour)
        most = max(most, *x)
    axes.set_title(words, fontsize=9.5, loc="left", color=INK)
    axes.set_xlabel("velocity deviation, %   (numbers: w_track, ring: 5)", fontsize=8.5, color=INK)
    axes.tick_params(labelsize=8, colors=INK)
    if lines:
        axes.legend(fontsize=8, frameon=False, loc="lower right")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return most
