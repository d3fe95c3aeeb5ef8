"""Vertex colours of a mesh from its photographs, as GLB.

A vertex takes its colour mostly from the photographs that see it most directly and from nearest. A photograph sees a
vertex if no other part of the mesh is in between.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import StageError
from wakewise.core.files import whole_file
from wakewise.core.interfaces import no_progress
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.reconstruction.outputs.clouds import read_surface
from wakewise.vision.reconstruction.sfm.registered_photos import RegisteredPhoto, read_views
from wakewise.vision.texturing.colour import srgb_decode

_SHARPNESS = 4
"""Power of a view's weight: at 4, one that sees a surface twice as well counts sixteen times."""
_STEEPEST_COS = 0.15
_GAP = 0.004  # of the distance: what is nearer than this before a vertex is the vertex's own surface
_UNSEEN = 0.18  # linear grey of what no photograph sees
_SPREAD = 200
_MIDDLE = 0.22
"""Linear brightness given to the median vertex."""


def write_textured(
    model: Path, photos: Path, out: Path, *, bed_z_m: float | None = None, progress: Callable[..., None] = no_progress
) -> float:
    """Write the mesh of a model as GLB with a colour at every vertex, and give the share of vertices seen, 0 to 1.

    `model`: folder with sparse/ and mesh.ply. `photos`: folder of the photographs. `out`: ends in .glb. Metres; x east,
    y up, z south of a model in NED with the bed at `bed_z_m`; if that is None, the axes are the model's own. Raises
    StageError if the mesh holds no triangles or no photograph sees it.
    """
    vertices, faces = read_surface(model / "mesh.ply")
    views, _ = read_views(model / "sparse", None)
    colours, seen = vertex_colours(vertices, faces, views, photos, progress)
    if not seen.any():
        raise StageError(f"{model / 'mesh.ply'}: no photograph sees it")
    colours = fill_unseen_colours(colours, seen, faces)
    # As light as a viewer can show it: what water and a short exposure leave is dark.
    brightest = colours.max(axis=1)
    colours = colours * min(
        _MIDDLE / max(float(np.median(brightest)), 1e-6), 0.9 / max(float(np.quantile(brightest, 0.99)), 1e-6)
    )
    mesh = trimesh.Trimesh(y_up_vertices(vertices, bed_z_m), faces, process=False)
    # glTF has colours in linear light; without a material of its own it takes a mesh for bare metal.
    rgba = np.concatenate([np.round(255 * np.clip(colours, 0, 1)), np.full((len(colours), 1), 255)], axis=1)
    mesh.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=0.9, doubleSided=True)
    )
    mesh.visual.vertex_attributes["color"] = rgba.astype(np.uint8)
    data = trimesh.Scene({"model": mesh}).export(file_type="glb", include_normals=True)
    with whole_file(out) as temporary:
        temporary.write_bytes(data)
    return float(seen.mean())


