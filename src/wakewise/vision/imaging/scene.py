"""The scene: the target on a bed of sand with stones, ready for ray casting; independent of the view.

Its origin F is the target's foot (the bed below the target's centre) with the world's axes, so single precision
suffices. Bounding spheres of pieces of the solids, tested against the cones of image tiles, select the pixels that need
rays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit
from wakewise.scene.targets import Mesh, Target
from wakewise.vision.imaging.bed_view import HeightField, grid_faces, height_field
from wakewise.vision.imaging.camera import ray_at
from wakewise.vision.imaging.daylight import LedPanels, bake_light
from wakewise.vision.imaging.texture import BED_MAP_LEVELS, BED_MAP_SIZE, BED_TEXEL_M, Maps, bake_bed, bed_heights

PIECE_M = 0.03
"""Width of the cells by which surfaces are cut into pieces."""
TILE_PX, COARSE = 8, 8
"""Pixels along a tile's side, and tiles along the side of a coarse one."""
SLACK = 1.02
"""Widening of a cone whose angle is that of its corners: a lens may bulge the sides between them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundingSpheres:
    """A surface cut into pieces, for spheres round them however it is moved; make it with `BoundingSpheres.of`.

    `faces` (m, 3) are vertex indices, those of a piece one after the other; `firsts` (k + 1,) says where each begins.
    """

    faces: IntArray
    firsts: IntArray

    @classmethod
    def of(cls, vertices: Array, faces: IntArray) -> BoundingSpheres:
        """Cut a surface into cells of `PIECE_M`."""
        if not len(faces):
            return cls(faces=np.zeros((0, 3), np.int64), firsts=np.zeros(1, np.int64))
        cells = np.floor(vertices[faces].mean(axis=1) / PIECE_M).astype(np.int64)
        cells -= cells.min(axis=0)
        _, rows, columns = cells.max(axis=0) + 1
        # One number a cell sorts as its three do, in a tenth of the time.
        number = (cells[:, 0] * rows + cells[:, 1]) * columns + cells[:, 2]
        order = np.argsort(number, kind="stable")
        begins = np.flatnonzero(np.diff(number[order], prepend=-1))
        return cls(faces=faces[order].astype(np.int64), firsts=np.append(begins, len(faces)))

    def spheres(self, vertices: Array) -> Array:
        """Spheres (x, y, z, radius), shape (k, 4), that hold the pieces where the vertices are now, shape (n, 3)."""
        out = np.empty((len(self.firsts) - 1, 4))
        _spheres(np.ascontiguousarray(vertices, np.float64), self.faces, self.firsts, out)
        return out


@njit(nogil=True)
def _spheres(vertices: Any, faces: Any, firsts: Any, out: Any) -> None:
    low, high = np.empty(3), np.empty(3)
    for k in range(out.shape[0]):
        low[:], high[:] = np.inf, -np.inf
        for m in range(firsts[k], firsts[k + 1]):
            for corner in range(3):
                for j in range(3):
                    low[j] = min(low[j], vertices[faces[m, corner], j])
                    high[j] = max(high[j], vertices[faces[m, corner], j])
        furthest = 0.0
        for j in range(3):
            out[k, j] = 0.5 * (low[j] + high[j])
        for m in range(firsts[k], firsts[k + 1]):
            for corner in range(3):
                away = 0.0
                for j in range(3):
                    away += (vertices[faces[m, corner], j] - out[k, j]) ** 2
                furthest = max(furthest, away)
        out[k, 3] = math.sqrt(furthest) + 1e-6


@njit(nogil=True)
def _cone(row: Any, x0: float, y0: float, x1: float, y1: float) -> tuple[float, float, float, float, float, float]:
    """Cone round the rays of a rectangle of pixels: unit axis, apex on the optical axis, half angle, apex's spread."""
    sx, sy, apex = ray_at(row, 0.5 * (x0 + x1), 0.5 * (y0 + y1))
    length = math.sqrt(sx * sx + sy * sy + 1.0)
    ax, ay, az = sx / length, sy / length, 1.0 / length
    least, spread = 1.0, 0.0
    for k in range(4):
        sx, sy, z0 = ray_at(row, x0 if k % 2 == 0 else x1, y0 if k < 2 else y1)
        cosine = (ax * sx + ay * sy + az) / math.sqrt(sx * sx + sy * sy + 1.0)
        least, spread = min(least, cosine), max(spread, abs(z0 - apex))
    return ax, ay, az, apex, SLACK * math.acos(max(min(least, 1.0), -1.0)) + 1e-6, SLACK * spread


