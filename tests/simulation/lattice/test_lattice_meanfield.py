"""Tables of the lattice: averaging around the axis, the file, the look-up and the sum of several jets."""

import math
from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.simulation.lattice import SHIPPED_CASES, LatticeFlow, MeanField, case_hash, load_mean_field
from wakewise.simulation.lattice.meanfield import read_mean_field
from wakewise_paper.lattice_reference.engines import around_axis
from wakewise_paper.lattice_reference.mean_field import save_mean_field

AREA_M2 = math.pi * 0.06**2 / 4
DENSITY = 998.0


def _table(**changes):
    """A swirling Gaussian jet whose values are known everywhere."""
    x, r = np.arange(0, 9.01, 0.1), np.arange(0, 5.01, 0.1)
    X, R = np.meshgrid(x, r, indexing="ij")
    shape = np.exp(-((R / (0.5 + 0.1 * X)) ** 2)) / (1 + 0.1 * X)
    fields = {
        "pressure": 0 * shape,
        "axial": shape,
        "radial": -0.05 * R * shape,
        "swirl": 0.3 * R * shape,
        "axial_rms": 0.2 * shape,
        "radial_rms": 0.1 * shape,
        "swirl_rms": 0.1 * shape,
    }
    words = {"case": "free", "hash": case_hash(SHIPPED_CASES["free"]), "cells_per_D": 10}
    times = {"axis_times": np.arange(3.0), "axis_speeds": np.zeros((3, len(x)))}
    return MeanField(**{**words, **fields, **times, "x_D": x, "r_D": r, "figures": {"a": 1.0}, **changes})


def _flow(table, thrusts=(1.0,), origins=((0, 0, 0),), directions=((1, 0, 0),), **options):
    areas = np.full(len(thrusts), AREA_M2)
    return LatticeFlow(
        table=table,
        origins_W_m=np.array(origins, float),
        directions_W=np.array(directions, float),
        thrusts_N=np.array(thrusts, float),
        areas_m2=areas,
        **options,
    )


def test_average_around_the_axis_finds_swirl_and_variances():
    """A field built from cylinder components gives these components back, variances rotated rightly."""
    y = (np.arange(40) - 19.5) / 10
    Y, Z = np.meshgrid(y, y, indexing="ij")
    R2 = Y**2 + Z**2
    axial, radial_over_r, swirl_over_r = np.exp(-R2), 0.2 * np.exp(-R2), -0.4 * np.exp(-R2)
    v, w = radial_over_r * Y - swirl_over_r * Z, radial_over_r * Z + swirl_over_r * Y
    # Fluctuations: 0.3 along x, 0.2 r outwards and 0.1 r around.
    cos2, sin2, cs = Y**2, Z**2, Y * Z
    vv, ww, vw = 0.04 * cos2 + 0.01 * sin2, 0.04 * sin2 + 0.01 * cos2, 0.03 * cs
    means = np.stack([0 * v, axial, v, w, axial**2 + 0.09, v * v + vv, w * w + ww, v * w + vw])[:, None]
    r = np.array([0.2, 0.5, 1.0])
    out = around_axis(means, y, y, r)
    assert out["axial"][0] == pytest.approx(np.exp(-(r**2)), rel=2e-3)
    assert out["radial"][0] == pytest.approx(0.2 * r * np.exp(-(r**2)), rel=5e-3)
    assert out["swirl"][0] == pytest.approx(-0.4 * r * np.exp(-(r**2)), rel=5e-3)
    assert out["axial_rms"][0] == pytest.approx(0.3, rel=5e-3)
    assert out["radial_rms"][0] == pytest.approx(0.2 * r, rel=1e-2)
    assert out["swirl_rms"][0] == pytest.approx(0.1 * r, rel=3e-2)


def test_file_gives_back_what_was_saved(tmp_path):
    """Arrays to 2^-17, words exactly."""
    table = _table()
    save_mean_field(tmp_path / "t.npz", table)
    back = read_mean_field(tmp_path / "t.npz")
    assert back.axial == pytest.approx(table.axial, abs=2**-17)
    assert (back.case, back.hash, back.figures) == (table.case, table.hash, table.figures)


def test_table_of_another_configuration_is_refused(tmp_path):
    """The loader compares the hash in the file with that of the case as it is now."""
    save_mean_field(tmp_path / "free.npz", _table(hash="0" * 16))
    with pytest.raises(InputError, match="compute it anew"):
        load_mean_field("free", tmp_path)


