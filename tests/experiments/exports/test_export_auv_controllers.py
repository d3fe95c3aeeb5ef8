"""Allocation matrices for ROS 2's auv_controllers."""

import numpy as np
import pytest
import yaml

from wakewise.core.errors import InputError
from wakewise.experiments.exports import tam_yaml
from wakewise.robot.vehicles import draft_names, load_draft

ROWS = ("x", "y", "z", "rx", "ry", "rz")


@pytest.mark.parametrize("name", draft_names())
@pytest.mark.parametrize("frame", ["flu", "fsd"])
def test_every_vehicle_of_the_library_comes_back(name: str, frame: str) -> None:
    """The rows, turned back, are the vehicle's own matrix to 1e-12, and every list is as long as the thrusters'."""
    draft = load_draft(name)
    text = tam_yaml(draft.name, draft.thruster_names, draft.allocation_matrix, draft.thrust_limits_N, frame)
    told = yaml.safe_load(text)["thruster_allocation_matrix_controller"]["ros__parameters"]
    matrix = np.array([told["tam"][row] for row in ROWS])
    assert all(type(value) is float for row in ROWS for value in told["tam"][row])  # ROS tells 0 from 0.0
    back = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0]) if frame == "flu" else np.ones(6)
    np.testing.assert_allclose(back[:, None] * matrix, draft.allocation_matrix, atol=1e-12)
    assert len(told["thrusters"]) == len(told["reference_controllers"]) == matrix.shape[1]


def test_the_projects_own_matrix_is_forward_starboard_down() -> None:
    """The horizontal thrusters of its BlueROV2 Heavy demo are ours in `fsd`, not in `flu`.

    From auv_control_demos/chained_controllers/config/chained_controllers.yaml; its verticals are numbered otherwise.
    """
    theirs = {"x": [-0.707, -0.707, 0.707, 0.707], "y": [0.707, -0.707, 0.707, -0.707]}
    theirs["rz"] = [0.1888, -0.1888, -0.1888, 0.1888]
    draft = load_draft("bluerov2-heavy")
    told = yaml.safe_load(tam_yaml("heavy", draft.thruster_names, draft.allocation_matrix, None, "fsd"))
    tam = told["thruster_allocation_matrix_controller"]["ros__parameters"]["tam"]
    for row, values in theirs.items():
        np.testing.assert_allclose(tam[row][:4], values, atol=1e-3)
    flu = yaml.safe_load(tam_yaml("heavy", draft.thruster_names, draft.allocation_matrix, frame="flu"))
    mirrored = flu["thruster_allocation_matrix_controller"]["ros__parameters"]["tam"]
    np.testing.assert_allclose(mirrored["y"][:4], -np.array(theirs["y"]), atol=1e-3)


def test_small_and_odd_numbers_are_numbers_in_yaml() -> None:
    """1e-05 without a point would be a string to YAML 1.1; no zero is negative; names do not break lines."""
    matrix = np.zeros((6, 2))
    matrix[0], matrix[1, 0] = 1e-05, -3e-17
    text = tam_yaml("a\nb: c", ("top: left\n#1", "2"), matrix, frame="flu")
    tam = yaml.safe_load(text)["thruster_allocation_matrix_controller"]["ros__parameters"]["tam"]
    assert tam["x"] == [1e-05, 1e-05]
    assert tam["y"][0] == 3e-17
    assert "-0.0" not in text


def test_an_unknown_frame_is_refused() -> None:
    """One line says which there are."""
    with pytest.raises(InputError, match="flu, fsd"):
        tam_yaml("a", ("1",), np.zeros((6, 1)), frame="enu")
