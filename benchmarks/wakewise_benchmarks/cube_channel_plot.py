"""One picture of the lattice round a cube: measured and computed profiles of the velocity along the channel."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from wakewise.core.errors import InputError
from wakewise.core.files import whole_file
from wakewise_paper.reports.wash_bench_plot import check_ending

MEASURED, LATTICE, GREY = "#22303a", "#c65a3a", "#c9ced1"
_SCALE_H = 0.45
"""Width in H of a profile that is as fast as the bulk velocity."""


def draw_cube(result: Mapping[str, Any], path: Path) -> None:
    """Draw the profiles of `wakewise bench truth` into a file, at their places along the channel.

    Raises InputError if the file's ending is not one of `SUFFIXES`, or the cube was not computed.
    """
    check_ending(path)
    cube = result["cube"]
    if not cube.get("profiles"):
        raise InputError(f"{path}: the lattice round the cube was not computed, so there is nothing to draw")
    figure = Figure(figsize=(9.0, 5.2), facecolor="white", layout="constrained")
    for axes, z_H in zip(figure.subplots(2, 1, sharex=True), (0.0, 1.0), strict=True):
        axes.fill_between([0.0, 1.0], 1.0, color=GREY, alpha=1.0 if z_H == 0.0 else 0.4, linewidth=0.0)
        for profile in (p for p in cube["profiles"] if p["z_H"] == z_H):
            x = profile["x_H"]
            axes.axvline(x, color=GREY, linewidth=0.6)
            measured = [x + _SCALE_H * u for u in profile["measured"]]
            axes.plot(measured, profile["y_H"], "o", color=MEASURED, markersize=2.5)
            axes.plot([x + _SCALE_H * u for u in profile["lattice"]], profile["y_H"], color=LATTICE, linewidth=1.4)
        axes.set_ylim(0.0, 2.0)
        axes.set_ylabel("y / H")
        where = "middle of the cube" if z_H == 0.0 else "half a cube beside it"
        axes.set_title(f"z / H = {z_H:g}, {where}", fontsize=9, loc="left")
    axes.set_xlabel(f"x / H; profiles of U: {_SCALE_H:g} H is the bulk velocity")
    axes.plot([], [], "o", color=MEASURED, markersize=2.5, label="measured (Martinuzzi and Tropea 1993)")
    axes.plot([], [], color=LATTICE, linewidth=1.4, label=f"lattice, {cube['cells_per_H']} cells to H")
    axes.legend(fontsize=8, loc="upper right", frameon=False)
    with whole_file(path) as temporary:
        figure.savefig(temporary, format=path.suffix[1:].lower(), dpi=110)
