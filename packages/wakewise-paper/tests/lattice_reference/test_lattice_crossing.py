"""The lattice's crossing as it ships: what it says, and that it is of the case and the solver as they are now."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise_paper.lattice_reference.crossing_jets import (
    DATA,
    crossing_field,
    crossing_place,
    is_crossing,
    load_crossing,
    save_crossing,
)
from wakewise_paper.lattice_reference.reference_cases import find_case
from wakewise_paper.lattice_reference.run import LatticeRun

SHIPPED = ("crossing", "crossing-40", "crossing-110")


def test_the_field_that_ships_has_a_fan():
    """Behind the crossing the flow is more than twice as high as wide, and leaves the jets' plane on both sides."""
    field = load_crossing()
    for away in (2.0, 3.0, 4.0):
        row = np.flatnonzero(field.away_D == away)[0]
        half = 0.5 * field.along_above[row, 0]
        high = field.out_D[np.argmax(field.along_above[row] < half)]
        wide = field.out_D[np.argmax(field.along_beside[row] < half)]
        assert high > 2.0 * wide
    assert np.all(field.out_above[1:5, 4] > 0.05) and np.all(np.abs(field.out_above[:, 0]) < 1e-6)


@pytest.mark.parametrize("name", SHIPPED[1:])
def test_the_fields_at_other_angles_are_fans_too(name):
    """Half a height out of the plane is 1.4 times half a width in it, and more, up to 4 D behind the crossing."""
    field = load_crossing(DATA / f"{name}.npz")
    assert field.case == name and field.cells_per_D == 8
    for away in (1.0, 2.0, 3.0, 4.0):
        row = np.flatnonzero(field.away_D == away)[0]
        half = 0.5 * field.along_above[row, 0]
        high = field.out_D[np.argmax(field.along_above[row] < half)]
        wide = field.out_D[np.argmax(field.along_beside[row] < half)]
        assert high > 1.4 * wide, away
    assert np.all(field.out_above[1:5, 4] > 0.05) and np.all(np.abs(field.out_above[:, 0]) < 1e-6)


def test_the_more_the_jets_oppose_each_other_the_less_runs_on():
    """On the bisector, 1 to 6 D behind the crossing: 40, 90, 110 degrees, each slower than the last, within 3 %."""
    speeds = []
    for name in ("crossing-40", "crossing", "crossing-110"):
        field = load_crossing(DATA / f"{name}.npz")
        speeds.append(field.along_above[(field.away_D >= 1.0) & (field.away_D <= 6.0), 0])
    assert np.all(np.diff(speeds, axis=0) < 0.03 * speeds[0])
    assert np.all(speeds[2] < 0.85 * speeds[0])


@pytest.mark.parametrize("name", SHIPPED)
def test_the_axes_cross_six_diameters_from_both_disks(name):
    """Where the jets' axes meet is as far from either disk, along its own way."""
    case = find_case(name)
    place = crossing_place(case)
    for jet in case.jets:
        assert place - jet.position_D == pytest.approx(6.0 * np.array(jet.direction), abs=1e-3)
    assert is_crossing(case) and not is_crossing(find_case("head-on")) and not is_crossing(find_case("twin"))


def test_both_sides_of_the_bisector_are_told_from_one_place():
    """Points lie in the plane midway and in the jets' own, at the distances that are stored."""
    above, beside = load_crossing().points_D()
    assert above.shape == beside.shape
    assert np.allclose(above[..., 0], above[..., 1]) and np.allclose(beside[..., 2], 0.0)
    assert np.linalg.norm(above[3, 0]) == pytest.approx(load_crossing().away_D[3])


def test_a_field_is_read_as_it_was_written_and_no_other(tmp_path):
    """What is saved comes back within single precision; of another case or solver it is refused with a way out."""
    field = load_crossing()
    save_crossing(tmp_path / "same.npz", field)
    again = load_crossing(tmp_path / "same.npz")
    assert np.array_equal(again.along_above, field.along_above) and again.cells_per_D == field.cells_per_D
    save_crossing(tmp_path / "other.npz", replace(field, hash="0"))
    with pytest.raises(InputError, match="compute it anew"):
        load_crossing(tmp_path / "other.npz")


def test_only_a_crossing_has_such_a_field():
    """A case of one jet is refused by name."""
    run = LatticeRun(find_case("free").resolved(4))
    with pytest.raises(InputError, match="free"):
        crossing_field(run)