def test_missing_or_broken_files_are_refused_in_one_line(tmp_path):
    """No file, a file that is no archive, an archive without the tables."""
    with pytest.raises(InputError, match="no such case"):
        load_mean_field("nothing")
    with pytest.raises(InputError, match="no such mean field"):
        load_mean_field("free", tmp_path)
    (tmp_path / "free.npz").write_bytes(b"not an archive")
    with pytest.raises(InputError, match="not a mean field"):
        load_mean_field("free", tmp_path)
    np.savez(tmp_path / "swirl.npz", x=1)
    with pytest.raises(InputError, match="not a mean field"):
        load_mean_field("swirl", tmp_path)


def test_hash_changes_with_everything_that_decides_the_flow():
    """Another grid, another constant or another jet is another case."""
    case = SHIPPED_CASES["free"]
    others = [case.resolved(8), replace(case, smagorinsky=0.1), replace(case, jets=case.jets * 2)]
    assert len({case_hash(c) for c in [case, *others]}) == 4


@pytest.mark.parametrize("name", ["free", "swirl", "floor"])
def test_shipped_tables_load(name):
    """The tables in the package are those of the cases as they are."""
    table = load_mean_field(name)
    assert table.cells_per_D == SHIPPED_CASES[name].cells_per_D
    assert np.abs(table.axial).max() < 2


def test_single_jet_is_the_table_whatever_its_place_direction_and_thrust():
    """Velocity = U0 times the table's components along, out from and around the jet."""
    table, rng = _table(), np.random.default_rng(0)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    side = np.cross(axis, [0, 0, 1.0])
    side /= np.linalg.norm(side)
    flow = _flow(table, (2.0,), ((0.1, -0.2, 0.3),), (3 * axis,))
    speed = math.sqrt(2.0 / (DENSITY * AREA_M2))
    point = np.array([0.1, -0.2, 0.3]) + 0.06 * (4.0 * axis + 0.5 * side)
    u = flow.velocity(point[None])[0]
    a, r, s = table.at(np.array([4.0]), np.array([0.5]))[:, 0]
    assert u == pytest.approx(speed * (a * axis + r * side + s * np.cross(axis, side)), rel=1e-9)
    assert np.cross(axis, u) @ np.cross(axis, np.cross(axis, side)) != 0


def test_four_times_the_thrust_doubles_the_flow():
    """Tables are in units of sqrt(T)."""
    points = np.random.default_rng(1).uniform(0, 0.4, (50, 3))
    assert _flow(_table(), (4.0,)).velocity(points) == pytest.approx(2 * _flow(_table(), (1.0,)).velocity(points))


def test_two_equal_jets_on_one_line_join_to_sqrt_two():
    """Momentum adds, not velocity."""
    points = np.array([[0.3, 0.01, 0.0], [0.4, 0.0, 0.02]])
    one = _flow(_table()).velocity(points)
    two = _flow(_table(), (1.0, 1.0), ((0, 0, 0),) * 2, ((1, 0, 0),) * 2).velocity(points)
    assert two == pytest.approx(math.sqrt(2) * one)


def test_flow_continues_beyond_the_table_like_itself():
    """Twice as far, half as fast and twice as wide; no jump at the table's end, rest behind and beside it."""
    table = _table()
    last = table.x_D[-1]
    far = table.at(np.array([2 * last]), np.array([1.0]))
    near = table.at(np.array([last]), np.array([0.5]))
    assert far == pytest.approx(near / 2)
    edge = table.at(np.array([last - 1e-9, last + 1e-9]), np.array([0.3, 0.3]))
    assert edge[:, 0] == pytest.approx(edge[:, 1], rel=1e-6)
    assert np.all(table.at(np.array([-5.0, 3.0]), np.array([0.0, 6.0])) == 0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"thrusts": (-1.0,)}, "turn the direction"),
        ({"directions": ((0, 0, 0),)}, "no length"),
        ({"origins": ((0, 0, np.nan),)}, "NaN"),
        ({"turns": np.ones(2)}, "shape"),
    ],
)
def test_bad_jets_are_refused(changes, words):
    """One line that says what is allowed."""
    with pytest.raises(InputError, match=words):
        _flow(_table(), **changes)
