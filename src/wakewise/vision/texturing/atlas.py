"""Texture atlas of a mesh from its photographs: OBJ with material and picture, and GLB.

Every triangle has its own place in the atlas, two to a square, row by row. Its colours are blended of the photographs
that see it most directly and from nearest.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray
from PIL import Image as Pillow

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import StageError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import Progress, no_progress
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.reconstruction.outputs.clouds import read_surface
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto, read_views

SIDES_PX = (512, 1024, 2048, 4096, 8192)
CELL_PX = 9
"""A square of two triangles has at least this side, its border of one pixel and a half included."""
BORDER_PX = 1.5
BEST = 3
"""Photographs that a triangle's colours are blended from."""
UNSEEN = 118
"""Grey of triangles that no photograph sees."""
_SHARPNESS, _STEEPEST_COS, _GAP = 4, 0.15, 0.004
_CHUNK = 2_000


@dataclass(frozen=True, kw_only=True, eq=False)
class AtlasLayout:
    """Where triangles lie in the picture: its side and that of a square in px, corners in px, shape (m, 3, 2)."""

    side: int
    cell: int
    corners_px: Array

    def __post_init__(self) -> None:
        freeze(self, corners_px=(None, 3, 2))


def lay_out(faces: int) -> AtlasLayout:
    """Squares in rows, two triangles in each; the smallest picture in which squares have their least side.

    Raises StageError if there are more triangles than the largest picture holds.
    """
    squares = -(-faces // 2)
    for side in SIDES_PX:
        cell = int(side // np.ceil(np.sqrt(squares)))
        if cell >= CELL_PX:
            break
    else:
        most = 2 * (SIDES_PX[-1] // CELL_PX) ** 2
        raise StageError(f"texture: {faces} triangles, a picture of {SIDES_PX[-1]} px holds {most}; lower mesh_depth")
    per_row = side // cell
    number = np.arange(faces)
    square = number // 2
    corner = np.stack([square % per_row, square // per_row], axis=1)[:, None, :] * float(cell)
    return AtlasLayout(side=side, cell=cell, corners_px=corner + _corners(cell)[number % 2])


def best_views(
    vertices: Array, faces: IntArray, views: tuple[RegisteredPhoto, ...], progress: Progress = no_progress
) -> tuple[IntArray, Array]:
    """The views that see each triangle best, shape (m, BEST), -1 where there are fewer, and their weights.

    A view sees a triangle if it sees its middle and has all its corners in the picture.
    """
    scene = EmbreeScene()
    TriangleMesh(scene, vertices.astype(np.float32), faces.astype(np.int32))
    corners = vertices[faces]
    middle = corners.mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    which = np.full((len(faces), BEST), -1, dtype=np.int64)
    weight = np.zeros((len(faces), BEST))
    for k, view in enumerate(views):
        progress(k, 2 * len(views), view.name)
        way = middle - view.p_WC_m
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
        facing = -np.einsum("ij,ij->i", normal, way) / length
        some = np.flatnonzero(facing > _STEEPEST_COS)
        pixels, depth = view.project(corners[some].reshape(-1, 3))
        size = np.array([view.width, view.height])
        inside = (depth > 1e-6) & ((pixels > 1.0) & (pixels < size - 1.0)).all(axis=1)
        some = some[inside.reshape(-1, 3).all(axis=1)]
        if not len(some):
            continue
        start = np.ascontiguousarray(np.broadcast_to(view.p_WC_m.astype(np.float32), (len(some), 3)))
        hit = np.asarray(scene.run(start, way[some].astype(np.float32), query="DISTANCE"))
        some = some[hit > 1.0 - _GAP]
        good = (facing[some] * view.focal_px / length[some]) ** _SHARPNESS
        # The least of the best so far gives way.
        last = weight[some].argmin(axis=1)
        better = good > weight[some, last]
        which[some[better], last[better]] = k
        weight[some[better], last[better]] = good[better]
    return which, weight


def paint(
    layout: AtlasLayout,
    vertices: Array,
    faces: IntArray,
    views: tuple[RegisteredPhoto, ...],
    photos: Path,
    progress: Progress = no_progress,
) -> tuple[NDArray[np.uint8], float]:
    """The picture, shape (side, side, 3), red first, and the share of triangles that a photograph sees."""
    which, weight = best_views(vertices, faces, views, progress)
    weight = weight / np.maximum(weight.sum(axis=1, keepdims=True), 1e-300)
    picture = np.full((layout.side**2, 3), UNSEEN, dtype=np.float32)
    seen = np.asarray(which.max(axis=1) >= 0)
    patterns = [_pattern(layout, which_half) for which_half in (0, 1)]
    for half, pattern in enumerate(patterns):
        mine = np.flatnonzero(seen[half::2]) * 2 + half
        for start in range(0, len(mine), _CHUNK):
            picture[_texels(layout, mine[start : start + _CHUNK], pattern[0])] = 0.0
    for k, view in enumerate(views):
        progress(len(views) + k, 2 * len(views), view.name)
        share = np.where(which == k, weight, 0.0).sum(axis=1)
        if not share.any():
            continue
        image = read_picture(photos / view.name, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        if image is None:
            raise StageError(f"{photos / view.name}: can no longer be read")
        scale = np.array([image.shape[1] / view.width, image.shape[0] / view.height])
        for half, (inside, bary) in enumerate(patterns):
            mine = np.flatnonzero(share[half::2] > 0.0) * 2 + half
            for start in range(0, len(mine), _CHUNK):
                part = mine[start : start + _CHUNK]
                points = np.einsum("nk,mkd->mnd", bary, vertices[faces[part]]).reshape(-1, 3)
                pixels = (view.project(points)[0] * scale - 0.5).astype(np.float32).reshape(len(part), -1, 2)
                colours = cv2.remap(
                    image, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
                )
                # No pixel belongs to two triangles, so none is added to twice.
                picture[_texels(layout, part, inside)] += (
                    share[part, None, None].astype(np.float32) * colours[..., ::-1]
                )
    out = np.clip(np.rint(picture), 0, 255).astype(np.uint8).reshape(layout.side, layout.side, 3)
    return out, float(seen.mean())


def _pattern(layout: AtlasLayout, half: int) -> tuple[IntArray, Array]:
    """Pixels of a square that one of its two triangles owns, as steps from the square's first, and their places in it.

    A triangle owns its half of the square, border and all: its colours go on beyond its edges, so that a viewer's
    interpolation finds nothing else there. Places are barycentric, shape (n, 3).
    """
    cell = layout.cell
    row, column = (axis.ravel() for axis in np.mgrid[:cell, :cell])
    own = np.flatnonzero((column + row + 1 > cell) == bool(half))
    a, b, c = _corners(cell)[half]
    matrix = np.linalg.inv(np.array([b - a, c - a]).T)
    two = (np.stack([column[own] + 0.5, row[own] + 0.5], axis=1) - a) @ matrix.T
    bary = np.concatenate([1.0 - two.sum(axis=1, keepdims=True), two], axis=1)
    return np.asarray(row[own] * layout.side + column[own], dtype=np.int64), bary


def _texels(layout: AtlasLayout, faces: IntArray, inside: IntArray) -> IntArray:
    """Pixels of the picture, counted row by row, that triangles own, shape (m, n)."""
    per_row = layout.side // layout.cell
    square = faces // 2
    first = (square // per_row) * layout.cell * layout.side + (square % per_row) * layout.cell
    return np.asarray(first[:, None] + inside, dtype=np.int64)


def _corners(cell: int) -> Array:
    """Corners of a square's two triangles in px, shape (2, 3, 2)."""
    low, high = BORDER_PX, cell - BORDER_PX
    gap = BORDER_PX  # between the two, along the diagonal
    first = [[low, low], [high - gap, low], [low, high - gap]]
    second = [[high, high], [low + gap, high], [high, low + gap]]
    return np.array([first, second])


def write_atlas(model: Path, photos: Path, out: Path, progress: Progress = no_progress) -> float:
    """Write textured.obj, textured.mtl, textured.png and textured.glb of a model's mesh.ply; the share that is seen.

    Raises StageError if there is no surface, no photograph sees it, or it has too many triangles.
    """
    path = model / "mesh.ply"
    vertices, faces = read_surface(path)
    views, _ = read_views(model / "sparse", None)
    layout = lay_out(len(faces))
    picture, seen = paint(layout, vertices, faces, views, photos, progress)
    if seen == 0.0:
        raise StageError(f"{path}: no photograph sees it")
    # v runs up, pixels down.
    uv = layout.corners_px.reshape(-1, 2) / layout.side * [1.0, -1.0] + [0.0, 1.0]
    stored = io.BytesIO()
    Pillow.fromarray(picture).save(stored, format="PNG")
    lines = ["mtllib textured.mtl", "usemtl photographs"]
    lines += [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices]
    lines += [f"vt {u:.6f} {v:.6f}" for u, v in uv]
    corner = np.arange(3 * len(faces)).reshape(-1, 3) + 1
    lines += [
        f"f {a}/{i} {b}/{j} {c}/{k}" for (a, b, c), (i, j, k) in zip((faces + 1).tolist(), corner.tolist(), strict=True)
    ]
    mesh = trimesh.Trimesh(vertices[faces].reshape(-1, 3), corner - 1, process=False)
    mesh.visual = trimesh.visual.TextureVisuals(
        uv=uv,
        material=trimesh.visual.material.PBRMaterial(
            baseColorTexture=Pillow.fromarray(picture), metallicFactor=0.0, roughnessFactor=0.9, doubleSided=True
        ),
    )
    glb = trimesh.Scene({"model": mesh}).export(file_type="glb")
    material = "newmtl photographs\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd textured.png\n"
    for name, data in (
        ("textured.png", stored.getvalue()),
        ("textured.mtl", material.encode()),
        ("textured.obj", ("\n".join(lines) + "\n").encode()),
        ("textured.glb", glb),
    ):
        with whole_file(out / name) as temporary:
            temporary.write_bytes(data)
    return seen
