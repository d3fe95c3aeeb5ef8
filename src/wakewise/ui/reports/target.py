"""What is delicate about a target: pictures coloured by score, and the points that stand for its water."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

from wakewise.core.arrays import Array, BoolArray, IntArray
from wakewise.core.errors import InputError
from wakewise.core.files import whole_file, write_bytes, write_text
from wakewise.scene.targets import Fragility, Region, Target
from wakewise.scene.targets.fragility import FRAGILE_FROM, SHARP_PER_M, THIN_M
from wakewise.ui.reports.page import framed_page, plot, section, template, tile
from wakewise.ui.reports.svg_style import INK, LINE, MUTED, SLATE, TEAL, new_figure, style_axes
from wakewise.ui.reports.trial import TrialMesh
from wakewise.ui.reports.views import ViewBounds, Viewpoint, draw_surface, png_pixels

SUFFIXES = (".html", ".svg", ".ply")
VIEW_PIXELS = 560
# Pale where robust, so that light and shade show the shape; read in grey too, and by those who see red and green alike.
SCALE = LinearSegmentedColormap.from_list("delicate", ("#ece7da", "#a9cfb8", "#4fa6a3", "#2a6a92", "#3b2a77"))
_NEAR_TO_FAR = LinearSegmentedColormap.from_list("far", colormaps["viridis"](np.linspace(0.0, 0.85, 64)))
VIEWS = (
    Viewpoint(name="from the north", azimuth_deg=0, elevation_deg=18),
    Viewpoint(name="from the east", azimuth_deg=90, elevation_deg=18),
    Viewpoint(name="from above", azimuth_deg=180, elevation_deg=89.9),
)
_OVER_BED_M = 1e-4


def write_target(path: Path, target: Target, delicacy: Fragility, region: Region) -> None:
    """Write a target's delicate features as a page (.html), a picture (.svg) or a coloured mesh (.ply).

    Raises InputError if the suffix is none of these.
    """
    suffix = path.suffix.lower()
    if suffix == ".html":
        write_text(path, target_page(target, delicacy, region))
    elif suffix == ".svg":
        with whole_file(path) as temporary:
            picture(target, delicacy, page=False).savefig(temporary, format="svg", metadata={"Date": None})
    elif suffix == ".ply":
        write_coloured(path, target, delicacy)
    else:
        raise InputError(f"{path}: suffix '{path.suffix}', allowed: {', '.join(SUFFIXES)}")


def write_coloured(path: Path, target: Target, delicacy: Fragility) -> None:
    """Write the mesh as binary PLY with a colour and the property `delicate` per vertex; z up, bed at z = 0, metres."""
    vertices = target.mesh.vertices_m * [1.0, -1.0, -1.0] + [0.0, 0.0, target.bed_z_m]
    colours = np.round(255 * colours_of(delicacy.score)).astype(np.uint8)
    mesh = trimesh.Trimesh(vertices, target.mesh.faces, vertex_colors=colours, process=False)
    mesh.vertex_attributes["delicate"] = delicacy.score.astype(np.float32)
    write_bytes(path, mesh.export(file_type="ply", vertex_normal=False))


def colours_of(score: Array) -> Array:
    """Colours from 0 to 1, shape (n, 3), of scores or shares from 0 to 1, shape (n,)."""
    return np.asarray(SCALE(np.clip(score, 0.0, 1.0)), dtype=np.float64)[:, :3]


def picture(target: Target, delicacy: Fragility, page: bool = True) -> Figure:
    """Target from three sides, coloured by score; in the page's ink, or in black for a picture of its own."""
    ink, muted, line = (INK, MUTED, LINE) if page else ("#12252d", "#587079", "#d9e1e3")
    surface = TrialMesh(vertices_m=target.mesh.vertices_m, faces=_above(target))
    frame = ViewBounds.around(target.mesh.vertices_m[np.unique(surface.faces)])
    sources = draw_surface(surface, colours_of(delicacy.score), VIEWS, frame, VIEW_PIXELS)
    figure = new_figure(10.2, 4.1)
    grid = figure.subplots(1, 3)
    span_mm = 1e3 * frame.radius_m
    for axes, source, view in zip(grid, sources, VIEWS, strict=True):
        axes.imshow(png_pixels(source), extent=(-span_mm, span_mm, -span_mm, span_mm), interpolation="antialiased")
        axes.set_axis_off()
        axes.annotate(view.name, (0.0, span_mm), xytext=(0, -4), textcoords="offset points", ha="center", va="top",
                      color=ink, fontsize=10.5)  # fmt: skip
    _ruler(grid[0], span_mm, muted)
    bar = figure.colorbar(
        ScalarMappable(Normalize(0, 1), SCALE), ax=list(grid), location="bottom", aspect=60, shrink=0.5
    )
    bar.set_label("score: 0 robust, 1 delicate", color=muted, fontsize=9.5)
    bar.ax.tick_params(colors=muted, labelsize=9, length=3)
    bar.outline.set_edgecolor(line)
    return figure


