"""The reader of thrust tables: what is right is read, what is wrong is named with its line."""

import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.thrusters.thrust_curve import ThrustCurve
from wakewise.robot.thrusters.thrust_table import KGF_N, parse_thrust_table, read_thrust_table

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data"))
HEAD = "supply_V,pwm_us,thrust_N\n"
GOOD = HEAD + "12,1100,-20\n12,1300,-6\n12,1480,-0.4\n12,1490,0\n12,1510,0\n12,1518,0.5\n12,1700,8\n12,1900,30\n"


def parsed(text: str) -> ThrustCurve:
    return parse_thrust_table(text, "some.csv", "some")


def refusal(text: str) -> str:
    """The one line that says why a table is refused."""
    with pytest.raises(InputError) as caught:
        parsed(text)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("thrust table some.csv: ")
    return str(caught.value)


def test_a_small_table_is_read_as_it_stands() -> None:
    curve = parsed(GOOD)
    assert curve.limits_N() == (-20.0, 30.0)
    assert curve.deadband_us() == (1490.0, 1510.0)
    assert curve.first_step_N() == (-0.4, 0.5)
    assert curve.neutral_us == 1500.0
    assert curve.thrust_N([1100.0, 1300.0, 1505.0, 1512.0, 1609.0]).tolist() == [-20.0, -6.0, 0.0, 0.5, 4.25]
    assert curve.notes == ()
    with pytest.raises(InputError, match="no column power_W"):
        curve.power_W(1.0)
    with pytest.raises(InputError, match="no column rpm"):
        curve.rpm(1.0)


def test_kilogram_force_comments_order_and_the_makers_headings_are_understood() -> None:
    """Shuffled rows in kgf under the workbook's headings give the same curve, and comments become the source."""
    rows = [line.split(",") for line in GOOD.splitlines()[1:]]
    text = " PWM (µs) , Force (Kg f),Voltage (V)\n" + "\n".join(
        f"{pulse},{float(thrust) / KGF_N!r},{volt}" for volt, pulse, thrust in rows[::-1]
    )
    curve, same = parsed("# A maker, 2020.\n\n" + text), parsed(GOOD)
    grid = np.linspace(1050.0, 1950.0, 301)
    assert np.allclose(curve.thrust_N(grid), same.thrust_N(grid), rtol=1e-12)
    assert curve.source == "A maker, 2020."


