"""The report of a model from photographs: whether it can be trusted, the model, its scale, every photograph."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from wakewise.core.arrays import IntArray
from wakewise.core.errors import InputError
from wakewise.core.files import write_text
from wakewise.ui.reports.page import (
    collapsible_section,
    legend_entry,
    missing,
    plot,
    scene_box,
    section,
    tile,
    whole_page,
)
from wakewise.ui.reports.photo_model.rows import facts_list, table_row
from wakewise.ui.reports.photo_model.scale import scale_section, scale_tile
from wakewise.ui.reports.photo_model.scene import model_scene
from wakewise.ui.reports.svg_style import TEAL, new_figure, style_axes
from wakewise.ui.reports.text import NONE, fixed, number, shown
from wakewise.vision.reconstruction.photo_facts import ModelStatistics, model_facts

PARTS = (
    ("model", "Model"),
    ("scale", "Scale"),
    ("matches", "Matches"),
    ("photos", "Photographs"),
    ("cut", "Cut"),
    ("figures", "Figures"),
)
_LONG = 12


def write_model_report(model: Path, photos: Path) -> Path:
    """Write report.html into the folder of a model that `wakewise reconstruct` made; it opens with no network.

    Raises
    ------
    InputError
        If the folder holds no such model.
    """
    try:
        figures = json.loads((model / "reconstruction.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        raise InputError(f"{model}: holds no reconstruction.json that can be read") from None
    facts = model_facts(model)
    path = model / "report.html"
    write_text(path, model_page(model.resolve().name, figures, facts, model_scene(model, photos, facts)))
    return path


def model_page(name: str, figures: dict[str, Any], facts: ModelStatistics, scene: str | None) -> str:
    """HTML of the report."""
    links = "".join(f'<a href="#{anchor}">{title}</a>' for anchor, title in PARTS)
    body = (
        f'<header class="top">{_headline(name, figures)}</header>'
        f'<nav class="parts" aria-label="parts"><div>{links}</div></nav><main>{_model(figures, facts, scene)}'
        f"{scale_section(figures)}{_matches(facts)}{_photos(figures, facts)}{_cut(figures)}{_figures(figures)}</main>"
        "<footer><p>The model's files are beside this page: sparse/ (COLMAP), dense.ply, mesh.ply, mesh.glb.</p>"
        "</footer>"
    )
    return whole_page(f"{name} · model", body)


def _headline(name: str, figures: dict[str, Any]) -> str:
    doubts = figures.get("doubts") or []
    images, placed = _count(figures.get("images")), _count(figures.get("registered_images"))
    said = "The model is doubtful" if doubts else f"A sound model of {placed} of {images} photographs"
    reasons = "".join(f'<p class="why">{escape(line)}</p>' for line in doubts)
    return (
        f'<p class="eyebrow"><span>model <b>{escape(name)}</b></span></p>'
        f'<h1 class="{"bad" if doubts else "good"}"><span class="mark"></span>{escape(said)}</h1>{reasons}'
        f'<dl class="tiles">{_tiles(figures)}</dl>'
    )


def _tiles(figures: dict[str, Any]) -> str:
    placed, images = figures.get("registered_images"), figures.get("images")
    spacing = figures.get("point_spacing_mm")
    dense = figures.get("dense_points")
    faces = figures.get("mesh_faces")
    note = "apart: no scale" if spacing is None else f"{number(spacing, 2)} mm apart"
    surface = "not asked for" if faces is None else "triangles"
    uncut, cut = fixed(figures.get("reprojection_uncut_px"), 2), fixed(figures.get("cut_pct"), 0)
    state = "" if placed is None or images is None else "ok" if placed == images else "off"
    return (
        tile("photographs placed", _count(placed), f"of {_count(images)}", "have a place in the model", state)
        + tile("error", fixed(figures.get("reprojection_px"), 2), "px", f"mean; {uncut} before {cut} % was cut")
        + scale_tile(figures)
        + tile("sparse points", _count(figures.get("points")), "",
               f"in {fixed(figures.get('track_length'), 1)} photos each")
        + tile("dense points", _count(dense), "", "not asked for" if dense is None else note)
        + tile("surface", _count(faces), "", surface)
    )  # fmt: skip


def _count(value: int | None) -> str:
    if value is None:
        return NONE
    return f"{value:,}".replace(",", " ") if value < 1_000_000 else f"{value / 1e6:.2f} M"


def _model(figures: dict[str, Any], facts: ModelStatistics, scene: str | None) -> str:
    lead = (
        "Turn it by dragging, come nearer by the wheel. Surface, points and photographs can be switched in the scene's "
        f"tree. Its cameras were found {figures.get('mapping') or 'in a way that is not on record'}."
    )
    placed = sum(photo.p_WC is not None for photo in facts.photos)
    legend = legend_entry("#d9562b", f"{placed} photographs") + legend_entry(
        "#8fa0a6", f"{_count(len(facts.points))} sparse points"
    )
    content = missing("the model", "no photograph has a place") if scene is None else scene_box(scene, legend)
    return section("model", "The model", lead, content)


def _matches(facts: ModelStatistics) -> str:
    partners = (facts.matches > 0).sum(axis=1)
    lead = (
        f"Each photograph shares verified matches with {int(np.median(partners))} others (median). Breaks in the band "
        "along the diagonal are where a path was interrupted; blocks away from it are where it came back."
    )
    return section(
        "matches",
        "What is matched with what",
        lead,
        plot(match_figure(facts.matches), "verified matches between photographs", "Photographs in order of name; the "
             "darker, the more matches.", "fewer than two photographs"),
    )  # fmt: skip


def match_figure(matches: IntArray) -> Figure | None:
    """Matrix of verified matches, shape (n, n), as a picture; None for fewer than two photographs."""
    count = len(matches)
    if count < 2:
        return None
    figure = new_figure(9.6, 5.0)
    axes = figure.subplots()
    style_axes(axes, x="photograph", y="photograph", grid="")
    i, j = np.nonzero(matches)
    strength = np.sqrt(matches[i, j] / matches.max())
    size = (280.0 / count) ** 2
    axes.scatter(i + 1, j + 1, s=size, marker="s", c=TEAL, alpha=0.15 + 0.85 * strength, linewidths=0)
    axes.set_xlim(0.5, count + 0.5)
    axes.set_ylim(count + 0.5, 0.5)
    axes.set_aspect("equal")
    return figure


def _photos(figures: dict[str, Any], facts: ModelStatistics) -> str:
    left = {one["name"]: one for one in figures.get("left_out") or []}
    head = table_row(
        ("photograph", "place", "features", "points seen", "error", "partners", "focal length"), "th", "tlrrrrr"
    )
    rows = []
    for k, photo in enumerate(facts.photos):
        partners = int((facts.matches[k] > 0).sum())
        place = "yes"
        if photo.p_WC is None:
            best = left.get(photo.name)
            found = best is not None and best["partner"]
            place = f"none; {_count(best['matches'])} matches with {best['partner']}" if best and found else "none"
        error = f"{fixed(photo.error_px, 2)} px"
        cells = (photo.name, place, _count(photo.features), _count(photo.observations), error, str(partners),
                 f"{fixed(photo.focal_px, 0)} px")  # fmt: skip
        rows.append(table_row(cells, "td", "tlrrrrr"))
    table = f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>"
    lead = "Errors are means over the sparse points that a photograph sees, each point's over all that see it."
    content = collapsible_section("Every photograph", table, f"{len(rows)}") if len(rows) > _LONG else table
    return section("photos", "Photographs", lead, content)


def _cut(figures: dict[str, Any]) -> str:
    before, after = fixed(figures.get("reprojection_uncut_px"), 2), fixed(figures.get("reprojection_px"), 2)
    left = (str(one["name"]) for one in (figures.get("left_out") or [])[:20])
    models = (f"{_count(count)} photos" for count in figures.get("sub_models") or [])
    others = (f"{_count(n)} of {kind}" for kind, n in (figures.get("passed_over") or {}).items())
    cut = fixed(figures.get("cut_pct"), 1)
    rows = [
        ("observations cut", f"{cut} %, error {before} px before and {after} px after"),
        ("photographs without a place", ", ".join(left) or "none"),
        ("copies left out", _count(figures.get("duplicates"))),
        ("models that came about", ", ".join(models) or NONE),
        ("files not read", ", ".join(others) or "none"),
    ]
    return section(
        "cut", "What was cut", "What the model rests on no longer, and why it may be missed.", facts_list(rows)
    )


def _figures(figures: dict[str, Any]) -> str:
    why = figures.get("why") or {}
    rows = ""
    for key, value in figures.items():
        if isinstance(value, (dict, list)) or key == "why":
            continue
        said = str(why.get(key) or "no reason was given") if value is None else _plain(value)
        kind = "" if value is None else ' class="num"'
        rows += f'<tr><td class="key">{escape(key)}</td><td{kind}>{escape(said)}</td></tr>'
    stages = ", ".join(f"{name} {fixed(took, 0)} s" for name, took in (figures.get("stages_s") or {}).items())
    table = f'<table class="main"><tbody>{rows}</tbody></table>'
    lead = f"As in reconstruction.json. Stages took: {stages}."
    return section("figures", "All figures", escape(lead), collapsible_section("All figures", table))


def _plain(value: Any) -> str:
    return shown(value) if isinstance(value, bool | float) else str(value)
