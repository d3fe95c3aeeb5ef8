"""Page of a real vehicle's log: one HTML file beside its table."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import polars as pl

from wakewise.core.files import write_text
from wakewise.ui.reports.page import missing, plot, section, tile, whole_page
from wakewise.ui.reports.text import NONE, fixed, number, shown
from wakewise_ardusub.logs.table import FACTS, PAGE, STEPS
from wakewise_ardusub.reports import log_plots

_END = {True: "within a record", False: "after a whole record", None: NONE}


def write_log_page(folder: Path, names: Sequence[str]) -> Path:
    """Write the page of a read log into its folder; `names` are the thrusters' in their order."""
    facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
    page = log_page(pl.read_parquet(folder / STEPS), facts, names)
    write_text(folder / PAGE, page)
    return folder / PAGE


def log_page(rows: pl.DataFrame, facts: dict[str, Any], names: Sequence[str]) -> str:
    """HTML of a log from its table and figures."""
    body = (
        f'<header class="top">{_headline(facts)}</header>'
        f"<main>{_dive(rows, facts)}{_thrusters(rows, facts, names)}{_spared(rows, facts, names)}{_file(facts)}</main>"
        "<footer>A reading of what the vehicle recorded; speeds are a wake model's, not measured. Made by Wakewise."
        "</footer>"
    )
    return whole_page(f"{facts['file']} · Wakewise", body)


def _headline(facts: dict[str, Any]) -> str:
    saved = facts.get("saved_pct")
    if saved is not None and saved >= 0.05:
        said = f"Gentler thrusts would have spared {number(saved)} % of the wash."
    elif saved is not None:
        said = "Gentler thrusts would have spared nothing."
    elif facts.get("running_s"):
        said = "No jet reached the points that were to be spared."
    elif "height_max_m" in facts:
        said = "Another vehicle than an ArduSub: what needs no table of ArduSub's."
    elif "why_no_hindsight" in facts:
        said = "The dive, without its thrusts."
    else:
        said = "No thruster ran."
    eyebrow = "".join(
        f"<span>{name} <b>{escape(str(value))}</b></span>"
        for name, value in (("log", facts["file"]), ("format", facts["format"]), ("vehicle", facts["vehicle"]))
    )
    why = (
        f"Wash is D, the weighted sum of squared speeds at points {escape(facts['points'])}, by the wake model "
        f"{escape(facts['wake_model'])}; the same forces and moments, shared among the thrusters otherwise."
    )
    what, deepest = ("highest", "height_max_m") if "height_max_m" in facts else ("deepest", "depth_max_m")
    depth, volts = facts[deepest], facts["voltage_min_V"]
    tiles = (
        tile("recorded", number(facts["duration_s"]), "s", f"armed {number(facts['armed_s'])} s")
        + tile("records", number(facts["records"]), "", "whole")
        + tile("bad records", number(facts["bad_records"]), "", _reasons(facts))
        + tile(what, fixed(depth, 2), "" if depth is None else "m", _source(facts))
        + tile("battery", fixed(volts, 1), "" if volts is None else "V", "at its lowest")
        + tile("spared", number(saved), "" if saved is None else "%", "of D as flown")
    )
    return (
        f'<p class="eyebrow">{eyebrow}</p><h1><span class="mark"></span>{escape(said)}</h1><p class="why">{why}</p>'
        f'<dl class="tiles">{tiles}</dl>'
    )


def _source(facts: dict[str, Any]) -> str:
    return f"from {facts['depth_from']}" if facts["depth_from"] else "no depth on record"


def _reasons(facts: dict[str, Any]) -> str:
    return _counts(facts["bad_by_reason"])


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{name}: {shown(count)}" for name, count in counts.items()) or "none"


