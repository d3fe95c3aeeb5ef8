"""Photogrammetry with COLMAP and semi-global stereo, in stages that take files and leave files.

- `pipeline.py`: the stages match, map, scale, dense, mesh in order. `settings.py`: their settings.
- `stages.py`: skips finished stages; what the result of each depends on.
- `photos/`: photographs, masks, films, intrinsics, known cameras. `sfm/`: structure from motion.
- `scale/`: metres by scale bars or position fixes. `dense/`: dense points. `outputs/`: point files and the surface.
- `quality/`: tests of photographs and models.
"""

from typing import TYPE_CHECKING

from wakewise.core.lazy_imports import lazy_attributes

if TYPE_CHECKING:
    from wakewise.vision.reconstruction.outputs.clouds import OrientedPointCloud, read_cloud, write_cloud, write_mesh
    from wakewise.vision.reconstruction.outputs.meshing import mesh_model
    from wakewise.vision.reconstruction.photos.calibration import CalibrationBoard, CameraCalibration, calibrate
    from wakewise.vision.reconstruction.photos.known_cameras import (
        KnownCameras,
        match_references,
        read_known_cameras,
        read_reference_cameras,
    )
    from wakewise.vision.reconstruction.photos.lenses import Lens, read_lens
    from wakewise.vision.reconstruction.photos.photo_folder import Photo, read_photos
    from wakewise.vision.reconstruction.pipeline import CropBox, Model, ReconstructionRequest, reconstruct
    from wakewise.vision.reconstruction.settings import ReconstructionSettings

__all__ = [
    "CalibrationBoard",
    "CameraCalibration",
    "CropBox",
    "KnownCameras",
    "Lens",
    "Model",
    "OrientedPointCloud",
    "Photo",
    "ReconstructionRequest",
    "ReconstructionSettings",
    "calibrate",
    "match_references",
    "mesh_model",
    "read_cloud",
    "read_known_cameras",
    "read_lens",
    "read_photos",
    "read_reference_cameras",
    "reconstruct",
    "write_cloud",
    "write_mesh",
]

lazy_attributes(__name__, "photos")
