"""Limits, lag and power of thrusters."""

import csv
import math
import os
from pathlib import Path

import numpy as np
import pytest

from wakewise.robot.thrusters import electrical_power_W, library_curve, saturate, scale_to_limits, thruster_lag
from wakewise.robot.thrusters.thruster import FIGURE_OF_MERIT_FORWARD, FIGURE_OF_MERIT_REVERSE
from wakewise.robot.vehicles import load_vehicle

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
LOWER, UPPER = np.full(3, -40.0), np.full(3, 51.0)


def test_clipping_holds_each_thrust_within_its_limits() -> None:
    assert np.array_equal(saturate(np.array([60.0, -50.0, 3.0]), LOWER, UPPER), [51.0, -40.0, 3.0])


def test_scaling_keeps_the_direction_of_the_wrench() -> None:
    thrusts = np.array([60.0, -50.0, 3.0])
    scaled = scale_to_limits(thrusts, LOWER, UPPER)
    assert np.all(scaled >= LOWER)
    assert np.all(scaled <= UPPER)
    assert np.allclose(np.cross(scaled, thrusts), 0.0, atol=1e-12)
    assert math.isclose(scaled[1], -40.0)


def test_scaling_leaves_allowed_thrusts_alone_and_cannot_push_where_there_is_no_room() -> None:
    allowed = np.array([50.0, -39.0, 0.0])
    assert np.array_equal(scale_to_limits(allowed, LOWER, UPPER), allowed)
    assert np.array_equal(scale_to_limits(np.array([1.0, 2.0, -1.0]), np.zeros(3), UPPER), np.zeros(3))


def test_lag_is_exact_so_two_half_steps_are_one_step() -> None:
    tau, start, command = np.array([0.1, 0.03, 0.0]), np.array([5.0, -3.0, 0.0]), np.array([-10.0, 20.0, 7.0])
    once = thruster_lag(start, command, tau, 0.05)
    twice = thruster_lag(thruster_lag(start, command, tau, 0.025), command, tau, 0.025)
    assert np.allclose(once, twice, rtol=1e-14)
    assert math.isclose(once[0], -10.0 + 15.0 * math.exp(-0.5))
    assert once[2] == 7.0


def test_no_time_changes_no_thrust() -> None:
    start = np.array([5.0, -3.0])
    assert np.array_equal(thruster_lag(start, np.zeros(2), np.full(2, 0.1), 0.0), start)


def test_the_heavys_lag_has_the_mean_delay_of_the_published_rotor() -> None:
    """The area between a unit step and the response is the mean delay: from the transfer function and from one lag."""
    numerator, denominator = [6136.0, 108700.0], [1.0, 89.0, 9258.0, 108700.0]
    delay_s = denominator[-2] / denominator[-1] - numerator[-2] / numerator[-1]
    tau = load_vehicle("bluerov2-heavy").thrusters[0].time_constant_s
    assert math.isclose(tau, delay_s, rel_tol=2e-3)
    dt_s, thrust, area = 1e-4, np.zeros(1), 0.0
    for _ in range(5000):
        after = thruster_lag(thrust, np.ones(1), np.array([tau]), dt_s)
        area += dt_s * float(1.0 - 0.5 * (thrust + after)[0])
        thrust = after
    assert math.isclose(area, tau, rel_tol=1e-4)


def test_power_grows_as_thrust_to_the_three_halves_and_falls_with_disk_area() -> None:
    area = np.full(2, 0.003)
    one, four = electrical_power_W(np.array([1.0, 4.0]), area)
    assert math.isclose(four, 8.0 * one)
    assert math.isclose(electrical_power_W(np.ones(1), np.array([0.012]))[0], one / 2.0)
    assert electrical_power_W(np.zeros(1), np.ones(1))[0] == 0.0
    # Momentum theory: T = 2 rho A v2, P = T v.
    v = math.sqrt(1.0 / (2.0 * 1000.0 * 0.003))
    assert math.isclose(one * FIGURE_OF_MERIT_FORWARD, v)


def test_the_figures_of_merit_are_those_of_the_makers_table() -> None:
    """Least squares through the T200's 16 V rows gives the constants and the stated errors."""
    path = DATA / "thruster_t200" / "t200_all_voltages.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    with path.open() as file:
        rows = [
            (float(row["force_kgf"]) * 9.80665, float(row["power_W"]))
            for row in csv.DictReader(file)
            if float(row["supply_V_sheet"]) == 16.0
        ]
    table = np.array(rows)
    for sign, figure, stated_rms_W in ((1.0, FIGURE_OF_MERIT_FORWARD, 4.1), (-1.0, FIGURE_OF_MERIT_REVERSE, 7.7)):
        thrust, power = table[sign * table[:, 0] > 0.01].T
        ideal = electrical_power_W(
            thrust, np.full(thrust.size, math.pi * 0.038**2), figure_of_merit_forward=1.0, figure_of_merit_reverse=1.0
        )
        fitted = float(ideal @ ideal / (ideal @ power))
        assert math.isclose(fitted, figure, abs_tol=5e-4)
        assert math.isclose(float(np.sqrt(np.mean((ideal / fitted - power) ** 2))), stated_rms_W, abs_tol=0.1)


def test_power_is_the_curves_where_there_is_one() -> None:
    """With a curve the table speaks, whatever the disk; the table stops at the thruster's limits."""
    curve = library_curve("t200")
    thrusts, areas = np.array([-30.0, 0.0, 0.1, 20.0, 99.0]), np.full(5, 1e-3)
    power = electrical_power_W(thrusts, areas, curve=curve, supply_V=16.0)
    assert np.array_equal(power, curve.power_W(thrusts, 16.0))
    assert power[1] == power[2] == 0.0
    assert math.isclose(power[4], 381.3)


def test_curve_and_actuator_disk_agree_as_documented() -> None:
    """T200 at 16 V: within 5 W rms forward and 9 W rms reverse, over the thrusts it can hold."""
    curve = library_curve("t200")
    first, limits = curve.first_step_N(16.0), curve.limits_N(16.0)
    area = np.full(300, math.pi * 0.038**2)
    for side, bound_W in ((1, 5.0), (0, 9.0)):
        thrusts = np.linspace(first[side], limits[side], 300)
        apart = electrical_power_W(thrusts, area) - electrical_power_W(thrusts, area, curve=curve, supply_V=16.0)
        assert float(np.sqrt(np.mean(apart**2))) < bound_W
