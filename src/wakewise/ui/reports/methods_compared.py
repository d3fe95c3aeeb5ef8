"""Methods side by side: in words, as plots, and pictures of each method's worst trial.

The pictures are photographs 0, 5 and 10 s after the first, and the model with its errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wakewise.experiments.campaigns.pictures import MODEL, photographs_of
from wakewise.experiments.campaigns.statistics import mean_interval, performance_profile
from wakewise.experiments.campaigns.summary import ENOUGH, FEWEST, MethodSummary, Place, worst_trials
from wakewise.experiments.campaigns.table import ComparisonMetric
from wakewise.ui.reports.figures import NARROW_IN, WIDTH_IN
from wakewise.ui.reports.page import error_scale, panel, parts, pictures, template
from wakewise.ui.reports.svg_style import (
    CORAL,
    INK,
    MUTED,
    SAND,
    SLATE,
    TEAL,
    VIOLET,
    add_legend,
    data_uri,
    error_colours,
    new_figure,
    style_axes,
)
from wakewise.ui.reports.text import number, percent, with_unit
from wakewise.ui.reports.views import SIDES, ViewBounds, draw_cloud

Row = Mapping[str, Any]
_ALIKE = 0.005
"""Costs that differ by less are told as the same."""
COLOURS = {
    "manual": SAND,
    "dp": CORAL,
    "mpc": SLATE,
    "mpc-smooth": VIOLET,
    "wake-aware": TEAL,
    "the paper's recipe": CORAL,
}
_FEWEST = 3  # of fewer trials a profile is a staircase of nothing
_MOST_BEYOND = 4.0  # a trial worse than so many times the median of all is drawn at the edge


_OTHERS = (TEAL, CORAL, VIOLET, SAND, SLATE)
"""For methods of one's own, and for what is no method at all, such as vehicles."""


def colour_of(method: str) -> str:
    """The same on every plot."""
    return COLOURS.get(method.split(",", maxsplit=1)[0], MUTED)


def colours_of(methods: Sequence[str]) -> dict[str, str]:
    """A colour each; where none of them has one of its own, one after the other."""
    if any(colour_of(method) != MUTED for method in methods):
        return {method: colour_of(method) for method in methods}
    return {method: _OTHERS[k % len(_OTHERS)] for k, method in enumerate(methods)}


def winner_text(glance: MethodSummary) -> str:
    """The method with the best mean against the next best; neither is ahead where the pairs do not tell them apart."""
    value = number(glance.means[glance.winner])
    if glance.rival is None:
        return f"{glance.winner}: {value} {glance.words}."
    if glance.means[glance.winner] == glance.means[glance.rival]:
        return f"{glance.winner} and {glance.rival} are even: {value} {glance.words} each."
    much, ends = percent(glance.less_pct, glance.interval_pct, more=not glance.less_is_better)
    ends = with_unit(ends.strip("()"))
    pairs = f"{glance.trials} {'pair' if glance.trials == 1 else 'pairs'}"
    if not glance.is_sure:
        both = f"{glance.winner} {value}, {glance.rival} {number(glance.means[glance.rival])} {glance.words}"
        head = "too few pairs" if glance.trials < FEWEST else "not told apart"
        return f"{head}: {both} ({pairs}; {f'interval {ends}' if ends else 'no interval'})."
    link = "as" if much.endswith("as much") else "less than" if glance.less_is_better else "more than"
    preliminary = f", preliminary (n < {ENOUGH})" if glance.trials < ENOUGH else ""
    return (
        f"{glance.winner}: {value} {glance.words}, {much} {link} {glance.rival} "
        f"({pairs}; interval {ends}){preliminary}."
    )


def cost_text(glance: MethodSummary) -> str:
    """What the method with the best mean costs, and where trials failed."""
    said = []
    if glance.energy_ratio is not None:
        alike = abs(glance.energy_ratio - 1.0) < _ALIKE
        much = "as much energy as" if alike else f"{number(glance.energy_ratio)} times the energy of"
        said.append(f"{glance.winner} takes {much} {glance.rival}.")
    if glance.silt_ratio is not None and abs(glance.silt_ratio - 1.0) >= _ALIKE:
        said.append(f"Silt between camera and target: {number(glance.silt_ratio)} times that of {glance.rival}.")
    lost = {method: count for method, count in glance.failed.items() if count}
    if lost:
        said.append("Failed: " + ", ".join(f"{method} {count}" for method, count in lost.items()) + ".")
    elif glance.trials:
        said.append("No trial failed.")
    return " ".join(said)