def test_the_makers_full_table_is_read_and_its_bad_row_is_named() -> None:
    """Five voltages; at 14 V, 1548 us power is not voltage times current: said, and kept out of the power."""
    path = DATA / "thruster_t200" / "t200_all_voltages.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    curve = read_thrust_table(path)
    assert curve.supply_V.tolist() == [10.0, 12.0, 14.0, 16.0, 20.0]
    line = next(
        number for number, text in enumerate(path.read_text().splitlines(), 1) if text.startswith("14.0,1548.0")
    )
    assert sum("electrical readings are left out" in note for note in curve.notes) == 1
    assert curve.notes[0].startswith(f"line {line} (14 V, 1548 us): power 1.4 W, but voltage times current is 0.14 W")
    power = curve.power_W(curve.thrust_N([1544.0, 1548.0, 1552.0], 14.0), 14.0)
    assert power[0] <= power[1] <= power[2]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        (HEAD, "no row"),
        (HEAD + "12,1500,0\n", r"line 2: 1 row\(s\) at 12 V, at least 3"),
        (GOOD + "13,1500,0\n", r"line 10: 1 row\(s\) at 13 V"),
        (GOOD.replace("1300,-6", "1300,nan"), "line 3: thrust_N = 'nan', must be a finite number"),
        (GOOD.replace("1300,-6", "1300,inf"), "line 3: thrust_N = 'inf'"),
        (GOOD.replace("1300,-6", "1300,"), "line 3: thrust_N = ''"),
        (GOOD.replace("1300,-6", "1300"), "line 3: 2 cells, the header has 3"),
        (GOOD.replace("1300,-6", "1300,-6,1"), "line 3: 4 cells"),
        (GOOD.replace("1300", "1100"), "line 3: pulse 1100 us given twice at 12 V"),
        (GOOD.replace("1300,-6", "1300,7"), "line 3: thrust 7 N at 12 V, 1300 us is .* N from any curve that rises"),
        (GOOD.replace("1700", "1.7"), "line 8: pwm_us = 1.7, allowed 500 to 2500"),
        (GOOD.replace("12,1700", "0,1700"), "line 8: supply_V = 0, allowed 1 to 1000"),
        (GOOD.replace("1490,0", "1490,-0.2").replace("1510,0", "1510,0.2"), "no row without thrust at 12 V"),
        (HEAD + "12,1400,0\n12,1500,0\n12,1600,0\n", "no row with thrust at 12 V"),
        (GOOD.replace("thrust_N", "thrust"), "unknown column 'thrust', allowed current_A"),
        (GOOD.replace("supply_V", "volts"), "unknown column 'volts'"),
        (GOOD.replace("supply_V", "rpm"), "no column supply_V"),
        (GOOD.replace("supply_V", "pwm_us"), "column pwm_us given more than once"),
        (GOOD.replace("pwm_us", "rpm"), "no column pwm_us"),
        (GOOD.replace("thrust_N", "current_A"), "either a column thrust_N or a column force_kgf"),
        ("a" * 5_000_001, "at most 5000000"),
    ],
)
def test_bad_tables_are_refused_with_the_line(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        parsed(text)
    assert refusal(text)


def test_one_row_alone_is_refused() -> None:
    assert "at least 3 are needed" in refusal(HEAD + "12,1500,0\n")


def powered(thrust: list[float], power: list[float], name: str = "thrust_N", extra: str = "") -> str:
    pulses = [1100, 1300, 1490, 1510, 1700, 1900]
    rows = "".join(f"12,{p},{t!r},{w!r}{extra}\n" for p, t, w in zip(pulses, thrust, power, strict=True))
    return f"supply_V,pwm_us,{name},power_W{',current_A' if extra else ''}\n{rows}"


def test_newton_and_kilogram_force_mixed_up_are_refused_either_way() -> None:
    """A thruster of 15 gram-force per watt is read in its own unit and refused in the other."""
    newton, power = [-20.0, -6.0, 0.0, 0.0, 8.0, 30.0], [140.0, 30.0, 0.0, 0.0, 40.0, 204.0]
    kgf = [value / KGF_N for value in newton]
    assert parsed(powered(newton, power)).limits_N() == (-20.0, 30.0)
    assert np.allclose(parsed(powered(kgf, power, "force_kgf")).limits_N(), (-20.0, 30.0))
    for swapped in (powered(kgf, power), powered(newton, power, "force_kgf")):
        assert "line 7 (12 V, 1900 us)" in refusal(swapped)
        assert "are newton and kgf mixed up?" in refusal(swapped)


def test_the_makers_table_in_the_wrong_unit_is_refused() -> None:
    path = DATA / "thruster_t200" / "t200_all_voltages.csv"
    if not path.is_file():
        pytest.skip(f"{path.name} is not here; set WAKEWISE_DATA")
    assert "mixed up" in refusal(path.read_text().replace("force_kgf", "thrust_N"))


def test_power_that_contradicts_current_throughout_is_refused() -> None:
    """One such row is a bad row; all of them are a wrong unit."""
    text = powered([-20.0, -6.0, 0.0, 0.0, 8.0, 30.0], [140.0, 30.0, 0.0, 0.0, 40.0, 204.0], extra=",900")
    assert "are the units W, V and A?" in refusal(text)
    assert "at least 0" in refusal(powered([-20.0, -6.0, 0.0, 0.0, 8.0, 30.0], [1.0, -1.0, 0.0, 0.0, 1.0, 1.0]))


def test_a_coarse_table_says_that_its_start_is_not_known_and_is_straight_there() -> None:
    curve = parsed(HEAD + "12,1100,-20\n12,1500,0\n12,1600,4\n12,1900,30\n")
    assert any("no row between 1500 us, silent, and 1600 us" in note for note in curve.notes)
    assert curve.thrust_N(1550.0) == 2.0
    assert curve.pwm_us(1.0) == 1525.0
    assert curve.first_step_N() == (0.0, 0.0)


def test_a_one_way_thruster_does_nothing_the_other_way() -> None:
    curve = parsed(HEAD + "12,1100,0\n12,1500,0\n12,1508,0.5\n12,1900,30\n")
    assert curve.limits_N() == (0.0, 30.0)
    assert any("no thrust this way" in note for note in curve.notes)
    assert curve.delivered_N([-5.0, 5.0]).tolist() == [0.0, 5.0]
    assert curve.pwm_us(-5.0) == curve.neutral_us
    assert curve.thrust_N(900.0) == 0.0


def test_files_that_are_not_there_or_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_thrust_table(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match="not readable as UTF-8"):
        read_thrust_table(tmp_path / "binary.csv")
    with pytest.raises(InputError, match="no such file"):
        read_thrust_table(tmp_path)


steps = st.lists(st.floats(0.05, 5.0), min_size=2, max_size=12)


@settings(max_examples=60, deadline=None)
@given(up=steps, down=steps, noise=st.lists(st.floats(-0.1, 0.1), min_size=26, max_size=26), volt=st.floats(6.0, 50.0))
def test_any_noisy_rising_table_is_read_within_its_noise(
    up: list[float], down: list[float], noise: list[float], volt: float
) -> None:
    """Readings of a rising curve with noise below the allowance: read, monotone, and as near as the noise."""
    forward, reverse = np.cumsum(up) + 0.2, np.cumsum(down) + 0.2
    thrust = np.concatenate([-reverse[::-1], [0.0, 0.0], forward])
    pulse = np.concatenate(
        [1492.0 - 8.0 * np.arange(len(down))[::-1], [1498.0, 1502.0], 1508.0 + 8.0 * np.arange(len(up))]
    )
    shaken = thrust + np.where(thrust == 0.0, 0.0, np.array(noise[: thrust.size]))
    curve = parsed(
        HEAD + "".join(f"{volt!r},{p!r},{t!r}\n" for p, t in zip(pulse.tolist(), shaken.tolist(), strict=True))
    )
    read = curve.thrust_N(pulse)
    assert np.all(np.diff(read) >= 0.0)
    assert np.abs(read - shaken).max() <= 0.2 + 1e-9
    assert math.isclose(curve.supply_V[0], volt)


@settings(max_examples=150, deadline=None)
@given(st.text(alphabet='0123456789.,-eE#\n"naif \t\x00;pwmus_thrN', max_size=200), st.booleans())
def test_no_text_makes_the_reader_fail_otherwise(text: str, headed: bool) -> None:
    """Whatever the text, the reader gives a curve or an InputError of one line."""
    try:
        curve = parsed(HEAD + text if headed else text)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert curve.supply_V.size >= 1
