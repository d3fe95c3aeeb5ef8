"""Thrusters in lists: every way of writing gives unit forces along what the file means, or a refusal in one line."""

from pathlib import Path

import numpy as np
import pytest

from wakewise.core.errors import InputError
from wakewise.robot.importers import import_vehicle
from wakewise.robot.vehicles import VehicleDraft

C = np.sqrt(0.5)
PLACES = "thruster_positions: [[1,0,0],[-1,0,0],[0,1,0],[0,-1,0]]\n"
FOUR = [[C, C, 0], [C, -C, 0], [0, 0, 1], [0, 0, -1]]


def imported(folder: Path, text: str) -> VehicleDraft:
    path = folder / "t.yaml"
    path.write_text(text)
    return import_vehicle(path)


def said(draft: VehicleDraft, words: str) -> bool:
    return any(words in note for note in draft.notes)


def test_rows_of_euler_angles_are_not_directions(tmp_path: Path) -> None:
    """Orientations whose rows are no unit vectors are roll, pitch and yaw, in radians or in degrees."""
    for key, rows in (
        ("thruster_orientations", "[[0,0,0.785398],[0,0,-0.785398],[0,-1.570796,0],[0,1.570796,0]]"),
        ("thruster_rpy", "[[0,0,0.785398],[0,0,-0.785398],[0,-1.570796,0],[0,1.570796,0]]"),
        ("thruster_orientations", "[[0,0,45],[0,0,-45],[0,-90,0],[0,90,0]]"),
        ("thruster_rpy_deg", "[[0,0,45],[0,0,-45],[0,-90,0],[0,90,0]]"),
    ):
        draft = imported(tmp_path, f"{PLACES}{key}: {rows}\n")
        np.testing.assert_allclose([t.axis_B for t in draft.thrusters], FOUR, atol=1e-6)
        assert said(draft, "+x of each thruster's frame")
    unit = imported(tmp_path, f"{PLACES}thruster_orientations: [[1,0,0],[0,1,0],[0,0,1],[0,0.7071,0.7071]]")
    np.testing.assert_allclose([t.axis_B for t in unit.thrusters][:3], np.eye(3))


@pytest.mark.parametrize(
    "rows", ["[[0,0,0.785],[0,0,-0.785],[0,-1.571,0],[0,1.571,0]]", "[[0,0,45],[1,0,0],[0,1,0],[0,0,1]]"]
)
def test_angles_called_directions_are_refused(tmp_path: Path, rows: str) -> None:
    with pytest.raises(
        InputError, match=r"t.yaml:2: thruster0: direction .* looks like angles; call the key thruster_rpy"
    ):
        imported(tmp_path, f"{PLACES}thruster_directions: {rows}")


