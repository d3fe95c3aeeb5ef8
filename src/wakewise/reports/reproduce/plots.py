"""The paper's figures redrawn from our data: methods compared, thrusts and D over time, obedience and wash."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wakewise.arrays import Array
from wakewise.campaigns.statistics import performance_profile, stratified_bootstrap
from wakewise.reports.figures import NARROW_IN, WIDTH_IN
from wakewise.reports.ink import CORAL, INK, LINE, MUTED, SAND, SLATE, TEAL, VIOLET, dress, key, new_figure
from wakewise.studies.reproduce.glance import JUDGED

Place = Mapping[str, Any]
Row = Mapping[str, Any]
COLOURS = {
    "manual": SAND,
    "dp": CORAL,
    "unaware": SLATE,
    "smooth": VIOLET,
    "wake-aware": TEAL,
    "the paper's recipe": CORAL,
}
_FEWEST = 3  # of fewer trials a profile is a staircase of nothing
_MOST_BEYOND = 4.0  # a trial worse than so many times the median of all is drawn at the edge


def colour_of(method: str) -> str:
    """The same on every plot."""
    return COLOURS.get(method.split(",", maxsplit=1)[0], MUTED)


def methods_compared(table: str, places: Sequence[Place], rows: Sequence[Row], narrow: bool = False) -> Figure | None:
    """A panel per world: each trial a dot, the mean with its interval, the paper's figure a tick."""
    if table not in JUDGED:
        return None
    figure, words, scale, _ = JUDGED[table]
    worlds = [w for w in dict.fromkeys(p["world"] for p in places) if _known(places, w, figure)]
    methods = list(dict.fromkeys(place["method"] for place in places))
    if not worlds:
        return None
    across = 1 if narrow else len(worlds)
    height = 0.34 * len(methods) + 1.0
    drawn = new_figure(NARROW_IN, height * len(worlds)) if narrow else new_figure(WIDTH_IN, height + 0.3)
    panels = drawn.subplots(len(worlds) if narrow else 1, across, squeeze=False).ravel()
    rng = np.random.default_rng(0)
    for number_, (axes, world) in enumerate(zip(panels, worlds, strict=True)):
        dress(axes, x=words, grid="x")
        for place, method in enumerate(methods):
            values = scale * np.array([v for _, v in _known(places, world, figure, method)])
            quoted = _quoted(rows, world, method, figure)
            if quoted is not None:
                axes.plot([scale * quoted] * 2, [place - 0.34, place + 0.34], color=INK, linewidth=2.0, zorder=1)
            if not len(values):
                continue
            colour = colour_of(method)
            spread = place + rng.uniform(-0.14, 0.14, len(values))
            axes.plot(values, spread, "o", color=colour, markersize=4, alpha=0.45, linewidth=0)
            mean, ends = stratified_bootstrap(values, [t for t, _ in _known(places, world, figure, method)])
            axes.plot([mean], [place], "D", color=colour, markersize=7, zorder=3)
            if ends is not None:
                axes.plot(ends, [place, place], color=colour, linewidth=2.4, zorder=2)
        axes.set_ylim(len(methods) - 0.5, -0.5)
        axes.set_yticks(range(len(methods)), methods if narrow or number_ == 0 else [""] * len(methods))
        axes.set_xlim(left=0.0)
        axes.set_title(world, loc="left", color=INK, fontsize=10.5)
    return drawn


def over_time(series: Mapping[str, Mapping[str, Array]], narrow: bool = False) -> Figure | None:
    """Thrusts, D and the target's water over the time of one flight of each method, as the paper's temporal figure."""
    if not series:
        return None
    count = len(series)
    drawn = new_figure(NARROW_IN if narrow else WIDTH_IN, 1.5 * count + 3.6)
    panels = list(drawn.subplots(count + 2, 1, sharex=True))
    most = max(float(np.abs(one["thrusts_N"]).max()) for one in series.values())
    for axes, (method, one) in zip(panels, series.items(), strict=False):
        dress(axes, y="thrust (N)", grid="y")
        axes.plot(one["time_s"], one["thrusts_N"], color=colour_of(method), linewidth=0.6, alpha=0.75)
        axes.set_ylim(-1.05 * most, 1.05 * most)
        axes.set_title(f"{method}: all thrusters", loc="left", color=INK, fontsize=10)
    water, disturbance = panels[count], panels[count + 1]
    dress(disturbance, x="time (s)", y="D (m²/s²)", grid="y")
    dress(water, y="target (mm/s)", grid="y")
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
    key(water, loc="upper right", ncols=count)
    return drawn


