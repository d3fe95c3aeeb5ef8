"""Photogrammetry: photographs to a 3D model with COLMAP and semi-global stereo, in stages that take files and leave
files.

Start reading in `pipeline.py` (the stages in order, `pipeline.py` calls them). What comes in: `photos.py` (with
`photos.py`), `video_frames.py`, `lenses.py` (with `lenses.py`, what they do to rays), `lens_groups.py` and
`per_photo_intrinsics.py` (which photographs share a lens), `known_cameras.py`, `known_cameras.py` (with
`known_cameras.py`) and `calibration.py`; `photo_preview.py` looks at photographs before anything long is done with
them. `features.py`, `features.py`, `pairs.py` and `pairs.py` match, `mapping.py`, `solving.py` and `colmap.py` find
cameras (structure from motion), `guided.py` and `prior_pose_mapping.py` do both from poses that are roughly known,
`known_pose_triangulation.py` from cameras that stay, `model_quality.py` says whether the result can be right.
`stereo.py`, `dense.py`, `dense.py`, `fusion.py` and `fusion.py` make the cloud, `meshing.py` the surface (`clouds.py`
and `registered_photos.py` are what they share), `dense.py` is COLMAP's own dense stereo where CUDA is; `stages.py`
skips what is done (`stages.py`: what a result hangs on). `scale/` gives metres by bars between coded targets,
`masks.py` hides what is not to be looked at, `pipeline.py` is what else may be asked for, `photo_facts.py` what is
known of each photograph in the end. `clouds.py` writes points for surveyors, `split_half_check.py` is the plane of a
flat subject, `split_half_check.py` measures area, volume and rugosity and how they repeat. `nerf/` is a neural radiance
field from the same photographs.
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
