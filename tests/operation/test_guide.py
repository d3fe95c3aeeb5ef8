"""The coverage guide of a flight: begun from what the crew believes."""

import numpy as np

from wakewise.operation import Scenario
from wakewise.operation.guide import begin_coverage


def test_the_guide_knows_what_the_crew_knows() -> None:
    """Patches lie on the target where it was found, 5 mm or so from where it is, and nothing is seen yet."""
    parts = Scenario.preset("quick").parts()
    coverage = begin_coverage(parts)
    found, true = parts.surveyed_target, parts.target
    off = found.centre_W_m - true.centre_W_m
    assert 0.0005 < np.linalg.norm(off) < 0.02
    low, high = found.mesh.vertices_m.min(axis=0), found.mesh.vertices_m.max(axis=0)
    assert (coverage.patches.points_W_m >= low - 1e-9).all()
    assert (coverage.patches.points_W_m <= high + 1e-9).all()
    assert coverage.share == 0.0
    assert len(coverage.views.places) > 50
    assert (coverage.views.centre_W_m == found.centre_W_m).all()


def test_the_planned_orbits_are_expected_to_cover_the_target() -> None:
    """The quick preset's own route sees nine tenths of its coral well, and the guide then has little to add."""
    parts = Scenario.preset("quick").parts()
    coverage = begin_coverage(parts)
    for X_WC in parts.route.X_WC_planned:
        coverage = coverage.seen(X_WC, parts.camera)
    assert coverage.share > 0.9
    assert coverage.gains.max() < 0.02
