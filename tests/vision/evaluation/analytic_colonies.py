"""Colonies on a bed whose size is known, and noise such as a reconstruction has."""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from wakewise.scene.targets import Mesh
from wakewise.scene.targets.corals import coral
from wakewise.vision.evaluation.bed_and_colony import cut_above

Array = NDArray[np.float64]
UP = np.array([0.0, 0.0, 1.0])
ROUGH_M, SMOOTH_M, WAVE_M = 0.0001, 0.00015, 0.012
"""Noise of a vertex, and noise that neighbours share: two models of a coral in the tank differ by .2 mm."""


def bed(half_m: float = 0.15, cells: int = 120) -> Mesh:
    """A flat square."""
    x = np.linspace(-half_m, half_m, cells)
    X, Y = np.meshgrid(x, x, indexing="ij")
    i = np.arange(cells * cells).reshape(cells, cells)
    quads = np.stack([i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]], axis=-1).reshape(-1, 4)
    vertices = np.stack([X, Y, np.zeros_like(X)], axis=-1).reshape(-1, 3)
    return Mesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices_m) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices_m for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
    )


def above(mesh: trimesh.Trimesh | Mesh) -> Mesh:
    """The part above z = 0."""
    whole = mesh if isinstance(mesh, Mesh) else Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    cut = cut_above(whole, UP, np.zeros(3))
    assert cut is not None
    return cut


@cache
def hemisphere() -> Mesh:
    """Radius 50 mm."""
    return above(trimesh.creation.icosphere(5, 0.05))


@cache
def box() -> Mesh:
    """80 x 60 x 40 mm."""
    solid = trimesh.creation.box((0.08, 0.06, 0.08))
    for _ in range(5):
        solid = solid.subdivide()
    return above(solid)


@cache
def cone() -> Mesh:
    """Radius 50 mm, height 40 mm."""
    x = np.linspace(0.0, 1.0, 41)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)[:-1]
    ring = np.stack([np.outer(x, np.cos(angle)), np.outer(x, np.sin(angle))], axis=-1) * 0.05
    vertices = np.dstack([ring, np.broadcast_to(0.04 * (1.0 - x)[:, None], ring.shape[:2])]).reshape(-1, 3)
    i = np.arange(41 * 180).reshape(41, 180)
    j = np.roll(i, -1, axis=1)
    quads = np.stack([i[:-1], i[1:], j[1:], j[:-1]], axis=-1).reshape(-1, 4)
    mesh = trimesh.Trimesh(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]), process=True)
    return Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def shared_noise(points: Array, rng: np.random.Generator) -> Array:
    """Normal noise of unit size that places nearer than `WAVE_M` share, shape (n,): random waves."""
    waves, phase = rng.normal(0.0, 1.0 / WAVE_M, (60, 3)), rng.uniform(0.0, 2.0 * np.pi, 60)
    return np.asarray(np.sqrt(2.0 / 60.0) * np.cos(points @ waves.T + phase).sum(axis=1))


def noisy(mesh: Mesh, rng: np.random.Generator, times: float = 1.0) -> Mesh:
    """The mesh with noise along its normals."""
    normals = np.array(trimesh.Trimesh(mesh.vertices_m, mesh.faces, process=False).vertex_normals)
    off = SMOOTH_M * shared_noise(mesh.vertices_m, rng) + rng.normal(0.0, ROUGH_M, len(normals))
    return Mesh(mesh.vertices_m + times * off[:, None] * normals, mesh.faces)


@cache
def smooth_coral() -> trimesh.Trimesh:
    """The package's brain coral with its grooves smoothed, as a reconstruction at a millimetre smooths them."""
    mesh = coral("brain", 0)
    out = trimesh.Trimesh(mesh.vertices_m, mesh.faces, process=False)
    n = len(mesh.vertices_m)
    edges = np.concatenate([out.edges_unique, out.edges_unique[:, ::-1]])
    neighbours = csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (n, n))
    count = np.asarray(neighbours.sum(axis=1))[:, None]
    vertices = np.asarray(out.vertices)
    for _ in range(60):
        vertices = 0.5 * (vertices + neighbours @ vertices / count)
    smooth = trimesh.Trimesh(vertices, mesh.faces, process=False)
    centre = out.center_mass
    vertices = centre + np.cbrt(out.volume / smooth.volume) * (vertices - centre)
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def grown_alone(grown_m: Array | float) -> Mesh:
    """The part of that coral above z = 0, grown along its normals everywhere or by so much at each vertex."""
    mesh = smooth_coral()
    normals = np.array(mesh.vertex_normals)
    vertices = np.asarray(mesh.vertices) + np.broadcast_to(grown_m, len(normals))[:, None] * normals
    return above(Mesh(vertices, np.asarray(mesh.faces)))


def grown_coral(grown_m: Array | float, rng: np.random.Generator) -> Mesh:
    """The grown coral on a bed, as a reconstruction would have it."""
    return noisy(joined(grown_alone(grown_m), bed()), rng)


def turned(mesh: Mesh, rotvec: tuple[float, float, float], shift_m: tuple[float, float, float]) -> Mesh:
    return Mesh(mesh.vertices_m @ Rotation.from_rotvec(rotvec).as_matrix().T + shift_m, mesh.faces)
