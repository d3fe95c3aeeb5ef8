"""The page's words on scale: where metres come from, how sure they are, what disagrees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from wakewise.ui.reports.page import collapsible_section, section, tile
from wakewise.ui.reports.photo_model.rows import facts_list, table_row
from wakewise.ui.reports.text import fixed, number, shown

_HOW = (
    "<p>Lay two or more bars between coded targets into the scene (<code>--bar A,B,LENGTH</code>), give the places of "
    "the cameras (<code>--reference-cameras</code>), or at least their depths or GPS fixes (<code>--fixes</code>).</p>"
)


def scale_tile(figures: dict[str, Any]) -> str:
    """One figure for the top of the page."""
    bars, fixes, scale = figures.get("scale_bars"), figures.get("scale_fixes"), figures.get("scale")
    if bars is not None and bars["used"]:
        count = len(bars["bars"])
        return tile("scale", f"± {number(bars['uncertainty_pct'], 2)}", "%", f"by {count} bar{'s' * (count > 1)}")
    if scale is not None:
        rms = figures.get("cameras_rmse_mm")
        if rms is None:
            return tile("scale", "given", "", "by the known cameras, which stay as they were")
        return tile("scale", number(rms), "mm", "cameras from their references, rms")
    if fixes is not None and fixes["used"]:
        return tile(
            "scale", f"± {number(fixes['uncertainty_pct'], 2)}", "%", f"by fixes of {shown(fixes['photos'])} photos"
        )
    return tile("scale", "–", "", "fixes are too unsure" if fixes is not None else "no bars, no reference cameras")


def scale_section(figures: dict[str, Any]) -> str:
    """The section: bars, references or fixes, whichever gave the scale first, then what checks it."""
    bars, fixes = figures.get("scale_bars"), figures.get("scale_fixes")
    lead, content = "The model has no scale: its lengths mean nothing by themselves.", _HOW
    if bars is not None:
        lead, content = _by_bars(bars)
    elif figures.get("scale") is not None:
        lead, content = "From the places of the cameras that were given.", facts_list(_references(figures))
    elif fixes is not None and fixes["used"]:
        lead, content = f"From where {shown(fixes['photos'])} photos were taken, as their fixes tell it.", ""
    return section("scale", "Scale", lead, content + ("" if fixes is None else facts_list(_by_fixes(fixes))))


def _by_fixes(fixes: dict[str, Any]) -> list[tuple[str, str]]:
    unsure = fixes.get("uncertainty_pct")
    rows = [("scale by fixes", "cannot be told" if unsure is None else f"uncertain by {number(unsure, 2)} %")]
    if fixes["why"] is not None:
        rows.append(("not used", fixes["why"]))
    if fixes["model_off_pct"] is not None and fixes["why"] is None:
        rows.append(("lengths by fixes", f"{fixed(fixes['model_off_pct'], 1, sign=True)} % off"))
    for key, words in (("horizontal_rms_m", "fixes off horizontally"), ("depth_rms_m", "fixes off in depth")):
        if fixes[key] is not None:
            rows.append((words, f"{number(fixes[key], 2)} m rms"))
    if fixes["far"]:
        far = [str(name) for name in fixes["far"]]
        rows.append(("fixes that do not fit", ", ".join(far[:6]) + (" ..." if len(far) > 6 else "")))
    if fixes["used"]:
        axes = "north, east, down" if fixes["north_known"] else "the third is down, north is not known"
        rows.append(("the model's axes", axes))
    return rows


def _by_bars(bars: dict[str, Any]) -> tuple[str, str]:
    lead = (
        f"From {len(bars['bars'])} bars between coded targets, uncertain by {number(bars['uncertainty_pct'], 2)} %."
        if bars["used"]
        else f"From reference cameras; by the bars, lengths are {fixed(bars['model_off_pct'], 3, sign=True)} % off."
    )
    head = table_row(("bar", "stated", "in the model", "off", "by the other bars", "photos"), "th", "tlrrrr")
    rows = "".join(
        table_row(
            (
                bar["name"],
                f"{fixed(bar['length_m'], 2, scale=1e3)} ± {fixed(bar['sigma_m'], 2, scale=1e3)} mm",
                f"{fixed(bar['found_m'], 2, scale=1e3)} mm",
                f"{fixed(bar['off_mm'], 2, sign=True)} mm",
                "only one" if bar["check_pct"] is None else f"{fixed(bar['check_pct'], 3, sign=True)} %",
                shown(bar["photos"]),
            ),
            "td",
            "tlrrrr",
        )
        for bar in bars["bars"]
    )
    table = f"<table><thead>{head}</thead><tbody>{rows}</tbody></table>"
    targets = "".join(
        table_row(
            (
                shown(one["target"]),
                shown(one["photos"]),
                f"{fixed(one['error_px'], 2)} px",
                f"{fixed(_mean(one['sides_mm']), 2)} mm",
                ", ".join(fixed(value, 4) for value in one["middle_m"] or []),
            ),
            "td",
            "trrrl",
        )
        for one in bars["targets"]
    )
    if targets:
        head = table_row(("target", "photos", "error", "side", "middle, m"), "th", "trrrl")
        inner = f"<table><thead>{head}</thead><tbody>{targets}</tbody></table>"
        table += collapsible_section(f"Targets ({bars['family']})", inner, f"{len(bars['targets'])}")
    return lead, table


def _mean(values: Sequence[float | None] | None) -> float | None:
    known = [value for value in values or [] if value is not None]
    return float(np.mean(known)) if known else None


def _references(figures: dict[str, Any]) -> list[tuple[str, str]]:
    surface = ("surface", f"{number(figures.get('surface_distance_m'))} m from the cameras")
    if figures.get("cameras_rmse_mm") is None:
        return [("cameras", "as they were given: nothing was fitted to them"), surface]
    return [
        ("cameras from their references", f"{number(figures['cameras_rmse_mm'])} mm rms, "
         f"{number(figures.get('cameras_max_mm'))} mm at most"),
        ("references that fit", shown(figures.get("reference_inliers"))),
        surface,
    ]  # fmt: skip
