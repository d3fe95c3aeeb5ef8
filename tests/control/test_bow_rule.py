"""The one-line rule as a method."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.allocation import least_thrusts
from wakewise.control import METHODS
from wakewise.control.bow_rule import bow_layout
from wakewise.control.loop import vehicle_layout
from wakewise.errors import InputError
from wakewise.vehicles import load_vehicle


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy"])
def test_the_bow_never_blows_forward_and_the_wrench_is_made_all_the_same(name):
    """For wrenches of a hover in any direction, heavy or light, no bow jet goes ahead; without the rule some do."""
    vehicle = load_vehicle(name)
    layout, free = bow_layout(vehicle), vehicle_layout(vehicle)
    axes, bow = vehicle.thruster_axes_B, vehicle.thruster_positions_B_m[:, 0] > 0.0
    level = bow & (np.abs(axes[:, 2]) < 0.5)
    rng = np.random.default_rng(0)
    forward = 0
    for _ in range(60):
        wrench = rng.uniform(-1.0, 1.0, 6) * [3.0, 3.0, 5.0, 0.2, 0.5, 0.3]
        thrusts = least_thrusts(layout, wrench).thrusts_N
        jets = -thrusts[level] * axes[level, 0]
        assert np.all(jets <= 1e-9)
        assert vehicle.allocation_matrix @ thrusts == pytest.approx(wrench, abs=1e-6)
        forward += bool(np.any(-least_thrusts(free, wrench).thrusts_N[level] * axes[level, 0] > 1e-3))
    assert forward > 20 and "bow-rule" in METHODS


def test_a_layout_that_the_rule_does_not_fit_is_refused():
    """A vehicle without a level thruster before its middle that blows ahead or astern has no such rule."""
    paper = load_vehicle("paper")
    verticals = tuple(t for t in paper.thrusters if abs(t.axis_B[2]) > 0.5 or t.p_BT_m[0] < 0.0)
    with pytest.raises(InputError, match="bow-rule: paper has no level thruster before its middle"):
        bow_layout(replace(paper, thrusters=verticals))
