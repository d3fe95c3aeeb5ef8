"""Report of a model from photographs: verdict, 3D scene, scale, matches, photographs, removed observations, figures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import viser
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.files import write_text
from wakewise.core.geometry import quat_from_matrix
from wakewise.ui.reports.media import thumbnail
from wakewise.ui.reports.page import (
    collapsible_section,
    framed_page,
    legend_entry,
    missing,
    parts,
    plot,
    scene_box,
    section,
    template,
    tile,
)
from wakewise.ui.reports.scene3d import (
    CAMERA_RGB,
    FOV_RAD,
    MAX_POINTS,
    add_points,
    aim_camera,
    decimated,
    matt_mesh,
    opaque,
    scene_server,
)
from wakewise.ui.reports.svg_style import TEAL, new_figure, style_axes
from wakewise.ui.reports.text import NONE, fixed, number, shown
from wakewise.ui.reports.trial import TrialMesh
from wakewise.vision.reconstruction import read_cloud
from wakewise.vision.reconstruction.quality.photo_statistics import ModelStatistics, PhotoStatistics, model_facts
from wakewise.vision.texturing.textured import read_textured


def scale_tile(figures: dict[str, Any]) -> str:
    """One figure for the top of the page."""
    bars, fixes, scale = figures.get("scale_bars"), figures.get("scale_fixes"), figures.get("scale")
    if bars is not None and bars["used"]:
        count = len(bars["bars"])
        return tile("scale", f"± {number(bars['uncertainty_pct'], 2)}", "%", f"by {_bars(count)}")
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
    lead, content = (
        "The model has no scale: its lengths mean nothing by themselves.",
        str(template("photos.html").scale_hint()),
    )
    if bars is not None:
        lead, content = _by_bars(bars)
    elif figures.get("scale") is not None:
        lead, content = "From the places of the cameras that were given.", str(parts().facts(_references(figures)))
    elif fixes is not None and fixes["used"]:
        lead, content = f"From where {shown(fixes['photos'])} photos were taken, by their fixes.", ""
    return section("scale", "Scale", lead, content + ("" if fixes is None else str(parts().facts(_by_fixes(fixes)))))


def _by_fixes(fixes: dict[str, Any]) -> list[tuple[str, str]]:
    unsure = fixes.get("uncertainty_pct")
    rows = [("scale by fixes", "unknown" if unsure is None else f"uncertain by {number(unsure, 2)} %")]
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
        f"From {_bars(len(bars['bars']))} between coded targets, uncertain by {number(bars['uncertainty_pct'], 2)} %."
        if bars["used"]
        else f"From reference cameras; by the bars, lengths are {fixed(bars['model_off_pct'], 3, sign=True)} % off."
    )
    rows = [
        (
            bar["name"],
            f"{fixed(bar['length_m'], 2, scale=1e3)} ± {fixed(bar['sigma_m'], 2, scale=1e3)} mm",
            f"{fixed(bar['found_m'], 2, scale=1e3)} mm",
            f"{fixed(bar['off_mm'], 2, sign=True)} mm",
            "only one" if bar["check_pct"] is None else f"{fixed(bar['check_pct'], 3, sign=True)} %",
            shown(bar["photos"]),
        )
        for bar in bars["bars"]
    ]
    heads = ("bar", "stated", "in the model", "off", "by the other bars", "photos")
    content = str(parts().table("ttnnnn", heads, rows))
    targets = [
        (
            shown(one["target"]),
            shown(one["photos"]),
            f"{fixed(one['error_px'], 2)} px",
            f"{fixed(_mean(one['sides_mm']), 2)} mm",
            ", ".join(fixed(value, 4) for value in one["middle_m"] or []),
        )
        for one in bars["targets"]
    ]
    if targets:
        table = parts().table("tnnnt", ("target", "photos", "error", "side", "middle, m"), targets)
        content += collapsible_section(f"Targets ({bars['family']})", table, f"{len(targets)}")
    return lead, content


def _bars(count: int) -> str:
    return f"{count} bar{'s' * (count > 1)}"


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


FRUSTUM_SHARE = 0.12
"""Size of a camera's pyramid over the median distance from camera to subject."""
_MOST_PICTURES = 120