def read_textured(path: Path) -> tuple[Array, IntArray, Array]:
    """Vertices (n, 3), faces (m, 3) and linear colours (n, 3), 0 to 1, of a file that `write_textured` wrote.

    Raises ValueError if the file is another kind of GLB.
    """
    data = path.read_bytes()
    if data[:4] != b"glTF":
        raise ValueError("is no GLB file")
    (size,) = struct.unpack("<I", data[12:16])
    tree = json.loads(data[20 : 20 + size])
    binary = data[28 + size :]
    primitive = tree["meshes"][0]["primitives"][0]

    def column(index: int, kind: str, width: int) -> Array:
        accessor = tree["accessors"][index]
        start = tree["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)
        values = np.frombuffer(binary, dtype=kind, count=accessor["count"] * width, offset=start)
        return values.reshape(-1, width).astype(np.float64)

    named = primitive["attributes"]
    vertices, colours = column(named["POSITION"], "<f4", 3), column(named["COLOR_0"], "u1", 4)[:, :3] / 255.0
    return vertices, column(primitive["indices"], "<u4", 1).astype(np.int64).reshape(-1, 3), colours


def y_up_vertices(vertices_m: Array, bed_z_m: float | None) -> Array:
    """Vertices with y up, as GLB has it, of a model in NED; unchanged without a bed."""
    if bed_z_m is None:
        return vertices_m
    x, y, z = vertices_m.T
    return np.column_stack([y, bed_z_m - z, -x])


def vertex_colours(
    vertices_m: Array,
    faces: IntArray,
    views: tuple[RegisteredPhoto, ...],
    photos: Path,
    progress: Callable[..., None] = no_progress,
) -> tuple[Array, NDArray[np.bool_]]:
    """Linear colours of vertices, shape (n, 3), and which of them are seen, shape (n,)."""
    scene = EmbreeScene()
    TriangleMesh(scene, vertices_m.astype(np.float32), faces.astype(np.int32))
    normals = np.asarray(trimesh.Trimesh(vertices_m, faces, process=False).vertex_normals)
    total, weight = np.zeros((len(vertices_m), 3)), np.zeros(len(vertices_m))
    for k, view in enumerate(views):
        progress(k, len(views), view.name)
        image = read_picture(photos / view.name)
        if image is None:
            continue
        h, w = image.shape[:2]
        if abs(w * view.height - h * view.width) > 0.01 * w * view.height:
            continue  # turned since: its pixels are not where the model has them
        way = vertices_m - view.p_WC_m
        length = np.sqrt(np.einsum("ij,ij->i", way, way))
        facing = -np.einsum("ij,ij->i", normals, way) / np.maximum(length, 1e-12)
        # Most of a mesh faces away; it is left out first.
        some = np.flatnonzero(facing > _STEEPEST_COS)
        pixels, depth = view.project(vertices_m[some])
        pixels = pixels * np.array([w / view.width, h / view.height])
        u, v = pixels.T
        inside = np.flatnonzero((depth > 1e-6) & (u > 1.0) & (u < w - 1.0) & (v > 1.0) & (v < h - 1.0))
        if not len(inside):
            continue
        start = np.ascontiguousarray(np.broadcast_to(view.p_WC_m.astype(np.float32), (len(inside), 3)))
        hit = scene.run(start, way[some[inside]].astype(np.float32), query="DISTANCE")
        inside = inside[np.asarray(hit) > 1.0 - _GAP]
        some, pixels, depth = some[inside], pixels[inside], depth[inside]
        colour = _sampled(srgb_decode(np.ascontiguousarray(image[..., ::-1])), (pixels - 0.5).astype(np.float32))
        good = (facing[some] * view.focal_px / depth) ** _SHARPNESS
        total[some] += good[:, None] * colour
        weight[some] += good
    seen = weight > 0.0
    return total / np.maximum(weight, 1e-300)[:, None], seen


def fill_unseen_colours(colours: Array, seen: NDArray[np.bool_], faces: IntArray) -> Array:
    """Colours in which vertices that nothing saw take the mean of neighbours that have one, ring by ring.

    A neighbour counts once for each face it shares.
    """
    out, known = np.where(seen[:, None], colours, _UNSEEN), seen.copy()
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.concatenate([edges, edges[:, ::-1]])
    for _ in range(_SPREAD):
        ring = edges[known[edges[:, 0]] & ~known[edges[:, 1]]]
        if not len(ring):
            break
        count = np.bincount(ring[:, 1], minlength=len(out))
        new = count > 0
        for band in range(3):
            total = np.bincount(ring[:, 1], out[ring[:, 0], band], minlength=len(out))
            out[new, band] = total[new] / count[new]
        known |= new
    return out


def _sampled(image: NDArray[np.float32], place: NDArray[np.float32]) -> Array:
    """Bilinear values, shape (n, 3), of an image at (column, row) with whole numbers at the pixels' middles."""
    column, row = np.floor(place).astype(int).T
    u, v = (place - np.floor(place)).T[:, :, None]
    return np.asarray(
        (1 - v) * ((1 - u) * image[row, column] + u * image[row, column + 1])
        + v * ((1 - u) * image[row + 1, column] + u * image[row + 1, column + 1])
    )
