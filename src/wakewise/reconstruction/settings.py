"""Settings of a reconstruction that a user may write in a scenario file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wakewise.settings import Settings


class ReconstructionSettings(Settings):
    """How photographs become a model. The defaults are one fixed rule for every target; none is fitted to one."""

    max_features: int = Field(default=3000, ge=200, le=30000, description="most SIFT features kept per photo")
    first_octave: Literal[-1, 0] = Field(
        default=-1, description="-1 doubles the photo before looking for features, for real photos; 0 is 4 times faster"
    )
    peak_threshold: float = Field(
        default=0.0067, gt=0.0, le=0.1, description="smallest SIFT contrast, 0.0067 is COLMAP's"
    )
    exhaustive_up_to: int = Field(
        default=80, ge=3, description="photos up to which every pair is matched; more: in sequence"
    )
    sequence_overlap: int = Field(default=10, ge=2, le=100, description="photos that each is matched with, in sequence")
    min_registered: int = Field(default=3, ge=3, description="fewer registered photos than this is a failure")
    dense_px: int = Field(default=640, ge=100, le=4000, description="longest side in pixels of what stereo works on")
    dense_zoom: float = Field(
        default=1.5, ge=1.0, le=3.0, description="enlargement of a region of interest before stereo"
    )
    stereo_partners: int = Field(
        default=3, ge=1, le=8, description="neighbours that each photo is paired with for stereo"
    )
    agreeing_views: int = Field(default=2, ge=1, le=10, description="other depth maps that must agree with a point")
    agreement_px: float = Field(
        default=1.0, gt=0.0, le=5.0, description="largest disparity difference of depths that agree"
    )
    mesh: bool = Field(default=True, description="make a surface mesh from the dense points")
    mesh_depth: int = Field(default=9, ge=6, le=12, description="greatest octree depth of the Poisson surface")
    threads: int = Field(
        default=2, ge=1, le=64, description="threads of feature extraction, matching, mapping and stereo"
    )
    random_seed: int = Field(default=0, ge=0, description="seed of every random choice")
