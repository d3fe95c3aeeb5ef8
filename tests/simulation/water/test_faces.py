"""Mirrors: coordinates there and back, and images that cancel the flow across faces, edges and corners."""

import math

import numpy as np
import pytest

from wakewise.simulation.water.faces import LEAST_IMAGE_M_S, TankFaces
from wakewise.simulation.water.parcels import confined_velocity

ROOM = TankFaces.of(1.5, (0.6, 0.5), surface=True)


@pytest.mark.parametrize("face", ROOM.faces, ids=lambda face: face.name)
def test_a_face_s_frame_turns_and_counts_outwards(face):
    """There and back is the same; the face lies at depth_m and the tank above it."""
    points = np.random.default_rng(0).uniform([-0.6, -0.5, 0.0], [0.6, 0.5, 1.5], (20, 3))
    assert face.world(face.local(points)) == pytest.approx(points)
    assert np.all(face.gap_m(points) >= 0.0)
    assert face.depth_m - face.local(points)[:, 2] == pytest.approx(face.gap_m(points))


def test_images_cancel_the_flow_across_every_face():
    """What is left across a face is below twice the limit for each parcel, corners included."""
    rng = np.random.default_rng(1)
    X = rng.uniform([-0.6, -0.5, 0.0], [0.6, 0.5, 1.5], (30, 3))
    m, sigma = rng.normal(0, 1e-3, (30, 3)), rng.uniform(0.02, 0.08, 30)
    for face in ROOM.faces:
        points = rng.uniform([-0.6, -0.5, 0.0], [0.6, 0.5, 1.5], (100, 3))
        points[:, face.axis] = face.at_m
        u = confined_velocity(points, X, m, sigma, ROOM)
        free = confined_velocity(points, X, m, sigma, TankFaces(()))
        assert np.abs(u[:, face.axis]).max() < max(0.1 * np.abs(free[:, face.axis]).max(), 30 * LEAST_IMAGE_M_S)


def test_open_water_has_no_faces():
    """Infinite sizes leave faces out."""
    assert TankFaces.of(math.inf, (math.inf, math.inf), surface=False).faces == ()
