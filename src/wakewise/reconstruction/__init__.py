"""Photographs to a 3D model with COLMAP and semi-global stereo, in stages that take files and leave files."""

from typing import TYPE_CHECKING

from wakewise.doors import lazy_door

if TYPE_CHECKING:
    from wakewise.reconstruction.calibration import Board, Calibration, calibrate
    from wakewise.reconstruction.clouds import Cloud, read_cloud, write_cloud, write_mesh
    from wakewise.reconstruction.lenses import Lens, read_lens
    from wakewise.reconstruction.photos import Photo, read_photos
    from wakewise.reconstruction.pipeline import Model, reconstruct
    from wakewise.reconstruction.references import match_references, read_reference_cameras
    from wakewise.reconstruction.settings import ReconstructionSettings

__all__ = [
    "Board",
    "Calibration",
    "Cloud",
    "Lens",
    "Model",
    "Photo",
    "ReconstructionSettings",
    "calibrate",
    "match_references",
    "read_cloud",
    "read_lens",
    "read_photos",
    "read_reference_cameras",
    "reconstruct",
    "write_cloud",
    "write_mesh",
]

lazy_door(__name__, "photos")
