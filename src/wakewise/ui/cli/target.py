"""`wakewise target`: what Wakewise makes of a target."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from wakewise.ui.cli.console import answer
from wakewise.ui.cli.options import Json, TargetSize, seed_option

if TYPE_CHECKING:
    from wakewise.scene.targets import Target

STREAMS_M_S = (0.004, 0.036, 0.06, 0.18)
"""Streams in which a soft target is shown: what a gentle method leaves, the tank's current, and the paper's washes."""

app = typer.Typer(help="What Wakewise makes of a target.")


@app.callback()
def _target() -> None:
    """What Wakewise makes of a target."""


@app.command("show")
def show(
    target: Annotated[
        str, typer.Argument(help="anemone, brain, branching, gorgonian, plate, seagrass, soft-coral, or a mesh file.")
    ] = "branching",
    out: Annotated[
        Path | None, typer.Option(help="Also write a page (.html), a picture (.svg) or a coloured mesh (.ply).")
    ] = None,
    marks: Annotated[Path | None, typer.Option(help="CSV of delicate places: x_m, y_m, z_m, radius_m, weight.")] = None,
    target_size: TargetSize = None,
    points: Annotated[int, typer.Option(help="Points of the region, 2 to 10000.")] = 300,
    gain: Annotated[
        float, typer.Option(help="How many times more the most delicate feature counts; 0 is the paper's weights.")
    ] = 0.0,
    seed: Annotated[
        int, typer.Option(callback=seed_option, help="Individual of a procedural coral, and draw of the points.")
    ] = 0,
    json: Json = False,
) -> None:
    """Show a target: size, surface, thickness, delicate features and the points that stand for its water.

    Delicate is what is thin or sharply curved, what the vertex property `delicate` of a PLY file says, and what
    --marks lists. Marks are in the frame of the written PLY: z up, centred, standing on z = 0, in metres.
    """
    import numpy as np

    from wakewise.core.errors import InputError
    from wakewise.core.optional_dependencies import need
    from wakewise.scene.targets import (
        find_fragility,
        find_mesh,
        is_mesh_file,
        place_on_bed,
        read_marks,
        read_vertex_scores,
        sample_region,
    )

    if out is not None and out.suffix.lower() not in (".html", ".svg", ".ply"):
        raise InputError(f"--out {out}: suffix '{out.suffix}', allowed: .html, .svg, .ply")
    if out is not None:
        need("--out", "reports", "photos", only=("matplotlib", "cv2", "embreex"))
    given = read_marks(marks) if marks is not None else None
    name, mesh = find_mesh(target, seed, target_size)
    scores = read_vertex_scores(Path(target).expanduser(), mesh) if is_mesh_file(target) else None
    marked = given.scores(mesh) if given is not None else None
    if marked is not None and scores is not None:
        marked = np.maximum(marked, scores)
    found = find_fragility(mesh, scores if marked is None else marked)
    standing = place_on_bed(name, mesh, 0.0)
    region = sample_region(standing, points, np.random.default_rng(seed), found, gain)
    if out is not None:
        from wakewise.ui.reports.target import write_target

        write_target(out, standing, found, region)
    quantiles = (0.05, 0.25, 0.5, 0.75, 0.95)
    area_m2 = float(mesh.face_areas_m2.sum())
    facts = {
        "target": name,
        "size_m": [float(value) for value in mesh.extent_m],
        "above_bed_m": float(standing.bed_z_m - standing.mesh.vertices_m[:, 2].min()),
        "vertices": len(mesh.vertices_m),
        "faces": len(mesh.faces),
        "area_m2": area_m2,
        "volume_m3": mesh.volume_m3 if mesh.is_closed else None,
        "watertight": mesh.is_closed,
        "thickness_m": {f"p{round(100 * q)}": float(np.quantile(found.thickness_m, q)) for q in quantiles},
        "curvature_per_m": {f"p{round(100 * q)}": float(np.quantile(found.curvature_per_m, q)) for q in quantiles},
        "delicate_share_pct": 100.0 * found.share(mesh),
        "marked_share_pct": None if given is None else 100.0 * float(np.mean(given.scores(mesh) > 0.0)),
        "region_points": len(region.weights),
        "region_on_surface": int(np.sum(region.distance_m == 0.0)),
        "region_weight": float(region.weights.sum()),
        "sway": _sway(standing),
        "out": None if out is None else str(out),
    }
    length, width, height = (1e3 * value for value in mesh.extent_m)
    volume = f", volume {1e6 * mesh.volume_m3:.0f} cm3" if mesh.is_closed else ""
    thick = ", ".join(f"p{round(100 * q)} {1e3 * np.quantile(found.thickness_m, q):.1f}" for q in quantiles)
    lines = [
        f"{name}: {length:.0f} x {width:.0f} x {height:.0f} mm, {len(mesh.faces):,} triangles",
        f"{'watertight' if mesh.is_closed else 'open'}, surface {1e4 * area_m2:.0f} cm2{volume}",
        f"thickness (mm): {thick}",
        f"delicate (score 0.5 or more): {facts['delicate_share_pct']:.1f} % of the surface",
    ]
    if given is not None:
        lines.append(f"marked: {len(given.weights)} places, {facts['marked_share_pct']:.1f} % of the vertices")
    lines.append(f"region: {facts['region_on_surface']} points on the surface, {points} in all")
    if isinstance(sway := facts["sway"], dict):
        bends = ", ".join(f"{way:.2g} at {speed}" for speed, way in sway["tip_mm"].items())
        stems = f"{sway['stems']} stem{'s' if sway['stems'] != 1 else ''}"
        lines.append(f"sways: {stems}, from {sway['frequency_Hz']:.2g} Hz; tip in a stream of m/s (mm): {bends}")
    answer(json, facts, *lines, None if out is None else f"written: {out}")


def _sway(target: Target) -> dict[str, object] | None:
    """How a soft procedural target bends; None of one that is rigid by its kind."""
    import numpy as np

    from wakewise.core.constants import TRIM_WATER_KG_M3
    from wakewise.scene.targets import TISSUES, BendingModes
    from wakewise.simulation.tank.soft_body import SurfaceElements, static_deflection_m

    if target.name not in TISSUES:
        return None
    tissue = TISSUES[target.name]
    sway = BendingModes.of(target, tissue, TRIM_WATER_KG_M3)
    pieces = SurfaceElements.of(target, sway)
    tips = {}
    for speed in STREAMS_M_S:
        streams = speed * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        ways = [static_deflection_m(pieces, sway, tissue.drag * TRIM_WATER_KG_M3, stream) for stream in streams]
        tips[f"{speed:g}"] = 1e3 * float(np.linalg.norm(ways, axis=2).max())
    return {"stems": len(sway.height_m), "frequency_Hz": float(sway.frequency_Hz.min()), "tip_mm": tips}
