"""One picture of the gentle bench: how fast the target's water moves by scenario and method."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file

SUFFIXES = (".png", ".svg", ".pdf")
WIDTH_IN, ROW_IN = 10.0, 0.42
INK, QUIET = "#22303a", "#8a979d"
LOOKS = {
    "dp": ("#c65a3a", "o"),
    "no-forward-jets": ("#b9923a", "s"),
    "mpc": (QUIET, "^"),
    "weighted-pseudo-inverse": ("#6f7f3a", "^"),
    "allocation-only": ("#5b8fb0", "D"),
    "wake-aware": ("#1f7a78", "o"),
    "wake-aware+trim": ("#7d4f9e", "P"),
    "no-forward-jets+trim": ("#d9b98a", "X"),
}
"""Methods that are drawn, with colour and mark."""
TROUBLE_MM_S = 10.0


def draw_gentle(result: Mapping[str, Any], path: Path) -> None:
    """Draw the answer of `wakewise bench gentle` into a file: a row per scenario, a mark per method.

    Raises
    ------
    InputError
        If the file's ending is not one of `SUFFIXES`.
    """
    check_ending(path)
    names = list(result["scenarios"])
    figure = Figure(figsize=(WIDTH_IN, ROW_IN * max(len(names), 1) + 1.6), facecolor="white", layout="constrained")
    axes = figure.subplots()
    for method, (colour, mark) in LOOKS.items():
        drawn = [
            (place, 1e3 * row["target_speed_mean_m_s"], row["target_speed_mean_m_s_interval"])
            for place, name in enumerate(names)
            if (row := result["scenarios"][name]["methods"].get(method)) and row["target_speed_mean_m_s"]
        ]
        for place, _, ends in drawn:
            if ends is not None and None not in ends:
                axes.plot(
                    [1e3 * max(end, 1e-5) for end in ends], [place, place], color=colour, linewidth=1.0, alpha=0.5
                )
        if drawn:
            axes.plot([v for _, v, _ in drawn], [p for p, _, _ in drawn], mark, color=colour, label=method, alpha=0.85)
    axes.axvline(TROUBLE_MM_S, color=QUIET, linewidth=0.8, linestyle=":")
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    axes.set_xlabel("mean speed at the target's surface that the vehicle causes (mm/s); trouble right of the dots")
    axes.tick_params(labelsize=8, colors=INK, which="both")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8, frameon=False, ncols=3)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=150)


def check_ending(path: Path) -> None:
    """Raise InputError for a picture's file whose ending is not one of `SUFFIXES`."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: ending '{path.suffix}', allowed {', '.join(SUFFIXES)}")