@njit(nogil=True)
def _meets(
    ax: float, ay: float, az: float, apex: float, cosine: float, sine: float, spread: float, x: float, y: float,
    z: float, radius: float,
) -> bool:  # fmt: skip
    """Whether a cone may meet a sphere: the distance to the cone's side is never more than to the cone."""
    z -= apex
    along = ax * x + ay * y + az * z
    aside = math.sqrt(max(x * x + y * y + z * z - along * along, 0.0))
    return bool(aside * cosine - along * sine <= radius + spread)


@njit(nogil=True)
def tile_sphere_overlap(row: Any, width: int, height: int, spheres_C: Any, out: Any) -> None:
    """Write, for each tile of 8 x 8 pixels, whether a ray through it may meet a sphere.

    `spheres_C` (k, 4) in the camera frame; `out` (ceil(height / 8), ceil(width / 8)) of bool.
    """
    rows, columns = out.shape
    some = np.empty(spheres_C.shape[0], np.int64)
    for big_j in range(0, rows, COARSE):
        for big_i in range(0, columns, COARSE):
            end_j, end_i = min(big_j + COARSE, rows), min(big_i + COARSE, columns)
            ax, ay, az, apex, angle, spread = _cone(
                row, big_i * TILE_PX, big_j * TILE_PX, min(end_i * TILE_PX, width), min(end_j * TILE_PX, height)
            )
            cosine, sine = math.cos(angle), math.sin(angle)
            count = 0
            for k in range(spheres_C.shape[0]):
                x, y, z, r = spheres_C[k, 0], spheres_C[k, 1], spheres_C[k, 2], spheres_C[k, 3]
                if _meets(ax, ay, az, apex, cosine, sine, spread, x, y, z, r):
                    some[count] = k
                    count += 1
            for j in range(big_j, end_j):
                for i in range(big_i, end_i):
                    hit = False
                    if count > 0:
                        ax, ay, az, apex, angle, spread = _cone(
                            row, i * TILE_PX, j * TILE_PX, min((i + 1) * TILE_PX, width), min((j + 1) * TILE_PX, height)
                        )
                        cosine, sine = math.cos(angle), math.sin(angle)
                        for m in range(count):
                            k = some[m]
                            x, y, z, r = spheres_C[k, 0], spheres_C[k, 1], spheres_C[k, 2], spheres_C[k, 3]
                            if _meets(ax, ay, az, apex, cosine, sine, spread, x, y, z, r):
                                hit = True
                                break
                    out[j, i] = hit


TARGET, BED, STONE = 0, 1, 2
"""Numbers of the three kinds of surface, as ray casting returns them."""

