"""Plots of one trial: the path from above and from the side, the water over time, the thrusts, the errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from wakewise.core.arrays import Array, IntArray
from wakewise.ui.reports.errors import CloudErrors
from wakewise.ui.reports.svg_style import (
    CARD,
    CORAL,
    DASHES,
    ERROR_LIMIT_MM,
    INK,
    LINE,
    MUTED,
    SAND,
    SERIES,
    SLATE,
    TEAL,
    VIOLET,
    add_legend,
    error_colours,
    new_figure,
    style_axes,
    thinned,
)
from wakewise.ui.reports.trial import Trial

WIDTH_IN, NARROW_IN = 10.2, 4.0
"""Widths of a figure on a page and on a phone, where panels stand one below the other."""
_REVERSE, _FORWARD = (0.05, 0.42, 0.62), (0.85, 0.38, 0.12)
THRUSTS = LinearSegmentedColormap.from_list(
    "thrust",
    [(0.0, (*_REVERSE, 1.0)), (0.5, (*_REVERSE, 0.0)), (0.5, (*_FORWARD, 0.0)), (1.0, (*_FORWARD, 1.0))],
)
"""Opaque at full thrust, clear at none, so that a strip sits on light and dark pages alike."""


def legs(trial: Trial) -> Iterator[tuple[str, float, float]]:
    """Name, start and end in seconds of every leg in order."""
    time_s = trial.column("time_s")
    if trial.steps is None or time_s is None or "leg" not in trial.steps.columns:
        return
    names = trial.steps["leg"].fill_null("").to_numpy()
    starts = np.flatnonzero(np.r_[True, names[1:] != names[:-1]])
    for start, stop in zip(starts, np.r_[starts[1:], len(names) - 1], strict=True):
        yield str(names[start]), float(time_s[start]), float(time_s[stop])


def plan_and_side(trial: Trial, narrow: bool = False) -> Figure | None:
    """The flight from above (east to the right) and from the side (height above the bed)."""
    path = trial.positions("true")
    path = path if np.isfinite(path).any() else trial.positions("est")
    poses = [shot.X_WC_true or shot.X_WC_est for shot in trial.photographs]
    cameras = [pose for pose in poses if pose is not None]
    if len(path) == 0 and not cameras:
        return None
    figure = new_figure(*((NARROW_IN, 7.0) if narrow else (WIDTH_IN, 5.0)))
    above, side = figure.subplots(2, 1, height_ratios=(1.35, 1.0)) if narrow else figure.subplots(
        1, 2, width_ratios=(1.0, 1.25)
    )  # fmt: skip
    for axes, across, up, labels in (
        (above, 1, 0, ("east (m)", "north (m)")),
        (side, 1, 2, ("east (m)", "height above the bed (m)")),
    ):
        style_axes(axes, x=labels[0], y=labels[1], grid="both")

        def flat(points: Array, across: int = across, up: int = up) -> Array:
            vertical = trial.bed_z_m - points[..., 2] if up == 2 else points[..., up]
            return np.stack([points[..., across], vertical], axis=-1)

        if trial.truth is not None:
            shapes = outlines(flat(trial.truth.vertices_m), trial.truth.faces)
            axes.add_collection(PolyCollection(shapes, facecolor=SAND, edgecolor="none", label="target"))
        if len(path):
            axes.plot(*flat(path[:: max(1, len(path) // 1500)]).T, color=TEAL, linewidth=1.3, label="vehicle")
        if cameras:
            eyes = flat(np.array([pose.p_m for pose in cameras]))
            views = flat(np.array([pose.p_m + 0.09 * pose.R[:, 2] for pose in cameras])) - eyes
            axes.quiver(*eyes.T, *views.T, color=CORAL, angles="xy", scale_units="xy", scale=1, width=0.0032, zorder=4)
            axes.plot(*eyes.T, "o", color=CORAL, markersize=3, label="photograph")
        if trial.planned:
            desired = flat(np.array([pose.p_m for pose in trial.planned]))
            axes.plot(*desired.T, "+", color=MUTED, markersize=6, label="planned viewpoint")
        axes.set_aspect("equal", adjustable="datalim")
    side.axhline(0.0, color=INK, linewidth=1.2)
    side.annotate(
        "bed", (0.995, 0.0), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=MUTED, fontsize=9,
        xytext=(0, 2), textcoords="offset points",
    )  # fmt: skip
    if side.get_ylim()[1] > trial.bed_z_m > 0:
        side.axhline(trial.bed_z_m, color=TEAL, linewidth=0.8, linestyle=(0, (6, 4)))
    above.set_title("from above", loc="left", color=INK, fontsize=10.5)
    side.set_title("from the south", loc="left", color=INK, fontsize=10.5)
    handles, names = side.get_legend_handles_labels()
    columns = 2 if narrow else 4
    figure.legend(
        handles, names, loc="outside upper right", ncols=columns, frameon=False, fontsize=9, labelcolor=MUTED,
    )  # fmt: skip
    return figure


def outlines(points: Array, faces: IntArray, pixels: int = 700) -> list[Array]:
    """Outer outlines, each of shape (k, 2), of a mesh seen along the third axis; points has shape (n, 2)."""
    low, span = points.min(axis=0), float(np.ptp(points, axis=0).max()) or 1.0
    shadow = np.zeros((pixels + 9, pixels + 9), np.uint8)
    for triangle in np.round((points - low) / span * pixels + 4)[faces].astype(np.int32):
        cv2.fillConvexPoly(shadow, triangle, 1)
    found, _ = cv2.findContours(shadow, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    return [(line[:, 0] - 4.0) / pixels * span + low for line in found if len(line) > 2]


def water_over_time(trial: Trial, narrow: bool = False) -> Figure | None:
    """Speeds at target and bed, disturbance, turbidity and position error, on one clock with the exposures."""
    time_s = trial.column("time_s")
    if time_s is None:
        return None
    rows = list(_water_rows(trial))
    if not rows:
        return None
    figure = new_figure(NARROW_IN if narrow else WIDTH_IN, 0.7 + 1.45 * len(rows))
    buckets = 200 if narrow else 900
    grid = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    exposures = exposure_times(trial)
    for axes, (label, lines) in zip(grid, rows, strict=True):
        style_axes(axes, y=label)
        for (name, values, colour), width in zip(lines, (1.4, 1.1, 1.0), strict=False):
            axes.plot(*thinned(time_s, values, buckets), color=colour, linewidth=width, label=name)
        top = max(float(np.nanmax(values)) for _, values, _ in lines)
        axes.set_ylim(0.0, 1.22 * top if top > 0 else 1.0)
        axes.vlines(exposures, 0.0, 0.06, transform=axes.get_xaxis_transform(), color=CORAL, linewidth=1.1)
        shade_legs(axes, trial)
        if len(lines) > 1:
            add_legend(axes, loc="upper right", ncols=3, borderaxespad=0.1)
        axes.margins(x=0.0)
    name_legs(grid[0], trial)
    grid[-1].set_xlabel("time (s)", color=MUTED, fontsize=9.5)
    figure.align_ylabels()
    return figure


def exposure_times(trial: Trial) -> Array:
    """When the shutter opened, in seconds, shape (k,)."""
    if trial.photographs:
        return np.array([shot.time_s for shot in trial.photographs])
    time_s, exposing = trial.column("time_s"), trial.column("exposing")
    return np.empty(0) if time_s is None or exposing is None else time_s[exposing > 0.5]


def position_error_m(trial: Trial, prefix: str, reference: str) -> Array | None:
    """Distance between two of the recorded positions, shape (n,), None unless both were recorded."""
    a, b = trial.positions(prefix), trial.positions(reference)
    if len(a) == 0 or len(b) == 0:
        return None
    distance = np.asarray(np.linalg.norm(a - b, axis=1), np.float64)
    return distance if np.isfinite(distance).any() else None


def _water_rows(trial: Trial) -> Iterator[tuple[str, list[tuple[str, Array, str]]]]:
    def lines(*wanted: tuple[str, Array | None, float, str]) -> list[tuple[str, Array, str]]:
        return [(name, scale * values, colour) for name, values, scale, colour in wanted if values is not None]

    yield from (
        (label, found)
        for label, found in (
            (
                "water speed at\nthe target (mm/s)",
                lines(
                    ("mean", trial.column("target_speed_mean_m_s"), 1e3, TEAL),
                    ("95th percentile", trial.column("target_speed_p95_m_s"), 1e3, SAND),
                ),
            ),
            ("speed at the bed,\np95 (mm/s)", lines(("p95", trial.column("bed_speed_p95_m_s"), 1e3, SLATE))),
            ("D, by the wake\nmodel (m²/s²)", lines(("D", trial.column("disturbance"), 1.0, VIOLET))),
            ("turbidity (1/m)", lines(("turbidity", trial.column("turbidity_per_m"), 1.0, SLATE))),
            (
                "position error\n(mm)",
                lines(
                    ("from the goal", position_error_m(trial, "true", "goal"), 1e3, CORAL),
                    ("of the estimate", position_error_m(trial, "est", "true"), 1e3, TEAL),
                ),
            ),
        )
        if found
    )


def shade_legs(axes: Axes, trial: Trial) -> None:
    """Shade every other leg, so that the plots of one clock can be read together."""
    for i, (_, start, stop) in enumerate(legs(trial)):
        if i % 2:
            axes.axvspan(start, stop, color=LINE, alpha=0.35, linewidth=0, zorder=0)


def name_legs(axes: Axes, trial: Trial) -> None:
    """Write the names of the legs above axes where there is room for them."""
    spans = list(legs(trial))
    if not spans:
        return
    whole = max(spans[-1][2] - spans[0][1], 1e-9)
    for name, start, stop in spans:
        if (stop - start) / whole > 0.11 / cast("Figure", axes.figure).get_figwidth() * len(name):
            axes.annotate(
                name, (0.5 * (start + stop), 1.0), xycoords=("data", "axes fraction"), ha="center", va="bottom",
                color=MUTED, fontsize=9, xytext=(0, 3), textcoords="offset points",
            )  # fmt: skip


def thrust_strip(trial: Trial, names_of: Sequence[str] = (), narrow: bool = False) -> Figure | None:
    """Thrust of every thruster over time, one row each; forward and reverse in two colours.

    `names_of` are the thrusters' names in their order, where the vehicle is known.
    """
    time_s = trial.column("time_s")
    names = thrust_columns(trial)
    if trial.steps is None or time_s is None or not names:
        return None
    thrusts = trial.steps.select(names).to_numpy().astype(np.float64).T
    buckets = min(400 if narrow else 1100, thrusts.shape[1])
    edges = np.linspace(0, thrusts.shape[1], buckets + 1).astype(int)
    shown = np.add.reduceat(np.nan_to_num(thrusts), edges[:-1], axis=1) / np.diff(edges)
    rms = np.sqrt(np.nanmean(thrusts**2, axis=1))
    limit = max(float(np.quantile(np.abs(shown), 0.995)), 1e-6)
    figure = new_figure(NARROW_IN if narrow else WIDTH_IN, 0.8 + 0.3 * len(names))
    strip, bars = figure.subplots(1, 2, width_ratios=(4.0, 1.0) if narrow else (9.0, 1.0), sharey=True)
    named = len(names_of) == len(names)
    style_axes(strip, x="time (s)", y="" if named else "thruster", grid="")
    style_axes(bars, x="rms (N)", grid="x")
    image = strip.imshow(
        shown, aspect="auto", cmap=THRUSTS, vmin=-limit, vmax=limit, interpolation="nearest",
        extent=(float(time_s[0]), float(time_s[-1]), len(names) + 0.5, 0.5),
    )  # fmt: skip
    for row in range(1, len(names)):
        strip.axhline(row + 0.5, color=CARD, linewidth=2)
    labels = [f"{name} {i}" for i, name in enumerate(names_of, start=1)] if named else None
    if narrow and labels is not None:
        labels = [label.replace(" horizontal", " h.").replace(" vertical", " v.") for label in labels]
    strip.set_yticks(range(1, len(names) + 1), labels)
    strip.set_ylim(len(names) + 0.5, 0.5)
    strip.vlines(exposure_times(trial), 0.0, -0.025, transform=strip.get_xaxis_transform(), color=CORAL, clip_on=False)
    bars.barh(range(1, len(names) + 1), rms, height=0.62, color=SLATE)
    bars.tick_params(axis="y", length=0)
    if narrow:
        bar = figure.colorbar(image, ax=[strip, bars], location="bottom", pad=0.02, aspect=30, extend="both")
    else:
        bar = figure.colorbar(image, ax=bars, pad=0.12, aspect=18, extend="both")
    bar.outline.set_visible(False)
    bar.ax.tick_params(colors=MUTED, labelsize=9, length=3)
    bar.set_label("thrust (N)", color=MUTED, fontsize=9.5)
    name_legs(strip, trial)
    return figure


def thrust_columns(trial: Trial) -> list[str]:
    """Columns of actual thrusts in the order of the thrusters."""
    if trial.steps is None:
        return []
    names = [name for name in trial.steps.columns if name.startswith("thrust_") and name.endswith("_N")]
    numbers = {name: name.removeprefix("thrust_").removesuffix("_N") for name in names}
    return sorted((name for name in names if numbers[name].isdigit()), key=lambda name: int(numbers[name]))


def error_histogram(errors: CloudErrors, narrow: bool = False) -> Figure:
    """How many points of the model are how far from the truth, and how much of the truth is covered how nearly."""
    figure = new_figure(*((NARROW_IN, 5.6) if narrow else (WIDTH_IN, 3.3)))
    accuracy, coverage = figure.subplots(*((2, 1) if narrow else (1, 2)))
    error_mm = 1e3 * errors.accuracy_m
    edges = np.linspace(0.0, 5.0, 51)
    shares = 100.0 * np.histogram(np.minimum(error_mm, 4.999), edges)[0] / len(error_mm)
    style_axes(accuracy, x="distance from the true surface (mm)", y="points of the model (%)")
    colours = error_colours(1e-3 * 0.5 * (edges[1:] + edges[:-1]))
    accuracy.bar(edges[:-1], shares, np.diff(edges), align="edge", color=colours, edgecolor=MUTED, linewidth=0.4)
    accuracy.set_xlim(0.0, 5.0)
    beyond = 100.0 * float((error_mm >= edges[-1]).mean())
    accuracy.set_title("accuracy: model to truth", loc="left", color=INK, fontsize=10.5)
    median = float(np.median(error_mm))
    accuracy.axvline(median, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
    accuracy.annotate(
        f"median {median:.2f} mm\n{beyond:.1f} % beyond {edges[-1]:g} mm", (1.0, 1.0), xycoords="axes fraction",
        ha="right", va="top", color=MUTED, fontsize=9,
    )  # fmt: skip
    style_axes(coverage, x="within (mm)", y="true surface covered (%)")
    within = np.linspace(0.0, 5.0, 101)
    covered = [errors.completeness_pct(1e-3 * w) for w in within]
    coverage.fill_between(within, covered, color=TEAL, alpha=0.16, linewidth=0)
    coverage.plot(within, covered, color=TEAL, linewidth=1.6)
    for limit in (1.0, 2.0, 3.0):
        share = errors.completeness_pct(1e-3 * limit)
        coverage.plot([limit], [share], "o", color=TEAL, markersize=5)
        coverage.annotate(
            f"{share:.1f} %", (limit, share), xytext=(6, -12), textcoords="offset points", color=INK, fontsize=9.5
        )
    coverage.axvline(ERROR_LIMIT_MM, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    coverage.set_xlim(0.0, 5.0)
    coverage.set_ylim(0.0, 104.0)
    coverage.set_title("completeness: truth to model", loc="left", color=INK, fontsize=10.5)
    return figure


def overlaid_speeds(trials: dict[str, Trial], narrow: bool = False) -> Figure | None:
    """Mean water speed at the target of several trials on one clock, and how much of the time each was below what."""
    found = {
        name: (time_s, 1e3 * speed)
        for name, trial in trials.items()
        if (time_s := trial.column("time_s")) is not None
        and (speed := trial.column("target_speed_mean_m_s")) is not None
    }
    if not found:
        return None
    figure = new_figure(*((NARROW_IN, 5.8) if narrow else (WIDTH_IN, 3.6)))
    clock, shares = figure.subplots(2, 1) if narrow else figure.subplots(1, 2, width_ratios=(2.4, 1.0))
    style_axes(clock, x="time (s)", y="mean water speed at the target (mm/s)" if not narrow else "mean speed (mm/s)")
    style_axes(shares, x="water speed (mm/s)", y="share of the time below (%)", grid="both")
    for k, (name, (time_s, speed)) in enumerate(found.items()):
        colour, dashes = SERIES[k % len(SERIES)], DASHES[k % len(DASHES)]
        times, speeds = thinned(time_s, speed, 200 if narrow else 900)
        clock.plot(times, speeds, color=colour, linestyle=dashes, linewidth=1.1, label=name)
        ordered = np.sort(speed[np.isfinite(speed)])
        pick = np.unique(np.linspace(0, len(ordered) - 1, 300).astype(int))
        shares.plot(ordered[pick], 100.0 * (pick + 1) / len(ordered), color=colour, linestyle=dashes, linewidth=1.6)
    clock.set_ylim(bottom=0.0)
    clock.margins(x=0.0)
    shares.set_xlim(left=0.0)
    shares.set_ylim(0.0, 102.0)
    add_legend(clock, loc="upper left", bbox_to_anchor=(0.0, 1.14), ncols=4, borderaxespad=0.0)
    return figure
