"""What tables say, in sentences: who won, what the paper has, and what could not be made."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from wakewise.ui.reports.text import number, percent, shown
from wakewise_paper.reproduction.claim import SETUP, count_met

Row = Mapping[str, Any]
Table = Mapping[str, Any]
_PACKAGES = ("wakewise", "numpy", "scipy", "numba", "pycolmap", "embreex", "daqp", "osqp", "opencv-python-headless")


def met_of(tables: Mapping[str, Sequence[Row]]) -> str:
    """How many of the paper's figures are met, by the rows of one table or of several."""
    counts = count_met(tables)
    if not counts["quoted"]:
        return "no figure of the paper is quoted here"
    figures = "figures that the paper quotes are" if counts["quoted"] > 1 else "figure that the paper quotes is"
    said = f"{counts['met']} of {counts['quoted']} {figures} met{where(counts)}"
    more = [f"{counts['surely']} surely"] if counts["surely"] else []
    more += [f"{counts['circular']} more in the paper's own water alone"] if counts["circular"] else []
    return f"{said} ({', '.join(more)})" if more else said


def where(counts: Mapping[str, int]) -> str:
    """In which worlds figures count as met, and how many are in the paper's own set-up."""
    own = f", and {counts['own']} of {counts['own_judged']} in {SETUP}, the paper's own set-up"
    return f" in any world at all{own if counts['own_judged'] else ''}" if counts["worlds"] else ""


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
    if row["reading"] == "less_pct":
        return percent(row["ours"], _ends(row))[1].strip("()")
    return "" if row["low"] is None else f"{number(row['low'])} to {number(row['high'])}"


def our_value(row: Row) -> str:
    """Our figure with its unit; how much less by more than a factor of 3 as that factor."""
    if row["reading"] == "less_pct":
        return percent(row["ours"], _ends(row))[0]
    return value(row["ours"]) if row["ours"] is None else f"{value(row['ours'])} {row['unit']}".strip()


def _ends(row: Row) -> tuple[float, float] | None:
    return None if row["low"] is None or row["high"] is None else (row["low"], row["high"])


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
    said = row.get("our_order") or our_value(row)
    head = f"{where}: " if where else ""
    return f"{head}{said}" + (f" ({ends})" if ends else "") + f", n = {shown(row['n'])}"


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
