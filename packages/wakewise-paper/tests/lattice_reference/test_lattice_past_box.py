"""The lattice's jets past a box as they ship: what they say, and that they are of cases and solver as they are now."""

from dataclasses import replace

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.simulation.lattice import load_mean_field
from wakewise_paper.lattice_reference.jet_past_box import load_past_box, past_field, past_figures, save_past_box
from wakewise_paper.lattice_reference.reference_cases import find_case
from wakewise_paper.lattice_reference.run import LatticeRun

SHIPPED = ("past-box", "grazing-box", "grazing-target")


@pytest.mark.parametrize("name", SHIPPED)
def test_a_field_has_the_jet_and_nothing_in_the_box(name):
    """Before the box the jet is the free one within 6 %; in the box nothing moves."""
    field = load_past_box(name)
    low, high = find_case(name).boxes_D[0]
    free = load_mean_field("free").at(np.array([1.0, 2.0]), np.zeros(2), ("axial",))[0]
    assert np.array(past_figures(field)["fastest"])[:2] == pytest.approx(free, rel=0.06)
    points = field.points_D()[0]
    deep = np.all((points > np.array(low) + 0.2) & (points < np.array(high) - 0.2), axis=-1)
    assert deep.sum() > 30 and np.abs(field.along[deep]).max() < 1e-6
    assert not field.wet(points)[deep].any() and field.wet(points)[:4].all()


def test_a_jet_one_diameter_beside_a_box_passes_it():
    """It is as fast as a free one within 15 %, keeps 88 % of its momentum and is not drawn by a quarter of D."""
    field = load_past_box("past-box")
    seen = past_figures(field)
    free = load_mean_field("free").at(np.array(seen["x_D"]), np.zeros(11), ("axial",))[0]
    assert np.array(seen["fastest"]) == pytest.approx(free, rel=0.15)
    assert np.abs(seen["drawn_D"]).max() < 0.25
    assert field.flux[-7:].min() > 0.88 * field.flux[0]


def test_a_jet_half_a_diameter_beside_a_box_loses_momentum_and_turns_away():
    """A fifth to three tenths of it stays on the box, and behind it the fastest water is farther off than the axis."""
    field = load_past_box("grazing-box")
    behind = field.x_D >= 8.0
    assert np.all((field.flux[behind] > 0.7 * field.flux[0]) & (field.flux[behind] < 0.8 * field.flux[0]))
    assert np.all(np.array(past_figures(field)["drawn_D"])[4:] < -0.1)


def test_nothing_passes_a_box_that_is_struck_square():
    """Its momentum stays on the box, and what runs off at its sides is up to three quarters as fast as at the disk."""
    field = load_past_box("struck-target")
    assert np.abs(field.flux[field.x_D >= 5.0]).max() < 0.02 and field.flux[0] > 0.9
    low, high = (np.array(corner) for corner in find_case("struck-target").boxes_D[0])
    upright = field.points_D()[0]
    gap = np.linalg.norm(np.maximum(np.maximum(low - upright, upright - high), 0.0), axis=-1)
    beside = (gap > 0.2) & (gap < 1.0) & (np.abs(upright[..., 2]) > high[2])
    assert 0.2 < np.hypot(field.along, field.down)[beside].max() < 0.75


def test_a_field_is_read_as_it_was_written_and_no_other(tmp_path):
    """What is saved comes back within its steps; of another case or solver it is refused with a way out."""
    field = load_past_box()
    save_past_box(tmp_path / "past-box.npz", field)
    again = load_past_box("past-box", tmp_path)
    assert np.array_equal(again.along, field.along) and np.array_equal(again.flux, field.flux)
    save_past_box(tmp_path / "grazing-box.npz", replace(field, hash="0"))
    with pytest.raises(InputError, match="compute it anew"):
        load_past_box("grazing-box", tmp_path)


def test_only_a_jet_past_a_box_has_such_a_field():
    """A case without a box is refused by name; the fastest of a parabola is found where it is."""
    with pytest.raises(InputError, match="free"):
        past_field(LatticeRun(find_case("free").resolved(4)))
    field = load_past_box()
    hill = 1.0 - 0.1 * (field.z_D - 0.4) ** 2 + 0 * field.x_D[:, None]
    seen = past_figures(field, hill)
    assert np.array(seen["drawn_D"]) == pytest.approx(np.full(11, 0.4), abs=1e-9)