@pytest.mark.parametrize(
    ("places", "rows"),
    [
        ("[1,0,0, -1,0,0, 0,1,0, 0,-1,0]", "[1,0,0, 1,0,0, 0,0,1, 0,0,1]"),
        ("[1,-1,0,0, 0,0,1,-1, 0,0,0,0]", "[1,1,0,0, 0,0,0,0, 0,0,1,1]"),
    ],
)
def test_flat_lists_are_read_the_way_that_makes_directions_unit(tmp_path: Path, places: str, rows: str) -> None:
    """Three numbers per thruster, or three rows."""
    draft = imported(tmp_path, f"thruster_positions: {places}\nthruster_directions: {rows}")
    np.testing.assert_allclose([t.p_BT_m for t in draft.thrusters], [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    np.testing.assert_allclose([t.axis_B for t in draft.thrusters], [[1, 0, 0], [1, 0, 0], [0, 0, 1], [0, 0, 1]])


def test_three_thrusters_are_read_by_row_or_by_column_as_their_directions_say(tmp_path: Path) -> None:
    places, axes = np.array([[1, 0, 0], [-1, 0.2, 0], [0, 0.3, 0.1]]), np.array([[1, 0, 0], [1, 0, 0], [0, 0, 1]])
    for p, a in ((places, axes), (places.T, axes.T)):
        draft = imported(tmp_path, f"positions: {p.tolist()}\ndirections: {a.tolist()}")
        np.testing.assert_allclose([t.p_BT_m for t in draft.thrusters], places)
        np.testing.assert_allclose([t.axis_B for t in draft.thrusters], axes)
    with pytest.raises(InputError, match="3 x 3 and read both ways"):
        imported(tmp_path, f"positions: {places.tolist()}\ndirections: [[0,1,0],[0,0,1],[1,0,0]]")


@pytest.mark.parametrize(
    "second",
    [
        "pose: [-1, 0, 0, 0, 0, -0.785398]",
        "pose: {x: -1, y: 0, z: 0, roll: 0, pitch: 0, yaw: -0.785398}",
        "pose: {position: {x: -1, y: 0, z: 0}, orientation: {x: 0, y: 0, z: -0.3826834, w: 0.9238795}}",
        "position: [-1, 0, 0], yaw: -0.785398",
        "position: [-1, 0, 0], yaw_deg: -45",
        "position: [-1, 0, 0], rpy_deg: [0, 0, -45]",
        "position: [-1, 0, 0], direction: [1, -1, 0]",
    ],
)
def test_poses_and_angles_of_a_list_are_all_read(tmp_path: Path, second: str) -> None:
    """None is dropped, whichever way each is written."""
    first = "{name: a, pose: [1, 0, 0, 0, 0, 0.785398]}"
    draft = imported(tmp_path, f"thrusters:\n- {first}\n- {{name: b, {second}}}\nmass: 3")
    np.testing.assert_allclose([t.axis_B for t in draft.thrusters], [[C, C, 0], [C, -C, 0]], atol=1e-6)
    np.testing.assert_allclose([t.p_BT_m for t in draft.thrusters], [[1, 0, 0], [-1, 0, 0]])


def test_numbered_tables_beside_one_another_are_thrusters(tmp_path: Path) -> None:
    draft = imported(tmp_path, "thruster_1: {pose: [1,0,0,0,0,45]}\nthruster_2: {pose: [-1,0,0,0,0,-45]}\nmass: 3")
    np.testing.assert_allclose([t.axis_B for t in draft.thrusters], [[C, C, 0], [C, -C, 0]], atol=1e-12)
    assert [t.name for t in draft.thrusters] == ["thruster_1", "thruster_2"]


def test_rows_of_poses_are_read(tmp_path: Path) -> None:
    draft = imported(tmp_path, "thruster_poses: [[1,0,0,0,0,45],[-1,0,0,0,0,-45]]")
    np.testing.assert_allclose([t.axis_B for t in draft.thrusters], [[C, C, 0], [C, -C, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("rest", "match"),
    [
        ("- {name: c}", r"t.yaml:3: thruster1 has no position .* the other thrusters have one"),
        ("- {name: c, pose: [1, 2, 3]}", r"t.yaml:3: pose of thruster1 has 3 numbers, must have 6"),
        ("- {name: c, pose: {x: 1}}", r"t.yaml:3: pose of thruster1 has no position"),
        ("- words", r"t.yaml:3: thruster1 is not a table with a position"),
        ("- {name: c, position: [1,0,0], orientation: [0,0,0,1]}", "quaternion's order is not known"),
        ("- {name: c, position: [1,0,0], orientation: {x: 0, y: 0, z: 2, w: 0}}", "length 2, must be 1"),
        ("- {name: c, position: [1,0,0], orientation: [0.6,0.8,0]}", "orientation has length 1: direction or angles"),
        ("- {name: c, position: [1,0,0], yaw_deg: 3, pitch: 1.1}", "are of different units"),
        ("- {name: c, position: [1,0,0]}", "thruster1 has a position but no direction"),
    ],
)
def test_a_list_that_places_some_and_not_others_is_refused(tmp_path: Path, rest: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        imported(tmp_path, f"thrusters:\n- {{name: a, position: [1,0,0], direction: [1,0,0]}}\n{rest}\nmass: 3")


def test_rows_of_six_that_may_be_poses_or_columns_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="poses or columns of a matrix"):
        imported(tmp_path, "mass: 3\nthrusters: [[1,0,0,0,0,0],[0,1,0,0,0,0]]")
