"""A campaign on one page: who won, by how much, how sure, at what price, where it failed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from wakewise.core.files import write_text
from wakewise.experiments.campaigns.summary import (
    FEWEST,
    ComparisonMetric,
    MethodSummary,
    Place,
    comparable,
    measures,
    method_contrasts,
    paired_groups,
)
from wakewise.experiments.campaigns.table import Results, failures, group_table
from wakewise.experiments.trials import UNITS
from wakewise.ui.reports.methods_compared import cost_text, methods_compared, profiles, winner_text, worst_panels
from wakewise.ui.reports.page import collapsible_section, missing, plot, section, whole_page
from wakewise.ui.reports.text import duration, number

PAGE = "campaign.html"
_DRAWN = ("rmse_mm", "target_speed_mean_m_s", "energy_kJ")
"""What is drawn trial by trial; a plot of every figure would be a wall."""


def write_campaign(found: Results, folder: Path, out: Path | None = None, compare: str = "") -> Path:
    """Write the page of a campaign, and give its path.

    Parameters
    ----------
    found : Results
        As `wakewise.experiments.campaigns.table.results` gives it.
    folder : Path
        The campaign's folder, where pictures lie; the page is written there if `out` is not given.
    out : Path, optional
        The file to write; in a folder, it is called campaign.html.
    compare : str, optional
        The factor that is compared; if not given the first that trials differ in, methods before all.

    Raises
    ------
    InputError
        If `compare` is no factor.
    """
    page = campaign_page(found, folder, compare)
    path = folder / PAGE if out is None else out if out.suffix == ".html" else out / PAGE
    write_text(path, page)
    return path


def campaign_page(found: Results, folder: Path, compare: str = "") -> str:
    """HTML of the page."""
    ended = paired_groups(found, compare)
    compared = compare or comparable(found)[0]
    judged = method_contrasts(ended)
    parts = [("glance", "At a glance"), ("plots", "Trial by trial"), ("worst", "Worst trials")]
    parts += [("groups", "Groups"), ("flown", "What was flown")]
    links = "".join(f'<a href="#{anchor}">{title}</a>' for anchor, title in parts)
    body = (
        f'<header class="top">{_head(found, judged, compared)}</header>'
        f'<nav class="parts" aria-label="parts"><div>{links}</div></nav>'
        f"<main>{_glance(judged, compared)}{_plots(ended)}{_worst(ended, folder)}{_groups(found)}{_flown(found)}</main>"
        "<footer>Intervals hold 95 %. Made by Wakewise.</footer>"
    )
    return whole_page(f"{found.plan.name} · Wakewise", body)


def _head(found: Results, judged: Sequence[tuple[ComparisonMetric, MethodSummary]], compared: str) -> str:
    done, failed, total = found.count("done"), found.count("failed"), len(found.made)
    took = duration(sum(one.took_s or 0.0 for one in found.made))
    eyebrow = (
        f'<p class="eyebrow"><span>campaign <b>{escape(found.plan.name)}</b></span><span><b>{done}</b> of {total} '
        f"trials, {failed} failed</span><span>{took} of trials</span></p>"
    )
    cautions = []
    if done + failed < total:
        cautions.append(
            f"<b>Not finished.</b> {total - done - failed} trials are still to come; this holds for those that ended."
        )
    few = min((one.trials for _, one in judged), default=0)
    if 0 < few < FEWEST:
        pairs = "One pair" if few == 1 else f"{few} pairs"
        cautions.append(
            f"<b>Few.</b> {pairs} somewhere: read it as what to look at next; more <code>seeds</code> tell."
        )
    said = "".join(f'<p class="caution">{text}</p>' for text in cautions)
    return f"{eyebrow}<h1>{escape(_title(judged, compared))}</h1>{_why(judged)}{said}"


def _title(judged: Sequence[tuple[ComparisonMetric, MethodSummary]], compared: str) -> str:
    """The leading measure in a sentence."""
    if not judged:
        return "No trials that can be compared have ended yet."
    leading = [one for measure, one in judged if measure == judged[0][0]]
    if len(leading) == 1:
        return winner_text(leading[0])
    wins = Counter(one.winner for one in leading if one.rival is not None and one.is_sure)
    what = leading[0].words
    if not wins:
        return f"No {compared} is surely best in any of {len(leading)} settings ({what})."
    winner, count = wins.most_common(1)[0]
    return f"{winner} is surely best in {count} of {len(leading)} settings ({what})."


def _why(judged: Sequence[tuple[ComparisonMetric, MethodSummary]]) -> str:
    leading = [one for measure, one in judged if measure == judged[0][0]] if judged else []
    return f'<p class="why">{escape(cost_text(leading[0]))}</p>' if len(leading) == 1 and cost_text(leading[0]) else ""


def _glance(judged: Sequence[tuple[ComparisonMetric, MethodSummary]], compared: str) -> str:
    if not judged:
        why = f"no seed has ended with every {compared}"
        return section("glance", "At a glance", "", missing("who won", why))
    rows = "".join(
        f"<tr><td>{escape(one.words)}</td><td>{escape(one.world)}</td><td>{escape(winner_text(one))}</td>"
        f'<td>{escape(_chance(one))}</td><td>{escape(cost_text(one))}</td><td class="num">{one.trials}</td></tr>'
        for _, one in judged
    )
    heads = (
        "<th>judged by</th><th>where</th><th>who won, by how much, how sure</th><th>chance</th><th>at what price</th>"
    )
    lead = (
        "Over the seeds and targets that all have; a model that was not made counts as the worst. Chance: how likely a "
        "trial of the winner beats one of the next best. Each line is a test of its own: of twenty, one is sure by "
        "accident."
    )
    heads += '<th class="num">pairs</th>'
    table = f'<table class="glance"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>'
    return section("glance", "At a glance", lead, f'<div class="wide">{table}</div>')


def _chance(one: MethodSummary) -> str:
    return "" if one.improvement is None or not one.is_sure else f"{number(100.0 * one.improvement)} %"


def _plots(ended: list[Place]) -> str:
    parts = []
    for measure in measures(ended):
        if measure.figure not in _DRAWN:
            continue
        drawn = tuple(methods_compared(measure, ended, narrow=narrow) for narrow in (False, True))
        caption = "Dots are trials, diamonds means with their interval."
        parts.append(plot(drawn[0], f"compared by {measure.words}", caption, narrow=drawn[1]))
    leading = measures(ended)[0] if parts else None
    profile = None if leading is None else profiles(leading, ended)
    if leading is not None and profile is not None:
        narrow = profiles(leading, ended, narrow=True)
        caption = "Share of trials that are at least so good; the curve that rises first is the better one."
        parts.append(plot(profile, "performance profiles", caption, narrow=narrow))
    content = "".join(parts) or missing("plots", "no trial gave an error of the model or a speed of the water")
    return section("plots", "Trial by trial", "", content)


def _worst(ended: list[Place], folder: Path) -> str:
    found = measures(ended)
    shown = worst_panels(found[0], ended, folder) if found else ""
    content = shown or missing("pictures", "they are kept of trials of `stages: model`")
    return section("worst", "Worst trials", "The worst of each, to see what goes wrong where it does.", content)


def _groups(found: Results) -> str:
    rows = group_table(found)
    factors = [key for key in rows[0] if key not in ("trials", "done", "failed", "figures")] if rows else []
    names = list(rows[0]["figures"]) if rows else []
    heads = "".join(f"<th>{escape(factor)}</th>" for factor in factors) + '<th class="num">trials</th>'
    heads += "".join(f'<th class="num">{escape(name)} {escape(UNITS.get(name, ""))}</th>' for name in names)
    body = "".join(
        "<tr>"
        + "".join(f"<td>{escape(str(row[factor]))}</td>" for factor in factors)
        + f'<td class="num">{row["done"]}/{row["trials"]}</td>'
        + "".join(f'<td class="num">{_figure(row["figures"][name])}</td>' for name in names)
        + "</tr>"
        for row in rows
    )
    table = f"<table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>"
    lead = "Mean and 95 % interval over the trials that gave the figure."
    lost = failures(found)
    items = "".join(f"<li>{escape(one['name'])}: {escape(str(one['reason']))}</li>" for one in lost)
    failed = collapsible_section("Failed trials", f"<ul>{items}</ul>", str(len(lost))) if lost else ""
    return section("groups", "Groups", lead, f'<div class="wide">{table}</div>{failed}')


def _figure(told: Mapping[str, Any]) -> str:
    if told["mean"] is None:
        return "–"
    ends = "" if told["low"] is None else f"<br><small>{number(told['low'])} to {number(told['high'])}</small>"
    return f"{number(told['mean'])}{ends}"


def _flown(found: Results) -> str:
    facts = {
        key: ", ".join(str(one) for one in value) if isinstance(value, (list, tuple)) else value
        for key, value in found.plan.campaign.items()
        if value not in (None, {}, [], ())
    }
    facts |= {"wakewise": found.plan.wakewise, "sources": found.plan.sources}
    items = "".join(f"<dt>{escape(str(key))}</dt><dd>{escape(str(value))}</dd>" for key, value in facts.items())
    lead = "All of one seed fly in the same water with the same vehicle: seeds are pairs."
    return section("flown", "What was flown", lead, f'<dl class="facts">{items}</dl>')
