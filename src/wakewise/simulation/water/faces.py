"""Flat faces of the tank (bed, surface, walls): mirror images of the jets, and coordinates of their wall jets.

Image and original together have no normal velocity on the face. The coordinates of a face are two along it and the
third outwards, as depth is for the bed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.jit.njit import assign, assign_rows, njit

LEAST_IMAGE_M_S = 5e-5
"""Images in walls and surface that would not reach this speed there are left out; the bed's are all kept."""


@dataclass(frozen=True)
class TankFace:
    """A plane across one of the world's axes."""

    name: str
    axis: int  # 0, 1 or 2: the world's axis across the face
    side: int  # +1 where the tank ends towards the axis, -1 where it begins
    at_m: float  # where on the axis it lies

    @property
    def depth_m(self) -> float:
        """Third coordinate of the face in its own frame."""
        return self.side * self.at_m

    @cached_property
    def frame(self) -> Array:
        """Origin, the rows of the turn from the world into the face's frame, depth there, and 0: shape (14,)."""
        return np.concatenate([np.zeros(3), self.turned(np.eye(3)).T.ravel(), [self.depth_m, 0.0]])

    def local(self, vectors_W: Array) -> Array:
        """Vectors or points of the world, shape (n, 3), in the face's frame: two along it, one out of the tank."""
        first, second = (self.axis + 1) % 3, (self.axis + 2) % 3
        return np.stack([vectors_W[:, first], vectors_W[:, second], self.side * vectors_W[:, self.axis]], axis=1)

    def world(self, vectors: Array) -> Array:
        """Inverse of `local`."""
        out = np.empty_like(vectors)
        out[:, (self.axis + 1) % 3] = vectors[:, 0]
        out[:, (self.axis + 2) % 3] = vectors[:, 1]
        out[:, self.axis] = self.side * vectors[:, 2]
        return out

    def turned(self, vectors_W: Array) -> Array:
        """Vectors of the world in the face's frame."""
        return self.local(vectors_W)

    def back(self, vectors: Array) -> Array:
        """Inverse of `turned`."""
        return self.world(vectors)

    def gap_m(self, points_W_m: Array) -> Array:
        """Distance from the face into the tank, shape (n,)."""
        gap: Array = self.depth_m - self.side * points_W_m[:, self.axis]
        return gap

    def mirrored(self, vectors_W: Array, shift: bool) -> Array:
        """Vectors (shift False) or points (shift True) mirrored in the face."""
        out = vectors_W.copy()
        out[:, self.axis] = (2 * self.at_m if shift else 0.0) - out[:, self.axis]
        return out


@dataclass(frozen=True)
class TankFaces:
    """The faces there are: none in open water; the bed, or all six, in a tank."""

    faces: tuple[TankFace, ...]

    @classmethod
    def of(cls, bed_z_m: float, half_size_m: tuple[float, float], surface: bool) -> TankFaces:
        """Bed, surface at z = 0 and walls at +- half_size; infinite ones are left out."""
        faces = [TankFace("bed", 2, 1, bed_z_m)] + ([TankFace("surface", 2, -1, 0.0)] if surface else [])
        for axis, half in enumerate(half_size_m):
            faces += [TankFace(f"wall {'xy'[axis]}{'-+'[side > 0]}", axis, side, side * half) for side in (-1, 1)]
        return cls(tuple(face for face in faces if math.isfinite(face.at_m)))

    @cached_property
    def walls(self) -> Array:
        """Axis, place, side and the speed that an image must reach there, of each face in order, shape (k, 4)."""
        rows = [(f.axis, f.at_m, f.side, 0.0 if f.name == "bed" else LEAST_IMAGE_M_S) for f in self.faces]
        return np.array(rows, dtype=np.float64).reshape(-1, 4)

    def with_images(self, positions_m: Array, impulses_m4_s: Array, sigmas_m: Array) -> tuple[Array, Array, Array]:
        """Impulses and those of their images that matter: positions, impulses, sizes.

        Faces across one axis mirror what the faces across the others have made, so that edges and corners hold too;
        opposite faces do not mirror each other's images, which lie at least the tank's size away.
        """
        images: tuple[Array, Array, Array] = mirrored(positions_m, impulses_m4_s, sigmas_m, self.walls)
        return images


@njit(apart=True, nogil=True)
def mirrored(X: Array, m: Array, sigma: Array, walls: Array) -> tuple[Array, Array, Array]:
    """Append images in faces; a dipole m at distance h sends at most 2 m / (4 pi h^3) across a face."""
    n = sigma.shape[0]
    room = 4 * n
    places, impulses, sizes = np.empty((room, 3)), np.empty((room, 3)), np.empty(room)
    assign_rows(places[:n], X)
    assign_rows(impulses[:n], m)
    assign(sizes[:n], sigma)
    count = n
    for axis in (2, 1, 0):
        first = count
        for f in range(walls.shape[0]):
            if walls[f, 0] != axis:
                continue
            at, side, least = walls[f, 1], walls[f, 2], walls[f, 3]
            if count + first > room:
                room = 2 * (count + first)
                places, impulses = with_capacity(places, room), with_capacity(impulses, room)
                short, sizes = sizes, np.empty(room)
                assign(sizes[:count], short[:count])
            for j in range(first):
                gap = max(side * (at - places[j, axis]), 1e-6)
                length2 = impulses[j, 0] ** 2 + impulses[j, 1] ** 2 + impulses[j, 2] ** 2
                if length2 <= (2 * math.pi * least * gap * gap * gap) ** 2:
                    continue
                for k in range(3):
                    places[count, k], impulses[count, k] = places[j, k], impulses[j, k]
                places[count, axis] = 2 * at - places[j, axis]
                impulses[count, axis] = -impulses[j, axis]
                sizes[count] = sizes[j]
                count += 1
    return places[:count], impulses[:count], sizes[:count]


@njit(nogil=True)
def with_capacity(rows: Array, room: int) -> Array:
    """A copy of rows, shape (n, k), with room for so many; what is new is not set."""
    out = np.empty((room, rows.shape[1]))
    assign_rows(out[: rows.shape[0]], rows)
    return out
