"""The vehicle as a solid that can be drawn: an open frame of its stated size, its thrusters where they really sit.

Size, thruster places, axes and disks and the camera mount are the vehicle's own; floats, tubes and frame between them
are a drawing of what such vehicles look like, and no physics knows of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.robot.vehicles import Vehicle

FLOAT_RGB, FRAME_RGB, TUBE_RGB, CAP_RGB = (
    (0.93, 0.58, 0.10),
    (0.085, 0.10, 0.12),
    (0.72, 0.75, 0.76),
    (0.12, 0.13, 0.15),
)
DUCT_RGB, BLADE_RGB, GLASS_RGB, LAMP_RGB = (
    (0.05, 0.06, 0.075),
    (0.10, 0.42, 0.47),
    (0.03, 0.05, 0.08),
    (1.0, 0.96, 0.85),
)
_CREASE_COS = float(np.cos(np.radians(40.0)))  # edges sharper than this stay edges


@dataclass(frozen=True, kw_only=True, eq=False)
class Hull:
    """Triangles in the body frame: vertices_B_m (n, 3), faces (m, 3), normals (m, 3, 3) by corner, colours (m, 3).

    Colours are linear reflectances. Neighbouring faces share a normal at a corner unless they meet at a crease.
    """

    vertices_B_m: Array
    faces: IntArray
    normals: Array
    colours: Array

    def __post_init__(self) -> None:
        freeze(self, vertices_B_m=(None, 3), normals=(len(self.faces), 3, 3), colours=(len(self.faces), 3))


def hull_of(vehicle: Vehicle) -> Hull:
    """Draw a vehicle as an open-frame craft that fills its `size_m`."""
    L, W, H = (float(v) for v in vehicle.size_m)
    parts: list[tuple[trimesh.Trimesh, tuple[float, float, float]]] = []

    def add(mesh: trimesh.Trimesh, colour: tuple[float, float, float], place: tuple[float, float, float]) -> None:
        mesh.apply_translation(place)
        parts.append((mesh, colour))

    round_m = 0.10 * min(L, W, H)
    for side in (-1.0, 1.0):
        add(_rounded((0.90 * L, 0.36 * W, 0.30 * H), 1.6 * round_m), FLOAT_RGB, (0.0, side * 0.275 * W, -0.345 * H))
        bar = 0.055 * min(W, H)
        y = side * (0.5 * W - 0.5 * bar)
        add(_rounded((0.96 * L, bar, 1.6 * bar), 0.3 * bar), FRAME_RGB, (0.0, y, 0.5 * H - 0.8 * bar))
        add(_rounded((0.80 * L, bar, 1.6 * bar), 0.3 * bar), FRAME_RGB, (0.0, y, -0.15 * H))
        for x in (-0.36 * L, 0.36 * L):
            add(_rounded((1.8 * bar, bar, 0.68 * H), 0.3 * bar), FRAME_RGB, (x, y, 0.16 * H))
        lamp = 0.055 * min(W, H)
        add(_along_x(lamp, 2.4 * lamp), CAP_RGB, (0.43 * L, side * 0.33 * W, 0.08 * H))
        add(_along_x(0.8 * lamp, 0.6 * lamp), LAMP_RGB, (0.43 * L + 1.4 * lamp, side * 0.33 * W, 0.08 * H))
    for x in (-0.30 * L, 0.30 * L):
        add(_rounded((0.08 * L, 0.94 * W, 0.04 * H), 0.01 * H), FRAME_RGB, (x, 0.0, 0.30 * H))
        add(_rounded((0.10 * L, 0.50 * W, 0.05 * H), 0.01 * H), FRAME_RGB, (x, 0.0, -0.18 * H))
    tube = 0.17 * min(W, H) + 0.02 * W
    add(_along_x(tube, 0.70 * L), TUBE_RGB, (-0.03 * L, 0.0, 0.02 * H))
    for x in (-0.38 * L, 0.32 * L):
        add(_along_x(1.10 * tube, 0.05 * L), CAP_RGB, (x, 0.0, 0.02 * H))
    add(_along_x(0.62 * tube, 0.62 * L), CAP_RGB, (0.0, 0.0, 0.30 * H + 0.62 * tube))
    eye = vehicle.X_BC
    dome = trimesh.creation.icosphere(subdivisions=3, radius=0.9 * tube)
    add(dome, GLASS_RGB, (0.345 * L, 0.0, 0.02 * H))
    lens = trimesh.creation.cylinder(radius=0.35 * tube, height=0.5 * tube, sections=32)
    lens.apply_transform(_matrix(eye.R, eye.p_m))
    parts.append((lens, GLASS_RGB))
    for thruster in vehicle.thrusters:
        radius = float(np.sqrt(thruster.disk_area_m2 / np.pi))
        turn = _matrix(_frame_of(np.asarray(thruster.axis_B)), np.asarray(thruster.p_BT_m))
        duct = trimesh.creation.annulus(r_min=1.04 * radius, r_max=1.30 * radius, height=1.1 * radius, sections=40)
        hub = trimesh.creation.capsule(radius=0.30 * radius, height=0.9 * radius, count=[16, 16])
        for mesh, colour in ((duct, DUCT_RGB), (hub, DUCT_RGB), *((blade, BLADE_RGB) for blade in _blades(radius))):
            mesh.apply_transform(turn)
            parts.append((mesh, colour))
    return _joined(parts)


def _blades(radius_m: float, count: int = 4) -> list[trimesh.Trimesh]:
    out = []
    for k in range(count):
        blade = trimesh.creation.box((0.70 * radius_m, 0.42 * radius_m, 0.05 * radius_m))
        blade.apply_transform(trimesh.transformations.rotation_matrix(np.radians(24.0), (1.0, 0.0, 0.0)))
        blade.apply_translation((0.62 * radius_m, 0.0, 0.0))
        blade.apply_transform(trimesh.transformations.rotation_matrix(2.0 * np.pi * k / count, (0.0, 0.0, 1.0)))
        out.append(blade)
    return out


def _rounded(size_m: tuple[float, float, float], radius_m: float) -> trimesh.Trimesh:
    """A box with round edges: what contains eight spheres."""
    half = 0.5 * np.array(size_m)
    radius = min(radius_m, 0.999 * float(half.min()))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius).vertices
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * (half - radius)
    hull: trimesh.Trimesh = trimesh.convex.convex_hull((corners[:, None] + ball[None]).reshape(-1, 3))
    return hull


def _along_x(radius_m: float, length_m: float) -> trimesh.Trimesh:
    mesh = trimesh.creation.cylinder(radius=radius_m, height=length_m, sections=48)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.5 * np.pi, (0.0, 1.0, 0.0)))
    return mesh


def _frame_of(axis: Array) -> Array:
    """A rotation that takes z to `axis`."""
    helper = np.array([1.0, 0.0, 0.0]) if abs(axis[0]) < 0.7 else np.array([0.0, 1.0, 0.0])
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def _matrix(R: Array, p_m: Array) -> Array:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = R, p_m
    return out


def _joined(parts: list[tuple[trimesh.Trimesh, tuple[float, float, float]]]) -> Hull:
    vertices, faces, normals, colours, first = [], [], [], [], 0
    for mesh, colour in parts:
        points, corners = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        vertices.append(points)
        faces.append(corners + first)
        normals.append(corner_normals(points, corners))
        colours.append(np.tile(colour, (len(corners), 1)))
        first += len(points)
    return Hull(
        vertices_B_m=np.concatenate(vertices),
        faces=np.concatenate(faces),
        normals=np.concatenate(normals),
        colours=np.concatenate(colours),
    )


def corner_normals(vertices_m: Array, faces: IntArray) -> Array:
    """Unit normals, shape (m, 3, 3), of each face's corners: the mean over the faces there that meet without a crease.

    Faces weigh by their area.
    """
    a, b, c = (vertices_m[faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    unit = area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-30)
    corner = faces.ravel()
    order = np.argsort(corner, kind="stable")
    starts = np.searchsorted(corner[order], np.arange(len(vertices_m) + 1))
    out = np.repeat(unit[:, None], 3, axis=1).reshape(-1, 3)
    for v in range(len(vertices_m)):
        here = order[starts[v] : starts[v + 1]]
        face = here // 3
        smooth = unit[face] @ unit[face].T > _CREASE_COS
        total = smooth @ area[face]
        out[here] = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
    return out.reshape(-1, 3, 3)
