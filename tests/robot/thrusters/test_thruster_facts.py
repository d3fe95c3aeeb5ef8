"""Plain values of curves and lags: complete, and a reason beside every missing one."""

import json

import numpy as np

from wakewise.robot.thrusters.lag_fit import identify_lag
from wakewise.robot.thrusters.rotor_lag import SecondOrderLag
from wakewise.robot.thrusters.thrust_table import library_curve, parse_thrust_table
from wakewise.robot.thrusters.thruster_facts import curve_facts, lag_facts, usual_voltage


def test_a_curves_facts_hold_the_limits_and_both_look_ups() -> None:
    facts = curve_facts(library_curve("t200"), 16.0, [10.0, 51.44, 0.1], [1500.0, 1700.0])
    assert facts["limits_N"] == [-39.91, 51.44]
    assert facts["deadband_us"] == [1472.0, 1528.0]
    assert [row["thrust_N"] for row in facts["thrusts"]] == [10.0, 51.44, 0.0]
    assert [row["desired_N"] for row in facts["thrusts"]] == [10.0, 51.44, 0.1]
    assert facts["pulses"][0] == {"pwm_us": 1500.0, "thrust_N": 0.0, "rpm": 0.0, "power_W": 0.0}
    assert facts["table"][0]["pwm_us"] == 1100.0
    assert facts["table"][-1]["thrust_N"] == 51.44
    assert facts["why"] == {}
    assert json.loads(json.dumps(facts, allow_nan=False)) == facts


def test_what_a_table_lacks_is_null_with_a_reason() -> None:
    curve = parse_thrust_table("supply_V,pwm_us,thrust_N\n12,1100,-20\n12,1500,0\n12,1900,30\n", "a.csv", "a")
    facts = curve_facts(curve, usual_voltage(curve), [3.0])
    assert facts["supply_V"] == 12.0
    assert set(facts["why"]) == {"rpm", "power_W"}
    assert facts["thrusts"][0]["rpm"] is None
    assert facts["thrusts"][0]["power_W"] is None
    assert facts["notes"]


def test_a_lags_facts_give_a_reason_for_what_is_missing() -> None:
    """A second-order lag has no time constant; a command that never rests has no delay by area."""
    time = np.arange(0.0, 3.0, 0.01)
    command = np.sin(2.0 * time) + (time > 1.0)
    thrust = SecondOrderLag(natural_rad_s=8.0, damping_ratio=0.3).response(command, 0.01)
    facts = lag_facts(identify_lag(time, command, thrust + np.random.default_rng(0).normal(0.0, 0.01, time.size)))
    assert facts["model"] == "second order"
    assert facts["time_constant_s"] is None
    assert facts["measured_delay_s"] is None
    assert {"time_constant_s", "measured_delay_s", "measured_delay_error_s"} <= set(facts["why"])
    assert len(facts["models"]) == 4
    assert json.loads(json.dumps(facts, allow_nan=False)) == facts
