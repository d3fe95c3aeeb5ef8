"""The lattice's crossing as it ships: what it says, and that it is of the case and the solver as they are now."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.errors import InputError
from wakewise.lattice.crossing import crossing_field, load_crossing, save_crossing
from wakewise.lattice.run import LatticeRun


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
    from wakewise.lattice import find_case

    run = LatticeRun(find_case("free").resolved(4))
    with pytest.raises(InputError, match="free"):
        crossing_field(run)
