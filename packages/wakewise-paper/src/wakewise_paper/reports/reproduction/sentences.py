"""What tables say, in sentences: how many figures are met where, verdicts, what the paper has, what was not judged."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from wakewise.experiments.campaigns.summary import ENOUGH, FEWEST
from wakewise.ui.reports.text import number, percent, shown, with_unit
from wakewise_paper.reproduction.claim import (
    CIRCULAR,
    DIFFERENCES,
    NO_FLIGHT,
    OWN_SETUP,
    SETUP,
    SetupTally,
    setups,
    tallies,
)

Row = Mapping[str, Any]
Table = Mapping[str, Any]
_PERCENT = ("less_pct", "more_pct")
"""Readings that are differences in percent."""
RULES = (
    "*Surely*: the whole interval is on that side; a difference needs "
    f"{FEWEST} pairs for that, and is preliminary below {ENOUGH}. A reduction whose interval contains zero is not met."
)
"""How figures are judged, beside every count."""
_PACKAGES = ("wakewise", "numpy", "scipy", "numba", "pycolmap", "embreex", "daqp", "osqp", "opencv-python-headless")


def met_of(tables: Mapping[str, Sequence[Row]]) -> str:
    """How many of the paper's figures are met: in its own set-up, then in each named world."""
    found = tallies(tables)
    if not found:
        return "no figure of the paper is judged here"
    first, *rest = found
    figures = "figure" if first.judged == 1 else "figures"
    head = f"{first.met} of {first.judged} {figures} met {place_name(first.setup)}{_behind(first)}"
    return "; ".join([head, *(f"{one.met} of {one.judged} {place_name(one.setup)}{_behind(one)}" for one in rest)])


def _behind(one: SetupTally) -> str:
    counts = ((one.surely, "surely"), (one.by_all, "by every method"), (one.preliminary, "preliminary"))
    said = [f"{count} {words}" for count, words in counts if count]
    return f" ({', '.join(said)})" if said else ""


def place_name(setup: str) -> str:
    """A set-up in a sentence: in the paper's own one, in a named world, or without a flight."""
    if setup == OWN_SETUP:
        return f"in the paper's own set-up, {SETUP}"
    if setup == NO_FLIGHT:
        return "without a flight"
    return f"in {setup} (circular)" if setup in CIRCULAR else f"in {setup}"


def verdict(row: Row) -> str:
    """Met or not, and what stands behind it: the other methods, the number of pairs, the interval."""
    said = [] if row["met"] is None else ["met" if row["met"] else "not met"]
    if row["met_by_all"]:
        said.append("by every method here")
    if row["ours"] is None:
        return ", ".join(said)
    if row["reading"] in DIFFERENCES:
        return ", ".join(said + _pairs(row))
    if row["met"] is not None and row["n"] == 1 and row["world"] != "-":
        said.append("one trial")
    elif row["sure"] is False:
        said.append("unsure")
    return ", ".join(said)


def _pairs(row: Row) -> list[str]:
    """What the pairs of a difference show."""
    if (row["n"] or 0) < FEWEST:
        return [f"too few pairs (n = {shown(row['n'])})"]
    said = []
    if row["told_apart"] is False:
        ends = with_unit(interval(row))
        said.append(f"not told apart ({shown(row['n'])} pairs; {f'interval {ends}' if ends else 'no interval'})")
    elif row["sure"] is False:
        said.append("unsure")
    return [*said, f"preliminary (n = {shown(row['n'])})"] if row["preliminary"] else said


def interval(row: Row) -> str:
    """Both ends, or nothing."""
    if row["reading"] in _PERCENT:
        return percent(row["ours"], _ends(row), more=row["reading"] == "more_pct")[1].strip("()")
    return "" if row["low"] is None else f"{number(row['low'])} to {number(row['high'])}"


def our_value(row: Row) -> str:
    """Our figure with its unit; a difference beyond a factor of 3 as that factor."""
    if row["reading"] in _PERCENT:
        return percent(row["ours"], _ends(row), more=row["reading"] == "more_pct")[0]
    return value(row["ours"]) if row["ours"] is None else f"{value(row['ours'])} {row['unit']}".strip()


def _ends(row: Row) -> tuple[float, float] | None:
    return None if row["low"] is None or row["high"] is None else (row["low"], row["high"])


def quoted(row: Row) -> str:
    """The paper's figure as it stands there; of a difference beyond a factor of 3 that factor as well."""
    if row["paper"] is None:
        return "–"
    told = f"{row['paper']:.3g}" + ("" if row["paper_sd"] is None else f" ± {row['paper_sd']:.3g}")
    return f"{told} %{_factor(row, row['paper'])}" if row["reading"] in _PERCENT else told


def _factor(row: Row, difference_pct: float) -> str:
    """The factor of a difference that the paper gives in percent, where ours would be given so."""
    told = percent(difference_pct, more=row["reading"] == "more_pct")[0]
    return f" ({told})" if told.endswith("as much") else ""


def value(told: Any) -> str:
    """A number, or a dash."""
    return "–" if told is None else number(float(told))


def reproduced(tables: Mapping[str, Table]) -> dict[str, list[str]]:
    """Sentences by heading: what is met and what is not, set-up by set-up; last what could not be judged."""
    met: dict[tuple[str, bool], list[str]] = {}
    unknown: list[str] = []
    for name, table in tables.items():
        for row in table["rows"]:
            if row["target"] is not None and name not in ("wake", "operator"):
                continue
            if row["asked"] is None and row["reading"] != "order":
                continue
            what = f"**{name}**, {row['method']}: {row['figure']}"
            if row["met"] is None:
                unknown.append(f"{what}, {place_name(row['setup'])}: {row['why'].get('ours', 'not judged')}.")
            else:
                bar = "" if row["asked"] is None else _bar(row, row["asked"])
                met.setdefault((row["setup"], row["met"]), []).append(f"{what}{bar}: {_measured(row)}.")
    found = {
        f"{'Met' if good else 'Not met'} {place_name(setup)}": met[setup, good]
        for setup in setups(setup for setup, _ in met)
        for good in (True, False)
        if (setup, good) in met
    }
    return found | ({"Not judged": unknown} if unknown else {})


def _bar(row: Row, asked: float) -> str:
    sign = "at most" if row["side"] == "less" else "at least"
    source = "paper" if row["paper"] is not None else "asked"
    factor = _factor(row, asked) if row["reading"] in _PERCENT else ""
    return f", {source}: {sign} {number(asked)} {row['unit']}".rstrip() + factor


def _measured(row: Row) -> str:
    """Ours with its interval and number, and what stands behind the verdict."""
    ends, told = interval(row), verdict(row).removeprefix("not met").removeprefix("met").removeprefix(", ")
    said = row.get("our_order") or our_value(row)
    pairs = "" if "n = " in told else f", n = {shown(row['n'])}"
    return f"{said}" + (f" ({ends})" if ends else "") + pairs + (f"; {told}" if told else "")


def computer_description() -> dict[str, str]:
    """The computer in words that name nobody: cores, system, versions."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    found = {"cores": str(cores), "system": f"{platform.system()} {platform.machine()}"}
    found["python"] = platform.python_version()
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found
