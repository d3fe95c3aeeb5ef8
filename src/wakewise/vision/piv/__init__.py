"""Particle image velocimetry (PIV), for synthetic and for real image pairs.

- `images.py`: synthetic pictures of tracer particles in a light sheet.
- `correlation.py`: displacement fields of image pairs by FFT cross-correlation.
- `folder.py`: a folder of real image pairs to velocity samples of a jet (`wakewise wake fit FOLDER`).
"""

from wakewise.vision.piv.correlation import Displacements, averaged, correlate, displacements
from wakewise.vision.piv.folder import PivFolder, read_pairs, read_piv_settings, samples_of_folder, samples_of_vectors
from wakewise.vision.piv.images import (
    CameraSettings,
    ImagePair,
    LightSheet,
    TracerSettings,
    carried,
    photograph_pair,
    picture,
    relaxation_s,
    seed_sheet,
    settling_speed_m_s,
)

__all__ = [
    "CameraSettings",
    "Displacements",
    "ImagePair",
    "LightSheet",
    "PivFolder",
    "TracerSettings",
    "averaged",
    "carried",
    "correlate",
    "displacements",
    "photograph_pair",
    "picture",
    "read_pairs",
    "read_piv_settings",
    "relaxation_s",
    "samples_of_folder",
    "samples_of_vectors",
    "seed_sheet",
    "settling_speed_m_s",
]
