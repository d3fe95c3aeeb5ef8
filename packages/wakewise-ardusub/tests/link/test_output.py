"""Thrusts on their way to the motors: through numbers of a message, the script and pulses back to thrusts."""

from __future__ import annotations

import numpy as np
import pytest

from script_bench import Bench, thrusts
from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise_ardusub.link.motor_interface import MotorOutput, motor_output

HEAVY = load_vehicle("bluerov2-heavy")
DIRECTIONS = (-1, -1, 1, 1, -1, 1, 1, -1)
PARAMETERS = {f"MOT_{i}_DIRECTION": float(d) for i, d in enumerate(DIRECTIONS, 1)} | {
    f"SERVO{i}_FUNCTION": 32.0 + i for i in range(1, 9)
}


@pytest.fixture(scope="module")
def output() -> MotorOutput:
    return motor_output(HEAVY, PARAMETERS)


@pytest.mark.parametrize("battery_V", [13.2, 14.8, 16.5, float("nan")])
def test_thrusts_come_out_of_the_script_as_they_were_desired(output: MotorOutput, battery_V: float) -> None:
    """Allocation's thrusts, the message, the script itself and the table: within half a microsecond of the demand."""
    desired = np.array([12.0, -8.0, 5.0, -3.0, 20.0, -15.0, 1.0, 0.0])
    bench = Bench()
    bench.load()
    bench.enable()
    bench.step(thrusts(list(output.controls(desired, battery_V)), 10))
    pulses = np.array([bench.pulses[channel] for channel in range(8)], dtype=float)
    assert pulses == pytest.approx(output.pulses_us(desired, battery_V))
    assert output.delivered_N(pulses, battery_V) == pytest.approx(desired, abs=0.12)
    assert pulses[7] == 1500.0


def test_rest_is_the_middle(output: MotorOutput) -> None:
    """Every motor at 1500 us, which is 0 on the wire."""
    assert output.neutral() == pytest.approx(np.zeros(8))


def test_the_wrench_on_the_vehicle_is_the_one_that_was_wanted(output: MotorOutput) -> None:
    """Ahead with four level thrusters: where mixer and direction turn a motor twice, its pulse is above the middle."""
    ahead = np.linalg.pinv(HEAVY.allocation_matrix) @ np.array([30.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    pulses = output.pulses_us(ahead, 16.0)
    wrench = HEAVY.allocation_matrix @ output.delivered_N(pulses, 16.0)
    assert wrench[0] == pytest.approx(30.0, abs=0.3)
    assert np.abs(wrench[1:3]).max() < 0.3
    assert (pulses[:4] > 1500.0).all()


def test_six_motors_on_an_eight_motor_frame_are_refused() -> None:
    """And the other way round: a vehicle file of another vehicle drives nothing."""
    six = load_vehicle("bluerov2")
    with pytest.raises(InputError, match=r"bluerov2: 6 thrusters, the autopilot drives motors 1, 2, .* 8; name the"):
        motor_output(six, PARAMETERS)
    fewer = {name: value for name, value in PARAMETERS.items() if value not in {39.0, 40.0}}
    with pytest.raises(InputError, match="8 thrusters, the autopilot drives motors 1, 2, 3, 4, 5, 6;"):
        motor_output(HEAVY, fewer)
    controls = motor_output(six, fewer).controls(np.ones(6))
    assert np.isnan(controls[6:]).all()
    assert np.isfinite(controls[:6]).all()


@pytest.mark.parametrize("value", [None, 0.0, 2.0])
def test_a_direction_that_is_not_known_is_refused(value: float | None) -> None:
    """Nothing is guessed about which way a motor pushes."""
    parameters = dict(PARAMETERS)
    if value is None:
        del parameters["MOT_3_DIRECTION"]
    else:
        parameters["MOT_3_DIRECTION"] = value
    with pytest.raises(InputError, match="MOT_3_DIRECTION"):
        motor_output(HEAVY, parameters)


def test_as_many_thrusts_as_thrusters(output: MotorOutput) -> None:
    """Seven are refused, and so are thrusts that are no numbers."""
    with pytest.raises(InputError, match="has 8 thrusters"):
        output.controls(np.zeros(7))
    with pytest.raises(InputError, match="finite"):
        output.controls(np.array([np.inf] * 8))


def test_limits_are_those_of_the_battery(output: MotorOutput) -> None:
    """A flat battery pushes less, and a turned motor has its stronger side the other way."""
    low, high = output.limits_N(12.0)
    full_low, full_high = output.limits_N(16.0)
    assert (high < full_high).all()
    assert (low > full_low).all()
    assert (high > -low).tolist() == [d > 0 for d in DIRECTIONS]
