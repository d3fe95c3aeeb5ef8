"""Matrices: forces or moments first, rows or columns, labelled or not, alone or beside a geometry."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from wakewise.core.errors import InputError
from wakewise.robot.importers import compare_with, import_vehicle
from wakewise.robot.importers.wrench_rows import order_in_comment, order_of, parse_order
from wakewise.robot.vehicles import VehicleDraft
from wakewise.robot.vehicles.draft import ThrusterDraft
from wakewise.robot.vehicles.mixing import ARDUSUB_VECTORED, ARDUSUB_VECTORED_6DOF, compare_with_ardusub
from wakewise.ui.cli.main import app

C = np.sqrt(0.5)
AXES = np.array([[C, C, 0], [C, -C, 0], [C, -C, 0], [C, C, 0], [0, 0, 1], [0, 0, 1], [0, 0, 1]])
PLACES = np.array(
    [[0.3, -0.2, 0], [0.3, 0.2, 0], [-0.31, -0.2, 0], [-0.31, 0.2, 0], [0.1, 0.2, 0], [0.1, -0.3, 0], [-0.2, 0.1, 0]]
)
WRENCH = np.hstack([AXES, np.cross(PLACES, AXES)]).T
MOMENTS_FIRST = WRENCH[[3, 4, 5, 0, 1, 2]]
DOWN = "body_frame: base_link_frd\n"


def imported(folder: Path, text: str, **options: Any) -> VehicleDraft:
    path = folder / "m.yaml"
    path.write_text(text)
    return import_vehicle(path, **options)


@pytest.mark.parametrize("n", [6, 7])
@pytest.mark.parametrize("way", ["rows", "per thruster", "flat", "flat per thruster", "named per thruster"])
@pytest.mark.parametrize("order", ["forces", "moments"])
def test_the_order_that_makes_thrusters_of_all_columns_is_taken(tmp_path: Path, n: int, way: str, order: str) -> None:
    """Unit forces tell moments first from forces first, in rows and in columns; what was inferred is said."""
    matrix = (WRENCH if order == "forces" else MOMENTS_FIRST)[:, :n]
    text = {
        "rows": f"tam: {matrix.tolist()}",
        "per thruster": f"tam: {matrix.T.tolist()}",
        "flat": f"tam: {matrix.ravel().tolist()}",
        "flat per thruster": f"tam: {matrix.T.ravel().tolist()}",
        "named per thruster": f"tam: {json.dumps({f't{i}': column.tolist() for i, column in enumerate(matrix.T)})}",
    }[way]
    draft = imported(tmp_path, DOWN + text)
    np.testing.assert_allclose(draft.allocation_matrix, WRENCH[:, :n])
    assert order == "forces" or any("moments first, inferred" in note for note in draft.notes)


LABELS = ["roll, pitch, yaw, surge, sway, heave", "Mx, My, Mz, Fx, Fy, Fz", "K, M, N, X, Y, Z", "rx, ry, rz, x, y, z"]


@pytest.mark.parametrize("labels", LABELS)
@pytest.mark.parametrize(
    "where", ["beside", "elsewhere", "words", "comment", "comments of rows", "told", "names of rows"]
)
def test_labels_say_what_the_rows_are(tmp_path: Path, labels: str, where: str) -> None:
    """A list beside the matrix or elsewhere, a comment, comments of rows, the user, or names of the rows."""
    # Levers of 1 m: forces first would fit as well, so only the labels tell.
    wrench = np.array([[1, 0, 0, 0, 1, 0], [0, 1, 0, 0, 0, 1], [0, 0, 1, 1, 0, 0]]).T.astype(float)
    raw = wrench[[3, 4, 5, 0, 1, 2]].tolist()
    names = labels.split(", ")
    text, told = f"tam: {raw}", {}
    if where == "beside":
        text = f"a: {{tam: {raw}, rows: [{labels}]}}"
    elif where == "keys":
        rows = [dict(zip(names, column, strict=True)) for column in np.array(raw).T.tolist()]
        text = f"tam: {json.dumps([{'id': i, **row} for i, row in enumerate(rows)])}"
    elif where == "elsewhere":
        text += f"\nb: {{c: {{order: [{labels}]}}}}"
    elif where == "words":
        text += f"\ndof_order: {labels}"
    elif where == "comment":
        text = f"# the rows: {labels}\n{text}"
    elif where == "comments of rows":
        text = "tam:\n" + "".join(f"- {row}  # {name}\n" for row, name in zip(raw, names, strict=True))
    elif where == "names of rows":
        text = "tam: {" + ", ".join(f"{name}: {row}" for row, name in zip(raw, names, strict=True)) + "}"
    else:
        told = {"rows": labels.replace(" ", "")}
    draft = imported(tmp_path, DOWN + text, **told)
    np.testing.assert_array_equal(draft.allocation_matrix, wrench)
    assert any(f"rows are {labels}" in note for note in draft.notes)
    plain = imported(tmp_path, f"{DOWN}tam: {raw}")
    assert any(note.startswith("QUESTIONED: tam reads as") and "--rows" in note for note in plain.notes)


@pytest.mark.parametrize("factors", [ARDUSUB_VECTORED, ARDUSUB_VECTORED_6DOF])
@pytest.mark.parametrize("columns", [False, True])
def test_motor_factors_are_no_wrench(tmp_path: Path, factors: np.ndarray, columns: bool) -> None:
    """Without labels they are refused with the option; with them the axes they make are right, and newtons are not."""
    text = f"thruster_matrix: {(factors.T if columns else factors).tolist()}"
    with pytest.raises(
        InputError, match=r"m.yaml:1: thruster_matrix holds -1, 0 and 1 only, like motor factors; say --rows"
    ):
        imported(tmp_path, text)
    labels = "roll, pitch, yaw, throttle, forward, lateral"
    for known in (
        imported(tmp_path, f"# {labels}, a row per motor\n{text}"),
        imported(tmp_path, f"{text}\nrows: [{labels}]"),
        imported(tmp_path, text, rows=labels.replace(" ", "")),
    ):
        lacks = "cannot make pitch alone" if len(factors) == 6 else "make all six axes"
        assert lacks in known.notes[-1] and known.notes[0].startswith("frame: FRD")
        assert any(note.startswith("QUESTIONED: thruster_matrix holds motor factors") for note in known.notes)


def test_signs_that_read_as_a_wrench_are_questioned(tmp_path: Path) -> None:
    """Roll, pitch, yaw, surge, sway, heave of six motors: with forces first no moment is along its force, by luck."""
    rows = "[[0,0,1,-1,1,0],[0,0,-1,-1,-1,0],[0,0,-1,1,1,0],[0,0,1,1,-1,0],[1,0,0,0,0,-1],[-1,0,0,0,0,-1]]"
    notes = imported(tmp_path, f"{DOWN}thruster_matrix: {rows}").notes
    assert any(n.startswith("QUESTIONED: thruster_matrix holds -1, 0 and 1 only") and "--rows" in n for n in notes)
    known = imported(tmp_path, f"{DOWN}thruster_matrix: {rows}\nrows: [roll, pitch, yaw, surge, sway, heave]")
    assert "cannot make pitch alone" in known.notes[-1]


def test_a_moment_along_its_own_force_is_refused(tmp_path: Path) -> None:
    """A propeller's reaction, some centimetres, passes."""
    text = "tam: [[1,0],[0,1],[0,0],[TWIST,0],[0,0],[0.5,-0.5]]"
    assert imported(tmp_path, DOWN + text.replace("TWIST", "0.03")).allocation_matrix.shape == (6, 2)
    with pytest.raises(InputError, match=r"column 1 has 0.7 N m along its own force, .*--rows roll,pitch,yaw,x,y,z"):
        imported(tmp_path, DOWN + text.replace("TWIST", "0.7"))