def spread(target: Target, delicacy: Fragility) -> Figure:
    """How much of the surface is how thick and how curved, with the bounds between which a score rises."""
    faces = _above(target)
    corners = target.mesh.triangles_m[_kept(target)]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    figure = new_figure(10.2, 2.9)
    thick, curved = figure.subplots(1, 2)
    for axes, values, bounds, unit, rising in (
        (thick, 1e3 * delicacy.thickness_m, 1e3 * np.array(THIN_M), "thickness (mm)", False),
        (curved, delicacy.curvature_per_m, np.array(SHARP_PER_M), "mean curvature (1/m)", True),
    ):
        style_axes(axes, x=unit, y="surface (%)")
        per_face = values[faces].mean(axis=1)
        low, high = np.percentile(per_face, [0.2, 99.8])
        low, high = (min(low, 0.0), max(high, 1.1 * bounds[1])) if not rising else (low, max(high, 1.1 * bounds[1]))
        axes.hist(per_face.clip(low, high), bins=60, weights=100.0 * area / area.sum(), color=SLATE)
        delicate = (bounds[1], high) if rising else (low, bounds[0])
        axes.axvspan(*delicate, color=TEAL, alpha=0.16, linewidth=0)
        axes.axvspan(*bounds, color=TEAL, alpha=0.08, linewidth=0)
        axes.set_xlim(low, high)
    return figure


def region_points(target: Target, region: Region) -> Figure:
    """Points of the region from the side and from above; area by weight, colour by distance to the surface."""
    figure = new_figure(10.2, 4.4)
    side, above = figure.subplots(1, 2)
    most = max(float(region.distance_m.max()), 1e-6)
    shadow = target.mesh.vertices_m[target.mesh.vertices_m[:, 2] < target.bed_z_m]
    for axes, up, label, title in (
        (side, 2, "height above the bed (mm)", "from the south"),
        (above, 0, "north (mm)", "from above"),
    ):
        style_axes(axes, x="east (mm)", y=label, grid="both")

        def flat(points: Array, up: int = up) -> tuple[Array, Array]:
            vertical = target.bed_z_m - points[:, 2] if up == 2 else points[:, up] - target.centre_W_m[up]
            return 1e3 * (points[:, 1] - target.centre_W_m[1]), 1e3 * vertical

        axes.plot(*flat(shadow[:: max(1, len(shadow) // 6000)]), ".", color=LINE, markersize=2.5, zorder=1)
        drawn = axes.scatter(
            *flat(region.points_W_m), s=16.0 * region.weights / region.weights.mean(), c=1e3 * region.distance_m,
            cmap=_NEAR_TO_FAR, vmin=0.0, vmax=1e3 * most, linewidths=0, alpha=0.9, zorder=2,
        )  # fmt: skip
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_title(title, loc="left", color=INK, fontsize=10.5)
    bar = figure.colorbar(drawn, ax=[side, above], aspect=26, pad=0.02)
    bar.set_label("distance to the surface (mm)", color=MUTED, fontsize=9.5)
    bar.ax.tick_params(colors=MUTED, labelsize=9, length=3)
    bar.outline.set_visible(False)
    return figure


def target_page(target: Target, delicacy: Fragility, region: Region) -> str:
    """HTML of the whole page, which opens with no network."""
    mesh = target.mesh
    length, width, height = 1e3 * mesh.extent_m
    middle = 1e3 * float(np.median(delicacy.thickness_m))
    tiles = (
        tile("size", f"{length:.0f}×{width:.0f}×{height:.0f}", "mm", "box round the mesh, with what is buried"),
        tile("surface", f"{1e4 * mesh.face_areas_m2.sum():.0f}", "cm²", f"{len(mesh.faces):,} triangles"),
        tile("thickness", f"{middle:.1f}", "mm", "median over the vertices"),
        tile("delicate", f"{100 * delicacy.share(mesh):.0f}", "%", f"of the surface scores {FRAGILE_FROM:g} or more"),
    )
    thin, sharp = 1e3 * np.array(THIN_M), SHARP_PER_M
    seen = plot(
        picture(target, delicacy),
        "Delicate features from three sides",
        f"Thin counts fully up to {thin[0]:g} mm and not from {thin[1]:g} mm on; sharp counts from a mean curvature of "
        f"{sharp[0]:g} per metre, fully from {sharp[1]:g}. Either suffices. What a person marked counts as marked.",
    )
    shares = plot(
        spread(target, delicacy),
        "Thickness and curvature",
        "Shaded: where the score rises, and where it is full. Weighted by area; the ends hold what lies beyond.",
    )
    few = int(np.sum(region.distance_m == 0.0))
    points = plot(
        region_points(target, region),
        "Points of the region",
        f"{few} points on the surface and {len(region.weights) - few} in the water stand for all of it. Area of a dot: "
        "its weight in the disturbance D. Grey: the target.",
    )
    features_lead = "Dark parts are thin, pointed or marked; pale parts are robust."
    sections = (
        section("", "Delicate features", features_lead, seen + shares),
        section("", "Region", "The disturbance is summed over these points.", points),
    )
    header = template("target.html").header(target.name, [Markup(one) for one in tiles])
    return framed_page(f"{target.name} · Wakewise", header, (), sections, "Made by Wakewise.")


def _kept(target: Target) -> BoolArray:
    """Which faces stand above the bed."""
    return np.asarray(np.any(target.mesh.triangles_m[:, :, 2] < target.bed_z_m - _OVER_BED_M, axis=1), dtype=np.bool_)


def _above(target: Target) -> IntArray:
    return target.mesh.faces[_kept(target)]


def _ruler(axes: Axes, span_mm: float, colour: str) -> None:
    """A bar of a round length under the first view."""
    length = next(step for step in (500.0, 200.0, 100.0, 50.0, 20.0, 10.0, 5.0) if step <= 0.7 * span_mm or step == 5.0)
    y = -0.97 * span_mm
    axes.plot([-0.5 * length, 0.5 * length], [y, y], color=colour, linewidth=1.4, solid_capstyle="butt")
    axes.annotate(f"{length:g} mm", (0.0, y), xytext=(0, 4), textcoords="offset points", ha="center", va="bottom",
                  color=colour, fontsize=9)  # fmt: skip
