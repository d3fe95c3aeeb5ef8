"""Write the README's animation: a flight with `dp` and one with `wake-aware`, from above, water coloured by its wash.

Both fly the preset `quick`, seed 1, in the same simulated water. The colour is the true speed that the thrusters add to
the water, in the level plane through the target's middle; the vehicle flies above it. Bars are the thrusts given.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.patches import Polygon
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

import wakewise as ww
from wakewise.operation.loop import Step

OUT = Path(__file__).parents[1] / "docs" / "images" / "wash.webp"
FROM_S, TO_S, EVERY_S = 17.0, 83.0, 1.0
"""The orbits, without the approach, shown at seven times their speed."""
FRAMES_HZ = 7
HALF_M, CELLS = 1.0, 64
MOST_CM_S = 20.0
BACKGROUND, INK = "#0b1d2a", "#f2f2f2"

Array = NDArray[np.float64]


@dataclass
class Flown:
    """What is kept of one flight: by frame the time, outline, thrusts and speeds; the running mean at the target."""

    method: str
    grid_W_m: Array
    times_s: list[float] = field(default_factory=list)
    hulls: list[Array] = field(default_factory=list)
    thrusts_N: list[Array] = field(default_factory=list)
    speeds_m_s: list[Array] = field(default_factory=list)
    target_m_s: list[float] = field(default_factory=list)


def flown(method: str) -> tuple[Flown, ww.Parts]:
    """Fly with one method and keep its frames."""
    parts = ww.Scenario.preset("quick", seed=1).parts().replace(method=method)
    axis = np.linspace(-HALF_M, HALF_M, CELLS)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    centre = parts.target.centre_W_m
    kept = Flown(method, np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) + centre)
    length, width = parts.vehicle.size_m[:2] / 2.0
    corners = np.array([[length, width], [length, -width], [-length, -width], [-length, width], [length, width]])
    corners = np.column_stack([corners, np.zeros(len(corners))])

    def watch(step: Step, truth_provider: Any) -> None:
        due = FROM_S + EVERY_S * len(kept.times_s)
        if step.truth is None or step.time_s < due or due > TO_S:
            return
        kept.times_s.append(step.time_s)
        kept.hulls.append(step.truth.state.X_WB.apply(corners) - centre)
        kept.thrusts_N.append(step.truth.thrusts_N)
        kept.speeds_m_s.append(
            np.linalg.norm(truth_provider.excess_velocity(kept.grid_W_m), axis=1).reshape(CELLS, CELLS)
        )
        kept.target_m_s.append(float(truth_provider.water().target_speed_mean_m_s))

    ww.fly(parts, watch=watch)
    return kept, parts


def drawn(both: list[tuple[Flown, ww.Parts]], out: Path) -> None:
    """Write the animation."""
    plt.rcParams.update({"font.size": 11, "text.color": INK, "axes.labelcolor": INK, "xtick.color": INK})
    figure, axes = plt.subplots(
        2, 2, figsize=(8.4, 5.6), height_ratios=(5, 1), facecolor=BACKGROUND, layout="constrained"
    )
    most_N = max(float(np.abs(thrusts).max()) for kept, _ in both for thrusts in kept.thrusts_N)
    panels = []
    for (kept, parts), water, bars in zip(both, axes[0], axes[1], strict=True):
        image = water.imshow(
            100.0 * kept.speeds_m_s[0],
            extent=(-HALF_M, HALF_M, -HALF_M, HALF_M),
            origin="lower",
            cmap="inferno",
            vmin=0.0,
            vmax=MOST_CM_S,
            interpolation="bilinear",
        )
        plan = parts.target.mesh.vertices_m[:, :2] - parts.target.centre_W_m[:2]
        outline = plan[ConvexHull(plan).vertices]
        water.add_patch(Polygon(outline[:, ::-1], fill=False, edgecolor="#5ad1c8", linewidth=1.5))
        (hull,) = water.plot([], [], color=INK, linewidth=1.5)
        box = {"facecolor": BACKGROUND, "edgecolor": "none", "alpha": 0.7}
        words = water.text(0.03, 0.94, "", transform=water.transAxes, fontsize=11, bbox=box)
        water.set(xticks=[], yticks=[], facecolor=BACKGROUND)
        names = {"dp": "dp: least thrusts", "wake-aware": "wake-aware: null space used"}
        water.set_title(names[kept.method], color=INK, fontsize=13)
        columns = bars.bar(range(1, len(kept.thrusts_N[0]) + 1), kept.thrusts_N[0], color="#5ad1c8")
        bars.axhline(0.0, color=INK, linewidth=0.8)
        bars.set(ylim=(-most_N, most_N), yticks=[], xticks=range(1, len(columns) + 1), facecolor=BACKGROUND)
        bars.set_xlabel(f"thrust of each thruster, full height {most_N:.0f} N")
        for spine in (*bars.spines.values(), *water.spines.values()):
            spine.set_visible(False)
        panels.append((kept, image, hull, words, columns))
    scale = figure.colorbar(panels[-1][1], ax=list(axes[0]), shrink=0.9, label="speed added by the thrusters (cm/s)")
    scale.ax.tick_params(colors=INK)

    def frame(k: int) -> list[Any]:
        for kept, image, hull, words, columns in panels:
            image.set_data(100.0 * kept.speeds_m_s[k])
            hull.set_data(kept.hulls[k][:, 1], kept.hulls[k][:, 0])
            mean = 1e3 * float(np.mean(kept.target_m_s[: k + 1]))
            words.set_text(f"at the target {1e3 * kept.target_m_s[k]:.0f} mm/s, mean so far {mean:.0f}")
            for column, thrust in zip(columns, kept.thrusts_N[k], strict=True):
                column.set_height(thrust)
        return []

    count = min(len(kept.times_s) for kept, _ in both)
    animation = FuncAnimation(figure, frame, frames=count, blit=False)
    animation.save(out, writer=PillowWriter(fps=FRAMES_HZ), dpi=78, savefig_kwargs={"facecolor": BACKGROUND})
    plt.close(figure)


def main() -> None:
    """Fly, draw and say where the file is."""
    out = Path(sys.argv[1]) if sys.argv[1:] else OUT
    drawn([flown(method) for method in ("dp", "wake-aware")], out)
    print(f"{out} ({out.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
