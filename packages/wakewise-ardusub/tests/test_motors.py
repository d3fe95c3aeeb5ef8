"""Thrusts to pulses and pulses to thrusts: each other's inverse wherever a motor can hold the thrust."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_table import library_curve
from wakewise.robot.vehicles import load_vehicle
from wakewise.robot.vehicles.vehicle import LeastThrust
from wakewise_ardusub.motors import (
    channels_of_motors,
    limits_of_motors,
    pulses_of_thrusts,
    supply_in_table,
    thrusts_of_pulses,
)

HEAVY = load_vehicle("bluerov2-heavy")
PLAIN = dataclasses.replace(HEAVY, curve=None, least_thrust=LeastThrust(forward_N=0.5, reverse_N=0.4))
DIRECTIONS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, -1.0])
volts = st.floats(10.0, 20.0)


@given(st.lists(st.integers(1100, 1900), min_size=8, max_size=8), volts)
@settings(max_examples=60, deadline=None)
def test_the_thrust_of_a_pulse_asks_for_a_pulse_with_that_thrust(pulses: list[int], supply_V: float) -> None:
    """Pulses of one thrust may be several, where the table is flat; their thrust comes back to a millinewton."""
    made = thrusts_of_pulses(HEAVY, np.array(pulses, dtype=float), DIRECTIONS, supply_V)
    back = pulses_of_thrusts(HEAVY, made, DIRECTIONS, supply_V)
    assert thrusts_of_pulses(HEAVY, back, DIRECTIONS, supply_V) == pytest.approx(made, abs=1e-3)


@given(st.lists(st.floats(-80.0, 80.0), min_size=8, max_size=8), volts)
@settings(max_examples=60, deadline=None)
def test_a_demand_becomes_the_nearest_thrust_that_a_whole_pulse_holds(desired: list[float], supply_V: float) -> None:
    """No other whole pulse comes nearer to what the thruster would deliver, whichever way the motor is turned."""
    demand = np.array(desired)
    pulses = pulses_of_thrusts(HEAVY, demand, DIRECTIONS, supply_V)
    assert (pulses == np.rint(pulses)).all()
    curve = library_curve("t200")
    delivered = DIRECTIONS * curve.delivered_N(DIRECTIONS * demand, supply_V)
    error = np.abs(thrusts_of_pulses(HEAVY, pulses, DIRECTIONS, supply_V) - delivered)
    every = np.arange(1100.0, 1901.0)
    best = [np.abs(d * curve.thrust_N(every, supply_V) - t).min() for d, t in zip(DIRECTIONS, delivered, strict=True)]
    assert error == pytest.approx(np.array(best), abs=1e-9)


def test_no_pulse_lies_in_the_dead_band() -> None:
    """Over all thrusts a motor rests at 1500 us or runs: 1472 to 1528 us at 16 V is never sent."""
    thrusts = np.linspace(-60.0, 60.0, 4000)
    for supply_V in (10.0, 13.3, 16.0, 20.0):
        low, high = library_curve("t200").deadband_us(supply_V)
        found = pulses_of_thrusts(HEAVY, thrusts.reshape(-1, 8), np.ones(8), supply_V).ravel()
        running = found[found != 1500.0]
        assert ((running < low) | (running > high)).all()
        assert (np.diff(found) >= 0.0).all()
    low, high = library_curve("t200").deadband_us(16.0)
    assert (low, high) == (1472.0, 1528.0)


def test_less_voltage_wants_a_longer_way_from_the_middle() -> None:
    """The same thrust at 12 V and at 16 V are different pulses, and the same thrust."""
    demand = np.full(8, 15.0)
    for supply_V in (12.0, 16.0):
        pulses = pulses_of_thrusts(HEAVY, demand, np.ones(8), supply_V)
        assert thrusts_of_pulses(HEAVY, pulses, np.ones(8), supply_V) == pytest.approx(demand, abs=0.1)
    assert (
        pulses_of_thrusts(HEAVY, demand, np.ones(8), 12.0)[0]
        > pulses_of_thrusts(HEAVY, demand, np.ones(8), 16.0)[0] + 20
    )


def test_a_turned_motor_has_everything_turned() -> None:
    """Pulses are mirrored about the middle only as far as the table is; limits change sides."""
    demand = np.full(8, 20.0)
    forward, turned = (pulses_of_thrusts(HEAVY, demand, d * np.ones(8), 16.0) for d in (1.0, -1.0))
    assert (forward > 1500.0).all()
    assert (turned < 1500.0).all()
    assert (np.abs(turned - 1500.0) > np.abs(forward - 1500.0)).all()
    low, high = limits_of_motors(HEAVY, np.ones(8), 16.0)
    low_turned, high_turned = limits_of_motors(HEAVY, -np.ones(8), 16.0)
    assert low_turned == pytest.approx(-high)
    assert high_turned == pytest.approx(-low)


@given(st.lists(st.floats(-60.0, 60.0), min_size=8, max_size=8))
@example([0.25] + [0.0] * 7)
@settings(max_examples=60, deadline=None)
def test_without_a_table_thrusts_go_in_proportion(desired: list[float]) -> None:
    """Limits, least thrusts and directions hold as well; half a microsecond of rounding is left."""
    demand = np.array(desired)
    pulses = pulses_of_thrusts(PLAIN, demand, DIRECTIONS, 0.0)
    low, high = limits_of_motors(PLAIN, DIRECTIONS, 0.0)
    made = thrusts_of_pulses(PLAIN, pulses, DIRECTIONS, 0.0)
    step = np.maximum(high, -low) / 400.0
    assert (
        np.abs(made - np.clip(demand, low, high)) <= 0.5 * step + 0.25 + 1e-9
    ).all()  # half a least thrust beside it
    assert (pulses[np.abs(demand) < 0.19] == 1500.0).all()
    assert pulses_of_thrusts(
        PLAIN, thrusts_of_pulses(PLAIN, pulses, DIRECTIONS, 0.0), DIRECTIONS, 0.0
    ) == pytest.approx(pulses)


def test_a_voltage_is_kept_within_the_table() -> None:
    """What is not known is the vehicle file's, and a flat battery counts as the table's lowest voltage."""
    assert supply_in_table(HEAVY, float("nan")) == supply_in_table(HEAVY, 0.0) == 16.0
    assert supply_in_table(HEAVY, 3.0) == 10.0
    assert supply_in_table(HEAVY, 25.0) == 20.0
    assert supply_in_table(PLAIN, 14.0) == 0.0


def test_channels_of_a_motor_are_all_that_name_it() -> None:
    """Also motors 9 to 12, which have functions of their own, and two channels of one motor."""
    found = channels_of_motors({"SERVO3_FUNCTION": 33.0, "SERVO9_FUNCTION": 33.0, "SERVO2_FUNCTION": 82.0})
    assert found == {1: [3, 9], 9: [2]}
    assert channels_of_motors({"SERVO1_FUNCTION": 59.0, "SERVO99_FUNCTION": 33.0, "X": 33.0}) == {}


def test_a_thrust_that_is_no_number_is_refused() -> None:
    """One line says so."""
    with pytest.raises(InputError, match="every one must be finite"):
        pulses_of_thrusts(HEAVY, np.array([np.nan] * 8), DIRECTIONS, 16.0)
