"""Files that other tools open: trajectories, photographs with their poses, ROS 2 bags, missions, allocation matrices.

Start reading in `records.py` (what comes in) and `frames.py` (how NED/FRD becomes ENU/FLU, z up, OpenGL); then a file
per format: `tum.py`, `nerfstudio.py`, `colmap.py` (with `colmap_points.py`), `rosbag2.py`, `qgc_plan.py`,
`auv_controllers.py`.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.experiments.exports.auv_controllers import tam_yaml
    from wakewise.experiments.exports.colmap import write_colmap
    from wakewise.experiments.exports.colmap_points import read_points
    from wakewise.experiments.exports.nerfstudio import write_nerfstudio
    from wakewise.experiments.exports.qgc_plan import GeodeticOrigin, write_plan
    from wakewise.experiments.exports.records import Photographs, SparsePoints, ThrustRecord, Trajectory
    from wakewise.experiments.exports.rosbag2 import write_bag
    from wakewise.experiments.exports.tum import write_tum

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
