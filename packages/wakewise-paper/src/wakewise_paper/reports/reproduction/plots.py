"""The paper's figures redrawn from our data: methods compared, thrusts and D over time, obedience and wash."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wakewise.core.arrays import Array
from wakewise.ui.reports.figures import NARROW_IN, WIDTH_IN
from wakewise.ui.reports.methods_compared import colour_of
from wakewise.ui.reports.svg_style import (
    CORAL,
    INK,
    LINE,
    MUTED,
    SAND,
    SLATE,
    TEAL,
    VIOLET,
    add_legend,
    new_figure,
    style_axes,
)

Row = Mapping[str, Any]


def over_time(series: Mapping[str, Mapping[str, Array]], narrow: bool = False) -> Figure | None:
    """Thrusts, D and the target's water over the time of one flight of each method, as the paper's temporal figure."""
    if not series:
        return None
    count = len(series)
    drawn = new_figure(NARROW_IN if narrow else WIDTH_IN, 1.5 * count + 3.6)
    panels = list(drawn.subplots(count + 2, 1, sharex=True))
    most = max(float(np.abs(one["thrusts_N"]).max()) for one in series.values())
    for axes, (method, one) in zip(panels, series.items(), strict=False):
        style_axes(axes, y="thrust (N)", grid="y")
        axes.plot(one["time_s"], one["thrusts_N"], color=colour_of(method), linewidth=0.6, alpha=0.75)
        axes.set_ylim(-1.05 * most, 1.05 * most)
        axes.set_title(f"{method}: all thrusters", loc="left", color=INK, fontsize=10)
    water, disturbance = panels[count], panels[count + 1]
    style_axes(disturbance, x="time (s)", y="D (m²/s²)", grid="y")
    style_axes(water, y="target (mm/s)", grid="y")
    for method, one in series.items():
        water.plot(one["time_s"], 1e3 * one["speed_m_s"], color=colour_of(method), linewidth=1.0, label=method)
        disturbance.plot(one["D_time_s"], np.maximum(one["D"], 1e-12), color=colour_of(method), linewidth=0.9)
    values = np.concatenate([one["D"] for one in series.values()])
    if values.max() > 0.0:
        disturbance.set_yscale("log")
        disturbance.set_ylim(max(1e-4 * float(values.max()), 1e-12), 2.0 * float(values.max()))
    begins_s = float(next(iter(series.values()))["begins_s"])
    for axes in panels:
        axes.axvspan(0.0, begins_s, color=LINE, alpha=0.35, linewidth=0)
    add_legend(water, loc="upper right", ncols=count)
    return drawn


def obedience(rows: Sequence[Row], narrow: bool = False) -> Figure | None:
    """Deviation from what a pilot asks for against the ratio of wash to direct allocation's; a line per world."""
    lines: dict[str, list[tuple[str, float, float]]] = {}
    for row in rows:
        if row["key"] != "velocity_deviation_pct" or row["ours"] is None or row["target"] is not None:
            continue
        other = next(
            (
                r
                for r in rows
                if r["key"] == "target_speed_mean_m_s" and (r["world"], r["method"]) == (row["world"], row["method"])
            ),
            None,
        )
        if other is not None and other["ours"] is not None:
            w_track = str(row["method"]).rpartition(" ")[2]
            lines.setdefault(row["world"], []).append((w_track, float(row["ours"]), 1.0 - float(other["ours"]) / 100.0))
    if not lines:
        return None
    drawn = new_figure(NARROW_IN if narrow else 0.62 * WIDTH_IN, 3.4)
    axes: Axes = drawn.subplots()
    style_axes(axes, x="deviation from the velocity asked for (%)", y="wash, times that of direct", grid="both")
    for (world, points), colour in zip(lines.items(), (TEAL, CORAL, VIOLET, SAND, SLATE), strict=False):
        axes.plot([p[1] for p in points], [p[2] for p in points], "o-", color=colour, label=world, linewidth=1.2)
        for w_track, x, y in points:
            axes.annotate(w_track, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=8, color=MUTED)
    axes.plot([15.0, 15.0, 0.0], [0.0, 0.4, 0.4], color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.set_xlim(0.0, max(18.0, 1.1 * max(p[1] for points in lines.values() for p in points)))
    axes.set_ylim(bottom=0.0)
    add_legend(axes, loc="lower right")
    return drawn


def agreement(rows: Sequence[Row], narrow: bool = False) -> Figure | None:
    """R2 of each wake model against each flow, near the axis and in the wake, with the paper's as ticks."""
    panels_of = [("r2_core", "near the axis"), ("r2_wake", "in the wake")]
    flows = list(dict.fromkeys(row["target"] for row in rows if row["key"] == "r2_core"))
    models = list(dict.fromkeys(row["method"] for row in rows if row["key"] == "r2_core"))
    if not flows:
        return None
    height = 0.34 * len(flows) + 1.3
    drawn = new_figure(NARROW_IN, 2.0 * height) if narrow else new_figure(WIDTH_IN, height)
    panels = drawn.subplots(2 if narrow else 1, 1 if narrow else 2, squeeze=False).ravel()
    marks = ("x", "s", "^", "D")
    for axes, (figure, words) in zip(panels, panels_of, strict=True):
        style_axes(axes, x="R2 (worse than -1 at the edge)", grid="x")
        for (model, mark), colour in zip(zip(models, marks, strict=False), (CORAL, SAND, SLATE, TEAL), strict=False):
            found = [(r["ours"], flows.index(r["target"])) for r in rows if (r["method"], r["key"]) == (model, figure)]
            known = [(max(float(v), -1.0), place) for v, place in found if v is not None]
            axes.plot(
                [v for v, _ in known], [p for _, p in known], mark, color=colour, markersize=6, label=model, linewidth=0
            )
        paper = next((r["paper"] for r in rows if r["key"] == figure and r["paper"] is not None), None)
        if paper is not None:
            axes.axvline(paper, color=INK, linewidth=1.6)
            axes.annotate(
                "paper", (paper, -0.45), xytext=(-4, 0), textcoords="offset points", fontsize=8, color=INK, ha="right"
            )
        axes.set_xlim(-1.05, 1.05)
        axes.set_ylim(len(flows) - 0.5, -0.7)
        axes.set_yticks(range(len(flows)), flows if narrow or figure == "r2_core" else [""] * len(flows))
        axes.set_title(words, loc="left", color=INK, fontsize=10.5)
    add_legend(panels[0], loc="lower left")
    return drawn
