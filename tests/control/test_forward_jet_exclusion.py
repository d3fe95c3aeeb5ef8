"""The one-line rule as a method."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.allocation import min_norm_allocation
from wakewise.control import METHODS
from wakewise.control.forward_jet_exclusion import bow_layout
from wakewise.control.null_space_allocation import vehicle_layout
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_euler, quat_multiply
from wakewise.robot.vehicles import load_vehicle


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
        thrusts = min_norm_allocation(layout, wrench).thrusts_N
        jets = -thrusts[level] * axes[level, 0]
        assert np.all(jets <= 1e-9)
        assert vehicle.allocation_matrix @ thrusts == pytest.approx(wrench, abs=1e-6)
        forward += bool(np.any(-min_norm_allocation(free, wrench).thrusts_N[level] * axes[level, 0] > 1e-3))
    assert forward > 20 and "no-forward-jets" in METHODS


def test_a_layout_that_the_rule_does_not_fit_is_refused():
    """A vehicle without a level thruster before its middle that blows ahead or astern has no such rule."""
    paper = load_vehicle("paper")
    verticals = tuple(t for t in paper.thrusters if abs(t.axis_B[2]) > 0.5 or t.p_BT_m[0] < 0.0)
    with pytest.raises(InputError, match="no-forward-jets: paper has no level thruster before its middle"):
        bow_layout(replace(paper, thrusters=verticals))


def test_a_layout_that_needs_its_bow_to_push_astern_is_refused_by_the_axis_it_would_lose():
    """Two level thrusters abreast that alone push ahead and astern cannot be forbidden to blow ahead."""
    paper = load_vehicle("paper")
    level = [t for t in paper.thrusters if abs(t.axis_B[2]) < 0.5]
    beside = [
        replace(level[0], name="right", p_BT_m=np.array([0.0, 0.2, 0.0]), axis_B=np.array([1.0, 0.0, 0.0])),
        replace(level[1], name="left", p_BT_m=np.array([0.0, -0.2, 0.0]), axis_B=np.array([1.0, 0.0, 0.0])),
    ]
    across = [
        replace(level[2], name="front", p_BT_m=np.array([0.2, 0.0, 0.0]), axis_B=np.array([0.0, 1.0, 0.0])),
        replace(level[3], name="rear", p_BT_m=np.array([-0.2, 0.0, 0.0]), axis_B=np.array([0.0, 1.0, 0.0])),
    ]
    upright = [t for t in paper.thrusters if abs(t.axis_B[2]) > 0.5]
    with pytest.raises(InputError, match="could not push ahead or astern if right, left never blew ahead"):
        bow_layout(replace(paper, thrusters=(*beside, *across, *upright)))


def test_thrusters_beside_the_middle_are_under_the_rule_where_others_push_astern():
    """Six level thrusters, two of them abreast: these and the front ones blow ahead no more, every wrench is made."""
    paper = load_vehicle("paper")
    level = [t for t in paper.thrusters if abs(t.axis_B[2]) < 0.5]
    beside = tuple(
        replace(level[0], name=name, p_BT_m=np.array([0.0, y, 0.0]), axis_B=np.array([1.0, 0.0, 0.0]))
        for name, y in (("right", 0.2), ("left", -0.2))
    )
    layout = bow_layout(replace(paper, thrusters=(*paper.thrusters, *beside)))
    assert np.all(layout.lower_N[8:] == 0.0) and np.all(layout.upper_N[:2] == 0.0)
    astern = min_norm_allocation(layout, np.array([-3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert astern.scale == 1.0 and astern.wrench_B[0] == pytest.approx(-3.0)


def test_ahead_is_where_the_camera_looks():
    """With the camera turned to starboard the two starboard thrusters are the bow; one that looks down has none."""
    paper = load_vehicle("paper")
    turned = Pose(paper.X_BC.p_m, quat_multiply(quat_from_euler(0.0, 0.0, np.pi / 2), paper.X_BC.q))
    layout = bow_layout(replace(paper, X_BC=turned))
    starboard = paper.thruster_positions_B_m[:4, 1] > 0.0
    sided = (layout.lower_N[:4] == 0.0) | (layout.upper_N[:4] == 0.0)
    assert np.array_equal(sided, starboard)
    down = Pose(paper.X_BC.p_m, quat_multiply(quat_from_euler(0.0, -np.pi / 2, 0.0), paper.X_BC.q))
    with pytest.raises(InputError, match="looks up or down"):
        bow_layout(replace(paper, X_BC=down))


@pytest.mark.parametrize("name", [f"bluerov2{kind}" for kind in ("", "-heavy", "-gazebo", "-heavy-wu", "-abir")])
def test_the_rule_fits_every_vectored_vehicle_of_the_library(name):
    """Limits of the two front thrusters become one-sided, those of all others stay."""
    vehicle = load_vehicle(name)
    layout = bow_layout(vehicle)
    assert int(np.sum(layout.upper_N == 0.0) + np.sum(layout.lower_N == 0.0)) == 2