def model_up(facts: ModelStatistics) -> Array:
    """Which way is up, a unit vector: the pictures' own where they agree on it, else against where cameras look."""
    turns = [photo.R_WC for photo in facts.photos if photo.R_WC is not None]
    if not turns:
        return np.array([0.0, 0.0, 1.0])
    upright, back = -np.mean([R[:, 1] for R in turns], axis=0), -np.mean([R[:, 2] for R in turns], axis=0)
    best = upright if np.linalg.norm(upright) > max(0.6, float(np.linalg.norm(back))) else back
    length = float(np.linalg.norm(best))
    return np.asarray(best / length, dtype=np.float64) if length > 1e-6 else np.array([0.0, 0.0, 1.0])


def model_scene(model: Path, photos: Path, facts: ModelStatistics) -> str | None:
    """Whole HTML page with the scene of a model's folder; None if no photograph has a place."""
    placed = [photo for photo in facts.photos if photo.p_WC is not None]
    if not placed or not len(facts.points):
        return None
    eyes = np.array([photo.p_WC for photo in placed])
    middle = np.median(facts.points, axis=0)
    up = model_up(facts)
    with scene_server(up.tolist()) as server:
        seen = _subject(server, model, facts)
        distance = float(np.median(np.linalg.norm(eyes - middle, axis=1)))
        _cameras(server, photos, placed, FRUSTUM_SHARE * distance)
        _aim(server, seen, eyes, up)
        return str(server.get_scene_serializer().as_html())


def _subject(server: viser.ViserServer, model: Path, facts: ModelStatistics) -> Array:
    """Add surface, dense and sparse points; what is in sight at first, as points."""
    seen = facts.points
    surface = (model / "mesh.glb").is_file()
    if surface:
        vertices, faces, colours = read_textured(model / "mesh.glb")
        light, chosen = decimated(TrialMesh(vertices_m=vertices, faces=faces))
        server.scene.add_mesh_trimesh("/surface", matt_mesh(light.vertices_m, light.faces, opaque(colours[chosen])))
        seen = light.vertices_m
    dense = (model / "dense.ply").is_file()
    if dense:
        cloud = read_cloud(model / "dense.ply")
        if not surface:
            seen = cloud.points_m
        _points(server, "/dense points", cloud.points_m, cloud.colours, not surface)
    _points(server, "/sparse points", facts.points, facts.colours, not surface and not dense, most=len(facts.points))
    return np.asarray(seen, dtype=np.float64)


def _points(
    server: viser.ViserServer, name: str, points: Array, colours: Array, visible: bool, most: int = MAX_POINTS
) -> None:
    extent = float(np.linalg.norm(np.subtract(*np.quantile(points, (0.95, 0.05), axis=0))))
    add_points(server, name, points, colours, 0.004 * extent, visible, most=most)


