"""Files of velocities as programs write them: units become SI, masked vectors are counted, the rest is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.wake.samples import read_samples

PIVLAB = (
    "PIVlab by W.Th. & E.J.S., ASCII chart output - 14-Mar-2017\n"
    "FRAME: 1, filenames: A: a.jpg & B: b.jpg, conversion factor xy (px -> m): 0.004, conversion factor uv "
    "(px/frame -> m/s): 0.004\n"
    "x [m],y [m],u [m/s],v [m/s],vorticity [1/s],Vector type [-]\n"
    "0.2,0.05,0.5,0.05,1,1\n0.2,0.06,NaN,NaN,NaN,0\n0.2,0.07,0.4,0.01,2,2\n0.25,-0.05,0.3,0.1,3,1\n"
)
TECPLOT = (
    'TITLE = "B00001"\nVARIABLES = "x mm", "y mm", "Vx m/s", "Vy m/s", "isValid"\nZONE T="Frame 0" I=2, J=2, F=POINT\n'
    "200 50 0.5 0.05 1\n200 60 0 0 0\n200 70 0.2 0.1 0\n250 -50 0.3 0.1 1\n"
)
PIVLAB_TECPLOT = (
    "# PIVlab by W.Th. & E.J.S., TECPLOT output - 14-Mar-2017\n"
    "# x [m] y [m] u [m/s] v [m/s] isNaN? vorticity [1/s]\n"
    'TITLE = "PIVlab frame"\nVARIABLES = "x", "y", "u", "v", "isNaN", "vorticity"\nZONE I=3, J=1, K=1, F=POINT, T="1"\n'
    "0.2 0.05 0.5 0.05 0 1\n0.2 0.06 0 0 1 0\n0.25 -0.05 0.3 0.1 0 3\n"
)
SEMICOLONS = (
    "x [mm];y [mm];Velocity u [m/s];Velocity v [m/s]\n200,0;50;0,5;0,05\n200;60;;\n200;70;0;0\n250;-50;0,3;0,1\n"
)
INSIGHT = (
    'TITLE="a.vec" VARIABLES="X mm", "Y mm", "U m/s", "V m/s", "CHC", DATASETAUXDATA LengthUnit="mm" ZONE I=3, J=1, '
    "F=POINT\n200.0, 50.0, 0.5, 0.05, 1\n200.0, 60.0, 0.1, 0.1, -1\n250.0, -50.0, 0.3, 0.1, 1\n"
)
BLANKS = "x [cm] y [cm] u [cm/s] v [cm/s]\n20 5 50 5\n25 -5 30 10\n"


def _read(folder: Path, text: str, **how: float):
    path = folder / "field.txt"
    path.write_text(text, encoding="utf-8")
    return read_samples(path, **({"disk_diameter_m": 0.06, "thrust_N": 2.0} | how))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PIVLAB, ["1 vectors NaN or empty left out", "1 vectors masked or interpolated", "not used: vorticity [1/s]"]),
        (TECPLOT, ["2 vectors masked left out", "x mm times 0.001"]),
        (PIVLAB_TECPLOT, ["1 vectors masked left out", "not used: vorticity"]),
        (SEMICOLONS, ["1 vectors NaN or empty", "1 vectors exactly 0", "x [mm] times 0.001"]),
        (INSIGHT, ["1 vectors masked left out", "Y mm times 0.001"]),
        (BLANKS, ["u [cm/s] times 0.01"]),
    ],
    ids=["pivlab", "tecplot", "pivlab-tecplot", "semicolons", "insight", "blanks"],
)
def test_every_writer_gives_the_same_two_vectors(tmp_path, text, said):
    """The place in metres, the radius in the plane, and both components; what was done to the file stands in words."""
    samples = _read(tmp_path, text)
    np.testing.assert_allclose(samples.x_m, [0.2, 0.25])
    np.testing.assert_allclose(samples.r_m, [0.05, 0.05])
    np.testing.assert_allclose(samples.speed_m_s, [0.5, 0.3])
    np.testing.assert_allclose(samples.across_m_s, [0.05, 0.1])
    np.testing.assert_allclose(samples.thrust_N, 2.0)
    told = "; ".join(samples.warnings)
    for words in [*said, "one plane: taken to hold the jet's axis"]:
        assert words in told


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PIVLAB.replace("[m/s]", "[px/frame]"), "is in pixels; calibrate it where it was made"),
        (TECPLOT.replace('"x mm"', '"x"'), "column 'x' says no unit, needs one of m, mm or cm"),
        (TECPLOT.replace("x mm", "x inch ["), "needed are x_m"),
        (TECPLOT.replace("F=POINT", "F=BLOCK"), "one line per point"),
        (TECPLOT + 'ZONE T="Frame 1" I=2, J=2\n1 2 3 4 5\n', "line 8: a second zone"),
        ('TITLE = "a"\nZONE I=2\n1 2 3\n', "without VARIABLES"),
        ("-11,5;2;0,1;0,2\n-11,5;3;0,1;0,2\n", "line 1: numbers where names of columns should stand"),
        ("x [m];y [m];u [m/s];v [m/s]\n0,2;0,05;nan;nan\n0,2;0,06;0;0\n", "no velocity is left: 1 NaN or empty, 1"),
        (PIVLAB.replace("0.25,-0.05", "0.25,far"), "line 7: y [m] is 'far', must be a number"),
        ("x_m,r_m,u_m_s,swirl\n1,2,3,4\n", "unknown column 'swirl'"),
        ("x_m,r_m,u_m_s,x [mm]\n1,2,3,4\n", "a column is there twice"),
        ("x [m],r [m],thrust [stone],u [m/s]\n1,2,3,4\n", "has the unit 'stone', needs one of N, kgf, gf or lbf"),
    ],
)
def test_what_cannot_be_taken_is_one_line(tmp_path, text, said):
    """Pixels, no unit, blocks, two fields, numbers without names, nothing left: what it is and what would be right."""
    with pytest.raises(InputError) as fault:
        _read(tmp_path, text)
    assert said in str(fault.value)
    assert "\n" not in str(fault.value)


def test_units_in_names_of_our_own_manner_are_taken(tmp_path):
    """x_mm and thrust_kgf are 1e-3 m and 9.80665 N, and that is said; an option beside a column must say the same."""
    text = "x_mm,r_mm,thrust_kgf,u_cm_s\n200,50,1,50\n"
    samples = _read(tmp_path, text, thrust_N=9.80665)
    assert (samples.x_m[0], samples.thrust_N[0], samples.speed_m_s[0]) == pytest.approx((0.2, 9.80665, 0.5))
    assert "thrust_kgf times 9.80665" in samples.warnings[0]
    with pytest.raises(InputError, match="in the file and 1 in the option --thrust"):
        _read(tmp_path, text, thrust_N=1.0)
