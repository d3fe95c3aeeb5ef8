"""One picture of the operator bench: obedience against still water, by w_track."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wakewise.errors import InputError
from wakewise.files import whole_file

SUFFIXES = (".png", ".svg", ".pdf")
INK, QUIET, GOOD, BAD = "#22303a", "#8a979d", "#1f7a78", "#c65a3a"
COURSES = {
    "w_track": "in front of the target: spare thrusters suffice",
    "w_track_over": "above it, 1 N heavy: only disobedience helps",
}
"""Keys of the bench's sweeps and what is said of them."""
ASKED_DEVIATION_PCT, ASKED_REDUCTION_PCT = 15.0, 60.0
"""The paper's claim at w_track = 5."""


def draw_operator(result: Mapping[str, Any], path: Path) -> None:
    """Draw the answer of `wakewise bench operator` into a file, one panel per course.

    Raises
    ------
    InputError
        If the file's ending is not one of `SUFFIXES`.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: ending '{path.suffix}', allowed {', '.join(SUFFIXES)}")
    figure = Figure(figsize=(10.0, 4.0), facecolor="white", layout="constrained")
    for place, (key, words) in enumerate(COURSES.items()):
        _panel(figure.add_subplot(1, len(COURSES), place + 1), result[key], words)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def _panel(axes: Axes, sweep: Mapping[str, Mapping[str, float]], words: str) -> None:
    weights = [float(w) for w in sweep]
    lines = (
        ("disturbance_reduction_pct", "disturbance lower by", GOOD, "o-"),
        ("velocity_deviation_pct", "velocity deviation", BAD, "o-"),
        ("velocity_deviation_planned_pct", "of that, planned", BAD, ":"),
        ("velocity_deviation_floor_pct", "dp, which spares nothing", QUIET, "--"),
    )
    for key, label, colour, style in lines:
        axes.plot(weights, [row[key] for row in sweep.values()], style, color=colour, label=label, markersize=4)
    for asked in (ASKED_DEVIATION_PCT, ASKED_REDUCTION_PCT):
        axes.axhline(asked, color=INK, linewidth=0.5, linestyle=(0, (1, 3)))
    axes.set_xscale("log")
    axes.set_xticks(weights, [f"{w:g}" for w in weights])
    axes.set_xticks([], minor=True)
    axes.set_ylim(0.0, 105.0)
    axes.set_xlabel("w_track", fontsize=8, color=INK)
    axes.set_ylabel("%", fontsize=8, color=INK)
    axes.set_title(words, fontsize=9, loc="left", color=INK)
    axes.tick_params(labelsize=7.5)
    axes.legend(fontsize=7.5, frameon=False, loc="center right")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
