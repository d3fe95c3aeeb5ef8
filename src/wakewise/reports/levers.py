"""One picture of the gentle bench: how fast the target's water moves by method, and what each lever is worth."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
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
    methods = max((len(figures["methods"]) for figures in flows.values()), default=0)
    tables = {flow: lines for flow, figures in flows.items() if (lines := lever_lines(figures))}
    heights = [methods + 3.5, *(len(lines) + 3.5 for lines in tables.values())]
    figure = Figure(figsize=(WIDTH_IN, BAR_IN * sum(heights)), facecolor="white", layout="constrained")
    rows = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    for axes, (flow, figures) in zip(
        np.atleast_1d(rows[0].subplots(1, max(len(flows), 1))), flows.items(), strict=True
    ):
        _methods(axes, flow, figures)
    for part, (flow, lines) in zip(rows[1:], tables.items(), strict=True):
        _levers(part.subplots(), flow, lines)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def lever_lines(figures: Mapping[str, Any]) -> list[tuple[str, Mapping[str, Any] | None]]:
    """Names and figures of the lines to draw from top to bottom; a kind's heading has no figures.

    Lines without a reduction are left out: where the water is the model's own, what they are held against stands still.
    """
    found: list[tuple[str, Mapping[str, Any] | None]] = []
    for group, heading in GROUPS.items():
        rows = [(name, row) for name, row in figures["lever_details"].items() if row["group"] == group]
        own = [(name, row) for name, row in rows if row["reduction_pct"] is not None]
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


def _levers(axes: Axes, flow: str, lines: list[tuple[str, Mapping[str, Any] | None]]) -> None:
    for place, (_, row) in enumerate(lines):
        if row is None:
            continue
        value = row["reduction_pct"]
        axes.barh(place, value, height=0.62, color=GOOD if value > 0.0 else BAD)
        low, high = row["interval_pct"] or (value, value)
        axes.plot([low, high], [place, place], color=INK, linewidth=1.4)
        words = f"  {value:+.0f} %, {row['position_rmse_mm']:.1f} mm off"
        axes.annotate(words, (max(value, high, 0.0), place), va="center", fontsize=7, color=INK)
    axes.axvline(0.0, color=INK, linewidth=0.8)
    axes.margins(x=0.12)
    names = [name for name, _ in lines]
    _dress(axes, names, f"{flow}: levers", "target speed lower by (%), 95 % of a bootstrap over pairs of flights")
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