def profiles(table: str, places: Sequence[Place], narrow: bool = False) -> Figure | None:
    """Share of trials that are at least so good, by method, a panel per world; failed trials never are."""
    if table not in JUDGED or not JUDGED[table][3]:
        return None
    figure, words, scale, _ = JUDGED[table]
    methods = dict.fromkeys(place["method"] for place in places)
    worlds = [
        world
        for world in dict.fromkeys(place["world"] for place in places)
        if all(len(_known(places, world, figure, method)) >= _FEWEST for method in methods)
    ]
    if not worlds:
        return None
    drawn = new_figure(NARROW_IN, 2.6 * len(worlds)) if narrow else new_figure(WIDTH_IN, 3.0)
    panels = drawn.subplots(len(worlds) if narrow else 1, 1 if narrow else len(worlds), squeeze=False).ravel()
    for axes, world in zip(panels, worlds, strict=True):
        dress(axes, x=f"at most, {words}", y="share of trials", grid="both")
        every = scale * np.array([v for _, v in _known(places, world, figure)])
        top = min(float(every.max()), _MOST_BEYOND * float(np.median(every))) * 1.05
        steps = np.linspace(0.0, top, 200)
        for method in dict.fromkeys(p["method"] for p in places if p["world"] == world):
            own = [p for p in places if p["world"] == world and p["method"] == method]
            values = [scale * float(p["figures"][figure]) if _has(p, figure) else np.nan for p in own]
            axes.plot(steps, performance_profile(values, steps), color=colour_of(method), label=method, linewidth=1.6)
        axes.set_ylim(0.0, 1.03)
        axes.set_xlim(0.0, top)
        axes.set_title(world, loc="left", color=INK, fontsize=10.5)
    key(panels[0], loc="lower right")
    return drawn


def obedience(rows: Sequence[Row], narrow: bool = False) -> Figure | None:
    """Deviation from what a pilot asks for against less wash than direct allocation, by w_track; a line per world."""
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
            lines.setdefault(row["world"], []).append((w_track, float(row["ours"]), float(other["ours"])))
    if not lines:
        return None
    drawn = new_figure(NARROW_IN if narrow else 0.62 * WIDTH_IN, 3.4)
    axes: Axes = drawn.subplots()
    dress(axes, x="deviation from the velocity asked for (%)", y="less wash than direct (%)", grid="both")
    for (world, points), colour in zip(lines.items(), (TEAL, CORAL, VIOLET, SAND, SLATE), strict=False):
        axes.plot([p[1] for p in points], [p[2] for p in points], "o-", color=colour, label=world, linewidth=1.2)
        for w_track, x, y in points:
            axes.annotate(w_track, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=8, color=MUTED)
    axes.plot([15.0, 15.0, 0.0], [105.0, 60.0, 60.0], color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    axes.set_xlim(0.0, max(18.0, 1.1 * max(p[1] for points in lines.values() for p in points)))
    axes.set_ylim(top=105.0)
    key(axes, loc="lower right")
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
        dress(axes, x="R2 (worse than -1 at the edge)", grid="x")
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
    key(panels[0], loc="lower left")
    return drawn


def _known(places: Sequence[Place], world: str, figure: str, method: str | None = None) -> list[tuple[str, float]]:
    """Target and value of the trials that have it."""
    return [
        (place["target"], float(place["figures"][figure]))
        for place in places
        if place["world"] == world and (method is None or place["method"] == method) and _has(place, figure)
    ]


def _has(place: Place, figure: str) -> bool:
    value = place["figures"].get(figure)
    return value is not None and bool(np.isfinite(float(value)))


def _quoted(rows: Sequence[Row], world: str, method: str, figure: str) -> float | None:
    """The paper's mean of this figure, in the trial's unit of our rows."""
    for row in rows:
        if (row["world"], row["method"], row["key"], row["reading"]) == (world, method, figure, "mean"):
            return None if row["paper"] is None else float(row["paper"])
    return None
