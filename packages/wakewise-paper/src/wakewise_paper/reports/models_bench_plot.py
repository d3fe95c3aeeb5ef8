"""Pictures of `wakewise bench models` (dose and response) and of `wakewise bench front` (wash against energy)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise_paper.model_failure.cases import USUAL
from wakewise_paper.reports.wash_bench_plot import INK, LOOKS, QUIET, check_ending
from wakewise_paper.wash_reduction.energy_front import LIMITS, RIVALS

RESPONSES = (
    ("sway_about_mean_mm", "sway between photographs, mm"),
    ("rmse_mm", "RMSE, mm"),
    ("completeness_1mm_pct", "complete within 1 mm, %"),
)
SUCCESS_RMSE_MM = 3.0
"""RMSE below which a model can be a success."""
DOSES = "doses"


def draw_models(result: Mapping[str, Any], path: Path) -> None:
    """Draw dose and response of `wakewise bench models` into a file: a row per quantity, a column per response.

    Raises
    ------
    InputError
        If the file's ending is not one of `SUFFIXES`, or the part with doses was not made.
    """
    check_ending(path)
    if DOSES not in result["parts"]:
        raise InputError(f"--plot: draws the part '{DOSES}', which was not made; --scenarios {DOSES}")
    part = result["parts"][DOSES]
    axes_of = {name: axis for name, axis in part["axes"].items() if len(_doses(part["rows"], name)) > 1}
    if not axes_of:
        raise InputError("--plot: no doses were flown by these methods; the part has dp and wake-aware")
    figure = Figure(figsize=(9.0, 1.75 * len(axes_of) + 0.5), facecolor="white", layout="constrained")
    grid = figure.subplots(len(axes_of), len(RESPONSES), sharey="col", squeeze=False)
    methods = list(dict.fromkeys(row["method"] for row in part["rows"]))
    for (name, axis), line in zip(axes_of.items(), grid, strict=True):
        for (figure_key, _), axes in zip(RESPONSES, line, strict=True):
            _respond(axes, part["rows"], name, figure_key, methods)
            axes.set_xlabel(f"{axis['title']}, {axis['unit']}", fontsize=8, color=INK)
    for (figure_key, title), column in zip(RESPONSES, grid.T, strict=True):
        column[0].set_title(title, fontsize=9, loc="left", color=INK)
        column[0].set_ylim(bottom=0.0)
        if figure_key == "rmse_mm":
            for axes in column:
                axes.axhline(SUCCESS_RMSE_MM, color=QUIET, linewidth=0.8, linestyle=":")
    grid[0][0].legend(fontsize=8, frameon=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def draw_front(result: Mapping[str, Any], path: Path) -> None:
    """Draw wash against energy, both over `dp`'s, a panel per place.

    Raises
    ------
    InputError
        If the file's ending is not one of `SUFFIXES`.
    """
    check_ending(path)
    places = result["places"]
    figure = Figure(figsize=(2.9 * len(places) + 0.6, 3.3), facecolor="white", layout="constrained")
    panels = figure.subplots(1, len(places), sharey=True, squeeze=False)[0]
    for axes, (name, place) in zip(panels, places.items(), strict=True):
        _front(axes, place["methods"])
        axes.set_title(name, fontsize=9, loc="left", color=INK)
        axes.set_xlabel("energy over dp's", fontsize=8, color=INK)
        _quiet(axes)
    panels[0].set_ylabel("wash over dp's", fontsize=8, color=INK)
    panels[-1].legend(fontsize=7, frameon=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def _front(axes: Axes, methods: Mapping[str, Mapping[str, Any]]) -> None:
    ours = [row for name in LIMITS if (row := methods.get(name)) and row["wash"] is not None]
    colour, mark = LOOKS["wake-aware"]
    axes.plot([r["energy"] for r in ours], [r["wash"] for r in ours], "-", color=colour, linewidth=1.0)
    axes.plot([r["energy"] for r in ours], [r["wash"] for r in ours], ".", color=colour, label="wake-aware, by limit")
    for name in ("dp", *RIVALS, "wake-aware"):
        row = {"energy": 1.0, "wash": 1.0} if name == "dp" else methods.get(name)
        if row and row["wash"] is not None:
            colour, mark = LOOKS[name]
            axes.plot([row["energy"]], [row["wash"]], mark, color=colour, label=name)


def _respond(axes: Axes, rows: Sequence[Mapping[str, Any]], name: str, key: str, methods: Sequence[str]) -> None:
    """Response of each method to the doses of one axis; means over seeds."""
    for method in methods:
        points = sorted(
            (row["doses"][name], row[key])
            for row in rows
            if row["method"] == method and name in row["doses"] and row[key] is not None
        )
        colour, mark = LOOKS[method]
        axes.plot([x for x, _ in points], [y for _, y in points], f"-{mark}", color=colour, label=method, markersize=4)
    values = sorted(_doses(rows, name))
    if values[0] > 0.0 and values[-1] / values[0] > 10.0:
        axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(values))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter("{x:g}")
    usual = next(row["doses"][name] for row in rows if row["case"] == USUAL)
    axes.axvline(usual, color=QUIET, linewidth=0.6)
    _quiet(axes)


def _doses(rows: Sequence[Mapping[str, Any]], name: str) -> set[float]:
    return {row["doses"][name] for row in rows if name in row["doses"]}


def _quiet(axes: Axes) -> None:
    axes.tick_params(labelsize=7.5, colors=INK, which="both")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