BED_HALF_WIDTH_M = 12.0
"""Half width of the whole bed: beyond it there is only water."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Surfaces of a trial with all that shading needs; make it with `Scene.build`.

    `foot_W_m` (3,) is the origin F in the world; `vertices_F_m` (n, 3), `faces` (m, 3) and `first_face` (3,) hold
    target, bed and stones one after the other; `normals` (n, 3) point outward; `daylight` (n, 2) is the irradiance of
    the down-welling light on the outer and the inner side, relative to a level open surface, and `panel_light` (n, 2)
    that of the tank's panels, relative to a level open surface at the foot; `bed_maps` the baked sand; `top_m` the
    least z of all vertices. The bed is a height field, `bed`, whose crossings are the vertices from `first_bed_vertex`
    on; `solids` is target and stones for ray casting, and `spheres_F_m` (k, 4) holds them. `moved_m` (n, 3) is how far
    the target's vertices are from their places at rest, which its colours keep; of a target at rest it is empty.
    """

    foot_W_m: Array
    vertices_F_m: NDArray[np.float32]
    faces: NDArray[np.int32]
    first_face: NDArray[np.int64]
    normals: NDArray[np.float32]
    daylight: NDArray[np.float32]
    panel_light: NDArray[np.float32]
    bed_maps: Maps
    top_m: float
    seed: int
    bed: HeightField
    first_bed_vertex: int
    spheres_F_m: Array
    solids: Any
    moved_m: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))

    def posed(self, moved_m: Array, target_normals: Array) -> Scene:
        """The same scene with its target's vertices moved from rest; colours and light from above move along.

        `moved_m`, shape (n, 3): one row for each vertex of the target. `target_normals`, shape (n, 3): unit normals of
        the moved surface, outward. Raises InputError if there is not one row for each vertex.
        """
        n = self.first_bed_vertex
        if moved_m.shape != (n, 3) or target_normals.shape != (n, 3):
            raise InputError(f"scene: {moved_m.shape} moves and {target_normals.shape} normals, needs ({n}, 3) of both")
        rest = self.vertices_F_m[:n] - (self.moved_m if len(self.moved_m) else np.float32(0.0))
        vertices, normals = self.vertices_F_m.copy(), self.normals.copy()
        vertices[:n], normals[:n] = rest + moved_m.astype(np.float32), target_normals
        own = self.faces[: self.first_face[1]]
        spheres = self._pieces.spheres(vertices[:n].astype(np.float64))
        return replace(
            self,
            vertices_F_m=vertices,
            normals=normals,
            top_m=float(min(v[:, 2].min(initial=np.inf) for v in (vertices[:n], vertices[n:]))),
            spheres_F_m=np.concatenate([spheres, self._stone_spheres]),
            solids=_embree([(vertices[:n], own), self._stones]),
            moved_m=np.ascontiguousarray(moved_m, np.float32),
        )

    @cached_property
    def _stones(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Vertices and faces of the stones by themselves."""
        first = self.first_bed_vertex + len(self.bed.lines_m) ** 2
        return self.vertices_F_m[first:], self.faces[self.first_face[2] :] - np.int32(first)

    @cached_property
    def _stone_spheres(self) -> Array:
        vertices, faces = self._stones
        places = vertices.astype(np.float64)
        return BoundingSpheres.of(places, faces.astype(np.int64)).spheres(places)

    @cached_property
    def _pieces(self) -> BoundingSpheres:
        """Of the target, cut as it stands here: pieces that it is moved in are no larger for it."""
        vertices, faces = self.vertices_F_m[: self.first_bed_vertex], self.faces[: self.first_face[1]]
        return BoundingSpheres.of(vertices.astype(np.float64), faces.astype(np.int64))

    @property
    def target_normals(self) -> NDArray[np.float32]:
        """Normals of the target's vertices, shape (n, 3)."""
        return self.normals[: self.first_bed_vertex]

    @classmethod
    def build(
        cls,
        target: Target,
        seed: int,
        *,
        bed_half_m: float = 1.5,
        stones: int = 200,
        panels: LedPanels | None = None,
    ) -> Scene:
        """Lay the bed, scatter the stones, light everything and make it ready for rays.

        `seed`: not negative; the same seed gives the same sand, stones and colours. `bed_half_m`: half width of the
        part of the bed with fine relief; flat coarse sand goes on to 12 m. `stones`: number of stones on the fine part,
        none nearer to the target's bounding circle than 3 cm. `panels`: four over a tank of 6 x 5 m if not given.
        Raises InputError if a number is out of range.
        """
        if seed < 0:
            raise InputError(f"scene: seed {seed}, must not be negative")
        if not 0.3 <= bed_half_m < BED_HALF_WIDTH_M:
            raise InputError(f"scene: bed_half_m {bed_half_m:g}, allowed 0.3 to {BED_HALF_WIDTH_M:g}")
        if stones < 0:
            raise InputError(f"scene: {stones} stones, must not be negative")
        noise_seed = seed % 65521 * 1000
        foot_W = np.array([target.centre_W_m[0], target.centre_W_m[1], target.bed_z_m])
        vertices, faces = target.mesh.vertices_m - foot_W, outward_oriented(target.mesh).faces
        clear_m = float(np.max(np.hypot(vertices[:, 0], vertices[:, 1])))

        lines, bed_vertices = _bed(clear_m, bed_half_m, noise_seed)
        bed_faces = grid_faces(len(lines))
        stone_vertices, stone_faces = _stones(stones, clear_m + 0.03, bed_half_m, noise_seed)
        parts = [(vertices, faces), (bed_vertices, bed_faces), (stone_vertices, stone_faces)]
        normals = [vertex_normals(v, f) for v, f in parts]
        panels = panels or LedPanels.over_tank(6.0, 5.0)
        daylight, panel_light = bake_light(parts, normals, clear_m + 0.4, panels, foot_W)

        offsets = np.cumsum([0] + [len(v) for v, _ in parts])
        bed_z = bed_vertices[:, 2].astype(np.float32).reshape(len(lines), len(lines))
        return cls(
            foot_W_m=foot_W,
            vertices_F_m=np.concatenate([v for v, _ in parts]).astype(np.float32),
            faces=np.concatenate([f + o for (_, f), o in zip(parts, offsets[:3], strict=True)]).astype(np.int32),
            first_face=np.cumsum([0, len(faces), len(bed_faces)]),
            normals=np.concatenate(normals).astype(np.float32),
            daylight=daylight,
            panel_light=panel_light,
            bed_maps=bake_bed(BED_MAP_SIZE, BED_MAP_LEVELS, BED_TEXEL_M, noise_seed),
            top_m=float(min(v[:, 2].min(initial=np.inf) for v, _ in parts)),
            seed=noise_seed,
            bed=height_field(lines, bed_z),
            first_bed_vertex=len(vertices),
            spheres_F_m=np.concatenate([BoundingSpheres.of(v, f).spheres(v) for v, f in (parts[0], parts[2])]),
            solids=_embree([parts[0], parts[2]]),
        )


def _embree(parts: Sequence[tuple[NDArray[Any], NDArray[Any]]]) -> Any:
    """Surfaces, given as vertices and faces, ready for rays; those without faces are left out."""
    solids = EmbreeScene()
    for vertices, faces in parts:
        if len(faces):
            TriangleMesh(solids, np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32))
    return solids


