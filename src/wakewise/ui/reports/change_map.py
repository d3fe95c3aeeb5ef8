"""Picture of growth and loss: the signed distances of two surfaces, seen from above and from the side."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from wakewise.core.arrays import Array
from wakewise.core.files import whole_file
from wakewise.vision.evaluation.surface_change import SurfaceChange

LOSS_AND_GROWTH = "RdBu"
NOT_SEEN, BEHIND = "#b3b3b3", "#4a525c"
"""Places that one date does not show; what is behind the surface, which is nearly white where nothing changed."""


def write_change_map(path: Path, change: SurfaceChange) -> None:
    """Write a PNG, whole or not at all: the second surface in colours of its change, and how the changes spread."""
    surface, bed = change.second.surface, change.bed
    points = 1e3 * (surface.points_m - surface.points_m.mean(axis=0) if bed is None else bed.to_plane(surface.points_m))
    middle = points[surface.standing].mean(axis=0) if surface.standing.any() else points.mean(axis=0)
    points[:, :2] -= middle[:2]
    seen, mm = change.second.seen, 1e3 * change.second.change_m
    smallest = float(change.figures["smallest_change_mm"] or 0.0)
    limit = max(float(np.percentile(np.abs(mm[seen]), 99)), 1.5 * smallest)
    figure = Figure(figsize=(11.0, 6.2), layout="constrained", facecolor="white")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1.0))
    above, side, spread = (figure.add_subplot(place) for place in (grid[:, 0], grid[0, 1], grid[1, 1]))
    norm = Normalize(-limit, limit)
    size = max(1.8e6 * surface.cell_m2, 2.0)
    for axes, across, depth, label in ((above, 1, points[:, 2], "along, mm"), (side, 2, -points[:, 1], "height, mm")):
        order = np.argsort(depth)  # nearest to the eye last
        hidden = order[~seen[order]]
        axes.scatter(points[hidden, 0], points[hidden, across], s=size, c=NOT_SEEN, linewidths=0)
        order = order[seen[order]]
        drawn = axes.scatter(
            points[order, 0], points[order, across], s=size, c=mm[order], cmap=LOSS_AND_GROWTH, norm=norm, linewidths=0
        )
        axes.set(xlabel="across, mm", ylabel=label, aspect="equal", facecolor=BEHIND)
    above.set_title("from above", fontsize=10, loc="left")
    side.set_title("from the side", fontsize=10, loc="left")
    figure.colorbar(drawn, ax=above, label="growth (blue) and loss (red), mm", shrink=0.7, location="left")
    _histogram(spread, mm[change.colony], limit, smallest)
    words = change.verdict.split("; ")
    figure.suptitle("\n".join(words), fontsize=12, x=0.02, ha="left")
    with whole_file(path) as temporary:
        figure.savefig(temporary, format="png", dpi=130)


def _histogram(axes: Axes, mm: Array, limit: float, smallest: float) -> None:
    axes.axvspan(-smallest, smallest, color="#e8e8e8", zorder=0, label="cannot be told")
    axes.hist(np.clip(mm, -limit, limit), bins=60, range=(-limit, limit), color="#3b6ea5", density=True)
    axes.axvline(0.0, color="#333333", linewidth=0.8)
    axes.set(xlabel="change of the colony, mm", ylabel="share of its surface", yticks=[])
    axes.set_title("how the changes spread", fontsize=10, loc="left")
    axes.legend(frameon=False, fontsize=9, loc="upper left")
