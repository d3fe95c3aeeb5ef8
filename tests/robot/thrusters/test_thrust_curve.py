"""The thrust curve that ships: it meets the maker's table, and its maps are each other's inverses."""

import csv
import itertools
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import CurveSide, ThrustCurve
from wakewise.robot.thrusters.thrust_table import curve_names, library_curve, load_curve

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
T200 = library_curve("t200")
VOLTAGES = [10.0, 12.0, 14.0, 16.0, 20.0]
BETWEEN = [10.7, 13.0, 14.8, 17.0, 18.5]


@pytest.fixture(scope="module")
def maker() -> np.ndarray:
    """The maker's rows: voltage, pulse, thrust in newton, rpm, power."""
    path = DATA / "thruster_t200" / "t200_all_voltages.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    with path.open() as file:
        return np.array(
            [
                [float(row[k]) for k in ("supply_V_sheet", "pwm_us", "force_kgf", "rpm", "power_W")]
                for row in csv.DictReader(file)
            ]
        ) * [1.0, 1.0, 9.80665, 1.0, 1.0]


@pytest.mark.parametrize("voltage", VOLTAGES)
def test_the_shipped_curve_meets_the_makers_table(maker: np.ndarray, voltage: float) -> None:
    """Thrust within 0.3 N rms at each voltage; speed and power, read at the measured thrust, within 1 % of full."""
    _, pulse, thrust, rpm, power = maker[maker[:, 0] == voltage].T
    assert rms(T200.thrust_N(pulse, voltage) - thrust) < 0.3
    assert rms(np.abs(T200.rpm(thrust, voltage)) - rpm) < 0.01 * rpm.max()
    assert rms(T200.power_W(thrust, voltage) - power) < 0.01 * power.max()


@pytest.mark.parametrize("voltage", VOLTAGES)
def test_the_shipped_inverse_finds_the_makers_pulses(maker: np.ndarray, voltage: float) -> None:
    """From measured thrust back to its pulse: within 4 us rms over all running rows, and 8 us at worst."""
    _, pulse, thrust, _, _ = maker[maker[:, 0] == voltage].T
    runs = thrust != 0.0
    error = T200.pwm_us(thrust[runs], voltage) - pulse[runs]
    assert rms(error) < 4.0
    assert np.abs(error).max() < 8.0


@pytest.mark.parametrize("voltage", VOLTAGES + BETWEEN)
def test_pulse_to_thrust_and_back_is_within_4_us_outside_the_deadband(voltage: float) -> None:
    low, high = T200.deadband_us(voltage)
    pulse = np.linspace(1100.0, 1900.0, 6401)
    outside = pulse[(pulse < low - 1e-9) | (pulse > high + 1e-9)]
    assert np.abs(T200.pwm_us(T200.thrust_N(outside, voltage), voltage) - outside).max() <= 4.0 + 1e-9
    beyond = outside[(outside < low - 4.0) | (outside > high + 4.0)]
    assert np.allclose(T200.pwm_us(T200.thrust_N(beyond, voltage), voltage), beyond, atol=1e-6)


@pytest.mark.parametrize("voltage", VOLTAGES)
def test_the_makers_full_table_keeps_its_rows_and_goes_there_and_back(maker: np.ndarray, voltage: float) -> None:
    """The curve built from all rows repeats them but for its smoothing, and its own round trip holds at every row."""
    full = load_curve(str(DATA / "thruster_t200" / "t200_all_voltages.csv"))
    _, pulse, thrust, _, _ = maker[maker[:, 0] == voltage].T
    assert np.abs(full.thrust_N(pulse, voltage) - thrust).max() < 0.07
    runs = thrust != 0.0
    assert np.abs(full.pwm_us(full.thrust_N(pulse[runs], voltage), voltage) - pulse[runs]).max() <= 4.0


def test_the_deadband_is_the_makers(maker: np.ndarray) -> None:
    """1472 to 1528 us at 16 V, and at each voltage the outermost rows without thrust."""
    assert T200.deadband_us(16.0) == (1472.0, 1528.0)
    for voltage in VOLTAGES:
        silent = maker[(maker[:, 0] == voltage) & (maker[:, 2] == 0.0), 1]
        assert T200.deadband_us(voltage) == (silent.min(), silent.max())
        assert np.all(T200.thrust_N(np.linspace(silent.min(), silent.max(), 57), voltage) == 0.0)


def test_no_thrust_is_the_neutral_pulse_and_small_demands_are_rounded() -> None:
    """Below half the first step a demand becomes none, above half it becomes the first step, on each side."""
    low, high = T200.first_step_N(16.0)
    demands = np.array([0.0, 0.49 * high, 0.51 * high, 0.49 * low, 0.51 * low])
    assert T200.pwm_us(demands, 16.0).tolist() == [1500.0, 1500.0, 1532.0, 1500.0, 1468.0]
    assert T200.delivered_N(demands, 16.0).tolist() == [0.0, 0.0, high, 0.0, low]
    assert T200.power_W(demands, 16.0)[[0, 1, 3]].tolist() == [0.0, 0.0, 0.0]
    assert T200.thrust_N(1529.0, 16.0) == high