def vertex_normals(vertices_m: Array, faces: IntArray) -> Array:
    """Unit normals, shape (n, 3): sum of the adjacent faces' normals weighted by area; zero where no face meets."""
    a, b, c = (vertices_m[faces[:, k]] for k in range(3))
    face_normals = np.cross(b - a, c - a)
    corner, weights = faces.ravel(), np.repeat(face_normals, 3, axis=0)
    normals = np.stack([np.bincount(corner, weights[:, k], minlength=len(vertices_m)) for k in range(3)], axis=1)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def outward_oriented(mesh: Mesh) -> Mesh:
    """The mesh, turned inside out if its volume is negative."""
    about_middle = Mesh(mesh.vertices_m - mesh.vertices_m.mean(axis=0), mesh.faces)
    return mesh if about_middle.volume_m3 >= 0.0 else Mesh(mesh.vertices_m, mesh.faces[:, ::-1])


def _bed(clear_m: float, half_m: float, seed: int) -> tuple[Array, Array]:
    """Lines of a square grid that is fine near the foot and coarsens outward, and a vertex at each crossing."""
    # Steps grow from 6 mm under the target to 3 cm at the edge of the fine part, then to 1 m on the apron.
    steps, edge = [], 0.0
    while edge < BED_HALF_WIDTH_M:
        step = 0.006 if edge < clear_m + 0.05 else min(0.03, 0.006 + 0.06 * (edge - clear_m - 0.05))
        steps.append(step if edge < half_m else min(1.0, 0.3 * (edge - half_m) + 0.03))
        edge += steps[-1]
    positive = np.cumsum(steps) * (BED_HALF_WIDTH_M / edge)
    line = np.concatenate([-positive[::-1], [0.0], positive])
    x, y = np.meshgrid(line, line, indexing="ij")
    xy = np.stack([x.ravel(), y.ravel()], axis=1)
    # Octaves of relief finer than the coarse apron's cells would only alias there: level it off.
    fade = np.clip((half_m + 0.5 - np.max(np.abs(xy), axis=1)) / 0.5, 0.0, 1.0)
    vertices = np.concatenate([xy, -(fade * bed_heights(xy, clear_m, seed))[:, None]], axis=1)
    return line, vertices