def _cameras(server: viser.ViserServer, photos: Path, placed: list[PhotoStatistics], size: float) -> None:
    every = max(1, -(-len(placed) // _MOST_PICTURES))
    for k, photo in enumerate(placed):
        if photo.R_WC is None or photo.p_WC is None:
            continue
        server.scene.add_camera_frustum(
            f"/photographs/{photo.name}", fov=float(np.radians(photo.fov_deg)), aspect=photo.aspect, scale=size,
            thickness=0.02 * size, color=CAMERA_RGB, image=thumbnail(photos / photo.name) if k % every == 0 else None,
            format="jpeg", jpeg_quality=70, cast_shadow=False, receive_shadow=False,
            wxyz=quat_from_matrix(photo.R_WC), position=photo.p_WC,
        )  # fmt: skip


def _aim(server: viser.ViserServer, seen: Array, eyes: Array, up: Array) -> None:
    """Open on the subject from where the cameras are, a little raised."""
    low, high = np.quantile(seen, (0.02, 0.98), axis=0)
    centre, reach = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    way = eyes.mean(axis=0) - centre
    side = eyes[0] - centre
    way = way / max(float(np.linalg.norm(way)), 1e-9) + 0.35 * side / max(float(np.linalg.norm(side)), 1e-9)
    way = way / max(float(np.linalg.norm(way)), 1e-9)
    distance = 1.15 * reach / np.sin(0.5 * FOV_RAD)
    aim_camera(server, centre, centre + distance * way, up.tolist(), near=0.005 * distance)


LINKS = (
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

    Raises InputError if the folder holds no such model.
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
    sections = (
        _model(figures, facts, scene),
        scale_section(figures),
        _matches(facts),
        _photos(figures, facts),
        _cut(figures),
        _figures(figures),
    )
    footer = template("photos.html").model_footer()
    return framed_page(f"{name} · model", _header(name, figures), LINKS, sections, footer)


def _header(name: str, figures: dict[str, Any]) -> str:
    warnings = figures.get("warnings") or []
    images, placed = _count(figures.get("images")), _count(figures.get("registered_images"))
    headline = "The model is doubtful" if warnings else f"A sound model of {placed} of {images} photographs"
    tiles = [Markup(one) for one in _tiles(figures)]
    return str(parts().header([("model", name)], headline, "bad" if warnings else "good", warnings, tiles))


def _tiles(figures: dict[str, Any]) -> list[str]:
    placed, images = figures.get("registered_images"), figures.get("images")
    spacing = figures.get("point_spacing_mm")
    dense = figures.get("dense_points")
    faces = figures.get("mesh_faces")
    note = "apart: no scale" if spacing is None else f"{number(spacing, 2)} mm apart"
    surface = "not asked for" if faces is None else "triangles"
    uncut, cut = fixed(figures.get("reprojection_uncut_px"), 2), fixed(figures.get("cut_pct"), 0)
    state = "" if placed is None or images is None else "ok" if placed == images else "off"
    features = f"in {fixed(figures.get('track_length'), 1)} photos each"
    return [
        tile("photographs placed", _count(placed), f"of {_count(images)}", "have a place in the model", state),
        tile("error", fixed(figures.get("reprojection_px"), 2), "px", f"mean; {uncut} px with outliers ({cut} %)"),
        scale_tile(figures),
        tile("sparse points", _count(figures.get("points")), "", features),
        tile("dense points", _count(dense), "", "not asked for" if dense is None else note),
        tile("surface", _count(faces), "", surface),
    ]


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
    rows = []
    for k, photo in enumerate(facts.photos):
        partners = int((facts.matches[k] > 0).sum())
        place = "yes"
        if photo.p_WC is None:
            best = left.get(photo.name)
            found = best is not None and best["partner"]
            place = f"none; {_count(best['matches'])} matches with {best['partner']}" if best and found else "none"
        error = NONE if photo.error_px is None else f"{fixed(photo.error_px, 2)} px"
        cells = (photo.name, place, _count(photo.features), _count(photo.observations), error, str(partners),
                 f"{fixed(photo.focal_px, 0)} px")  # fmt: skip
        rows.append(cells)
    heads = ("photograph", "place", "features", "points seen", "error", "partners", "focal length")
    table = parts().table("ttnnnnn", heads, rows)
    lead = "Errors are means over the sparse points that a photograph sees, each point's over all that see it."
    content = collapsible_section("Every photograph", table, f"{len(rows)}") if len(rows) > _LONG else table
    return section("photos", "Photographs", lead, str(content))


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
        "cut", "What was cut", "What the model rests on no longer, and why it may be missed.", str(parts().facts(rows))
    )


def _figures(figures: dict[str, Any]) -> str:
    why = figures.get("why") or {}
    rows = []
    for key, value in figures.items():
        if isinstance(value, (dict, list)) or key == "why":
            continue
        reason = str(why.get(key) or "no reason was given")
        rows.append((key, reason if value is None else template("photos.html").number_cell(_plain(value))))
    stages = ", ".join(f"{name} {fixed(took, 0)} s" for name, took in (figures.get("stages_s") or {}).items())
    table = parts().table("kt", (), rows, "main", wide=False)
    lead = f"As in reconstruction.json. Stages took: {stages}."
    return section("figures", "All figures", str(escape(lead)), collapsible_section("All figures", table))


def _plain(value: Any) -> str:
    return shown(value) if isinstance(value, bool | float) else str(value)