@pytest.mark.parametrize("rows", ["roll,pitch", "x,y,z,x,y,z", "x,y,z,roll,pitch,jaw", ""])
def test_rows_that_name_no_six_are_refused(tmp_path: Path, rows: str) -> None:
    with pytest.raises(InputError, match="must name x, y, z, roll, pitch, yaw once each"):
        imported(tmp_path, f"tam: {WRENCH.tolist()}", rows=rows)
    assert parse_order(None) is None and order_of(["a"] * 6) is None


def test_six_words_in_a_comment_are_an_order() -> None:
    order = order_in_comment("a row per motor: roll pitch yaw throttle forward lateral (ArduSub)")
    assert order is not None and order.places == (3, 4, 5, 2, 0, 1) and order.throttle
    assert order_in_comment("x y and z, then roll pitch yaw") is None


def vehicle(places: np.ndarray = PLACES, axes: np.ndarray = AXES) -> VehicleDraft:
    pairs = enumerate(zip(places, axes, strict=True))
    thrusters = tuple(ThrusterDraft(name=f"t{i}", p_BT_m=p, axis_B=a) for i, (p, a) in pairs)
    return VehicleDraft(name="v", title="v", source="test", does_not_claim="all", thrusters=thrusters)


@pytest.mark.parametrize("suffix", [".yaml", ".txt"])
@pytest.mark.parametrize("per_thruster", [False, True])
@pytest.mark.parametrize("order", ["forces", "moments"])
@pytest.mark.parametrize("up", [False, True])
def test_a_geometry_settles_what_a_file_leaves_open(
    tmp_path: Path, suffix: str, per_thruster: bool, order: str, up: bool
) -> None:
    """Rows or columns, forces or moments first, z up or down: all entries agree, and the way of reading is said."""
    matrix = WRENCH * np.array([1, -1, -1, 1, -1, -1])[:, None] if up else WRENCH
    matrix = matrix if order == "forces" else matrix[[3, 4, 5, 0, 1, 2]]
    matrix = matrix.T if per_thruster else matrix
    path = tmp_path / f"m{suffix}"
    path.write_text(
        f"tam: {matrix.tolist()}" if suffix == ".yaml" else "\n".join(" ".join(map(str, r)) for r in matrix)
    )
    found = compare_with(vehicle(), str(path))
    assert found.agree == found.compared == 42
    assert suffix == ".txt" or any(f"{order} first" in note for note in found.notes)