def _stones(count: int, inner_m: float, half_m: float, seed: int) -> tuple[Array, IntArray]:
    """Stones of 3-18 mm, half buried, denser near the foot; lumpy ellipsoids on a subdivided icosahedron."""
    rng = np.random.default_rng([seed, 7])
    sphere, sphere_faces = _icosphere()
    vertices, faces = [], []
    for k in range(count):
        radius = 0.003 * 6.0 ** (rng.random() ** 2)
        distance = inner_m + radius + (half_m - inner_m) * rng.random() ** 1.5
        angle = rng.uniform(0.0, 2 * math.pi)
        scale = radius * rng.uniform([0.8, 0.6, 0.4], [1.3, 1.0, 0.7])
        lumps = 1.0 + 0.25 * np.sin(sphere @ rng.normal(0.0, 2.0, (3, 4)) + rng.uniform(0, 6.3, 4)).mean(axis=1)
        turn = rng.uniform(0.0, 2 * math.pi)
        c, s = math.cos(turn), math.sin(turn)
        shape = (sphere * lumps[:, None] * scale) @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        place = np.array([[distance * math.cos(angle), distance * math.sin(angle)]])
        height = float(bed_heights(place, inner_m - 0.03, seed)[0])
        vertices.append(shape + np.array([place[0, 0], place[0, 1], -height - 0.25 * scale[2]]))
        faces.append(sphere_faces + k * len(sphere))
    if not count:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    return np.concatenate(vertices), np.concatenate(faces)


def _icosphere(levels: int = 2) -> tuple[Array, IntArray]:
    """Unit sphere of 20 * 4**levels triangles, seen counter-clockwise from outside."""
    g = (1 + math.sqrt(5)) / 2
    corners: list[tuple[float, float, float]] = [(-1, g, 0), (1, g, 0), (-1, -g, 0), (1, -g, 0), (0, -1, g), (0, 1, g)]
    corners += [(0, -1, -g), (0, 1, -g), (g, 0, -1), (g, 0, 1), (-g, 0, -1), (-g, 0, 1)]
    points = [np.array(p, dtype=np.float64) / math.hypot(1, g) for p in corners]
    rows = "0 11 5 0 5 1 0 1 7 0 7 10 0 10 11 1 5 9 5 11 4 11 10 2 10 7 6 7 1 8"
    rows += " 3 9 4 3 4 2 3 2 6 3 6 8 3 8 9 4 9 5 2 4 11 6 2 10 8 6 7 9 8 1"
    triangles = np.array(rows.split(), dtype=np.int64).reshape(-1, 3).tolist()
    for _ in range(levels):
        middle: dict[tuple[int, int], int] = {}
        finer = []
        for a, b, c in triangles:
            mids = []
            for p, q in ((a, b), (b, c), (c, a)):
                key = (min(p, q), max(p, q))
                if key not in middle:
                    middle[key] = len(points)
                    sum_ = points[p] + points[q]
                    points.append(sum_ / np.linalg.norm(sum_))
                mids.append(middle[key])
            ab, bc, ca = mids
            finer += [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        triangles = finer
    return np.array(points), np.array(triangles, dtype=np.int64)
