"""Irradiance of sky and LED panels on every vertex, with the shadows of target and stones; baked once per scene.

Under water the sky is within Snell's window, 48.6 deg about the zenith for an index of 4/3; dim diffuse light comes
from outside of it (Mobley, Light and Water, Academic Press 1994, section 4.2). The shares are a choice for a shallow
tank under a bright overcast sky, not a measurement. Panels radiate by Lambert's law. The water's colour on the way from
a panel is part of the reference irradiance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from wakewise.core.arrays import Array, IntArray, freeze
from wakewise.core.errors import InputError
from wakewise.core.jit.njit import njit

SPOTS = 8
"""Spots on each panel that stand for its face."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LedPanels:
    """Rectangular panels that face straight down: middles in the world, shape (k, 3), and size along x and y."""

    centres_W_m: Array
    size_m: tuple[float, float] = (0.6, 0.3)

    def __post_init__(self) -> None:
        freeze(self, centres_W_m=(None, 3))
        if not min(self.size_m) > 0.0:
            raise InputError(f"panels: size {self.size_m} m, both must be above 0")

    @classmethod
    def over_tank(cls, length_m: float, width_m: float) -> LedPanels:
        """Four panels at the surface, z = 0, each over the middle of a quarter of the tank; its middle is x = y = 0."""
        x, y = 0.25 * length_m, 0.25 * width_m
        return cls(centres_W_m=np.array([[x, y, 0.0], [x, -y, 0.0], [-x, -y, 0.0], [-x, y, 0.0]]))

    def spots_W_m(self, along: int) -> Array:
        """Middles of equal parts of all panels' faces, `along` in x and SPOTS / along in y, shape (k * SPOTS, 3)."""
        across = SPOTS // along
        x = ((np.arange(along) + 0.5) / along - 0.5) * self.size_m[0]
        y = ((np.arange(across) + 0.5) / across - 0.5) * self.size_m[1]
        offsets = np.stack([*np.meshgrid(x, y), np.zeros((across, along))], axis=-1).reshape(-1, 3)
        return (self.centres_W_m[:, None, :] + offsets[None]).reshape(-1, 3)

    def irradiance(
        self, points_W_m: Array, normals: Array, occluder: EmbreeScene | None = None, origin_W_m: Array | None = None
    ) -> NDArray[np.float64]:
        """Irradiance at points of surfaces with unit normals, relative to pi times the panels' radiance, shape (n,).

        `points_W_m`, `normals` have shape (n, 3). `occluder`: what casts shadows, in a frame with the world's axes and
        the origin `origin_W_m`.
        """
        n = len(points_W_m)
        total = np.zeros(n)
        area = self.size_m[0] * self.size_m[1] / SPOTS
        points, normals = np.ascontiguousarray(points_W_m), np.ascontiguousarray(normals)
        origin = np.zeros(3) if origin_W_m is None else np.array(origin_W_m, np.float64)
        starts, ways = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
        which, shares = np.empty(n, np.int64), np.empty(n)
        # Two patterns take turns among the vertices, so that penumbras show no steps; smoothing evens them out.
        for group, along in enumerate((4, 2)):
            for spot in self.spots_W_m(along):
                k = _aim(points, normals, group, spot, origin, starts, ways, which, shares)
                if occluder is not None:
                    hit = occluder.run(starts[:k], ways[:k], query="OCCLUDED") >= 0
                    shares[:k][hit] = 0.0
                total[which[:k]] += shares[:k] * (area / math.pi)
        return total


@njit(nogil=True)
def _aim(
    points: Any, normals: Any, group: int, spot: Any, origin: Any, starts: Any, ways: Any, which: Any, shares: Any
) -> int:
    """Of every second point, from `group` on, those that face the spot and that it faces: how many there are.

    Written are rays to the spot from 0.3 mm over the surface, in a frame whose origin is given, which points they
    start at, and the cosines at both ends over the squared way.
    """
    count = 0
    for i in range(group, points.shape[0], 2):
        x, y, z = spot[0] - points[i, 0], spot[1] - points[i, 1], spot[2] - points[i, 2]
        facing = x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2]
        if facing > 0.0 and z < 0.0:
            r2 = max(x * x + y * y + z * z, 1e-6)
            which[count], shares[count] = i, facing * -z / r2 / r2
            ways[count, 0], ways[count, 1], ways[count, 2] = x, y, z
            for j in range(3):
                starts[count, j] = points[i, j] + 3e-4 * normals[i, j] - origin[j]
            count += 1
    return count


SNELL_SIN = 0.75
"""Sine of the half angle of Snell's window."""
OUTSIDE_SHARE = 0.15
"""Radiance outside of Snell's window relative to inside."""
BED_REFLECTANCE = 0.36
TARGET_REFLECTANCE = 0.2
RAYS_TOTAL = 2_500_000
"""Rays spent on a scene; large meshes get fewer per vertex, at least 8."""


