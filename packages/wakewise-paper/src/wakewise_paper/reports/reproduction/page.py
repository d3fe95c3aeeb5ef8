"""One page of all tables that were made, with pictures: at a glance, then table by table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from wakewise.core.arrays import Array
from wakewise.core.files import write_text
from wakewise.ui.reports.methods_compared import cost_text, methods_compared, profiles, winner_text, worst_panels
from wakewise.ui.reports.page import collapsible_section, missing, plot, prose, section, whole_page
from wakewise.ui.reports.text import NONE, duration, number, shown
from wakewise_paper.flights import read_series
from wakewise_paper.reports.reproduction import plots, sentences
from wakewise_paper.reproduction.claim import (
    CIRCULAR,
    JUDGED,
    OWN_SETUP,
    UNKNOWN,
    UNMEASURED,
    glances,
    tallies,
)
from wakewise_paper.reproduction.worlds import water

PAGE = "reproduce.html"
_TEMPORAL = ("mpc", "wake-aware")
_SCANNED = ("dynamic", "success", "sediment", "field")


def write_pages(tables: Mapping[str, Mapping[str, Any]], store: Path, out: Path) -> Path:
    """Write the page, and give its path.

    Parameters
    ----------
    tables : mapping
        As `wakewise_paper.reproduction.run.reproduce` gives them.
    store : Path
        The campaign's folder, where pictures and series lie.
    out : Path
        Folder.
    """
    path = out / PAGE
    write_text(path, tables_page(tables, store))
    return path


def tables_page(tables: Mapping[str, Mapping[str, Any]], store: Path) -> str:
    """HTML of the page."""
    made = {name: table for name, table in tables.items() if table["rows"]}
    links = '<a href="#glance">At a glance</a>' + "".join(f'<a href="#{name}">{name}</a>' for name in tables)
    links += '<a href="#limits">What is not known</a>'
    body = (
        f'<header class="top">{_head(tables)}</header>'
        f'<nav class="parts" aria-label="parts"><div>{links}</div></nav><main>{_glance(made)}'
        + "".join(_table(table, store) for table in tables.values())
        + f"{_limits(made)}</main><footer>Intervals hold 95 %. Made by Wakewise.</footer>"
    )
    return whole_page("The paper's tables beside ours · Wakewise", body)


def _head(tables: Mapping[str, Mapping[str, Any]]) -> str:
    found = tallies({name: table["rows"] for name, table in tables.items()})
    trials, failed = (sum(table[key] or 0 for table in tables.values()) for key in ("made", "failed"))
    took = duration(sum(table["trial_s"] or 0.0 for table in tables.values()))
    own = next((one for one in found if one.setup == OWN_SETUP), None)
    title = (
        f"{own.met} of {own.judged} figures met {sentences.place_name(OWN_SETUP)}; {own.surely or 'none'} surely"
        if own is not None
        else "No figure of the paper is judged in its own set-up"
    )
    circular = any(w in CIRCULAR for table in tables.values() for w in table["worlds"])
    caution = (
        '<p class="caution"><b>Circular.</b> In the world <i>paper</i> the water is the planner\'s own wake model: '
        "what is met there says what a method does with its freedom, not what water does.</p>"
        if circular
        else ""
    )
    few = max((table["trials"] or 0 for table in tables.values() if table["worlds"]), default=0)
    if 0 < few < 3:
        words_ = "one trial" if few == 1 else "two trials"
        caution += (
            f'<p class="caution"><b>Few.</b> At most {words_} of each method and target: read it as what to look at '
            "next. More: <code>--trials</code> or <code>--budget</code>.</p>"
        )
    return (
        f'<p class="eyebrow"><span>the paper\'s tables, and ours</span><span><b>{trials}</b> trials, {failed} failed'
        f"</span><span>{took} of trials</span></p><h1>{escape(title)}</h1>"
        f'<p class="why">{escape(_upper(sentences.met_of({name: table["rows"] for name, table in tables.items()})))}. '
        f"{escape(sentences.RULES.replace('*', ''))}</p>{caution}"
    )


def _glance(tables: Mapping[str, Mapping[str, Any]]) -> str:
    rows = []
    for name, table in tables.items():
        for one in glances(name, table["places"]):
            circular = " (circular)" if one.world in CIRCULAR else ""
            rows.append(
                f'<tr><td><a href="#{name}">{name}</a></td><td>{escape(one.world)}{circular}</td>'
                f"<td>{escape(winner_text(one))}</td><td>{escape(cost_text(one))}</td>"
                f'<td class="num">{one.trials}</td></tr>'
            )
    if not rows:
        return ""
    table_ = (
        "<table><thead><tr><th>table</th><th>world</th><th>first and next best, difference</th>"
        f'<th>at what cost</th><th class="num">trials</th></tr></thead><tbody>{"".join(rows)}</tbody></table>'
    )
    lead = "Over the seeds that all methods of a table flew. Models that were not made count as the worst."
    return section("glance", "At a glance", lead, f'<div class="wide">{table_}</div>')


def _table(table: Mapping[str, Any], store: Path) -> str:
    name, rows, places = table["table"], table["rows"], table["places"]
    if not rows:
        why = "; ".join(table["why"].values()) or "no trial of it gave a figure"
        return section(name, name.capitalize(), escape(table["title"]), missing(f"the table of {name}", why))
    lead = (
        f"{escape(_upper(table['title']))}. {escape(_upper(sentences.met_of({name: rows})))}. "
        f"{shown(table['made'])} {'trial' if table['made'] == 1 else 'trials'}, {shown(table['failed'])} failed; "
        "configuration "
        f"{table['config_hash']}."
    )
    worlds = "".join(f"<dt>{escape(w)}</dt><dd>{prose(water(w).title)}</dd>" for w in table["worlds"])
    parts = [f'<dl class="facts">{worlds}</dl>' if worlds else "", _drawn(table)]
    parts.append(_matrix(rows) if name == "wake" else _rows(rows))
    if name == "station":
        parts.append(_temporal(places, store))
    if name in _SCANNED:
        parts.append(worst_panels(JUDGED[name], places, store))
    if table["failures"]:
        items = "".join(f"<li>{escape(f['trial'])}: {escape(str(f['reason']))}</li>" for f in table["failures"])
        parts.append(collapsible_section("Failed trials", f"<ul>{items}</ul>", f"{len(table['failures'])}"))
    return section(name, name.capitalize(), lead, "".join(parts))


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def _drawn(table: Mapping[str, Any]) -> str:
    """The table as a plot, if it is one of methods, models or weights."""
    name, rows, places = table["table"], table["rows"], table["places"]
    parts = []
    if name == "wake":
        drawn = (plots.agreement(rows), plots.agreement(rows, narrow=True))
        parts.append(plot(drawn[0], "wake models against flows", "The line is the paper's.", narrow=drawn[1]))
    if name == "operator":
        drawn = (plots.obedience(rows), plots.obedience(rows, narrow=True))
        caption = "By w_track. Below and left of the dashed lines: 15 % and 60 % less, which the paper has for D."
        parts.append(plot(drawn[0], "obedience and wash", caption, narrow=drawn[1]))
    elif name in JUDGED:
        measure = JUDGED[name]
        drawn = (methods_compared(measure, places, rows), methods_compared(measure, places, rows, narrow=True))
        caption = "Dots are trials, diamonds means with their interval, black ticks the paper's figures."
        parts.append(plot(drawn[0], f"methods compared, {name}", caption, narrow=drawn[1]))
    profile = profiles(JUDGED[name], places) if name in ("dynamic", "station") else None
    if profile is not None:
        narrow = profiles(JUDGED[name], places, narrow=True)
        caption = "Share of trials whose figure is at most that of the axis."
        parts.append(plot(profile, f"performance profiles, {name}", caption, narrow=narrow))
    return "".join(parts)


def _rows(rows: Sequence[Mapping[str, Any]]) -> str:
    """Rows over all targets; those of one target that have such a row above them lie folded."""
    over_all = {(row["world"], row["method"], row["figure"]) for row in rows if row["target"] is None}
    parts = [row for row in rows if row["target"] and (row["world"], row["method"], row["figure"]) in over_all]
    shown = _listed([row for row in rows if row not in parts])
    return shown + (
        collapsible_section("Target by target", _listed(parts), f"{len(parts)} rows", folded=True) if parts else ""
    )


def _listed(rows: Sequence[Mapping[str, Any]]) -> str:
    tables = []
    several = any(row["target"] for row in rows)
    of = "<th>of</th>" if several else ""
    for world in dict.fromkeys(row["world"] for row in rows):
        body = "".join(_row(row, several) for row in rows if row["world"] == world)
        title = "" if world == "-" else f"<caption>{escape(world)}</caption>"
        tables.append(
            f"<table>{title}<thead><tr><th>method</th><th>figure</th>{of}<th class='num'>paper</th>"
            "<th class='num'>ours</th><th class='num'>95 %</th><th></th><th class='num'>n</th><th>verdict</th></tr>"
            f"</thead><tbody>{body}</tbody></table>"
        )
    return f'<div class="wide">{"".join(tables)}</div>'


def _matrix(rows: Sequence[Mapping[str, Any]]) -> str:
    """Models against flows: a row per figure and model, a column per flow."""
    flows = list(dict.fromkeys(row["target"] for row in rows))
    heads = "".join(f'<th class="num">{escape(flow)}</th>' for flow in flows)
    body = []
    for title, method in dict.fromkeys((row["figure"], row["method"]) for row in rows):
        own = {row["target"]: row for row in rows if (row["figure"], row["method"]) == (title, method)}
        first = next(iter(own.values()))
        cells = "".join(
            f'<td class="num" title="{escape(own[flow]["why"].get("ours", own[flow]["how"]), quote=True)}">'
            f'<span class="{_mark(own[flow])}">{escape(sentences.value(own[flow]["ours"]))}</span></td>'
            for flow in flows
        )
        body.append(
            f"<tr><td>{escape(method)}</td><td>{escape(title)}</td>"
            f'<td class="num">{escape(sentences.quoted(first))}</td>{cells}'
            f'<td class="unit">{escape(first["unit"])}</td></tr>'
        )
    return (
        f'<div class="wide"><table><thead><tr><th>model</th><th>figure</th><th class="num">paper</th>{heads}<th></th>'
        f"</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
    )


def _two(value: float | None) -> str:
    return NONE if value is None else f"{value:.2g}"


def _mark(row: Mapping[str, Any]) -> str:
    return "" if row["met"] is None else "kept" if row["met"] else "missed"


def _row(row: Mapping[str, Any], several: bool) -> str:
    said = row.get("our_order") or sentences.our_value(row)
    more = [row["how"], f"paper: {row['paper_says']}" + (f" ({row['source']})" if row["source"] else "")]
    if row.get("p_holm") is not None:
        more.append(f"paired t-test p {_two(row['p_t'])}, Holm {_two(row['p_holm'])}")
    if row.get("p_wilcoxon") is not None:
        more.append(f"Wilcoxon p {_two(row['p_wilcoxon'])}")
    if row.get("d_z") is not None:
        more.append(f"d {number(row['d_z'])}, probability of improvement {number(row['improvement'], scale=100.0)} %")
    if row.get("pairs_for_80_pct"):
        more.append(f"{row['pairs_for_80_pct']} pairs would show it with a chance of 80 %")
    more += [str(reason) for key, reason in row["why"].items() if key == "ours"]
    title = escape("; ".join(more), quote=True)
    figures = (  # an order is words, which would widen every column of numbers
        f'<td colspan="4">{escape(said)}; paper: {escape(row["paper_says"])}</td>'
        if row["reading"] == "order"
        else f'<td class="num" title="{escape(row["paper_says"], quote=True)}">{escape(sentences.quoted(row))}</td>'
        f'<td class="num">{escape(said)}</td><td class="num">{escape(sentences.interval(row))}</td>'
        f'<td class="unit">{escape("" if row["reading"] in ("less_pct", "more_pct") else row["unit"])}</td>'
    )
    return (
        f'<tr title="{title}"><td>{_unbroken(row["method"])}</td><td>{escape(row["figure"])}</td>'
        + (f"<td>{escape(row['target'] or '')}</td>" if several else "")
        + f'{figures}<td class="num">{shown(row["n"])}</td>'
        f'<td><span class="{_mark(row)}">{escape(sentences.verdict(row))}</span></td></tr>'
    )


def _unbroken(text: str) -> str:
    """A name that stays on one line."""
    return escape(text).replace("-", "&#8209;").replace(" ", "&nbsp;")


def _temporal(places: Sequence[Mapping[str, Any]], store: Path) -> str:
    """Thrusts and disturbance over one flight of each of two methods, the same seed, in each world."""
    parts = []
    for world in dict.fromkeys(place["world"] for place in places):
        series: dict[str, dict[str, Array]] = {}
        for method in _TEMPORAL:
            found = next((p for p in places if (p["world"], p["method"]) == (world, method)), None)
            told = None if found is None else read_series(store / found["folder"])
            if told is not None:
                series[method] = told
        if len(series) == len(_TEMPORAL):
            drawn = (plots.over_time(series), plots.over_time(series, narrow=True))
            caption = f"{world}, the first seed: true thrusts, the target's water, D by what is believed of the jets."
            parts.append(plot(drawn[0], f"thrusts and disturbance over time, {world}", caption, narrow=drawn[1]))
    return "".join(parts)


def _limits(tables: Mapping[str, Mapping[str, Any]]) -> str:
    def listed(lines: Sequence[str]) -> str:
        return "<ul>" + "".join(f"<li>{prose(line.replace('**', ''))}</li>" for line in lines) + "</ul>"

    content = ""
    for title, lines in sentences.reproduced(tables).items():
        content += collapsible_section(title, listed(lines), str(len(lines)))
    content += collapsible_section("Stated by the paper, not measured here", listed(UNMEASURED), str(len(UNMEASURED)))
    content += collapsible_section("Not known here of the paper", listed(UNKNOWN), str(len(UNKNOWN)))
    return section("limits", "What could be reproduced, and what not", "Computed from the rows above.", content)
