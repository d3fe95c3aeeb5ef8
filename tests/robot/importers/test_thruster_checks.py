"""Few enough thrusters, each of unit force, as many as the file's own lists say, and as able as its words claim."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.importers.thruster_checks import claimed
from wakewise.robot.vehicles import VehicleDraft

SIX = np.array(
    [
        [1, 0, 0, 0, 0.1, 0.2],
        [1, 0, 0, 0, -0.1, 0.3],
        [0, 1, 0, 0.1, 0, 0],
        [0, 0, 1, 0.2, 0.3, 0],
        [0, 0, 1, -0.2, 0.3, 0],
        [0, 0, 1, 0.1, -0.3, 0],
    ]
).T
TWO = "tam: [[1,0],[0,1],[0,0],[0,0],[0,0],[0.5,-0.5]]\n"
DOWN = "body_frame: base_link_ned\n"


def imported(folder: Path, text: str, name: str = "m.yaml") -> VehicleDraft:
    path = folder / name
    path.write_text(text)
    return import_vehicle(path)


@pytest.mark.parametrize("n", [6, 8])
def test_matrices_of_a_row_or_a_column_per_thruster_are_one(tmp_path: Path, n: int) -> None:
    """Also 6 x 6 and flat lists, where only the unit forces tell rows from columns."""
    matrix = np.hstack([SIX, SIX[:, :2] * [[1], [1], [1], [1], [-2], [1]]])[:, :n]
    for way in (matrix, matrix.T, matrix.ravel(), matrix.T.ravel()):
        draft = imported(tmp_path, f"{DOWN}tam: {way.tolist()}")
        np.testing.assert_array_equal(draft.allocation_matrix, matrix)


def test_a_matrix_that_reads_both_ways_is_decided_by_its_moments_or_questioned(tmp_path: Path) -> None:
    """A moment is at right angles to its force; where that does not tell either, a note questions the reading."""
    turned = np.vstack([np.eye(3), np.roll(np.eye(3), 1, axis=0)[:, :]])
    matrix = np.hstack([turned, turned])
    draft = imported(tmp_path, f"{DOWN}tam: {matrix.tolist()}")
    np.testing.assert_array_equal(draft.allocation_matrix, matrix)


def test_a_matrix_of_named_columns_is_read_and_one_of_tables_is_questioned(tmp_path: Path) -> None:
    draft = imported(tmp_path, f"{DOWN}tam: {{port: [1,0,0,0,0,0.2], starboard: [1,0,0,0,0,-0.2]}}\nmass: 3")
    np.testing.assert_array_equal(draft.allocation_matrix, np.array([[1, 0, 0, 0, 0, 0.2], [1, 0, 0, 0, 0, -0.2]]).T)
    odd = imported(tmp_path, "tam: [{name: a, wrench: [1,0,0,0,0,0.2]}]\nmass: 3")
    assert odd.shipped_matrix is None and any("QUESTIONED: tam is not read" in note for note in odd.notes)


@pytest.mark.parametrize(
    ("matrix", "match"),
    [
        ("[[40,0],[0,40],[0,0],[0,0],[0,0],[20,-20]]", "force of column 1 has length 40, must be 1"),
        ("[[1,0],[0,0],[0,0],[0,0],[0,0],[0.5,-0.5]]", "force of column 2 has length 0, must be 1"),
        ("[[],[],[],[],[],[]]", "m.yaml:1: tam has no columns"),
    ],
)
def test_a_matrix_to_fly_with_has_unit_forces(tmp_path: Path, matrix: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        imported(tmp_path, f"tam: {matrix}")


@pytest.mark.parametrize(
    "text",
    [
        "thruster_names: [a, b, c]\n" + TWO,
        "num_thrusters: 8\n" + TWO,
        "thrusters: {num: 3}\n" + TWO,
        "thrusters: [a, b, c]\n" + TWO,
        "thruster_ids: [0, 1, 2]\nthruster_positions: [[1,0,0],[0,1,0]]\nthruster_directions: [[1,0,0],[0,1,0]]",
        TWO + "thruster_positions: [[1,0,0],[0,1,0],[0,0,1],[1,1,1]]\n"
        "thruster_directions: [[1,0,0],[0,1,0],[0,0,1],[1,0,0]]",
    ],
)
def test_the_count_agrees_with_the_files_own_lists(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError, match=r"m.yaml.*(says \d thrusters, but|the file places 4 thrusters)"):
        imported(tmp_path, text)


def test_a_count_that_agrees_is_no_matter(tmp_path: Path) -> None:
    draft = imported(tmp_path, "thruster_names: [a, b]\nnum_thrusters: 2\nthrusters: {num: 2}\n" + TWO)
    assert draft.allocation_matrix.shape == (6, 2)


def test_more_thrusters_than_any_vehicle_has_are_refused(tmp_path: Path) -> None:
    """In lists and in matrices, and the message names the cap."""
    many = "thrusters:\n" + "- {position: [1,0,0], direction: [1,0,0]}\n" * 65
    with pytest.raises(InputError, match="65 thrusters, at most 64 are read"):
        imported(tmp_path, many)
    with pytest.raises(InputError, match="1000 thrusters, at most 64 are read"):
        imported(tmp_path, f"tam: {np.tile([[1], [0], [0], [0], [0], [0]], (1, 1000)).tolist()}")


@pytest.mark.parametrize(
    ("words", "axes"),
    [
        ("vectored_6dof", 6),
        ("5-DOF", 5),
        ("4 dof frame", 4),
        ("fully actuated", 6),
        ("holonomic", 6),
        ("vectored", 0),
        ("16dof", 0),
        ("v1.6dofus", 0),
    ],
)
def test_words_claim_axes(words: str, axes: int) -> None:
    assert claimed(words) == axes


def test_a_rank_below_what_the_words_claim_is_questioned(tmp_path: Path) -> None:
    """A layout of six axes with six thrusters in one line is read with a note; with two thrusters it cannot be."""
    flat = np.tile([[1.0], [0], [0], [0], [0], [0]], (1, 6)).tolist()
    draft = imported(tmp_path, f"frame: vectored_6dof\ntam: {flat}")
    assert any(note.startswith("QUESTIONED: frame: vectored_6dof claims 6 axes") for note in draft.notes)
    with pytest.raises(InputError, match=r"m.yaml:1: frame: vectored_6dof claims 6 axes, but 2 thrusters"):
        imported(tmp_path, "frame: vectored_6dof\n" + TWO)
    with pytest.raises(InputError, match=r"dofs.num: 3 claims 3 axes"):
        imported(tmp_path, "propulsion: {dofs: {num: 3}}\n" + TWO)
    named = imported(tmp_path, TWO, "rov_6dof.yaml")
    assert any("the name rov_6dof claims 6 axes" in note for note in named.notes)
    whole = imported(tmp_path, f"frame: vectored_6dof\n{DOWN}tam: {SIX.tolist()}")
    assert not any("QUESTIONED" in note for note in whole.notes)
