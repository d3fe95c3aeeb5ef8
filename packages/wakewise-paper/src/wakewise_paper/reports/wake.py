"""One page on how good the wake models are: the paper's scatter plot, profiles, decay and table, for every flow.

Plots of wake models against flows: predicted against measured, angular profile, decay along the axis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from wakewise.core.arrays import Array
from wakewise.core.constants import FRESH_WATER_KG_M3
from wakewise.core.files import write_text
from wakewise.ui.reports.page import missing, plot, section, tile, whole_page
from wakewise.ui.reports.svg_style import CORAL, INK, LINE, MUTED, SAND, SLATE, TEAL, VIOLET, new_figure, style_axes
from wakewise.ui.reports.text import NONE, fixed, number, shown
from wakewise.wake.jets import AxialJet
from wakewise.wake.samples import CORE, WAKE, JetSamples, predicted_speed
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


def _panels(result: WakeValidation, draw: Callable[[Axes, MeasuredFlow], None], x: str, y: str) -> Figure | None:
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


_GOOD, _FAIR = 0.9, 0.5
_SEEN = {"oracle-swirl": "lattice, swirl", "oracle": "lattice, no swirl", "parcels": "parcels"}
_WORDS = {
    "paper": "the paper's formula as printed",
    "paper-calibrated": "the paper's formula, its gain fitted",
    "fitted": "cone with gain, two powers and softening fitted",
    "jet": "momentum-conserving round jet, one slope fitted",
    "jet-fitted": "Gaussian jet with virtual origin, four numbers fitted",
    "linear": "1/r within 45 deg, no angle; not fitted",
}


def write_wake_report(result: WakeValidation, values: Mapping[str, Any], out: Path) -> Path:
    """Write wake.html into a folder and give its path; `values` are the figures of the result."""
    path = out / "wake.html"
    write_text(path, wake_page(result, values))
    return path


def wake_page(result: WakeValidation, values: Mapping[str, Any]) -> str:
    """HTML of the report."""
    parts = (
        ("table", "R2"), ("scatter", "Predicted and measured"), ("profile", "Profile"), ("decay", "Decay"),
        ("numbers", "Numbers"), ("piv", "PIV"), ("flows", "Flows"),
    )  # fmt: skip
    links = "".join(f'<a href="#{anchor}">{title}</a>' for anchor, title in parts)
    body = (
        f'<header class="top">{_headline(values)}</header>'
        f'<nav class="parts" aria-label="parts"><div>{links}</div></nav><main>'
        f"{_table(result, values)}{_scatter(result, values)}{_profile(result)}{_decay(result)}{_numbers(values)}"
        f"{_piv(values)}{_flows(values)}</main>"
        "<footer>Speeds are along the jet. No flow was adjusted to a model. Made by Wakewise.</footer>"
    )
    return whole_page("Wake models against flows · Wakewise", body)


def main_flow(values: Mapping[str, Any]) -> str | None:
    """The flow that the page leads with: the swirling lattice jet if there is one, else the parcels."""
    there = list(values["flows"])
    return next((name for name in ("oracle-swirl", "oracle", "parcels") if name in there), there[0] if there else None)


def _headline(values: Mapping[str, Any]) -> str:
    name, paper = main_flow(values), values["paper"]
    if name is None:
        return "<h1>No flow could be had.</h1>"
    printed, ranked = values["models"]["paper"][name], _ranked(values)
    tiles, head, state, lines = [], "No model could be tested.", "", []
    if ranked:
        best, worst = ranked[0]
        good = worst >= _FAIR
        state = "good" if worst >= _GOOD else "" if good else "bad"
        head = f"Use {best}." if good else f"No model fits every flow; {best} comes nearest."
        flows = sum(values["models"][best][flow]["r2_core"] is not None for flow in values["flows"])
        lines.append(f"{best} ({_WORDS.get(best, best)}): its R2 is {_number(worst)} or better on all {flows} flows.")
        if len(ranked) > 1:
            second, low = ranked[1]
            lines[-1] += f" Next comes {second} ({_WORDS.get(second, second)}) with {_number(low)} at its worst."
        tiles += _tiles_of(best, values["models"][best][name], _SEEN.get(name, name))
    seen = _SEEN.get(name, name)
    tiles += [
        tile("paper claims", number(paper["r2_core"]), "", f"R2 in A, {number(paper['r2_wake'])} in B"),
        tile("as printed, A", _floored(printed["r2_core"]), "", f"R2 against the {seen}", "off"),
        tile("as printed, B", _floored(printed["r2_wake"]), "", f"R2 against the {seen}", "off"),
    ]
    grid = values["grid_convergence_pct"]
    tiles.append(tile("two grids", fixed(grid, 1), "%", "change of the lattice's speed at 0.3 m"))
    lines.append(
        "As printed, the paper's formula does not describe a thruster's jet."
        if _literal_fails(values)
        else "The paper's formula as printed meets at least one of the flows."
    )
    lines.append(
        "R2 is 1 for a model that is right everywhere, and negative where it is farther from the flow than a single "
        "mean speed would be. Calibrated models are tested on thrusts and positions that their fit has not seen."
    )
    said = "".join(f'<p class="why">{escape(line)}</p>' for line in lines)
    return (
        f'<p class="eyebrow"><span>which wake model to use</span></p><h1 class="{state}"><span class="mark"></span>'
        f'{escape(head)}</h1>{said}<dl class="tiles">{"".join(tiles)}</dl>'
    )


def _ranked(values: Mapping[str, Any]) -> list[tuple[str, float]]:
    """Models with their worst R2 over all flows and both regions, the best model first; the untested are left out."""
    found = []
    for model, cells in values["models"].items():
        known = [cell[key] for cell in cells.values() for key in ("r2_core", "r2_wake") if cell[key] is not None]
        if known:
            found.append((model, min(known)))
    return sorted(found, key=lambda each: -each[1])


def _tiles_of(model: str, cell: Mapping[str, Any], seen: str) -> list[str]:
    return [
        tile(
            f"{model}, {region}", _number(cell[key]), "", f"R2 against the {seen}",
            "ok" if cell[key] is not None and cell[key] >= _GOOD else "off",
        )
        for region, key in (("A", "r2_core"), ("B", "r2_wake"))
    ]  # fmt: skip


def _floored(value: float | None) -> str:
    """R2 for the head of the page: below -1 how far below says nothing more; the table has the number."""
    return "below −1" if value is not None and value < -1.0 else _number(value)


def _literal_fails(values: Mapping[str, Any]) -> bool:
    cells = values["models"]["paper"].values()
    known = [cell["r2_core"] for cell in cells if cell["r2_core"] is not None]
    return bool(known) and all(value < 0.0 for value in known)


def _table(result: WakeValidation, values: Mapping[str, Any]) -> str:
    flows = [*values["flows"], *result.absent]
    paper = values["paper"]
    tables = ""
    captions = {
        "r2_core": f"R2 in region A: |theta| &lt; 15°, 0.1–0.3 m (the paper: {number(paper['r2_core'])})",
        "r2_wake": f"R2 in region B: |theta| &lt; 30°, 0.1–0.5 m (the paper: {number(paper['r2_wake'])})",
        "bias_far_pct": "bias beyond 0.4 m on the axis side (|theta| &lt; 15°), in % of what is measured",
    }
    for key, caption in captions.items():
        head = "".join(f'<th class="num">{escape(name)}</th>' for name in flows)
        rows = ""
        for model, cells in values["models"].items():
            row = "".join(_value(cells[name], key) for name in flows)
            rows += f'<tr><td>{model}<br><small class="null">{_WORDS.get(model, "")}</small></td>{row}</tr>'
        tables += (
            f'<div class="wide"><table><caption>{caption}</caption><thead><tr><th>model</th>{head}</tr></thead>'
            f"<tbody>{rows}</tbody></table></div>"
        )
    lead = (
        "Models down, flows across, on the rows that were held out. R2 = 1 − Σ(u − model)² / Σ(u − mean)² of the speed "
        "along the jet, the mean taken per thrust, so that some thrusts being stronger explains nothing. "
        "“paper” and “linear” are not calibrated; the others are, on each flow's training part. The flows: "
        + "; ".join(f"<b>{escape(name)}</b>, {escape(flow['title'])}" for name, flow in values["flows"].items())
        + "."
    )
    return section("table", "How good is each model?", lead, tables + _plainly(values))


def _plainly(values: Mapping[str, Any]) -> str:
    """Where the literal model fails, in words."""
    lines = []
    for name, cell in values["models"]["paper"].items():
        if cell["r2_core"] is None or cell["r2_core"] >= _FAIR:
            continue
        bias = cell["bias_far_pct"]
        far = "" if bias is None else f", {fixed(bias, 0, sign=True)} % beyond 0.4 m"
        gain = values["models"]["paper-calibrated"][name]["r2_core"]
        then = (
            "" if gain is None else f" With its gain fitted it reaches {_number(gain)} in A: the shape is not a jet's."
        )
        lines.append(f"<li><b>{escape(name)}</b>: R2 {_number(cell['r2_core'])} in A{far}.{then}</li>")
    if not lines:
        return ""
    return f"<h3>Where the printed formula fails</h3><ul>{''.join(lines)}</ul>"


def _value(cell: Mapping[str, Any], key: str) -> str:
    value = cell[key]
    if value is None:
        return (
            f'<td class="num"><span class="null" title="{escape(cell.get("why", {}).get(key, ""))}">{NONE}</span></td>'
        )
    if key == "bias_far_pct":
        return f'<td class="num">{fixed(value, 0, sign=True)}</td>'
    bold = ' style="font-weight:650;color:var(--good)"' if value >= _GOOD else ""
    poor = ' style="color:var(--bad)"' if value < _FAIR else ""
    return f'<td class="num"{bold or poor}>{_number(value)}</td>'


def _number(value: float | None) -> str:
    if value is None:
        return NONE
    return f"{value:.3f}" if value > -1 else f"{value:.1f}" if value > -100 else f"{value:.0f}"


def _scatter(result: WakeValidation, values: Mapping[str, Any]) -> str:
    name = main_flow(values)
    if name is None:
        return section("scatter", "Predicted and measured", "", missing("the scatter", "no flow could be had"))
    others = [each for each in values["flows"] if each != name]
    lead = (
        "Every held-out point: measured speed across, predicted up, both over the exit speed √(T/ρA), so that all "
        "thrusts share one plot. On the line a model is right. The paper's formula as printed leaves the plot: its own "
        "panel has a scale of its own."
    )
    figures = plot(scatters(result, name), f"predicted against measured, {name}", f"Against {escape(name)}.")
    for other in others:
        caption = f"Against {escape(other)}."
        figures += (
            f"<details><summary>{escape(other)}</summary>"
            f"{plot(scatters(result, other), f'predicted against measured, {other}', caption)}</details>"
        )
    return section("scatter", "Predicted and measured", lead, figures)


def _profile(result: WakeValidation) -> str:
    lead = (
        "The angular profile 0.2 m from the disk's middle, over the exit speed. Dots are the flow (all thrusts), lines "
        "are the models; the formula as printed lies far above the plots. cos⁴θ falls to half at "
        "33°, these jets at 5 to 12°."
    )
    return section(
        "profile", "Profile at 0.2 m", lead, plot(profiles(result), "angular profile", "Half the jet; it is round.")
    )


def _decay(result: WakeValidation) -> str:
    lead = (
        "Speed on the axis against distance. The paper has 1/r²; jets keep their speed over a core of some six "
        "diameters and then fall as 1/x."
    )
    return section("decay", "Decay along the axis", lead, plot(decays(result), "axial decay", "Both axes logarithmic."))


def _numbers(values: Mapping[str, Any]) -> str:
    rows = ""
    for model, cells in values["models"].items():
        for flow, cell in cells.items():
            found = cell.get("parameters", {})
            if not found:
                continue
            shown = (f"{name} {_three(each['value'])}{_interval(each)}" for name, each in found.items())
            words = ", ".join(shown)
            notes = "; ".join(cell.get("warnings", []))
            rows += f"<tr><td>{model}</td><td>{escape(flow)}</td><td>{escape(words)}</td>"
            rows += f'<td class="text">{escape(notes)}</td></tr>'
    table = (
        '<div class="wide"><table><thead><tr><th>model</th><th>flow</th><th>numbers (95 % of fits)</th><th>notes</th>'
        f"</tr></thead><tbody>{rows}</tbody></table></div>"
    )
    lead = "What the fits found, and where 95 % of the fits to resampled thrusts and positions lie."
    return section("numbers", "Calibrated numbers", lead, table)


def _interval(figure: Mapping[str, Any]) -> str:
    if figure["low"] is None:
        return ""
    return f" ({_three(figure['low'])} to {_three(figure['high'])})"


def _three(value: float | None) -> str:
    return NONE if value is None else f"{round(value, 9):.3g}"


def _piv(values: Mapping[str, Any]) -> str:
    trips = values["piv"]["round_trips"]
    if not trips:
        return section("piv", "Virtual PIV", "", missing("the round trip", values["why"].get("piv", "not run")))
    rows = "".join(
        f"<tr><td>{escape(t['field'])}</td>"
        f'<td class="num">{fixed(t["median_px"], 4)}</td><td class="num">{fixed(t["rms_px"], 3)}</td>'
        f'<td class="num">{fixed(t["bias_px"], 4, sign=True)}</td><td class="num">{fixed(t["valid_pct"], 1)}</td></tr>'
        for t in trips
    )
    table = (
        '<div class="wide"><table><thead><tr><th>field</th><th class="num">median error, px</th>'
        '<th class="num">rms, px</th><th class="num">bias, px</th><th class="num">vectors kept, %</th></tr></thead>'
        f"<tbody>{rows}</tbody></table></div>"
    )
    real = values["piv"]["real_pairs"]
    if real is None:
        words = missing("the real pairs", values["why"].get("piv.real_pairs", "not there"))
    else:
        words = (
            f"<p>{shown(real['pairs'])} real pairs of a round jet: "
            f"{fixed(real['valid_pct'], 0)} % of the vectors kept, the fastest move {fixed(real['fastest_px'], 1)} px, "
            f"{fixed(real['along_jet_pct'], 0)} % of the "
            "fast ones along the jet. They come without scale and time: nothing can be said of speed.</p>"
        )
    lead = (
        "Synthetic pairs of a known field: 20 µm tracers (they follow the water within 23 µs), 0.02 per pixel, a light "
        "sheet, 120 frames per second, sensor noise. Windows of 64, 32 and 16 px with deformation."
    )
    return section("piv", "Virtual PIV", lead, table + words)


def _flows(values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(flow['title'])}</td><td class='text'>{escape(flow['note'])}</td>"
        f"<td class='text'>{escape(flow['split'])}</td><td class='num'>{shown(flow['points'])}</td>"
        f"<td class='num'>{shown(flow['test_points'])}</td></tr>"
        for name, flow in values["flows"].items()
    )
    absent = {
        name: cell["why"]["r2_core"] for name, cell in values["models"]["paper"].items() if name not in values["flows"]
    }
    gaps = "".join(missing(f"flow {name}", reason) for name, reason in absent.items())
    table = (
        '<div class="wide"><table><thead><tr><th>flow</th><th>what it is</th><th>source and limits</th><th>split</th>'
        f"<th class='num'>points</th><th class='num'>tested</th></tr></thead><tbody>{rows}</tbody></table></div>"
    )
    return section("flows", "The flows", "What the models were held against.", table + gaps)
