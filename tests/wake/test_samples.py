"""Data files of measured jets: what is read, and what is refused with the line that is wrong."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from wakewise.core.errors import InputError
from wakewise.wake.samples import CORE, FAR, WAKE, JetSamples, joined, read_samples

HEAD = "x_m,r_m,thrust_N,u_m_s,disk_diameter_m\n"


def _file(tmp_path, text):
    path = tmp_path / "jet.csv"
    path.write_text(text, encoding="utf-8")
    return path


def _samples(**changes):
    columns = {"x_m": [0.2], "r_m": [0.0], "thrust_N": [1.0], "speed_m_s": [0.5], "across_m_s": [0.0]}
    return JetSamples(**(columns | changes), disk_diameter_m=0.06)


def test_cylindrical_and_cartesian_columns_give_the_same_samples(tmp_path):
    """r_m and (y_m, z_m) are two ways to say one place; v and w join to the speed across."""
    round_ = read_samples(_file(tmp_path, "x_m,r_m,thrust_N,u_m_s,v_m_s\n0.2,0.05,1,0.5,0.05\n"), 0.06)
    flat = read_samples(
        _file(tmp_path, "# note\nx_m,y_m,z_m,thrust_N,u_m_s,v_m_s,w_m_s\n.2,.03,-.04,1,.5,.03,.04\n"), 0.06
    )
    for name in ("x_m", "r_m", "thrust_N", "speed_m_s", "across_m_s"):
        np.testing.assert_allclose(getattr(round_, name), getattr(flat, name), atol=1e-15)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEAD + "0.1,0,1,0.5,0.06\nnan,0,1,0.5,0.06\n", "line 3: x_m is nan"),
        (HEAD + "0.1,0,1,0.5,0.06\n0.2,0,1,inf,0.06\n", "line 3: u_m_s is inf"),
        (HEAD + "0.1,0,1,0.5,0.06\n\n0.2,-0.01,1,0.5,0.06\n", "line 4: r_m is -0.01, must not be negative"),
        (HEAD + "0.1,0,0,0.5,0.06\n", "line 2: thrust_N is 0"),
        (HEAD + "0.1,0,1,,0.06\n0.1,0,1,NaN,0.06\n", "no velocity is left: 2 NaN or empty"),
        (HEAD + "-0.1,0,1,0.5,0.06\n0,0,1,0.5,0.06\n", "no point downstream of the disk, all 2 have x_m <= 0"),
        (HEAD + "0.1,0,,0.5,0.06\n", "line 2: thrust_N is ''"),
        (HEAD + "0.1,0,1,0.5\n", "line 2: 4 values, needs 5"),
        (HEAD + "0.1,0,1,0.5,0\n", "disk_diameter_m 0"),
        (HEAD + "0.1,0,1,0.5,0.06\n0.1,0,1,0.5,0.07\n", "2 values"),
        ("x_m,r_m,thrust_N,u_m_s\n0.1,0,1,0.5\n", "diameter is not known"),
        ("x_m,r_m,u_m_s,disk_diameter_m\n0.1,0,1,0.06\n", "--thrust gives one thrust for all rows"),
        ("x_m,r_m,thrust_N\n0.1,0,1\n", "column u_m_s is missing"),
        ("x_m,r_m,force,u_m_s\n0.1,0,1,1\n", "unknown column 'force'"),
        ("x_m,y_m,thrust_N,u_m_s\n0.1,0,1,1\n", "place across the jet"),
        (HEAD, "no rows"),
    ],
)
def test_faulty_files_are_refused_with_the_place_of_the_fault(tmp_path, text, words):
    """Nothing that is no finite number, no radius or no thrust gets into a fit."""
    with pytest.raises(InputError) as fault:
        read_samples(_file(tmp_path, text))
    assert words in str(fault.value)
    assert "\n" not in str(fault.value)


def test_points_upstream_are_left_out_and_that_is_said(tmp_path):
    """No model holds behind the disk, so such points are not fitted, with a warning."""
    samples = read_samples(_file(tmp_path, HEAD + "0.1,0,1,0.5,0.06\n-0.1,0,1,0.5,0.06\n"))
    assert len(samples) == 1
    assert "1 points upstream" in samples.warnings[0]


@given(text=st.text(alphabet="x_mrthustN,0123456789.-e\nnai", max_size=120))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_text_is_read_or_refused(tmp_path, text):
    """The reader of a file from outside raises nothing but `InputError`."""
    path = _file(tmp_path, text)
    try:
        samples = read_samples(path, 0.06)
    except InputError:
        return
    assert np.isfinite(samples.speed_m_s).all()


def test_regions_are_the_papers():
    """A: 15 deg and 0.1-0.3 m; B: 30 deg and 0.1-0.5 m; far: beyond 0.4 m, all from the disk's middle."""
    angle = np.radians([0.0, 14.0, 16.0, 29.0, 31.0])
    for distance, core, wake, far in (
        (0.05, 0, 0, 0),
        (0.2, 2, 4, 0),
        (0.35, 0, 4, 0),
        (0.45, 0, 4, 2),
        (0.7, 0, 0, 2),
    ):
        one = np.ones(5)
        samples = _samples(
            x_m=distance * np.cos(angle), r_m=distance * np.sin(angle), thrust_N=one, speed_m_s=one, across_m_s=one
        )
        assert [int(region.holds(samples).sum()) for region in (CORE, WAKE, FAR)] == [core, wake, far]


def test_samples_refuse_what_cannot_be():
    """A disk without area, a negative radius, NaN and columns of different length are refused at the door."""
    for changes in ({"r_m": [-0.1]}, {"speed_m_s": [math.nan]}, {"thrust_N": [0.0]}, {"x_m": [0.1, 0.2]}):
        with pytest.raises(InputError):
            _samples(**changes)
    with pytest.raises(InputError, match="disk_diameter_m 0"):
        JetSamples(x_m=[0.1], r_m=[0.0], thrust_N=[1.0], speed_m_s=[1.0], across_m_s=[0.0], disk_diameter_m=0.0)


def test_joining_and_taking_are_inverse():
    """Rows that are joined can be taken apart again."""
    one = dataclasses.replace(_samples(thrust_N=[2.0]), warnings=("5 left out",))
    both = joined([_samples(), one, one])
    assert both.warnings == ("5 left out",)
    assert both.thrusts_N.tolist() == [1.0, 2.0]
    assert both.take(both.thrust_N == 2.0).thrust_N.tolist() == [2.0, 2.0]
