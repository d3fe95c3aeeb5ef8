"""The page's words on scale: where metres come from, how sure they are, what disagrees."""

from __future__ import annotations

from typing import Any

import numpy as np

from wakewise.reports.page import fold, section, tile
from wakewise.reports.photo_model.rows import facts_list, table_row
from wakewise.reports.words import number

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
        return tile("scale", number(figures["cameras_rmse_mm"]), "mm", "cameras from their references, rms")
    if fixes is not None and fixes["used"]:
        return tile("scale", f"± {number(fixes['uncertainty_pct'], 2)}", "%", f"by fixes of {fixes['photos']} photos")
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
        lead, content = f"From where {fixes['photos']} photos were taken, as their fixes tell it.", ""
    return section("scale", "Scale", lead, content + ("" if fixes is None else facts_list(_by_fixes(fixes))))


def _by_fixes(fixes: dict[str, Any]) -> list[tuple[str, str]]:
    unsure = fixes["uncertainty_pct"]
    rows = [("scale by fixes", "cannot be told" if unsure is None else f"uncertain by {number(unsure, 2)} %")]
    if fixes["why"] is not None:
        rows.append(("not used", fixes["why"]))
    if fixes["model_off_pct"] is not None and fixes["why"] is None:
        rows.append(("lengths by fixes", f"{fixes['model_off_pct']:+.1f} % off"))
    for key, words in (("horizontal_rms_m", "fixes off horizontally"), ("depth_rms_m", "fixes off in depth")):
        if fixes[key] is not None:
            rows.append((words, f"{number(fixes[key], 2)} m rms"))
    if fixes["far"]:
        rows.append(("fixes that do not fit", ", ".join(fixes["far"][:6]) + (" ..." if len(fixes["far"]) > 6 else "")))
    if fixes["used"]:
        axes = "north, east, down" if fixes["north_known"] else "the third is down, north is not known"
        rows.append(("the model's axes", axes))
    return rows


def _by_bars(bars: dict[str, Any]) -> tuple[str, str]:
    lead = (
        f"From {len(bars['bars'])} bars between coded targets, uncertain by {number(bars['uncertainty_pct'], 2)} %."
        if bars["used"]
        else f"From reference cameras; by the bars, lengths are {bars['model_off_pct']:+.3f} % off."
    )
    head = table_row(("bar", "stated", "in the model", "off", "by the other bars", "photos"), "th", "tlrrrr")
    rows = "".join(
        table_row(
            (
                bar["name"],
                f"{1e3 * bar['length_m']:.2f} ± {1e3 * bar['sigma_m']:.2f} mm",
                f"{1e3 * bar['found_m']:.2f} mm",
                f"{round(bar['off_mm'], 2) + 0.0:+.2f} mm",
                "only one" if bar["check_pct"] is None else f"{bar['check_pct']:+.3f} %",
                str(bar["photos"]),
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
                str(one["target"]),
                str(one["photos"]),
                f"{one['error_px']:.2f} px",
                f"{np.mean(one['sides_mm']):.2f} mm",
                ", ".join(f"{value:.4f}" for value in one["middle_m"]),
            ),
            "td",
            "trrrl",
        )
        for one in bars["targets"]
    )
    if targets:
        head = table_row(("target", "photos", "error", "side", "middle, m"), "th", "trrrl")
        inner = f"<table><thead>{head}</thead><tbody>{targets}</tbody></table>"
        table += fold(f"Targets ({bars['family']})", inner, f"{len(bars['targets'])}")
    return lead, table


def _references(figures: dict[str, Any]) -> list[tuple[str, str]]:
    return [
        ("cameras from their references", f"{number(figures['cameras_rmse_mm'])} mm rms, "
         f"{number(figures['cameras_max_mm'])} mm at most"),
        ("references that fit", str(figures["reference_inliers"])),
        ("surface", f"{number(figures['surface_distance_m'])} m from the cameras"),
    ]  # fmt: skip
