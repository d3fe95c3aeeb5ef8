"""Plots of wake models against flows: predicted against measured, angular profile, decay along the axis."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.ui.reports.svg_style import CORAL, INK, LINE, MUTED, SAND, SLATE, TEAL, VIOLET, new_figure, style_axes
from wakewise.wake.jets import AxialJet
from wakewise.wake.samples import CORE, WAKE, JetSamples
from wakewise.wake.scores import predicted_speed
from wakewise_paper.wake_validation import MeasuredFlow, WakeValidation, axial_decay, exit_speeds, find_flow, profile

PROFILE_AT_M = 0.2
_DOTS = 250
_COLOURS = {
    "paper": CORAL,
    "paper-calibrated": SAND,
    "fitted": TEAL,
    "jet": SLATE,
    "jet-fitted": VIOLET,
    "linear": MUTED,
}
_DASHES = {"linear": (0, (1, 2)), "paper": (0, (5, 2)), "paper-calibrated": (0, (5, 2))}


def scatters(result: WakeValidation, flow: str) -> Figure:
    """Predicted against measured speed on the held-out rows of one flow, a panel per model."""
    measured = find_flow(result, flow)
    test = _fewer(measured.test)
    scale = exit_speeds(test)
    wake, core = WAKE.holds(test), CORE.holds(test)
    figure = new_figure(10.2, 6.4)
    panels = figure.subplots(2, 3).ravel()
    top = 1.08 * float((test.speed_m_s / scale).max())
    across = test.speed_m_s / scale
    for axes, (name, by_flow) in zip(panels, result.verdicts.items(), strict=False):
        up = predicted_speed(by_flow[flow].model, test) / scale
        style_axes(axes, grid="both")
        high = top if name != "paper" else max(1.05 * float(up.max()), top)
        axes.plot([0, top], [0, top], color=INK, linewidth=0.9)
        rest = ~wake
        for rows, colour, label in ((rest, LINE, "elsewhere"), (wake & ~core, TEAL, "B"), (core, CORAL, "A")):
            axes.plot(across[rows], up[rows], "o", color=colour, markersize=2.4, alpha=0.75, linewidth=0, label=label)
        axes.set_xlim(min(0.0, float(across.min())), top)
        axes.set_ylim(0, high)
        scores = by_flow[flow].scores
        words = ", ".join(
            f"{region} {_short(value)}" for region, value in (("A", scores.r2_core), ("B", scores.r2_wake))
        )
        axes.set_title(name, loc="left", color=INK, fontsize=10.5)
        axes.set_title(f"R2 {words}", loc="right", color=MUTED, fontsize=8.5)
    for axes in panels[3:]:
        axes.set_xlabel("measured over exit speed", color=MUTED, fontsize=9.5)
    for axes in panels[::3]:
        axes.set_ylabel("predicted over exit speed", color=MUTED, fontsize=9.5)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper right", ncols=3, frameon=False, fontsize=9, labelcolor=MUTED, markerscale=2
    )
    return figure


def _fewer(samples: JetSamples) -> JetSamples:
    """At most `_DOTS` rows, evenly picked: more dots only make the page heavy."""
    rows = np.zeros(len(samples), dtype=np.bool_)
    rows[np.unique(np.linspace(0, len(samples) - 1, _DOTS).astype(int))] = True
    return samples.take(rows)


def profiles(result: WakeValidation) -> Figure | None:
    """Angular profile at 0.2 m, a panel per flow."""

    def draw(axes: Axes, flow: MeasuredFlow) -> None:
        angle, speed, _ = profile(_one_thrust(flow), PROFILE_AT_M)
        thin = slice(None, None, 1 + len(angle) // 250)
        axes.plot(
            np.degrees(angle[thin]), speed[thin], "o", color=INK, markersize=2.6, alpha=0.5, linewidth=0, label="flow"
        )
        at = np.radians(np.linspace(0.0, 34.9, 200))
        for name, by_flow in result.verdicts.items():
            line = _exit_share(by_flow[flow.name].model, flow, PROFILE_AT_M * np.cos(at), PROFILE_AT_M * np.sin(at))
            _line(axes, name, np.degrees(at), line)
        axes.set_xlim(0, 35)
        axes.set_ylim(0, 1.35 * max(float(speed.max()), 0.1))

    return _panels(result, draw, "angle off the jet (deg)", "speed over exit speed")


def decays(result: WakeValidation) -> Figure | None:
    """Speed along the axis, a panel per flow."""

    def draw(axes: Axes, flow: MeasuredFlow) -> None:
        x, speed, _ = axial_decay(_one_thrust(flow))
        thin = slice(None, None, 1 + len(x) // 250)
        axes.plot(x[thin], speed[thin], "o", color=INK, markersize=2.6, alpha=0.5, linewidth=0, label="flow")
        at = np.geomspace(0.05, 0.65, 120)
        for name, by_flow in result.verdicts.items():
            _line(axes, name, at, _exit_share(by_flow[flow.name].model, flow, at, np.zeros_like(at)))
        axes.set_xscale("log")
        axes.set_yscale("log")
        ticks = [0.05, 0.1, 0.2, 0.4, 0.6]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_xticks([], minor=True)
        axes.set_xlim(0.05, 0.65)
        axes.set_ylim(0.1, 30)
        ticks = [0.1, 0.3, 1, 3, 10, 30]
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.set_yticks([], minor=True)

    return _panels(result, draw, "distance from the disk (m)", "speed over exit speed")


def _panels(result: WakeValidation, draw, x: str, y: str) -> Figure | None:  # type: ignore[no-untyped-def]
    flows = result.flows
    if not flows:
        return None
    rows = -(-len(flows) // 3)
    figure = new_figure(10.2, 2.9 * rows + 0.5)
    panels = np.atleast_1d(figure.subplots(rows, 3, squeeze=False)).ravel()
    for axes, flow in zip(panels, flows, strict=False):
        style_axes(axes, grid="both")
        draw(axes, flow)
        axes.set_title(flow.name, loc="left", color=INK, fontsize=10.5)
    for axes in panels[len(flows) :]:
        axes.set_visible(False)
    for k, axes in enumerate(panels[: len(flows)]):
        if k + 3 >= len(flows):
            axes.set_xlabel(x, color=MUTED, fontsize=9.5)
        if k % 3 == 0:
            axes.set_ylabel(y, color=MUTED, fontsize=9.5)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=7, frameon=False, fontsize=9, labelcolor=MUTED)
    return figure


def _one_thrust(flow: MeasuredFlow) -> JetSamples:
    """All positions of the strongest thrust that was held out."""
    thrust = float(np.unique(flow.test.thrust_N)[-1])
    return flow.samples.take(flow.samples.thrust_N == thrust)


def _line(axes: Axes, name: str, x: Array, y: Array) -> None:
    axes.plot(x, y, color=_COLOURS.get(name, SLATE), linewidth=1.6, linestyle=_DASHES.get(name, "-"), label=name)


def _exit_share(model: AxialJet, flow: MeasuredFlow, x: Array, r: Array) -> Array:
    """Speed of a model over the exit speed for the flow's disk, which no longer depends on thrust."""
    area = flow.samples.disk_area_m2
    return np.asarray(model.speed(x, r, 1.0, area) * np.sqrt(FRESH_WATER_KG_M3 * area))


def _short(value: float | None) -> str:
    return "—" if value is None else f"{value:.2f}" if value > -10 else f"{value:.0f}"