def test_a_thruster_saturates_at_its_limits_and_pushes_less_in_reverse() -> None:
    low, high = T200.limits_N(16.0)
    assert (low, high) == (-39.91, 51.44)
    assert T200.pwm_us([-1e6, 1e6], 16.0).tolist() == [1100.0, 1900.0]
    assert T200.delivered_N([-1e6, 1e6], 16.0).tolist() == [low, high]
    assert T200.thrust_N([0.0, 1e6], 16.0).tolist() == [low, high]
    assert T200.rpm([-10.0, 10.0], 16.0)[0] < 0.0


@given(st.floats(10.0, 20.0), st.lists(st.floats(-80.0, 80.0), min_size=2, max_size=8))
def test_maps_never_fall_and_demands_are_met(voltage: float, demands: list[float]) -> None:
    """At any voltage more demand never gives less pulse or thrust; what is delivered is what the pulse gives."""
    desired = np.sort(np.array(demands))
    pulse = T200.pwm_us(desired, voltage)
    delivered = T200.delivered_N(desired, voltage)
    assert np.all(np.diff(pulse) >= 0.0)
    assert np.all(np.diff(delivered) >= 0.0)
    assert np.allclose(T200.thrust_N(pulse, voltage), delivered, atol=1e-9)
    low, high = T200.limits_N(voltage)
    inside = (desired >= low) & (desired <= high) & (np.abs(desired) > 0.6)
    assert np.allclose(delivered[inside], desired[inside], atol=1e-9)
    assert np.all(T200.power_W(desired, voltage) >= 0.0)


def test_between_voltages_the_curve_lies_between_and_grows(maker: np.ndarray) -> None:
    """Limits grow with voltage; a voltage left out is found from its neighbours within 0.3 N rms."""
    limits = np.array([T200.limits_N(voltage) for voltage in np.linspace(10.0, 20.0, 41)])
    assert np.all(np.diff(limits[:, 1]) > 0.0)
    assert np.all(np.diff(limits[:, 0]) < 0.0)
    for left_out in (12.0, 14.0):
        others = np.array([v for v in VOLTAGES if v != left_out])
        rows = [VOLTAGES.index(v) for v in others]
        without = ThrustCurve(
            name="without",
            source="",
            supply_V=others,
            neutral_us=1500.0,
            forward=thinned(T200.forward, rows),
            reverse=thinned(T200.reverse, rows),
        )
        _, pulse, thrust, _, _ = maker[maker[:, 0] == left_out].T
        assert rms(without.thrust_N(pulse, left_out) - thrust) < 0.3


def test_shapes_are_kept() -> None:
    thrust = np.linspace(-20.0, 20.0, 12).reshape(3, 2, 2)
    for method in (T200.pwm_us, T200.delivered_N, T200.rpm, T200.power_W):
        assert method(thrust, 15.0).shape == (3, 2, 2)
    assert T200.thrust_N(1700.0, 15.0).shape == ()


def test_voltages_outside_the_table_and_figures_that_are_none_are_refused() -> None:
    for voltage, said in ((9.9, "9.9"), (20.1, "20.1"), (float("nan"), "nan")):
        with pytest.raises(InputError, match=f"supply_V = {said}, the table holds 10 to 20 V"):
            T200.thrust_N(1600.0, voltage)
    with pytest.raises(InputError, match="which supply voltage"):
        T200.limits_N()
    for method in (T200.thrust_N, T200.pwm_us, T200.rpm, T200.power_W, T200.delivered_N):
        with pytest.raises(InputError, match="must be finite"):
            method([1.0, float("nan")], 16.0)


def test_a_curve_that_is_none_is_refused() -> None:
    sound = {"share": [0.0, 1.0], "silent_us": [1520.0], "first_us": [1524.0], "last_us": [1900.0]}
    for change, said in (
        ({"thrust_N": [[2.0, 1.0]]}, "never falls"),
        ({"thrust_N": [[-1.0, 1.0]]}, "never falls"),
        ({"thrust_N": [[1.0, 2.0]], "share": [0.0, 0.9]}, "from 0 to 1"),
        ({"thrust_N": [[1.0, 2.0, 3.0]]}, "shape"),
    ):
        with pytest.raises(InputError, match=said):
            CurveSide(**(sound | change))


def test_the_library_is_small_and_says_what_it_holds() -> None:
    """The shipped table is derived: at most a seventh of the maker's rows, with the maker named."""
    assert curve_names() == ["t200"]
    assert "Blue Robotics" in T200.source
    assert "Derived" in T200.source
    assert T200.notes == ()
    with pytest.raises(InputError, match="allowed t200"):
        library_curve("t500")
    with pytest.raises(InputError, match="allowed t200 or the path"):
        load_curve("t500")
    rows = (Path(__file__).parents[3] / "src/wakewise/robot/thrusters/data/t200.csv").read_text()
    table = [line for line in rows.splitlines() if line[0].isdigit()]
    assert len(table) <= 1005 / 7
    assert all(a != b for a, b in itertools.pairwise(table))


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def thinned(side: CurveSide, rows: list[int]) -> CurveSide:
    return CurveSide(
        share=side.share,
        silent_us=side.silent_us[rows],
        first_us=side.first_us[rows],
        last_us=side.last_us[rows],
        thrust_N=side.thrust_N[rows],
    )
