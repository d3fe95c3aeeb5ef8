"""One picture of how the costs of the tank grow with the number of parcels, points and particles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wakewise.core.files import whole_file
from wakewise_benchmarks.tank_scaling import AT_POINTS, USUAL_THRUSTERS
from wakewise_paper.reports.wash_bench_plot import check_ending

_DRAWN = (
    ("parcels", "parcels of the jets", {"step_ms": "a step of the water", "flow_ms": f"flow at {AT_POINTS} points",
                                        "direct_ms": "the same, all pairs"}),
    ("points", "points", {"flow_ms": f"flow of {USUAL_THRUSTERS} thrusters"}),
    ("particles", "silt particles", {"step_ms": "a step of the silt"}),
)  # fmt: skip
_COLOURS = ("#1f6f8b", "#c65a3a", "#7a7f87")


def draw_scaling(result: Mapping[str, Any], path: Path) -> None:
    """Draw the costs of `wakewise bench tank` into a file, each beside the line of n log n through its last point."""
    check_ending(path)
    figure = Figure(figsize=(9.5, 3.6), facecolor="white", layout="constrained")
    for axes, (name, label, costs) in zip(figure.subplots(1, 3), _DRAWN, strict=True):
        rows = result["scaling"]["rows"][name]
        n = np.array([row["count"] for row in rows])
        for colour, (cost, words) in zip(_COLOURS, costs.items(), strict=False):
            ms = np.array([row[cost] for row in rows])
            grows = result["scaling"]["exponents"][name][cost]
            axes.loglog(n, ms, "o-", color=colour, markersize=3.5, linewidth=1.4, label=f"{words}: n^{grows:.2f}")
            axes.loglog(n, ms[-1] * n * np.log(n) / (n[-1] * math.log(n[-1])), ":", color=colour, linewidth=1.0)
        axes.set_xlabel(f"number n of {label}")
        axes.legend(fontsize=7.5, frameon=False, loc="upper left", title="exponent at large n", title_fontsize=7.5)
        axes.set_ylim(top=axes.get_ylim()[1] * 8.0)
        axes.grid(alpha=0.25, linewidth=0.5)
    figure.axes[0].set_ylabel("processor time, ms")
    figure.suptitle("Cost of the tank (dotted: n log n)", fontsize=10)
    with whole_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower(), dpi=110)
