"""Picture of a dive's track with the photographs that were taken and those that were chosen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from wakewise.core.files import whole_file
from wakewise.vision.photo_selection.pick import PickedPhotos

TRACK, TAKEN, CHOSEN = "#9aa5b1", "#6f7f8f", "#c8442f"


def write_photo_track(path: Path, picked: PickedPhotos) -> None:
    """Write a PNG, whole or not at all: track seen from above, and how far apart the chosen photographs are."""
    figure = Figure(figsize=(10.5, 6.0), layout="constrained", facecolor="white")
    grid = figure.add_gridspec(1, 2, width_ratios=(1.7, 1.0))
    above, apart = figure.add_subplot(grid[0]), figure.add_subplot(grid[1])
    track, taken = picked.track_W_m, picked.photos_W_m
    chosen = taken[picked.chosen]
    above.plot(track[:, 1], track[:, 0], color=TRACK, linewidth=1.2, zorder=1, label="track")
    above.scatter(taken[:, 1], taken[:, 0], s=5, color=TAKEN, linewidths=0, zorder=2, label=f"{len(taken)} photos")
    above.scatter(
        chosen[:, 1], chosen[:, 0], s=26, facecolor=CHOSEN, edgecolor="white", linewidths=0.6, zorder=3,
        label=f"{len(chosen)} picked",
    )  # fmt: skip
    above.plot(*track[0, [1, 0]], marker="^", color="black", markersize=8, linestyle="none", zorder=4, label="begin")
    above.set(xlabel="east, m", ylabel="north, m", aspect="equal")
    above.margins(0.06)
    above.grid(color="#eeeeee", linewidth=0.8)
    above.set_axisbelow(True)
    figure.legend(*above.get_legend_handles_labels(), loc="outside lower left", ncols=4, frameon=False, fontsize=9)
    way = np.array([float(row[17]) for row in picked.rows])
    apart.plot(way[1:], np.diff(way), color=CHOSEN, marker=".", markersize=4, linewidth=0.8)
    every = picked.figures["every_m"]
    if every is not None:
        apart.axhline(every, color="#333333", linewidth=0.8, label=f"asked: {every:g} m")
        apart.legend(frameon=False, fontsize=9, loc="lower right")
    apart.set(xlabel="way flown, m", ylabel="from one picked photo to the next, m")
    apart.set_ylim(bottom=0.0)
    offset = picked.figures["offset"]
    hours = offset.get("whole_hours", 0)
    value = f"{hours:+d} h {offset['rest_s']:+.2f} s" if hours else f"{offset['offset_s']:+.2f} s"
    sure = f" ± {offset['sigma_s']:.2f} s" if offset["from"] == "motion" else ", as given"
    count, way_m = picked.figures["counts"]["photos"], picked.figures["way_m"]
    words = f"{len(chosen)} of {count} photos picked along {way_m:.1f} m; clock offset {value}{sure}"
    figure.suptitle(words, fontsize=12, x=0.02, ha="left")
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png", dpi=130)