def _dive(rows: pl.DataFrame, facts: dict[str, Any]) -> str:
    return section(
        "dive",
        "What was asked, what the vehicle did",
        f"All channels on one clock at {number(facts['rate_hz'])} Hz. Grey: armed.",
        plot(
            log_plots.dive(rows),
            "sticks, depth, attitude and battery over time",
            "Sticks are the pilot's, 1 is full: forward, right, down and clockwise are positive. Modes stand above. A "
            "gap is where the log says nothing.",
            "the log holds no sticks, depth or attitude",
            narrow=log_plots.dive(rows, narrow=True),
        ),
    )


def _thrusters(rows: pl.DataFrame, facts: dict[str, Any], names: Sequence[str]) -> str:
    channels = facts.get("motors", list(range(1, 9)))
    named = list(names) if "motors" in facts else [f"output {channel}" for channel in channels]
    return section(
        "pulses",
        "What the thrusters were told",
        "Servo pulses from the middle one; those within about 30 µs of it turn no propeller.",
        plot(
            log_plots.pulses(rows, channels, named),
            "pulses over time",
            "Orange is above 1500 µs, blue below; the stronger the colour, the farther.",
            "every output stood at its middle" if "servo" in facts["samples"] else "the log holds no servo outputs",
            narrow=log_plots.pulses(rows, channels, named, narrow=True),
        ),
    )


def _spared(rows: pl.DataFrame, facts: dict[str, Any], names: Sequence[str]) -> str:
    title, lead = "What gentler thrusts would have done", "For the wrench of each instant, by itself."
    why = facts.get("why_no_hindsight") or ("" if facts["running_s"] else "no thruster ran while this was recorded")
    if why:
        return section("spared", title, lead, missing("what was to be spared", why))
    reversed_ = [str(i) for i, d in enumerate(facts["directions"], start=1) if d is not None and d < 0]
    turned = f" Motors {', '.join(reversed_)} run the other way (MOT_n_DIRECTION)." if reversed_ else ""
    lead = (
        "At each instant the flown pulses make a force and a moment. Least thrusts make the same with the smallest "
        "sum of squares, gentle ones so that the points are disturbed least. The wash grows and fades at once here, "
        "and thrusts too small to be held are taken as pulses of the same mean."
    )
    weight = facts["total_weight"]
    return section(
        "spared",
        title,
        lead,
        plot(
            log_plots.speeds(rows, weight),
            "speed at the points over time",
            "Root mean square over the points, by the wake model.",
            narrow=log_plots.speeds(rows, weight, narrow=True),
        )
        + plot(
            log_plots.thrusts(rows, names),
            "thrusts over time",
            "By the thrusters' curve at the battery's voltage; orange pushes along the thruster's axis, blue against "
            f"it.{turned}",
            narrow=log_plots.thrusts(rows, names, narrow=True),
        ),
    )


def _file(facts: dict[str, Any]) -> str:
    jumps = [
        f"{fixed(jump['step_s'], 1, sign=True)} s at {fixed(jump['time_s'], 1)} s" for jump in facts["clock_jumps"]
    ]
    told = [
        ("vehicle, as it says", facts["identity"] or NONE),
        ("records", f"{shown(facts['records'])} whole, {shown(facts['bad_records'])} bad ({_reasons(facts)})"),
        ("bytes in bad ones", shown(facts["bad_bytes"])),
        ("of other fields, not read", _counts(facts["unread_records"])),
        ("end of the file", _END[facts["cut_short"]]),
        ("jumps of the clock", ", ".join(jumps[:8]) + (" …" if len(jumps) > 8 else "") or "none"),
        ("parameters", f"{shown(facts['parameters'])}, in parameters.csv"),
        ("samples", ", ".join(f"{name} {shown(count)}" for name, count in facts["samples"].items())),
    ]
    listed = "".join(f"<dt>{name}</dt><dd>{escape(value)}</dd>" for name, value in told)
    lead = "A bad record is a packet whose checksum is wrong, or a stretch of bytes that is no record."
    return section("file", "What was in the file", lead, f'<dl class="facts">{listed}</dl>')