def methods_compared(
    measure: ComparisonMetric, places: Sequence[Place], rows: Sequence[Row] = (), narrow: bool = False
) -> Figure | None:
    """A panel per world: each trial a dot, the mean with its interval, the paper's figure a tick."""
    figure, words, scale, _ = measure
    worlds = [w for w in dict.fromkeys(p["world"] for p in places) if _known(places, w, figure)]
    methods = list(dict.fromkeys(place["method"] for place in places))
    if not worlds:
        return None
    colours = colours_of(methods)
    across = 1 if narrow else len(worlds)
    height = 0.34 * len(methods) + 1.0
    drawn = new_figure(NARROW_IN, height * len(worlds)) if narrow else new_figure(WIDTH_IN, height + 0.3)
    panels = drawn.subplots(len(worlds) if narrow else 1, across, squeeze=False).ravel()
    rng = np.random.default_rng(0)
    for number_, (axes, world) in enumerate(zip(panels, worlds, strict=True)):
        style_axes(axes, x=words, grid="x")
        for place, method in enumerate(methods):
            values = scale * np.array([v for _, v in _known(places, world, figure, method)])
            quoted = _quoted(rows, world, method, figure)
            if quoted is not None:
                axes.plot([scale * quoted] * 2, [place - 0.34, place + 0.34], color=INK, linewidth=2.0, zorder=1)
            if not len(values):
                continue
            colour = colours[method]
            spread = place + rng.uniform(-0.14, 0.14, len(values))
            axes.plot(values, spread, "o", color=colour, markersize=4, alpha=0.45, linewidth=0)
            mean, ends = mean_interval(values, [t for t, _ in _known(places, world, figure, method)])
            axes.plot([mean], [place], "D", color=colour, markersize=7, zorder=3)
            if ends is not None:
                axes.plot(ends, [place, place], color=colour, linewidth=2.4, zorder=2)
        axes.set_ylim(len(methods) - 0.5, -0.5)
        axes.set_yticks(range(len(methods)), methods if narrow or number_ == 0 else [""] * len(methods))
        axes.set_xlim(left=0.0)
        axes.set_title(world, loc="left", color=INK, fontsize=10.5)
    return drawn


def profiles(measure: ComparisonMetric, places: Sequence[Place], narrow: bool = False) -> Figure | None:
    """Share of trials that are at least so good, by method, a panel per world; failed trials never are."""
    figure, words, scale, less = measure
    if not less:
        return None
    methods = list(dict.fromkeys(place["method"] for place in places))
    colours = colours_of(methods)
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
        style_axes(axes, x=f"at most, {words}", y="share of trials", grid="both")
        every = scale * np.array([v for _, v in _known(places, world, figure)])
        top = min(float(every.max()), _MOST_BEYOND * float(np.median(every))) * 1.05
        steps = np.linspace(0.0, top, 200)
        for method in methods:
            own = [p for p in places if p["world"] == world and p["method"] == method]
            values = [scale * float(p["figures"][figure]) if _has(p, figure) else np.nan for p in own]
            axes.plot(steps, performance_profile(values, steps), color=colours[method], label=method, linewidth=1.6)
        axes.set_ylim(0.0, 1.03)
        axes.set_xlim(0.0, top)
        axes.set_title(world, loc="left", color=INK, fontsize=10.5)
    add_legend(panels[0], loc="lower right")
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


PIXELS = 260


def worst_panels(measure: ComparisonMetric, places: Sequence[Place], store: Path) -> str:
    """The worst trial of each method in each world: what its camera saw, and its model; empty where none was kept."""
    panels = []
    for world in dict.fromkeys(place["world"] for place in places):
        worst = worst_trials(measure, world, places)
        if not any(
            (store / place["folder"] / MODEL).is_file() or photographs_of(store / place["folder"])
            for place in worst.values()
        ):
            continue
        seen = before_after(worst, store)
        if seen:
            panels.append(panel(f"Before and after, {world}", "Each method's worst trial.", "", seen))
        scale = error_scale("error (mm)")
        title = f"Worst models, {world}"
        panels.append(panel(title, "Coloured by distance to the true surface.", scale, models(worst, store)))
    return "".join(panels)


def before_after(worst: Mapping[str, Mapping[str, Any]], store: Path) -> str:
    """A row of photographs per method of its worst trial; empty where none was taken."""
    rows = []
    for method, place in worst.items():
        figures = []
        for after_s, path in photographs_of(store / place["folder"]):
            try:
                source = data_uri(path.read_bytes(), "image/jpeg")
            except OSError:
                continue
            facts = f"{method}, {after_s:.1f} s after the first photograph"
            figures.append(parts().captioned(parts().photo(source, facts, facts), f"{after_s:.1f} s"))
        if figures:
            rows.append(str(parts().row_title(method, trial_text(place)) + parts().columns(figures)))
    return "".join(rows)


def models(worst: Mapping[str, Mapping[str, Any]], store: Path) -> str:
    """The model of each method's worst trial from five sides, coloured by error; or why there is none."""
    rows = []
    for method, place in worst.items():
        rows.append(str(parts().row_title(method, trial_text(place))))
        drawn = model_views(store / place["folder"] / MODEL)
        if drawn is None:
            rows.append(str(template("campaign.html").no_model(str(place["reason"] or "none was kept"))))
        else:
            rows.append(pictures(drawn, SIDES, method))
    return "".join(rows)


def model_views(path: Path) -> list[str] | None:
    """A model from all sides, as PNG data URIs; None where none was kept."""
    if not path.is_file():
        return None
    with np.load(path) as kept:
        points, errors = kept["points_m"].astype(np.float64), kept["error_mm"].astype(np.float64)
    return draw_cloud(points, error_colours(1e-3 * errors), SIDES, ViewBounds.around(points), PIXELS)


def trial_text(place: Mapping[str, Any]) -> str:
    """World, target, seed and error of a trial."""
    rmse = place["figures"].get("rmse_mm")
    target = "" if place["target"].startswith("the ") else f"{place['target']}, "
    said = f"{place['world']}, {target}seed {place['seed']}"
    return said if rmse is None else f"{said}: {number(rmse)} mm RMSE"
