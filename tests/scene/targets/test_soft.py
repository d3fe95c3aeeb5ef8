"""Procedural soft targets are closed, of a stated size, and bend as their tissue says."""

import numpy as np
import pytest

from wakewise.scene.targets import TISSUES, BendingModes, coral, place_on_bed, soft_kinds


@pytest.mark.slow
@pytest.mark.parametrize("kind", soft_kinds())
def test_a_soft_target_is_closed_and_bends_slowly(kind):
    """Closed, 10 to 15 cm high, through the bed, the same for the same seed, and softest below 6 Hz in water."""
    mesh = coral(kind)
    assert mesh.is_closed
    assert mesh.volume_m3 > 0.0
    assert 0.1 < mesh.vertices_m[:, 2].max() < 0.16
    assert -0.02 < mesh.vertices_m[:, 2].min() < -0.005
    assert coral.__wrapped__(kind, 0).vertices_m.tobytes() == mesh.vertices_m.tobytes()
    assert coral(kind, 1).vertices_m.tobytes() != mesh.vertices_m.tobytes()
    sway = BendingModes.of(place_on_bed(kind, mesh, 1.5), TISSUES[kind], 1000.0)
    assert 0.1 < sway.frequency_Hz[:, 0].min() < 6.0
    assert len(sway.height_m) == (16 if kind == "seagrass" else len(sway.height_m))


def test_a_fan_is_flat():
    """A gorgonian is at least four times as wide as thick, and bends across its plane first."""
    mesh = coral("gorgonian")
    above = mesh.vertices_m[mesh.vertices_m[:, 2] > 0.04, :2]
    spread, axes = np.linalg.eigh(np.cov(above.T))
    assert np.sqrt(spread[1] / spread[0]) > 4.0
    sway = BendingModes.of(place_on_bed("gorgonian", mesh, 1.5), TISSUES["gorgonian"], 1000.0)
    across = axes[:, 0] * [1.0, -1.0]  # a mesh is turned over when it is placed
    assert abs(sway.axes_W[0, 0] @ across) > 0.95
