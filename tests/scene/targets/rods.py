"""Rods and strips of a stated section that stand on the bed, for tests of sections and of bending."""

import numpy as np

from wakewise.scene.targets import Mesh, place_on_bed

BED_Z = 1.5


def rod_mesh(half_x, half_y, height, around=64, levels=60, at=(0.0, 0.0)):
    """A closed elliptic rod, z up, from 1 cm below the bed."""
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.stack([half_x * np.cos(angle) + at[0], half_y * np.sin(angle) + at[1]], axis=1)
    z = np.linspace(-0.01, height, levels)
    vertices = [np.column_stack([ring, np.full(around, level)]) for level in z]
    vertices.append(np.array([[*at, -0.01], [*at, height]]))
    faces = []
    for i in range(levels - 1):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            faces += [[a, b, b + around], [a, b + around, a + around]]
    for j in range(around):
        after, last = (j + 1) % around, (levels - 1) * around
        faces += [[levels * around, after, j], [levels * around + 1, last + j, last + after]]
    return Mesh(np.concatenate(vertices), np.array(faces))


def together(*meshes):
    """Several meshes as one."""
    first = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes])
    faces = [mesh.faces + offset for mesh, offset in zip(meshes, first[:-1], strict=True)]
    return Mesh(np.concatenate([mesh.vertices_m for mesh in meshes]), np.concatenate(faces))


def rod(half_x=0.0025, half_y=0.0025, height=0.1):
    """A rod standing on the bed of the world."""
    return place_on_bed("rod", rod_mesh(half_x, half_y, height), BED_Z)
