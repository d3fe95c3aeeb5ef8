"""Virtual particle image velocimetry: tracers in a flow, a light sheet, a camera, and the processing of real pairs."""

from wakewise.vision.piv.correlation import Displacements, averaged, correlate
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
from wakewise.vision.piv.processing import Engine, displacements, has_openpiv

__all__ = [
    "CameraSettings",
    "Displacements",
    "Engine",
    "ImagePair",
    "LightSheet",
    "PivFolder",
    "TracerSettings",
    "averaged",
    "carried",
    "correlate",
    "displacements",
    "has_openpiv",
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
