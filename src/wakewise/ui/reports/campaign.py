"""A campaign on one page: the first method against the next best, from how many pairs, at what cost; failures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wakewise.core.files import write_text
from wakewise.experiments.campaigns.summary import (
    ENOUGH,
    FEWEST,
    MethodSummary,
    Place,
    hover_words,
    measures,
    method_contrasts,
    paired_groups,
)
from wakewise.experiments.campaigns.table import ComparisonMetric, Results, failures, group_table, varying_factors
from wakewise.experiments.trials import UNITS
from wakewise.ui.reports.methods_compared import cost_text, methods_compared, profiles, winner_text, worst_panels
from wakewise.ui.reports.page import collapsible_section, framed_page, missing, parts, plot, section, template
from wakewise.ui.reports.text import duration, number

PAGE = "campaign.html"
_DRAWN = ("rmse_mm", "target_speed_mean_m_s", "energy_kJ")
"""What is drawn trial by trial; a plot of every figure would be a wall."""


def write_campaign(found: Results, folder: Path, out: Path | None = None, compare: str = "") -> Path:
    """Write the page of a campaign, and return its path.

    `folder` is the campaign's folder with the pictures. `out` is the file, or a folder for campaign.html; `folder` if
    not given. `compare` is the factor that is compared; if empty the first in which trials differ, methods first.

    Raises InputError if `compare` is no factor.
    """
    page = campaign_page(found, folder, compare)
    path = folder / PAGE if out is None else out if out.suffix == ".html" else out / PAGE
    write_text(path, page)
    return path


def campaign_page(found: Results, folder: Path, compare: str = "") -> str:
    """HTML of the page."""
    ended = paired_groups(found, compare)
    compared = compare or varying_factors(found.plan)[0]
    judged = method_contrasts(ended)
    links = [("glance", "At a glance"), ("plots", "Trial by trial"), ("worst", "Worst trials")]
    links += [("groups", "Groups"), ("flown", "What was flown")]
    sections = (_glance(judged, compared), _plots(ended), _worst(ended, folder), _groups(found), _flown(found))
    header, footer = _header(found, judged, compared), "Intervals hold 95 %. Made by Wakewise."
    return framed_page(f"{found.plan.name} · Wakewise", header, links, sections, footer)


def _header(found: Results, judged: Sequence[tuple[ComparisonMetric, MethodSummary]], compared: str) -> str:
    done, failed, total = found.count("done"), found.count("failed"), len(found.made)
    macros = template("campaign.html")
    took = duration(sum(one.took_s or 0.0 for one in found.made))
    summary = macros.summary(found.plan.name, done, total, failed, took)
    few = min((one.trials for _, one in judged), default=0)
    pairs = "" if not 0 < few < FEWEST else "One pair" if few == 1 else f"{few} pairs"
    title, hovers = _title(judged, compared), hover_words(found)
    return str(macros.header(summary, title, _cost(judged), total - done - failed, pairs, hovers))


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
        return f"No {compared} is told apart from the next best in any of {len(leading)} settings ({what})."
    winner, count = wins.most_common(1)[0]
    few = any(one.is_sure and one.winner == winner and one.trials < ENOUGH for one in leading)
    preliminary = f", preliminary (n < {ENOUGH})" if few else ""
    return f"{winner} is ahead of the next best in {count} of {len(leading)} settings ({what}){preliminary}."


def _cost(judged: Sequence[tuple[ComparisonMetric, MethodSummary]]) -> str:
    leading = [one for measure, one in judged if measure == judged[0][0]] if judged else []
    return cost_text(leading[0]) if len(leading) == 1 else ""


def _glance(judged: Sequence[tuple[ComparisonMetric, MethodSummary]], compared: str) -> str:
    if not judged:
        why = f"no seed has ended with every {compared}"
        return section("glance", "At a glance", "", missing("the comparison", why))
    rows = [(one.words, one.world, winner_text(one), _chance(one), cost_text(one), one.trials) for _, one in judged]
    heads = ("judged by", "where", "first and next best, difference", "chance", "at what cost", "pairs")
    lead = (
        "Over the seeds and targets that all have; a model that was not made counts as the worst. Chance: how likely a "
        "trial of the first beats one of the next best. Each line is a test of its own: one in twenty "
        "shows a difference by chance."
    )
    return section("glance", "At a glance", lead, parts().table("tttttn", heads, rows, "glance"))


def _chance(one: MethodSummary) -> str:
    return "" if one.improvement is None or not one.is_sure else f"{number(100.0 * one.improvement)} %"


def _plots(ended: list[Place]) -> str:
    plots = []
    for measure in measures(ended):
        if measure.figure not in _DRAWN:
            continue
        drawn = tuple(methods_compared(measure, ended, narrow=narrow) for narrow in (False, True))
        caption = "Dots are trials, diamonds means with their interval."
        plots.append(plot(drawn[0], f"compared by {measure.words}", caption, narrow=drawn[1]))
    leading = measures(ended)[0] if plots else None
    profile = None if leading is None else profiles(leading, ended)
    if leading is not None and profile is not None:
        narrow = profiles(leading, ended, narrow=True)
        caption = "Share of trials whose figure is at most that of the axis."
        plots.append(plot(profile, "performance profiles", caption, narrow=narrow))
    content = "".join(plots) or missing("plots", "no trial gave an error of the model or a speed of the water")
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
    units = [f"{name} {UNITS.get(name, '')}" for name in names]
    kinds = "t" * len(factors) + "n" * (1 + len(names))
    cells = [
        (
            *(str(row[factor]) for factor in factors),
            f"{row['done']}/{row['trials']}",
            *(_interval(row["figures"][name]) for name in names),
        )
        for row in rows
    ]
    table = parts().table(kinds, (*factors, "trials", *units), cells)
    lead = "Mean and 95 % interval over the trials that gave the figure."
    lost = failures(found)
    reasons = parts().items([f"{one['name']}: {one['reason']}" for one in lost])
    failed = collapsible_section("Failed trials", reasons, str(len(lost))) if lost else ""
    return section("groups", "Groups", lead, str(table) + failed)


def _interval(found: Mapping[str, Any]) -> str:
    made: str = template("campaign.html").interval(found["mean"], found["low"], found["high"])
    return made


def _flown(found: Results) -> str:
    facts = {
        key: ", ".join(str(one) for one in value) if isinstance(value, (list, tuple)) else value
        for key, value in found.plan.campaign.items()
        if value not in (None, {}, [], ())
    }
    facts |= {"wakewise": found.plan.wakewise, "sources": found.plan.sources}
    lead = "All of one seed fly in the same water with the same vehicle: seeds are pairs."
    return section("flown", "What was flown", lead, parts().facts(facts.items()))