def sky_radiance(up: NDArray[np.float64]) -> NDArray[np.float64]:
    """Radiance from a direction whose upward component is `up`, relative to what gives a level surface irradiance 1.

    Radiance is counted in units of irradiance / pi, so that its cosine-weighted mean over a hemisphere is the
    irradiance. Downward directions see the lit bed.
    """
    inside_sin2 = SNELL_SIN**2
    window = 1.0 / (inside_sin2 + OUTSIDE_SHARE * (1.0 - inside_sin2))
    cos_edge = math.sqrt(1.0 - inside_sin2)
    return np.where(up >= cos_edge, window, np.where(up >= 0.0, OUTSIDE_SHARE * window, BED_REFLECTANCE))


def bake_light(
    parts: Sequence[tuple[Array, IntArray]], normals: Sequence[Array], near_m: float, panels: LedPanels, foot_W_m: Array
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Irradiance by sky and by panels on both sides of each vertex of target, bed and stones, shape (n, 2) each.

    Each is 1 on a level open surface at the foot. What bed and target throw back is the same share of either. The bed
    has one side that is seen, column 0.

    `near_m`: bed vertices farther than this from the foot are taken as unshaded. `foot_W_m`, shape (3,): origin of the
    scene's frame in the world.
    """
    occluder = EmbreeScene()
    for vertices, faces in (parts[0], parts[2]):
        if len(faces):
            TriangleMesh(occluder, np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.int32))
    down = np.array([[0.0, 0.0, -1.0]])
    at_foot = float(panels.irradiance(foot_W_m[None], down)[0])
    per_unit = 1.0 / at_foot if at_foot > 0.0 else 0.0
    skies, lamps = [], []
    for k, ((vertices, faces), normal) in enumerate(zip(parts, normals, strict=True)):
        sky, lamp = np.zeros((len(vertices), 2), np.float32), np.zeros((len(vertices), 2), np.float32)
        lit = np.arange(len(vertices))
        if k == 1:
            sky[:] = np.clip(0.5 - 0.5 * normal[:, 2:], 0.0, 1.0)
            near = np.hypot(vertices[:, 0], vertices[:, 1]) < near_m
            lit, far = np.flatnonzero(near), np.flatnonzero(~near)
            lamp[far] = per_unit * panels.irradiance(vertices[far] + foot_W_m, normal[far])[:, None]
        sides = (1.0, -1.0) if k == 0 else (1.0,)
        rays = int(np.clip(RAYS_TOTAL // max(1, len(lit) * len(sides) * len(parts)), 8, 64))
        for side, sign in enumerate(sides):
            points, outward = vertices[lit], sign * normal[lit]
            direct, thrown_back = _irradiance(occluder, points, outward, rays)
            sky[lit, side] = direct + thrown_back
            lamp[lit, side] = per_unit * panels.irradiance(points + foot_W_m, outward, occluder, foot_W_m) + thrown_back
        skies.append(_smooth(sky, faces) if len(faces) else sky)
        lamps.append(_smooth(lamp, faces) if len(faces) else lamp)
    return np.concatenate(skies).astype(np.float32), np.concatenate(lamps).astype(np.float32)


def _irradiance(
    occluder: EmbreeScene, points: Array, normals: Array, rays: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean radiance of the sky, and of bed and target, over a cosine-weighted hemisphere of `rays` directions, (n,)."""
    # The same golden-angle spiral everywhere, turned by a vertex's own angle so that no pattern shows.
    k = np.arange(rays)
    radius = np.sqrt((k + 0.5) / rays)
    direct, thrown_back = np.zeros(len(points)), np.zeros(len(points))
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    tangent = np.cross(normals, helper)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    bitangent = np.cross(normals, tangent)
    turn = np.arange(len(points)) * 2.399963
    start = np.ascontiguousarray(points + 3e-4 * normals, np.float32)
    for i in range(rays):
        a = turn + 2.399963 * k[i]
        out = math.sqrt(1.0 - radius[i] ** 2)
        way = radius[i] * (np.cos(a)[:, None] * tangent + np.sin(a)[:, None] * bitangent) + out * normals
        hit = occluder.run(start, np.ascontiguousarray(way, np.float32), query="OCCLUDED") >= 0
        radiance, up = sky_radiance(-way[:, 2]), way[:, 2] <= 0.0
        direct += np.where(~hit & up, radiance, 0.0)
        thrown_back += np.where(hit, TARGET_REFLECTANCE * 0.5, np.where(up, 0.0, radiance))
    return direct / rays, thrown_back / rays


def _smooth(light: NDArray[np.float32], faces: IntArray, passes: int = 2) -> NDArray[np.float32]:
    """Average each vertex with the corners of its faces, to quieten the few rays per vertex."""
    n = len(light)
    corner = faces.ravel()
    count = np.maximum(np.bincount(corner, minlength=n), 1)
    for _ in range(passes):
        face_mean = light[faces].mean(axis=1)
        columns = [np.bincount(corner, np.repeat(face_mean[:, k], 3), minlength=n) / count for k in range(2)]
        light = np.stack(columns, axis=1).astype(np.float32)
    return light
