"""One picture of the gentle bench: how fast the target's water moves by method, and what each lever is worth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wakewise.errors import InputError
from wakewise.files import whole_file

SUFFIXES = (".png", ".svg", ".pdf")
WIDTH_IN, BAR_IN = 11.0, 0.25
INK, QUIET, GOOD, BAD = "#22303a", "#8a979d", "#1f7a78", "#c65a3a"
GROUPS = {
    "alone": "levers alone, against the planner without levers",
    "way": "other ways, against their base",
    "left out": "one lever left out, against all together",
    "mission": "changes of vehicle and mission, with wake-aware and with dp",
}
"""Kinds of lines of the lever table, in the order in which they are drawn."""


def draw_levers(result: Mapping[str, Any], path: Path) -> None:
    """Draw the answer of `wakewise bench gentle` into a file; flows side by side, methods above, levers below.

    Raises
    ------
    InputError
        If the file's ending is not one of `SUFFIXES`.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: ending '{path.suffix}', allowed {', '.join(SUFFIXES)}")
    flows: Mapping[str, Any] = result["flows"]
    lines = max((len(lever_lines(figures)) for figures in flows.values()), default=0)
    methods = max((len(figures["methods"]) for figures in flows.values()), default=0)
    figure = Figure(figsize=(WIDTH_IN, BAR_IN * (lines + methods) + 2.2), facecolor="white", layout="constrained")
    grid = figure.add_gridspec(2, max(len(flows), 1), height_ratios=(methods + 1.5, lines + 1.5))
    for column, (flow, figures) in enumerate(flows.items()):
        _methods(figure.add_subplot(grid[0, column]), flow, figures)
        _levers(figure.add_subplot(grid[1, column]), figures)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def lever_lines(figures: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any] | None]]:
    """Names and figures of the lines to draw from top to bottom; a kind's heading has no figures."""
    found: list[tuple[str, Mapping[str, Any] | None]] = []
    for group, heading in GROUPS.items():
        own = [(name, row) for name, row in figures["lever_details"].items() if row["group"] == group]
        if own:
            found += [(heading, None), *own]
    return found


def _methods(axes: Axes, flow: str, figures: Mapping[str, Any]) -> None:
    names = list(figures["methods"])
    for place, name in enumerate(names):
        row = figures["methods"][name]
        value = row["target_speed_mean_m_s"]
        if value is None:
            continue
        axes.barh(place, 1e3 * value, height=0.62, color=GOOD if name == "wake-aware" else QUIET)
        interval = row.get("target_speed_mean_m_s_interval")
        if interval is not None:
            axes.plot([1e3 * x for x in interval], [place, place], color=INK, linewidth=1.4)
        end = max(1e3 * value, *((1e3 * x for x in interval) if interval is not None else (0.0,)))
        axes.annotate(f"  {row['position_rmse_mm']:.1f} mm off", (end, place), va="center", fontsize=7, color=INK)
    words = "circular: its wake model is the water" if figures["circular"] else "the tank's water"
    _dress(axes, names, f"{flow} ({words}), {figures['seeds']} seeds", "mean speed at the target's surface (mm/s)")


def _levers(axes: Axes, figures: Mapping[str, Any]) -> None:
    lines = lever_lines(figures)
    for place, (_, row) in enumerate(lines):
        value = None if row is None else row["reduction_pct"]
        if row is None or value is None:
            continue
        axes.barh(place, value, height=0.62, color=GOOD if value > 0.0 else BAD)
        if row["interval_pct"] is not None:
            axes.plot(row["interval_pct"], [place, place], color=INK, linewidth=1.4)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    axes.set_xlim(-110.0, 105.0)
    _dress(
        axes, [name for name, _ in lines], "", "target speed lower by (%), 95 % of a bootstrap over pairs of flights"
    )
    for label, (_, row) in zip(axes.get_yticklabels(), lines, strict=True):
        if row is None:
            label.set_fontweight("bold")


def _dress(axes: Axes, names: list[str], title: str, words: str) -> None:
    axes.set_yticks(range(len(names)), names, fontsize=7.5, color=INK)
    axes.invert_yaxis()
    axes.set_xlabel(words, fontsize=8, color=INK)
    axes.set_title(title, fontsize=9, loc="left", color=INK)
    axes.tick_params(axis="x", labelsize=7.5)
    axes.tick_params(axis="y", length=0)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
