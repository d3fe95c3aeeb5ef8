"""Perception: finds, maps and tracks the target in the camera's pictures.

It knows pictures, the camera's calibration and the estimated pose; never a mesh or the true place of anything.

- `calibrated_camera.py`: pixels to rays and back.
- `feature_tracks.py`: features from picture to picture.
- `point_map.py`: their places, an information filter of rays.
- `resection.py`: the camera's pose by mapped points.
- `bed_plane.py`: the plane of the bed.
- `target_shape.py`: centre, size and surface of the target; the protected region.
- `common_shift.py`: how a swaying target is followed.
- `bundle_adjustment.py`, `bundle_kernels.py`, `map_initialization.py`: keyframes, map and lens adjusted.
- `designation.py`: which body is the target.
- `detector.py`, `onnx_model.py`, `onnx_detector.py`: detectors of a user's own.
- `plane_sweep.py`, `surface_map.py`: depth of a window of a picture, and the surface gathered from it.
- `target_tracker.py`: all of it, picture by picture; `tracker_state.py`: what it knows.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.perception.calibrated_camera import CalibratedCamera
    from wakewise.perception.feature_tracks import grey_picture
    from wakewise.perception.settings import PerceptionSettings
    from wakewise.perception.target_tracker import TargetTracker
    from wakewise.perception.tracker_state import TrackerState

__all__ = ["CalibratedCamera", "PerceptionSettings", "TargetTracker", "TrackerState", "grey_picture"]

lazy_attributes(__name__, "photos")
