"""One picture of the operator bench: how closely a pilot is obeyed against how still the target's water is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file

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
