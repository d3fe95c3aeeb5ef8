"""A box on the bed, a real coral, and views of them, shared by the imaging tests."""

from __future__ import annotations

from functools import cache

import numpy as np

from wakewise.core.geometry import Pose, look_at
from wakewise.scene.targets import Mesh, Target
from wakewise.vision.imaging import Scene

R_BC = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
BED_Z = 1.5


def box(size=(0.12, 0.1, 0.08)):
    """A box standing on the bed, eight vertices and twelve triangles that face outward."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    centre = np.array([0.0, 0.0, BED_Z - 0.5 * size[2]])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    mesh = Mesh(0.5 * signs * size + centre, faces)
    return Target(name="box", mesh=mesh, centre_W_m=centre, radius_m=0.5 * float(np.linalg.norm(size)), bed_z_m=BED_Z)


@cache
def box_scene():
    return Scene.build(box(), 3, stones=20)


@cache
def coral_scene():
    from wakewise.scene.targets import coral, place_on_bed

    target = place_on_bed("branching", coral("branching", 0), BED_Z)
    return Scene.build(target, 5, stones=20), target


def view(elevation_deg=40.0, azimuth_deg=30.0, distance_m=0.5, centre=(0.0, 0.0, BED_Z - 0.04)):
    """Camera pose X_WC that looks at `centre` from a distance and an elevation."""
    el, az = np.deg2rad([elevation_deg, azimuth_deg])
    way = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), -np.sin(el)])
    eye = np.asarray(centre) + distance_m * way
    return Pose.from_matrix(look_at(eye, centre) @ R_BC, eye)