# ArduSub's six motors, horizontal ones at 45 degrees.
MOTORS = np.array([[-C, C, 0], [-C, -C, 0], [C, C, 0], [C, -C, 0], [0, 0, 1], [0, 0, 1]])
AT = np.array([[0.3, 0.2, 0], [0.3, -0.2, 0], [-0.3, 0.2, 0], [-0.3, -0.2, 0], [0, 0.2, 0], [0, -0.2, 0]])


@pytest.mark.parametrize("columns", [False, True])
def test_motor_factors_beside_a_geometry_are_compared_by_their_signs(tmp_path: Path, columns: bool) -> None:
    path = tmp_path / "mixer.yaml"
    path.write_text(f"mixer: {(ARDUSUB_VECTORED.T if columns else ARDUSUB_VECTORED).tolist()}")
    found = compare_with(vehicle(AT, MOTORS), str(path))
    assert found.agree == found.compared == 36
    assert any("roll, pitch, yaw, throttle, forward, lateral" in note for note in found.notes)


def test_a_command_tells_what_else_it_makes() -> None:
    """Aft thrusters 1 cm farther out than the fore ones make sway turn the vehicle, by half a centimetre's lever."""
    farther = AT.copy()
    farther[2:4, 0] = -0.31
    assert compare_with_ardusub(vehicle(AT, MOTORS)).commands == ()
    (line,) = compare_with_ardusub(vehicle(farther, MOTORS)).commands
    assert line.startswith("sway alone also makes yaw -0.5 % (N or N m per N of sway, moments about the origin")
    result = CliRunner().invoke(app, ["vehicle", "check", "bluerov2", "--matrix", "ardusub"])
    assert result.exit_code == 0 and "command: sway alone also makes roll +2.0 %, yaw -0.5 %" in result.output
