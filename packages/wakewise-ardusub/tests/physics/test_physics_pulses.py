"""Pulses to thrusts behind a firmware."""

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_table import library_curve
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.physics.physics import PulseTable

HEAVY = load_vehicle("bluerov2-heavy")
REST = (1500,) * 8


def test_a_pulse_gives_what_the_thrusters_own_curve_says() -> None:
    """At the vehicle's supply voltage, for each whole microsecond."""
    assert HEAVY.curve is not None
    curve, table = library_curve(HEAVY.curve.table), PulseTable.of(HEAVY)
    for pulse in (1100, 1330, 1471, 1500, 1529, 1700, 1900):
        thrusts = table.thrusts((pulse, *REST[1:], *(0,) * 8))
        assert thrusts[0] == curve.thrust_N(pulse, HEAVY.curve.supply_V)
        assert not thrusts[1:].any()


def test_what_is_no_signal_turns_nothing() -> None:
    """0 where an output is off, and pulses that no speed controller takes for one."""
    for pulse in (0, 700, 2300, 65535):
        assert not PulseTable.of(HEAVY).thrusts((pulse,) * 16).any()


def test_outputs_and_turned_motors_are_the_parameters() -> None:
    """Motor 1 on output 9, motor 2 turned."""
    parameters = {f"SERVO{i}_FUNCTION": 32.0 + i for i in range(2, 9)}
    parameters |= {"SERVO9_FUNCTION": 33.0, "MOT_2_DIRECTION": -1.0}
    table = PulseTable.of(HEAVY, parameters)
    plain = PulseTable.of(HEAVY)
    thrusts = table.thrusts((0, 1700, *(1500,) * 6, 1700, *(0,) * 7))
    assert thrusts[0] == plain.thrusts((1700, *(1500,) * 15))[0] > 0.0
    assert thrusts[1] == -thrusts[0]


def test_six_motors_do_not_drive_eight() -> None:
    """Which motors the outputs have is said."""
    with pytest.raises(InputError, match="8 thrusters"):
        PulseTable.of(HEAVY, {f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 7)})


def test_without_a_curve_thrust_goes_in_proportion() -> None:
    """A pulse of 1900 is the highest thrust, 1300 half of the lowest."""
    vehicle = load_vehicle("bluerov2-heavy").with_ideal_thrusters()
    thrusts = PulseTable.of(vehicle).thrusts((1900, 1300, *(1500,) * 14))
    assert np.allclose(thrusts[:2], [vehicle.thrust_upper_N[0], 0.5 * vehicle.thrust_lower_N[1]])
