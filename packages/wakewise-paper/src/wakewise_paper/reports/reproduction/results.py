"""The tables as Markdown pages with small plots, to be kept beside the code: layout as in qpbenchmark's reports.

README.md says on what machine, with which versions and seeds; a page and all trials (CSV) for each table; reproduced.md
what could and could not be reproduced, computed from the rows.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl
from matplotlib.figure import Figure

from wakewise.core.arrays import Array
from wakewise.core.files import whole_file, write_text
from wakewise.experiments.campaigns.statistics import smallest_effect
from wakewise.experiments.campaigns.summary import worst_trials
from wakewise.ui.reports.methods_compared import cost_text, methods_compared, profiles, winner_text
from wakewise.ui.reports.svg_style import CARD, CORAL, INK, LINE, MUTED, SAND, SLATE, TEAL, VIOLET
from wakewise.ui.reports.text import duration, number, shown
from wakewise_paper.flights import read_series
from wakewise_paper.reports.reproduction import plots, sentences
from wakewise_paper.reports.reproduction.model_sheet import model_sheet
from wakewise_paper.reproduction.claim import CIRCULAR, JUDGED, UNKNOWN, UNMEASURED, glances, tallies
from wakewise_paper.reproduction.run import COLUMNS, command_of
from wakewise_paper.reproduction.run import tables as compared_tables
from wakewise_paper.reproduction.worlds import water

INDEX, REPRODUCED = "README.md", "reproduced.md"
_LIGHT = {
    INK: "#12252d", MUTED: "#587079", LINE: "#d9e1e3", CARD: "#ffffff", TEAL: "#0b7285", CORAL: "#d9562b",
    VIOLET: "#6b4fa0", SAND: "#c8952a", SLATE: "#5c8096",
}  # fmt: skip
"""The page's stand-in colours in its light theme."""


def write_results(tables: Mapping[str, Mapping[str, Any]], store: Path, out: Path, note: str = "") -> Path:
    """Write README.md, a page and a list of trials for each table, reproduced.md, plots; the path of README.md.

    Parameters
    ----------
    tables : mapping
        As `wakewise_paper.reproduction.run.reproduce` gives them.
    store : Path
        The campaign's folder, where series lie.
    out : Path
        Folder; files of earlier runs with these names are replaced.
    note : str
        What readers should know of this run, below the title.
    """
    for name, table in tables.items():
        write_text(out / f"{name}.md", _page(table, store, out))
        _write_trials(table, out / f"{name}.csv")
    write_text(out / REPRODUCED, _reproduced(tables))
    write_text(out / INDEX, _index(tables, note))
    return out / INDEX


