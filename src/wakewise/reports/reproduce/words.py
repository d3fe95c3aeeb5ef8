"""What tables say, in sentences: who won, what the paper has, and what could not be made."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from wakewise.reports.words import number
from wakewise.studies.reproduce.glance import Glance, tally

_ALIKE = 0.005
"""Costs that differ by less are told as the same."""
Row = Mapping[str, Any]
Table = Mapping[str, Any]
_PACKAGES = ("wakewise", "numpy", "scipy", "numba", "pycolmap", "embreex", "daqp", "osqp", "opencv-python-headless")


def won(glance: Glance) -> str:
    """Who won, by how much, how sure."""
    value = number(glance.means[glance.winner])
    if glance.rival is None:
        return f"{glance.winner}: {value} {glance.words}."
    if glance.means[glance.winner] == glance.means[glance.rival]:
        return f"{glance.winner} and {glance.rival} are even: {value} {glance.words} each."
    said = f"{glance.winner} is best with {value} {glance.words}"
    if glance.less_pct is not None:
        ends = (
            ""
            if glance.interval_pct is None
            else f" ({number(glance.interval_pct[0])} to {number(glance.interval_pct[1])})"
        )
        said += f", {number(abs(glance.less_pct))} %{ends} better than {glance.rival}"
    return f"{said}; {glance.sure}."


def price(glance: Glance) -> str:
    """What the winner costs, and where trials failed."""
    said = []
    if glance.energy_ratio is not None:
        alike = abs(glance.energy_ratio - 1.0) < _ALIKE
        much = "as much energy as" if alike else f"{number(glance.energy_ratio)} times the energy of"
        said.append(f"It takes {much} {glance.rival}.")
    lost = {method: count for method, count in glance.failed.items() if count}
    if lost:
        said.append("Failed: " + ", ".join(f"{method} {count}" for method, count in lost.items()) + ".")
    elif glance.trials:
        said.append("No trial failed.")
    return " ".join(said)


def met_of(tables: Mapping[str, Sequence[Row]]) -> str:
    """How many of the paper's figures are met, by the rows of one table or of several."""
    counts = tally(tables)
    if not counts["quoted"]:
        return "no figure of the paper is quoted here"
    figures = "figures that the paper quotes are" if counts["quoted"] > 1 else "figure that the paper quotes is"
    said = f"{counts['met']} of {counts['quoted']} {figures} met"
    more = [f"{counts['surely']} surely"] if counts["surely"] else []
    more += [f"{counts['circular']} more in the paper's own water alone"] if counts["circular"] else []
    return f"{said} ({', '.join(more)})" if more else said


def verdict(row: Row) -> str:
    """Met or not, and whether that is sure; a single flight is never."""
    if row["met"] is None:
        return ""
    single = row["world"] != "-" and row["n"] == 1
    return ("met" if row["met"] else "not met") + (
        ", one trial" if single else ", unsure" if row["sure"] is False else ""
    )


def interval(row: Row) -> str:
    """Both ends, or nothing."""
    return "" if row["low"] is None else f"{number(row['low'])} to {number(row['high'])}"


def quoted(row: Row) -> str:
    """The paper's figure as it stands there."""
    return "–" if row["paper"] is None else f"{row['paper']:.3g}"


def value(told: Any) -> str:
    """A number, or a dash."""
    return "–" if told is None else number(float(told))


def reproduced(tables: Mapping[str, Table]) -> tuple[list[str], list[str], list[str]]:
    """Sentences on what is met in some world, on what is met in none, and on what could not be judged."""
    groups: dict[tuple[str, str, str, Any], list[Row]] = {}
    for name, table in tables.items():
        for row in table["rows"]:
            if row["target"] is not None and name not in ("wake", "operator"):
                continue
            if row["asked"] is None and row["reading"] != "order":
                continue
            groups.setdefault((name, row["method"], row["figure"], row["asked"]), []).append(row)
    could, could_not, unknown = [], [], []
    for (name, method, figure, asked), rows in groups.items():
        judged = [row for row in rows if row["met"] is not None]
        what = f"**{name}**, {method}: {figure}"
        if not judged:
            unknown.append(f"{what}: {rows[0]['why'].get('ours', 'not judged')}.")
            continue
        bar = "" if asked is None else _bar(rows[0], asked)
        good = [row for row in judged if row["met"]]
        if good:
            where = "; ".join(_place(row) for row in good)
            rest = "; ".join(_place(row) for row in judged if not row["met"])
            could.append(f"{what}{bar}: {where}." + (f" Not in {rest}." if rest else ""))
        else:
            could_not.append(f"{what}{bar}: {'; '.join(_place(row) for row in judged)}.")
    return could, could_not, unknown


def _bar(row: Row, asked: float) -> str:
    sign = "at most" if row["side"] == "less" else "at least"
    source = "paper" if row["paper"] is not None else "asked"
    return f", {source}: {sign} {number(asked)} {row['unit']}".rstrip()


def _place(row: Row) -> str:
    where = row["target"] if row["world"] == "-" else row["world"]
    where = f"{where} ({row['target']})" if row["world"] != "-" and row["target"] else where
    ends = interval(row)
    said = row.get("our_order") or f"{value(row['ours'])} {row['unit']}".strip()
    head = f"{where}: " if where else ""
    return f"{head}{said}" + (f" ({ends})" if ends else "") + f", n = {row['n']}"


def machine() -> dict[str, str]:
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
