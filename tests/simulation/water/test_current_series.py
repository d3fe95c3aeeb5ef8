"""Series of currents: read as they are, refused where doubtful."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.simulation.water import read_current_series

DATA = Path(os.environ.get("WAKEWISE_DATA", Path(__file__).parents[4] / "shared" / "data")) / "currents"
STILL = np.zeros((1, 3))


def _csv(folder, text):
    path = folder / "series.csv"
    path.write_text(text)
    return path


def test_a_series_is_linear_between_its_samples(tmp_path):
    """Half way between two samples the current is their mean, alike everywhere; the gain multiplies it."""
    path = _csv(tmp_path, "time_s,v,u\n10,0.2,0.1\n20,0.4,0.3\n30,0,0\n")
    series = read_current_series(path, gain=0.5)
    assert series.velocity(np.zeros((2, 3)), 5.0) == pytest.approx(np.tile([0.1, 0.15, 0.0], (2, 1)))
    assert series.end_s == 20.0
    with pytest.raises(InputError, match=r"covers 0.0 to 20.0 s"):
        series.velocity(STILL, 21.0)


def test_a_part_of_a_series_starts_at_zero(tmp_path):
    """Cut out from 5 s on, what was at 5 s is at 0 s; vertical currents are read too."""
    path = _csv(tmp_path, "time_s,north_m_s,east_m_s,down_m_s\n0,0,0,0\n10,1,0,0.1\n20,1,1,0\n")
    series = read_current_series(path, start_s=5.0, stop_s=15.0)
    assert series.velocity(STILL, 0.0) == pytest.approx(np.array([[0.5, 0.0, 0.05]]))
    assert series.velocity(STILL, 10.0) == pytest.approx(np.array([[1.0, 0.5, 0.05]]))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,u,v\n0,10,0\n1,12,0\n", "looks like cm/s"),
        ("time_s,u,v\n0,0.1,0\n1,nan,0\n2,0,0\n", "line 3: nan in u"),
        ("time_s,u,v\n0,0.1,0\n1,,0\n2,0,0\n", "line 3: '' in u"),
        ("time_s,u,v\n0,0,0\n1,0,0\n2,0,0\n9,0,0\n", "gap of 7 s after 2 s"),
        ("time_s,u,v\n0,0,0\n2,0,0\n1,0,0\n", "line 4: time 1 s does not come after 2 s"),
        ("time_s,u,v\n0,0,0\n1e11,0,0\n2e11,0,0\n", "looks like milliseconds"),
        ("time_s,speed\n0,0\n", "needed are time_s,u,v"),
        ("time_s,u,v\n0,0,0\n", "needs at least 2"),
        ("", "columns none"),
    ],
)
def test_doubtful_files_are_refused(tmp_path, text, message):
    """Units, gaps, missing values, falling times and missing columns are named in one line."""
    with pytest.raises(InputError, match=message) as fault:
        read_current_series(_csv(tmp_path, text))
    assert "\n" not in str(fault.value)


def test_other_formats_and_missing_files_are_refused(tmp_path):
    """NetCDF is said to have no reader; a file that is not there is said to be missing."""
    with pytest.raises(InputError, match="no reader for NetCDF or HDF5"):
        read_current_series(tmp_path / "series.nc")
    with pytest.raises(InputError, match="no such file"):
        read_current_series(tmp_path / "series.csv")


def test_noaas_json_is_cm_per_s_towards_degrees(tmp_path):
    """Speed and direction of a current station become north and east, in the order of time."""
    path = tmp_path / "s.json"
    path.write_text(json.dumps({"s": {"60000": 50.0, "0": 100.0}, "d": {"0": 90.0, "60000": 180.0}}))
    series = read_current_series(path)
    assert series.velocity(STILL, 0.0) == pytest.approx(np.array([[0.0, 1.0, 0.0]]), abs=1e-12)
    assert series.velocity(STILL, 60.0) == pytest.approx(np.array([[-0.5, 0.0, 0.0]]), abs=1e-12)
    path.write_text(json.dumps({"s": {"0": 100.0, "1": 1.0}, "d": {"0": 90.0}}))
    with pytest.raises(InputError, match="speed or a direction but not both"):
        read_current_series(path)


@given(st.text(max_size=200))
def test_no_text_breaks_the_readers(tmp_path_factory, text):
    """Whatever a file holds, it is a series or bad input."""
    folder = tmp_path_factory.mktemp("texts")
    for name in ("a.csv", "a.json"):
        path = folder / name
        path.write_text(text, encoding="utf-8")
        try:
            assert read_current_series(path).end_s > 0.0
        except InputError as fault:
            assert str(path) in str(fault)


def test_a_real_station_is_read_and_its_gaps_are_refused():
    """Southampton Shoal: its first hour is a current of 0.7 m/s; as a whole it has gaps of weeks."""
    path = DATA / "s08010.json"
    if not path.exists():
        pytest.skip(f"{path.name} of the reference data is not there")
    series = read_current_series(path, stop_s=3000.0)
    assert np.linalg.norm(series.velocity(STILL, 0.0)) == pytest.approx(0.673)
    with pytest.raises(InputError, match="gap of"):
        read_current_series(path)
    with pytest.raises(InputError, match="no reader"):
        read_current_series(DATA / "Sig1000_tidal.nc")


def test_a_column_named_twice_is_refused(tmp_path):
    """Nobody can say which of the two is meant."""
    path = tmp_path / "c.csv"
    path.write_text("time_s,u,u,v\n0,0,1,0\n1,0,1,0\n")
    with pytest.raises(InputError, match="named twice"):
        read_current_series(path)
