"""A target stands on the bed the right way up."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.scene.targets import Mesh, coral, place_on_bed


def test_up_becomes_shallow_and_nothing_is_mirrored():
    """The tip of a coral lies above the bed, at a smaller depth, and the volume keeps its sign and size."""
    mesh = coral("brain")
    target = place_on_bed("brain", mesh, 1.5, (0.3, -0.2))
    top = mesh.vertices_m[np.argmax(mesh.vertices_m[:, 2])]
    np.testing.assert_allclose(
        target.mesh.vertices_m[np.argmin(target.mesh.vertices_m[:, 2])], [0.3 + top[0], -0.2 - top[1], 1.5 - top[2]]
    )
    assert target.mesh.volume_m3 == pytest.approx(mesh.volume_m3, rel=1e-9)


def test_the_sphere_holds_what_stands_above_the_bed():
    """Every vertex above the bed lies in the sphere, one of them on it, and the centre is above the bed."""
    target = place_on_bed("plate", coral("plate"), 1.5)
    above = target.mesh.vertices_m[target.mesh.vertices_m[:, 2] < 1.5]
    distance = np.linalg.norm(above - target.centre_W_m, axis=1)
    assert distance.max() == pytest.approx(target.radius_m, abs=1e-12)
    assert target.centre_W_m[2] < target.bed_z_m


def test_a_buried_target_is_refused():
    """Nothing to see is nothing to scan."""
    with pytest.raises(InputError, match="above the bed"):
        place_on_bed("buried", Mesh(np.eye(3) - 1.0, np.array([[0, 1, 2]])), 1.5)