def standalone_svg(figure: Figure) -> str:
    """SVG of a figure in the light colours, without a date, so that the same figure is the same file."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", facecolor="white", metadata={"Date": None})
    text = buffer.getvalue()
    for stand_in, colour in _LIGHT.items():
        text = text.replace(stand_in, colour)
    return re.sub(r'\sd="[^"]+"', lambda m: re.sub(r"(\d\.\d{2})\d+", r"\1", m[0]), text)


def _write_trials(table: Mapping[str, Any], path: Path) -> None:
    """All trials of a table, a row each, if it has any."""
    rows = [
        {key: place[key] for key in ("world", "method", "target", "seed", "reason")}
        | {key: round(value, 6) if isinstance(value, float) else value for key, value in place["figures"].items()}
        for place in table["places"]
        if place["figures"] or place["reason"]
    ]
    if rows:
        write_text(path, pl.DataFrame(rows, infer_schema_length=None).write_csv())


def _index(tables: Mapping[str, Mapping[str, Any]], note: str) -> str:
    found = tallies({name: table["rows"] for name, table in tables.items()})
    lines = [
        "# The paper's tables beside ours",
        "",
        *([note, ""] if note else []),
        "## Figures of the paper that are met",
        "",
        "| where | met | of | surely | by every method | preliminary |",
        "|---|--:|--:|--:|--:|--:|",
        *(
            f"| {sentences.place_name(one.setup)} | {one.met} | {one.judged} | {one.surely} | {one.by_all} | "
            f"{one.preliminary} |"
            for one in found
        ),
        "",
        f"The paper's own set-up stands first; each other world is judged by itself. {sentences.RULES} Figure by "
        f"figure: [{REPRODUCED}]({REPRODUCED}).",
        "",
        "| table | what | trials | failed | most of one target | seeds | configuration | met |",
        "|---|---|--:|--:|--:|---|---|---|",
    ]
    for name, table in tables.items():
        seeds, config = _seeds(table["seeds"]), f"`{table['config_hash']}`" if table["made"] else ""
        met = (
            sentences.met_of({name: table["rows"]})
            if table["rows"]
            else "; ".join(table["why"].values()) or "nothing was made"
        )
        lines.append(
            f"| [{name}]({name}.md) | {table['title']} | {shown(table['made'])} | {shown(table['failed'])} | "
            f"{shown(table['trials'])} | "
            f"{seeds} | {config} | {met} |"
        )
    lines += [
        "",
        "## At a glance",
        "",
        "| table | world | first and next best, difference | at what cost |",
        "|---|---|---|---|",
    ]
    for name, table in tables.items():
        for one in glances(name, table["places"]):
            circular = " (circular)" if one.world in CIRCULAR else ""
            lines.append(f"| {name} | {one.world}{circular} | {winner_text(one)} | {cost_text(one)} |")
    lines += [
        "",
        "## How",
        "",
        "Made by `wakewise reproduce`, which goes on where it was stopped and adds what is new. Intervals hold 95 %: "
        "Student's t within targets for means and on logarithms for ratios, exact ones for shares. Differences are "
        "over pairs of one seed, all methods in the same water. No "
        "constant was tuned to the paper's outcome. How each table is measured, and in which "
        "world: [reproduce.md](../reproduce.md).",
        "",
        _power(tables),
        "",
        "## Machine and versions",
        "",
        "| | |",
        "|---|---|",
        *(f"| {name} | {value} |" for name, value in sentences.computer_description().items()),
        f"| time of all trials | {duration(sum(table['trial_s'] or 0.0 for table in tables.values()))} |",
    ]
    return "\n".join(lines) + "\n"


def _power(tables: Mapping[str, Mapping[str, Any]]) -> str:
    """What so many pairs can show at all."""
    rows = (row for table in tables.values() for row in table["rows"])
    pairs = sorted({row["n"] for row in rows if row["reading"] == "less_pct" and row["n"] is not None})
    shown = [(n, smallest_effect(n)) for n in pairs if n > 1]
    if not shown:
        return "With a single pair of trials no difference can be shown; read these tables as what to look at next."
    n, effect = shown[-1]
    return (
        f"The most pairs of one difference are {n}: they show, with a chance of 80 %, a difference of "
        f"{number(effect or 0.0)} times the spread between pairs (paired t-test), and no smaller one."
    )


def _page(table: Mapping[str, Any], store: Path, out: Path) -> str:
    name, rows = table["table"], table["rows"]
    lines = [f"# {name.capitalize()}: {table['title']}", ""]
    if not rows:
        return "\n".join([*lines, f"Not made: {'; '.join(table['why'].values()) or 'no trial gave a figure'}.", ""])
    lines += [
        f"{sentences.met_of({name: rows}).capitalize()}. {shown(table['made'])} "
        f"{'trial' if table['made'] == 1 else 'trials'}, {shown(table['failed'])} failed, "
        f"seeds {_seeds(table['seeds'])}, configuration `{table['config_hash']}`."
        + (f" Every trial: [{name}.csv]({name}.csv)." if any(place["figures"] for place in table["places"]) else ""),
        "",
    ]
    lines += [f"- *{world}*: {water(world).title}" for world in table["worlds"]]
    lines += [""] if table["worlds"] else []
    for title, figure in _plots(table, store):
        file = f"{name}-{re.sub(r'[^a-z0-9]+', '-', title.lower())}.svg"
        write_text(out / file, standalone_svg(figure))
        lines += [f"![{title}]({file})", ""]
    if name == "comparison":
        lines += _cells(rows)
        return "\n".join(lines) + "\n"
    if name == "wake":
        lines += _matrix(rows)
    for world in () if name == "wake" else dict.fromkeys(row["world"] for row in rows):
        lines += [] if world == "-" else [f"## {world}", ""]
        lines += _table(row for row in rows if row["world"] == world)
    lines += _worst(table, store, out)
    lines += ["## How each figure is measured", ""]
    lines += [f"- {how}" for how in dict.fromkeys(map(_how, rows))]
    if table["failures"]:
        lines += ["", "## Failed trials", ""]
        lines += [f"- {failure['trial']}: {failure['reason']}" for failure in table["failures"]]
    return "\n".join(lines) + "\n"


def _how(row: Mapping[str, Any]) -> str:
    """How a figure is measured, and where the paper has it."""
    return f"*{row['figure']}*: {row['how']}" + ("" if row["source"] is None else f" (paper: {row['source']})")


def _worst(table: Mapping[str, Any], store: Path, out: Path) -> list[str]:
    """The worst trial of each method in each world: its photographs and model, or which it was."""
    name, lines = table["table"], []
    for world in table["worlds"]:
        worst = worst_trials(JUDGED[name], world, table["places"])
        drawn = model_sheet(worst, store) if any("rmse_mm" in place["figures"] for place in worst.values()) else None
        if drawn is not None:
            file = f"{name}-worst-{world}.jpg"
            with whole_file(out / file) as temporary:
                temporary.write_bytes(drawn)
            lines += [f"![Worst trial of each method, {world}]({file})", ""]
        elif worst:
            figure, unit, scale, _ = JUDGED[name]
            told = (
                f"{method} seed {shown(place['seed'])} ({_told(place, figure, scale)})"
                for method, place in worst.items()
            )
            lines += [f"- {world}, {unit}: {', '.join(told)}"]
    if not lines:
        return []
    title = "Worst trial of each method"
    more = " First and last of three photographs; the model, coloured by its distance to the truth, red from 3 mm on."
    return [f"## {title}", "", *([more.strip(), ""] if lines[0].startswith("!") else []), *lines, ""]


def _told(place: Mapping[str, Any], figure: str, scale: float) -> str:
    value = place["figures"].get(figure)
    return "failed" if value is None else number(scale * float(value))


def _plots(table: Mapping[str, Any], store: Path) -> list[tuple[str, Figure]]:
    name, rows, places = table["table"], table["rows"], table["places"]
    drawn: list[tuple[str, Figure | None]] = []
    if name == "wake":
        drawn.append(("agreement", plots.agreement(rows)))
    elif name == "operator":
        drawn.append(("obedience", plots.obedience(rows)))
    elif name in JUDGED:
        drawn.append(("methods", methods_compared(JUDGED[name], places, rows)))
    if name == "dynamic":
        drawn.append(("profiles", profiles(JUDGED[name], places)))
    if name == "station":
        for world in table["worlds"]:
            series: dict[str, dict[str, Array]] = {}
            for method in ("mpc", "wake-aware"):
                place = next((p for p in places if (p["world"], p["method"]) == (world, method)), None)
                found = None if place is None else read_series(store / place["folder"])
                if found is not None:
                    series[method] = found
            if len(series) == 2:
                drawn.append((f"over time {world}", plots.over_time(_thinner(series))))
    return [(title, figure) for title, figure in drawn if figure is not None]


def _thinner(series: Mapping[str, Mapping[str, Array]]) -> dict[str, dict[str, Array]]:
    """Once a second: a plot for a page of text needs no more, and its file stays small."""
    found: dict[str, dict[str, Array]] = {}
    for method, one in series.items():
        every = max(1, len(one["time_s"]) // 180)
        found[method] = {key: value[::every] if value.ndim else value for key, value in one.items()}
    return found


def _table(rows: Any) -> list[str]:
    lines = [
        "| method | figure | of | paper | ours | 95 % | n | verdict | p (Holm) | d |",
        "|---|---|---|--:|--:|--:|--:|---|--:|--:|",
    ]
    for row in rows:
        ours = row.get("our_order") or sentences.our_value(row)
        paper = row["paper_says"] if row["paper"] is None and row["asked"] is not None else sentences.quoted(row)
        paper = row["paper_says"] if row["reading"] == "order" else paper
        p = "" if row.get("p_holm") is None else f"{row['p_holm']:.2g}"
        d = "" if row.get("d_z") is None else number(row["d_z"])
        mark = f"**{sentences.verdict(row)}**" if row["met"] else sentences.verdict(row)
        lines.append(
            f"| {row['method']} | {row['figure']} | {row['target'] or ''} | {paper} | {ours} | "
            f"{sentences.interval(row)} | "
            f"{shown(row['n'])} | {mark} | {p} | {d} |"
        )
    return [*lines, ""]


def _matrix(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Models against flows; bold is as good as the paper's."""
    flows = list(dict.fromkeys(row["target"] for row in rows))
    lines = [f"| model | figure | paper | {' | '.join(flows)} |", f"|---|---|--:|{'--:|' * len(flows)}"]
    for title, method in dict.fromkeys((row["figure"], row["method"]) for row in rows):
        own = {row["target"]: row for row in rows if (row["figure"], row["method"]) == (title, method)}
        first = next(iter(own.values()))
        unit = f", {first['unit']}" if first["unit"] else ""
        told = [sentences.value(own[flow]["ours"]) for flow in flows]
        cells = [f"**{t}**" if own[flow]["met"] else t for flow, t in zip(flows, told, strict=True)]
        lines.append(f"| {method} | {title}{unit} | {sentences.quoted(first)} | {' | '.join(cells)} |")
    return [*lines, ""]


