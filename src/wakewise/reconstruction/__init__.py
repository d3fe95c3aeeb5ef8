"""Photogrammetry: photographs to a 3D model with COLMAP and semi-global stereo, in stages that take files and leave
files.

Start reading in `pipeline.py` (the stages in order). `photos.py`, `lenses.py`, `references.py` and `calibration.py`
are what comes in; `features.py`, `sift.py` and `pairs.py` match, `mapping.py` and `colmap.py` find cameras (structure
from motion), `guided.py` and `seeded.py` do both from poses that are roughly known; `stereo.py`, `dense.py`,
`fusion.py` and `cells.py` make the cloud, `meshing.py` the surface (`clouds.py` and `views.py` are what they share),
`patchmatch.py` is COLMAP's own dense stereo where CUDA is; `stages.py` skips what is done. `nerf/` is a neural radiance
field from the same photographs.
"""

from typing import TYPE_CHECKING

from wakewise.doors import lazy_door

if TYPE_CHECKING:
    from wakewise.reconstruction.calibration import Board, Calibration, calibrate
    from wakewise.reconstruction.clouds import Cloud, read_cloud, write_cloud, write_mesh
    from wakewise.reconstruction.lenses import Lens, read_lens
    from wakewise.reconstruction.photos import Photo, read_photos
    from wakewise.reconstruction.pipeline import Model, mesh_model, reconstruct
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
    "mesh_model",
    "read_cloud",
    "read_lens",
    "read_photos",
    "read_reference_cameras",
    "reconstruct",
    "write_cloud",
    "write_mesh",
]

lazy_door(__name__, "photos")
