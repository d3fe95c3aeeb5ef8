"""Files that other tools open: trajectories, photographs with their poses, ROS 2 bags, missions, allocation matrices.

Start reading in `records.py` (what comes in) and `records.py` (how NED/FRD becomes ENU/FLU, z up, OpenGL); then a file
per format: `colmap.py`, `colmap.py`, `colmap.py` (with `colmap.py`), `rosbag2.py`, `qgc_plan.py`,
`auv_controllers.py`.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.experiments.exports.auv_controllers import tam_yaml
    from wakewise.experiments.exports.colmap import read_points, write_colmap, write_nerfstudio, write_tum
    from wakewise.experiments.exports.qgc_plan import GeodeticOrigin, write_plan
    from wakewise.experiments.exports.records import Photographs, SparsePoints, ThrustRecord, Trajectory
    from wakewise.experiments.exports.rosbag2 import write_bag

__all__ = [
    "GeodeticOrigin",
    "Photographs",
    "SparsePoints",
    "ThrustRecord",
    "Trajectory",
    "read_points",
    "tam_yaml",
    "write_bag",
    "write_colmap",
    "write_nerfstudio",
    "write_plan",
    "write_tum",
]

lazy_attributes(__name__, "ros")
