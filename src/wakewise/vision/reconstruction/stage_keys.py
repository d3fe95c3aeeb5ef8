"""What each stage's result hangs on, as a fingerprint."""

from __future__ import annotations

from typing import Any

from wakewise.vision.reconstruction.colmap import pycolmap
from wakewise.vision.reconstruction.settings import ReconstructionSettings
from wakewise.vision.reconstruction.stages import fingerprint

# Part of every stage's fingerprint: raise it when a stage's result changes for the same input.
VERSION = 10
STAGES: dict[str, tuple[str, ...]] = {
    "match": ("detector", "max_features", "first_octave", "lens"),
    "map": (
        "mapper",
        "refine_camera",
        "lens_check",
        "known_cameras",
        "reprojection_px",
        "position_priors",
        "prior_sigma_m",
    ),
    "scale": (),
    "dense": ("dense", "dense_px", "dense_zoom", "stereo_paths", "stereo_partners", "agreeing_views"),
    "mesh": ("mesh_depth",),
}


def stage_key(settings: ReconstructionSettings, stage: str, before: str, *parts: Any) -> str:
    """Fingerprint of all that a stage's result hangs on; `before` is that of the stage before."""
    used = {field: getattr(settings, field) for field in STAGES[stage]}
    return fingerprint(VERSION, pycolmap.__version__, stage, before, used, parts)
