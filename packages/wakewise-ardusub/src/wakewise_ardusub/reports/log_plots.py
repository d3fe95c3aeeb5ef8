"""Figures of a real vehicle's log: sticks, motion, pulses, thrusts and wash."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wakewise.core.arrays import Array
from wakewise.ui.reports.figures import NARROW_IN, THRUSTS, WIDTH_IN
from wakewise.ui.reports.svg_style import (
    CARD,
    CORAL,
    LINE,
    MUTED,
    SAND,
    SLATE,
    TEAL,
    VIOLET,
    add_legend,
    new_figure,
    style_axes,
    thinned,
)

Lines = list[tuple[str, Array, str]]
SHARES = (("flown", "as flown", CORAL), ("least", "least thrusts", SAND), ("gentle", "gentle", TEAL))
MIDDLE_US = 1500.0
LEAST_SPAN = {"sticks": 1.0, "depth": 0.5, "roll": 20.0, "heading": 20.0, "place": 1.0, "battery": 1.0}
"""Smallest scales that are drawn: less than these is noise."""


def column(rows: pl.DataFrame, name: str) -> Array:
    """A column as floats, shape (n,), NaN where nothing is known."""
    return rows[name].cast(pl.Float64).fill_null(np.nan).to_numpy()


def dive(rows: pl.DataFrame, narrow: bool = False) -> Figure | None:
    """Sticks, depth, attitude, place and voltage on one clock; modes named above, shaded while armed."""
    panels = [(label, lines) for label, lines in _panels(rows) if any(np.isfinite(y).any() for _, y, _ in lines)]
    if not panels:
        return None
    figure = new_figure(NARROW_IN if narrow else WIDTH_IN, 0.8 + 1.5 * len(panels))
    grid = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    time_s = column(rows, "time_s")
    for axes, (label, lines) in zip(grid, panels, strict=True):
        style_axes(axes, y=label)
        _shade_armed(axes, rows, time_s)
        for name, values, colour in lines:
            axes.plot(*_broken(time_s, values, 200 if narrow else 800), color=colour, linewidth=1.2, label=name)
        if label.startswith("depth"):
            axes.invert_yaxis()
        _room(axes, label, lines)
        if len(lines) > 1:
            add_legend(axes, loc="upper right", ncols=2 if narrow else 4, borderaxespad=0.1)
        axes.margins(x=0.0)
    _name_modes(grid[0], rows, time_s)
    grid[-1].set_xlabel("time (s)", color=MUTED, fontsize=9.5)
    figure.align_ylabels()
    return figure


def pulses(rows: pl.DataFrame, channels: Sequence[int], names: Sequence[str], narrow: bool = False) -> Figure | None:
    """Servo pulses of the thrusters over time, one row each."""
    values = [column(rows, f"servo_{channel}_us") - MIDDLE_US for channel in channels]
    if not values or not np.nan_to_num(values).any():
        return None
    return _strip(rows, [("", np.stack(values))], names, "pulse from the middle (µs)", 50.0, narrow)


def thrusts(rows: pl.DataFrame, names: Sequence[str], narrow: bool = False) -> Figure:
    """Flown and gentle thrusts over time, one row each."""
    parts = [
        (title, np.stack([column(rows, f"{share}_{i + 1}_N") for i in range(len(names))]))
        for share, title in (("thrust", "as flown"), ("gentle", "gentle, same wrench"))
    ]
    return _strip(rows, parts, names, "thrust (N)", 1e-6, narrow)


def speeds(rows: pl.DataFrame, total_weight: float, narrow: bool = False) -> Figure:
    """Root mean square speed that the wake model gives at the points: flown, least and gentle thrusts."""
    figure = new_figure(NARROW_IN if narrow else WIDTH_IN, 2.9)
    axes = figure.subplots()
    time_s = column(rows, "time_s")
    style_axes(axes, x="time (s)", y="speed at the points\n(mm/s, rms)")
    _shade_armed(axes, rows, time_s)
    # What was flown is often the least: the wider line shows under the other.
    for (share, name, colour), width in zip(SHARES, (3.2, 1.2, 1.2), strict=True):
        speed = 1e3 * np.sqrt(np.maximum(column(rows, f"disturbance_{share}"), 0.0) / total_weight)
        axes.plot(*_broken(time_s, speed, 200 if narrow else 800), color=colour, linewidth=width, label=name)
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0.0)
    add_legend(axes, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.1)
    return figure


def _panels(rows: pl.DataFrame) -> Iterator[tuple[str, Lines]]:
    sticks = (("forward", TEAL), ("right", CORAL), ("down", VIOLET), ("turn", SAND))
    yield "sticks", [(name, column(rows, f"stick_{name}"), colour) for name, colour in sticks]
    yield "depth (m)", [("depth", column(rows, "depth_m"), TEAL)]
    leans = (("roll", TEAL), ("pitch", CORAL))
    yield "roll, pitch\n(deg)", [(n, np.degrees(column(rows, f"{n}_rad")), c) for n, c in leans]
    heading = np.degrees(column(rows, "heading_rad"))
    # A line that jumps from 360 to 0 is no turn.
    heading[1:][np.abs(np.diff(heading)) > 180.0] = np.nan
    yield "heading\n(deg)", [("heading", heading, SLATE)]
    places = (("north", "est_x_m", TEAL), ("east", "est_y_m", CORAL))
    yield "place (m)", [(name, column(rows, found), colour) for name, found, colour in places]
    yield "battery (V)", [("battery", column(rows, "voltage_V"), SLATE)]


def _strip(
    rows: pl.DataFrame,
    parts: Sequence[tuple[str, Array]],
    names: Sequence[str],
    unit: str,
    least: float,
    narrow: bool,
) -> Figure:
    """Values of shape (m, n) as strips, one below the other, of one scale of colours."""
    count = len(names)
    figure = new_figure(NARROW_IN if narrow else WIDTH_IN, 0.7 + (0.27 * count + 0.35) * len(parts))
    grid = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
    time_s = column(rows, "time_s")
    limit = max(least, *(float(np.quantile(np.abs(np.nan_to_num(values)), 0.995)) for _, values in parts))
    for axes, (title, values) in zip(grid, parts, strict=True):
        edges = np.linspace(0, values.shape[1], min(400 if narrow else 1100, values.shape[1]) + 1).astype(int)
        shown = np.add.reduceat(np.nan_to_num(values), edges[:-1], axis=1) / np.diff(edges)
        style_axes(axes, grid="")
        image = axes.imshow(
            shown, aspect="auto", cmap=THRUSTS, vmin=-limit, vmax=limit, interpolation="nearest",
            extent=(0.0, max(float(time_s[-1]), 1e-3), count + 0.5, 0.5),
        )  # fmt: skip
        for row in range(1, count):
            axes.axhline(row + 0.5, color=CARD, linewidth=2)
        labels = [f"{name} {i}" for i, name in enumerate(names, start=1)]
        if narrow:
            labels = [label.replace(" horizontal", " h.").replace(" vertical", " v.") for label in labels]
        axes.set_yticks(range(1, count + 1), labels)
        if title:
            axes.set_title(title, loc="left", color=MUTED, fontsize=9.5)
    grid[-1].set_xlabel("time (s)", color=MUTED, fontsize=9.5)
    where = {"location": "bottom", "pad": 0.03, "aspect": 30} if narrow else {"pad": 0.015, "aspect": 22}
    bar = figure.colorbar(image, ax=list(grid), extend="both", **where)
    bar.outline.set_visible(False)
    bar.ax.tick_params(colors=MUTED, labelsize=9, length=3)
    bar.set_label(unit, color=MUTED, fontsize=9.5)
    return figure


def _broken(x: Array, y: Array, buckets: int) -> tuple[Array, Array]:
    """A thinned line that keeps its gaps."""
    known = np.isfinite(y)
    if known.all() or len(x) <= 2 * buckets:
        return thinned(x, y, buckets)
    turns = np.flatnonzero(np.diff(known)) + 1
    xs: list[Array] = []
    ys: list[Array] = []
    for part in np.split(np.arange(len(x)), turns):
        if known[part[0]]:
            share = max(2, round(buckets * len(part) / len(x)))
            for found, value in zip((xs, ys), thinned(x[part], y[part], share), strict=True):
                found += [value, np.array([np.nan])]
    return (np.concatenate(xs), np.concatenate(ys)) if xs else (x[:0], y[:0])


def _room(axes: Axes, label: str, lines: Lines) -> None:
    """Leave room for the key above the lines, and no scale that blows up a still channel."""
    every = np.concatenate([values[np.isfinite(values)] for _, values, _ in lines])
    low, high = float(every.min()), float(every.max())
    short = max(LEAST_SPAN[label.split(maxsplit=1)[0].strip(",")] - (high - low), 0.0)
    low, high = low - 0.5 * short, high + 0.5 * short
    ends = (low - 0.12 * (high - low), high + (0.45 if len(lines) > 1 else 0.15) * (high - low))
    axes.set_ylim(*(ends[::-1] if axes.yaxis_inverted() else ends))


def _shade_armed(axes: Axes, rows: pl.DataFrame, time_s: Array) -> None:
    for start, stop, armed in _runs(rows["armed"].fill_null(False).to_list()):
        if armed:
            axes.axvspan(time_s[start], time_s[stop], color=LINE, alpha=0.4, linewidth=0, zorder=0)


def _name_modes(axes: Axes, rows: pl.DataFrame, time_s: Array) -> None:
    whole = max(float(time_s[-1]), 1e-9)
    for start, stop, mode in _runs(rows["mode"].to_list()):
        if not mode:
            continue
        if start and rows["mode"][start - 1] is not None:
            axes.axvline(time_s[start], color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
        share = (time_s[stop] - time_s[start]) / whole
        if share * cast("Figure", axes.figure).get_figwidth() > 0.11 * len(str(mode)):
            axes.annotate(
                str(mode), (0.5 * (time_s[start] + time_s[stop]), 1.0), xycoords=("data", "axes fraction"),
                ha="center", va="bottom", color=MUTED, fontsize=9, xytext=(0, 3), textcoords="offset points",
            )  # fmt: skip


def _runs(values: list[object]) -> Iterator[tuple[int, int, object]]:
    """First and last row of each stretch of one value."""
    start = 0
    for i in range(1, len(values) + 1):
        if i == len(values) or values[i] != values[start]:
            yield start, min(i, len(values) - 1), values[start]
            start = i
