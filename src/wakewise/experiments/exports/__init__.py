"""Files that other tools open: trajectories, photographs with their poses, ROS 2 bags, missions, allocation matrices.

- `records.py`: what exports are made from, and the frames NED/FRD, ENU/FLU, z up, OpenGL.
- `colmap.py`: COLMAP models, nerfstudio's transforms.json, TUM trajectories.
- `training_data.py`: held-out split, undistorted photographs, dense points and water for trainers of fields and splats.
- `rosbag2.py`: ROS 2 bags. `qgc_plan.py`: QGroundControl plans. `auv_controllers.py`: allocation matrices for ROS 2.
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