def _cells(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The comparison as two tables, a row per method or approach, with the command that shows it."""
    lines: list[str] = []
    found = {(row["world"], row["method"], row["key"]): row for row in rows}
    for world in dict.fromkeys(row["world"] for row in rows):
        for title, names in compared_tables().items():
            heads = [f"{head}{f', {unit}' if unit else ''}" for _, head, unit, _ in COLUMNS]
            lines += [
                f"## {title}, {world}",
                "",
                f"| | {' | '.join(heads)} | shown by |",
                f"|---|{'--:|' * len(heads)}---|",
            ]
            for name in names:
                cells = [found.get((world, name, key)) for key, *_ in COLUMNS]
                if all(cell is None for cell in cells):
                    continue
                told = " | ".join("–" if cell is None else sentences.value(cell["ours"]) for cell in cells)
                lines.append(f"| {name} | {told} | `{command_of(name)}` |")
            lines.append("")
    return [*lines, "The paper's own cells are not quoted here; these are flown in their place.", ""]


def _reproduced(tables: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [
        "# What we could and could not reproduce, and why",
        "",
        "Every number below is computed from the trials of this folder. A figure is met where ours is as good as the "
        "paper's or better; where the paper's number is not known here but its direction is, the direction is asked. "
        f"{sentences.RULES} In the world *paper* the water is the planner's own wake model: circular.",
        "",
    ]
    for title, told in sentences.reproduced(tables).items():
        lines += [f"## {title}", "", *(f"- {line}" for line in told), ""]
    lines += ["## Why", "", *(f"- {line}" for line in _reasons(tables)), ""]
    lines += ["## Stated by the paper, not measured here", "", *(f"- {line}" for line in UNMEASURED), ""]
    lines += ["## What of the paper is not known here", "", *(f"- {line}" for line in UNKNOWN)]
    return "\n".join(lines) + "\n"


def _reasons(tables: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What the trials themselves say of why a figure is not met."""
    said = []
    for name in ("station", "flow", "ablation"):
        for world in tables.get(name, {}).get("worlds", ()):
            speeds = _means(tables[name], world, "target_speed_mean_m_s", ("mpc", "dp", "wake-aware"))
            if "mpc" in speeds and "wake-aware" in speeds:
                said.append(
                    f"*{name}, {world}*: there is {number(1e3 * speeds['mpc'])} mm/s of wash to take away with "
                    f"`mpc`, where the paper has 180; `wake-aware` leaves {number(1e3 * speeds['wake-aware'])}."
                )
    for world in tables.get("station", {}).get("worlds", ()):
        place, estimate, seen = (
            _means(tables["station"], world, f"{figure}_rmse_mm", ("wake-aware",)).get("wake-aware")
            for figure in ("position", "estimate", "tracking")
        )
        if place is not None and estimate is not None and seen is not None:
            said.append(
                f"*station, {world}*: the true place is {number(place)} mm off, the estimate of it {number(estimate)}, "
                f"which no controller can know (the paper's is 5.2 off, and its place 2.1); by its own estimate the "
                f"vehicle is {number(seen)} mm off."
            )
    if tables.get("station", {}).get("worlds"):
        said.append(
            "*station, energy*: least thrusts spend next to the least power that makes the same wrenches "
            "(docs/research-log/0080), and shares that spare the water spend more."
        )
    said += [
        f"*flow, {row['world']}*: PIV reads {number(1e3 * row['ours'])} mm/s where there is no wash at all, and sees "
        "nothing below that."
        for row in tables.get("flow", {}).get("rows", ())
        if row["key"] == "piv_floor_m_s" and row["ours"] is not None
    ]
    for world in tables.get("dynamic", {}).get("worlds", ()):
        sway = _means(tables["dynamic"], world, "sway_rms_mm")
        wash = _means(tables["dynamic"], world, "sway_wash_mm")
        rmse = _means(tables["dynamic"], world, "rmse_mm")
        if rmse:
            spread = max(rmse.values()) - min(rmse.values())
            words_ = f"*dynamic, {world}*: the methods' models lie within {number(spread)} mm of each other"
            if sway and wash:
                words_ += (
                    f"; the target sways by {number(max(sway.values()))} mm at most, of which the wash has "
                    f"{number(max(wash.values()))}"
                )
            else:
                words_ += "; the target is rigid, so water that moves shows only through the vehicle's pose and silt"
            said.append(words_ + ".")
    said += [
        f"*wake, {row['target']}*: the printed model has an R2 of {number(row['ours'])} near the axis."
        for row in tables.get("wake", {}).get("rows", ())
        if (row["method"], row["key"]) == ("paper", "r2_core") and row["ours"] is not None
    ]
    return said or ["the tables that would say it were not made"]


def _means(table: Mapping[str, Any], world: str, figure: str, methods: Sequence[str] | None = None) -> dict[str, float]:
    found: dict[str, list[float]] = {}
    for place in table["places"]:
        value = place["figures"].get(figure)
        if place["world"] == world and value is not None and (methods is None or place["method"] in methods):
            found.setdefault(place["method"], []).append(float(value))
    return {method: sum(values) / len(values) for method, values in found.items()}


def _seeds(seeds: Sequence[int]) -> str:
    if not seeds:
        return "none"
    return shown(seeds[0]) if len(seeds) == 1 else f"{shown(seeds[0])} to {shown(seeds[-1])}"
