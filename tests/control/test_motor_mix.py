"""ArduSub's mixer: factors read off the geometry are the frame's own, outputs are normalised as it does."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.control.motor_mix import motor_mix
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import ARDUSUB_VECTORED_6DOF, load_vehicle


@pytest.mark.parametrize("name", ["paper", "bluerov2-heavy", "bluerov2-heavy-wu", "bluerov2-heavy-gazebo"])
def test_the_factors_of_the_frame_are_the_signs_of_the_geometry(name):
    """Vehicles in the frame's order and with its signs get its own table."""
    assert np.array_equal(motor_mix(load_vehicle(name)).factors, ARDUSUB_VECTORED_6DOF)


def test_a_thruster_that_is_mounted_the_other_way_round_is_turned_back():
    """All factors of that motor change sign, as MOT_n_DIRECTION does, so that its thrust in the vehicle stays."""
    paper = load_vehicle("paper")
    first = replace(paper.thrusters[0], axis_B=-paper.thrusters[0].axis_B)
    factors = motor_mix(replace(paper, thrusters=(first, *paper.thrusters[1:]))).factors
    assert np.array_equal(factors[0], -ARDUSUB_VECTORED_6DOF[0]) and np.array_equal(
        factors[1:], ARDUSUB_VECTORED_6DOF[1:]
    )


@pytest.mark.parametrize("axis", range(6))
def test_a_small_demand_of_one_axis_pushes_along_that_axis(axis):
    """Roll, pitch, yaw, up, forward, right, with a hundredth of it in any other force or moment of its kind."""
    vehicle = load_vehicle("paper")
    mix = motor_mix(vehicle.with_ideal_thrusters())
    demands = np.zeros(6)
    demands[axis] = 0.1
    outputs, saturated = mix.outputs(demands)
    even = 40.0 * outputs
    wrench = vehicle.allocation_matrix @ even
    along = [wrench[3], wrench[4], wrench[5], -wrench[2], wrench[0], wrench[1]]
    assert not saturated and along[axis] > 0.0
    kind = (0, 1, 2) if axis < 3 else (3, 4, 5)
    assert all(abs(along[other]) < 0.3 * along[axis] for other in kind if other != axis)


def test_sums_above_one_are_divided_by_the_largest_each_group_for_itself():
    """Upright motors by theirs, level ones by theirs; nothing leaves [-1, 1], and it is told."""
    mix = motor_mix(load_vehicle("paper"))
    outputs, saturated = mix.outputs(np.array([0.5, 0.0, 0.0, 1.0, 0.2, 0.0]))
    assert saturated and np.abs(outputs).max() == pytest.approx(1.0)
    np.testing.assert_allclose(outputs[:4], 0.2 * ARDUSUB_VECTORED_6DOF[:4, 4])
    np.testing.assert_allclose(outputs[4:], (0.5 * ARDUSUB_VECTORED_6DOF[4:, 0] + ARDUSUB_VECTORED_6DOF[4:, 3]) / 1.5)


def test_pulses_are_in_proportion_and_small_ones_turn_no_propeller():
    """A sixteenth of an output is the T200's dead band; half of it gives a sixth of full thrust or so, not half."""
    mix = motor_mix(load_vehicle("bluerov2-heavy"))
    assert not mix.thrusts_N(np.full(8, 0.06)).any()
    half, full = mix.thrusts_N(np.full(8, 0.5))[0], mix.thrusts_N(np.ones(8))[0]
    assert full == pytest.approx(51.44, abs=0.01) and 0.25 * full < half < 0.4 * full


@pytest.mark.parametrize("name", ["bluerov2", "paper-six-thrusters"])
def test_other_layouts_are_refused_with_what_they_have(name):
    """Six thrusters are another frame."""
    with pytest.raises(InputError, match="4 level and 2 upright thrusters, the frame vectored_6dof four of each"):
        motor_mix(load_vehicle(name))
