"""Tables that a probe is given: columns found by name; units, limits, gaps and nonsense refused in one line."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.robot.vehicles import load_vehicle
from wakewise.simulation.tank.probe import ThrustHistory, read_points, read_thrusts, regular_times

VEHICLE = load_vehicle("paper")
NAMES = ",".join(f"thrust_{i + 1}_N" for i in range(8))


def test_columns_are_found_by_name_in_any_order(tmp_path):
    """Numbers as in steps.parquet, the thrusters' own names, or no known names in the vehicle's order."""
    path = tmp_path / "t.csv"
    shuffled = [7, 0, 3, 1, 2, 6, 5, 4]
    row = ",".join(str(i) for i in shuffled)
    for names in ([f"thrust_{i + 1}_N" for i in shuffled], [f"T{i + 1}" for i in shuffled],
                  [VEHICLE.thrusters[i].name for i in shuffled]):  # fmt: skip
        path.write_text(",".join(names) + f",time_s\n{row},0\n{row},1\n")
        history, taken = read_thrusts(path, VEHICLE)
        assert history.thrusts_N[0].tolist() == list(range(8))
        assert taken[names[0]] == VEHICLE.thrusters[7].name
    path.write_text("time_s,a,b,c,d,e,f,g,h\n0,0,1,2,3,4,5,6,7\n1,0,1,2,3,4,5,6,7\n")
    assert read_thrusts(path, VEHICLE)[0].thrusts_N[0].tolist() == list(range(8))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{NAMES}\n0,0,0,0,0,0,0,0\n", "no column time_s"),
        ("time_s,thrust_1_N\n0,0\n1,0\n", "1 thrust columns, paper has 8 thrusters"),
        (f"time_s,{NAMES}\n1,0,0,0,0,0,0,0,0\n0,0,0,0,0,0,0,0,0\n", "does not come after"),
        (f"time_s,{NAMES}\n0,nan,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0,0\n", "must be finite"),
        (f"time_s,{NAMES}\n0,x,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0,0\n", "a number is needed"),
        (f"time_s,{NAMES}\n0,0,0,0,0,0,0,0,0\n", "at least 2 are needed"),
        (f"time_s,{NAMES.replace('_8_', '_1_')}\n", "named twice"),
        (f"time_s,{NAMES.replace('_8_', '_9_')}\n0,0,0,0,0,0,0,0,0\n", "not one thruster's alone"),
        (
            f"time_s,{NAMES}\n0,0,500,0,0,0,0,0,0\n1,0,0,0,0,0,0,0,0\n",
            r"row 1: 500 N for .* of paper, allowed -42 to 53",
        ),
        (f"time_s,{NAMES}\n0,0,0,0,0,0,0,0,-43\n1,0,0,0,0,0,0,0,0\n", r"row 1: -43 N for .*allowed -42 to"),
        (f"time_s,{NAMES.replace('_N', '_kgf')}\n0,0,0,0,0,0,0,0,0\n", "thrust_1_kgf looks like kgf, .* needed in N"),
        (f"time_s,{NAMES}\n0,0,0,0,0,0,0,0,0\n60000,0,0,0,0,0,0,0,0\n", "60000 s, allowed up to 36000"),
        ("", "empty"),
    ],
)
def test_bad_thrusts_are_refused(tmp_path, text, message):
    """Missing columns, a wrong number of them, unsorted times and values that are none: one line, with the file."""
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as fault:
        read_thrusts(path, VEHICLE)
    assert str(path) in str(fault.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(st.text(alphabet='time_s,x_m1.0-\n"NaT', max_size=120))
def test_no_text_breaks_the_reader(tmp_path, text):
    """Whatever the files hold, they are read or bad input."""
    path = tmp_path / "any.csv"
    path.write_text(text, encoding="utf-8")
    for read in (read_points, lambda p: read_thrusts(p, VEHICLE)):
        try:
            read(path)
        except InputError as fault:
            assert "\n" not in str(fault)


def test_what_a_table_lacks_is_named(tmp_path):
    """A column too few is named, and so are semicolons."""
    path = tmp_path / "T.csv"
    path.write_text("time_s," + NAMES.removesuffix(",thrust_8_N") + "\n")
    with pytest.raises(InputError, match="7 thrust columns, paper has 8 thrusters, no column thrust_8_N"):
        read_thrusts(path, VEHICLE)
    path.write_text("time_s;thrust_1_N\n0;1\n")
    with pytest.raises(InputError, match="semicolons, commas are needed"):
        read_thrusts(path, VEHICLE)


def test_times_at_equal_steps():
    """They lie within the history; a step that is none, or longer than it, is refused."""
    history = ThrustHistory(times_s=np.array([1.0, 3.0]), thrusts_N=np.zeros((2, 8)))
    assert regular_times(history, 0.5).tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]
    assert regular_times(history, 2.0).tolist() == [1.0, 3.0]
    for step_s, words in ((0.0, "more than 0"), (float("nan"), "more than 0"), (5.0, "thrusts go on for 2 s only")):
        with pytest.raises(InputError, match=words):
            regular_times(history, step_s)
