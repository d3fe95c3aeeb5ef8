"""Orthophoto and heights of a flat subject on one grid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import StageError
from wakewise.core.files import whole_file, write_text
from wakewise.core.interfaces import Progress, no_progress
from wakewise.vision.imaging.sensor import srgb_encode
from wakewise.vision.reconstruction import read_cloud
from wakewise.vision.reconstruction.quality.split_half_check import fit_ground_plane, heights
from wakewise.vision.reconstruction.sfm.registered_photos import read_views
from wakewise.vision.texturing.colour import srgb_bytes
from wakewise.vision.texturing.textured import vertex_colours

MOST_CELLS = 6_000_000
GAP_CELLS = 2.5
"""Holes are closed up to so many cells from where there are points; beyond, the picture is transparent."""
CELL_SPACINGS = 1.5
STRAY_QUANTILES = (0.01, 0.99)


def write_orthophoto(
    model: Path, photos: Path, out: Path, *, cell: float | None = None, progress: Progress = no_progress
) -> dict[str, Any]:
    """Write `out/orthophoto.png` (transparent where nothing is known), `heights.png` (16 bits), world files and a JSON.

    The plane is that of `fit_ground_plane`; its first axis is to the right of the pictures, its second upwards.

    `cell`: side of a pixel in units of the model; one and a half point spacings if not given. Returns what
    orthophoto.json holds: cell, columns, rows, corner and axes in the model, step and lowest of the heights. Raises
    StageError if the subject is no plane, or nothing of it is seen.
    """
    cloud = read_cloud(model / "dense.ply")
    views, _ = read_views(model / "sparse", None)
    level = fit_ground_plane(cloud.points_m, np.array([view.p_WC_m for view in views]))
    in_plane = without_strays(level.to_plane(cloud.points_m))
    extent = np.ptp(in_plane[:, :2], axis=0)
    if cell is None:
        cell = CELL_SPACINGS * float(np.sqrt(extent.prod() / len(in_plane)))
    cell = max(cell, float(np.sqrt(extent.prod() / MOST_CELLS)))
    grid, low = heights(in_plane, cell)
    grid = closed(grid, GAP_CELLS)
    known = np.isfinite(grid)
    rows, columns = grid.shape
    across = low[0] + (np.arange(columns) + 0.5) * cell
    along = low[1] + (np.arange(rows) + 0.5) * cell
    vertices = level.to_model(
        np.stack([np.tile(across, rows), np.repeat(along, columns), np.where(known, grid, 0.0).ravel()], axis=1)
    )
    colours, seen = vertex_colours(vertices, grid_faces(known), views, photos, progress)
    seen &= known.ravel()
    if not seen.any():
        raise StageError("orthophoto: no photograph sees the subject from above")
    picture = np.zeros((rows * columns, 4), dtype=np.uint8)
    picture[seen, :3] = srgb_bytes(srgb_encode(np.clip(colours[seen], 0.0, 1.0)))
    picture[seen, 3] = 255
    lowest, highest = float(np.nanmin(grid)), float(np.nanmax(grid))
    step = max((highest - lowest) / 65534.0, 1e-12)
    levels = np.where(known, 1.0 + np.rint((np.where(known, grid, lowest) - lowest) / step), 0.0).astype(np.uint16)
    # Row 0 of a picture is its top.
    _png(out / "orthophoto.png", picture.reshape(rows, columns, 4)[::-1][..., [2, 1, 0, 3]])
    _png(out / "heights.png", levels[::-1])
    top = float(along[-1])
    world = "".join(f"{value:.12g}\n" for value in (cell, 0.0, 0.0, -cell, float(across[0]), top))
    for name in ("orthophoto.pgw", "heights.pgw"):
        write_text(out / name, world)
    facts = {
        "cell": cell,
        "columns": columns,
        "rows": rows,
        "first_pixel_across_along": [float(across[0]), top],
        "origin": level.origin.tolist(),
        "axes_across_along_up": level.axes.tolist(),
        "height_lowest": lowest,
        "height_step": step,
        "height_of": "height = height_lowest + (value - 1) * height_step; 0 is unknown",
        "covered_pct": 100.0 * float(seen.mean()),
    }
    write_text(out / "orthophoto.json", json.dumps(facts, indent=2) + "\n")
    return facts


def without_strays(in_plane: Array) -> Array:
    """Points less those that lie beyond nearly all others by a fifth of their extent, in any direction."""
    low, high = np.quantile(in_plane, STRAY_QUANTILES, axis=0)
    wide = 0.2 * (high - low)
    return np.asarray(in_plane[((in_plane >= low - wide) & (in_plane <= high + wide)).all(axis=1)])


def closed(grid: Array, most: float) -> Array:
    """Heights with holes closed by the nearest known one, up to `most` cells away."""
    known = np.isfinite(grid)
    distance, nearest = distance_transform_edt(~known, return_indices=True)
    return np.asarray(np.where(distance <= most, grid[tuple(nearest)], np.nan))


def grid_faces(known: NDArray[np.bool_]) -> IntArray:
    """Two triangles, shape (m, 3), for every four cells that are all known; corners are numbered row by row."""
    rows, columns = known.shape
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    whole = known[:-1, :-1] & known[:-1, 1:] & known[1:, 1:] & known[1:, :-1]
    # Counter-clockwise seen from above.
    return np.concatenate(
        [np.stack([a[whole], b[whole], c[whole]], axis=1), np.stack([a[whole], c[whole], d[whole]], axis=1)]
    )


def _png(path: Path, image: NDArray[Any]) -> None:
    data = cv2.imencode(".png", np.ascontiguousarray(image))[1].tobytes()
    with whole_file(path) as temporary:
        temporary.write_bytes(data)
