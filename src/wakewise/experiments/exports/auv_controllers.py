"""An allocation matrix as parameters of ROS 2's `thruster_allocation_matrix_controller`.

The controller (auv_controllers, https://github.com/Robotic-Decision-Making-Lab/auv_controllers, formerly Evan-Palmer's)
takes `thrusters`, `reference_controllers` and the matrix by rows, `tam.{x, y, z, rx, ry, rz}`
(thruster_allocation_matrix_controller/src/thruster_allocation_matrix_controller_parameters.yaml), and multiplies a
geometry_msgs/Wrench by its pseudo-inverse; it handles neither limits nor frames: the matrix must be in the axes of the
wrench that it is sent. That is FLU for a wrench as ROS has it (REP 103). The project's own velocity controllers work in
`base_link_fsd` (forward-starboard-down, our FRD), and the matrix of its demo is of that frame
(auv_control_demos/chained_controllers/config/chained_controllers.yaml).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError
from wakewise.experiments.exports.records import flu_of

FRAMES = {
    "flu": "forward, left, up (FLU), as a wrench of ROS; auv_controllers' own controllers want --frame fsd",
    "fsd": "forward, starboard, down (FSD), as auv_controllers' own controllers have it; ROS's is --frame flu",
}
ROWS = ("x", "y", "z", "rx", "ry", "rz")


def tam_yaml(
    vehicle: str, names: Sequence[str], matrix_B: Array, limits_N: tuple[Array, Array] | None = None, frame: str = "fsd"
) -> str:
    """Text of the parameter file.

    `names` are of the thrusters, in the order of the columns; joints and controllers are numbered from 1, as in the
    project's demos (`thruster_1_joint`). `matrix_B`, shape (6, n), is the wrench about the body origin per newton of
    each thruster, in FRD. `limits_N` are lowest and highest thrusts, shape (n,) each, which the controller does not
    know: they go into the comments. `frame`, a key of `FRAMES`, are the axes of the matrix that is written.

    Raises InputError if the frame is not known.
    """
    if frame not in FRAMES:
        raise InputError(f"--frame: '{frame}', allowed are {', '.join(FRAMES)}")
    parts = (matrix_B[:3], matrix_B[3:])
    matrix = matrix_B if frame == "fsd" else np.concatenate([flu_of(part.T).T for part in parts])
    matrix = matrix + 0.0  # no negative zeros
    joints, controllers = [], []
    for k, name in enumerate(names):
        told = " ".join(str(name).split())
        reach = "" if limits_N is None else f", {limits_N[0][k]:.3g} to {limits_N[1][k]:.3g} N"
        joints.append(f"      - thruster_{k + 1}_joint  # {told}{reach}")
        controllers.append(f"      - thruster_{k + 1}_controller")
    rows = [
        f"      {row}: [{', '.join(_number(value) for value in values)}]"
        for row, values in zip(ROWS, matrix, strict=True)
    ]
    return "\n".join(
        [
            f"# Allocation matrix of {' '.join(vehicle.split())} for auv_controllers: N and N m per N of thrust,",
            f"# x, y, z {FRAMES[frame]}.",
            "# Moments are about the body's origin.",
            "thruster_allocation_matrix_controller:",
            "  ros__parameters:",
            "    thrusters:",
            *joints,
            "    reference_controllers:",
            *controllers,
            "    tam:",
            *rows,
            "",
        ]
    )


def _number(value: float) -> str:
    """A double as YAML and ROS take it: with a point, also where it has an exponent."""
    text = repr(float(value))
    return text.replace("e", ".0e") if "e" in text and "." not in text else text
