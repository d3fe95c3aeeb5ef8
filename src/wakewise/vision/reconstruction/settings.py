"""Settings of a reconstruction in a scenario file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from wakewise.core.settings import Settings

RANDOM_SEED = 0
"""Of every random choice: the same photos give the same model."""


class ReconstructionSettings(Settings):
    """How photographs become a model. The defaults are one fixed rule for every target; none is fitted to one."""

    detector: Literal["colmap", "opencv"] = Field(
        default="colmap",
        description="whose SIFT: COLMAP's registered more real photos (31 of 31 against 24); OpenCV's takes a third of "
        "the time and is as precise on sharp ones",
    )
    max_features: int = Field(default=3000, ge=200, le=30000, description="most SIFT features kept per photo")
    first_octave: Literal[-1, 0] = Field(
        default=-1, description="-1 doubles the photo before looking for features, for real photos; 0 is 4 times faster"
    )
    matching: Literal["auto", "exhaustive", "sequential", "look-alike", "poses"] = Field(
        default="auto",
        description="which photos to match: all pairs, neighbours in order of name (and laps by ever wider steps), "
        "these and those that look alike, or neighbours by known camera poses; auto takes poses if known, else all "
        "pairs up to 80 photos and look-alikes beyond",
    )
    mapper: Literal["poses", "incremental", "global"] = Field(
        default="poses",
        description="where camera poses come with the photos and fit, match along epipolar lines and begin from them, "
        "else one photo after the other; or that in any case; or all at once (GLOMAP)",
    )
    reprojection_px: float = Field(
        default=0.5,
        gt=0.0,
        le=10.0,
        description="mean reprojection error to get below: outliers are cut ever more closely until it is met",
    )
    lens: Literal["perspective", "fisheye"] = Field(
        default="perspective",
        description="kind of lens where no camera is given: fisheye where straight lines bend strongly (fields of view "
        "above some 110 deg)",
    )
    refine_camera: bool = Field(
        default=True,
        description="fit focal length and distortion to the photos, from EXIF or a given camera on; false keeps a "
        "given camera as it is",
    )
    check_shared_intrinsics: bool = Field(
        default=True,
        description="map once more with a lens for each photo, which finds photos of several lenses that were not "
        "declared, and parts them; not of a flight's photographs, which one camera took",
    )
    position_priors: bool = Field(
        default=False, description="let known camera positions pull at the model, instead of only placing it"
    )
    prior_sigma_m: float = Field(
        default=0.005,
        gt=0.0,
        le=100.0,
        description="standard deviation of a known camera position, m, where priors pull",
    )
    known_cameras: Literal["fixed", "priors"] = Field(
        default="fixed",
        description="what known poses and lenses of photos are: as they are, or where mapping begins from, for the "
        "photos to correct",
    )
    dense: Literal["stereo", "patch-match"] = Field(
        default="stereo", description="dense points by semi-global stereo, or by COLMAP's patch-match, which needs CUDA"
    )
    dense_px: int = Field(default=640, ge=100, le=4000, description="longest side in pixels of what stereo works on")
    dense_zoom: float = Field(
        default=1.5, ge=1.0, le=3.0, description="enlargement of a region of interest before stereo"
    )
    stereo_paths: Literal[3, 8] = Field(
        default=8, description="directions that stereo smooths along; 3 costs a third of 8"
    )
    stereo_partners: int = Field(
        default=3, ge=1, le=8, description="neighbours that each photo is paired with for stereo"
    )
    agreeing_views: int = Field(default=2, ge=1, le=10, description="other depth maps that must agree with a point")
    mesh: bool = Field(default=True, description="make a surface mesh from the dense points")
    mesh_depth: int = Field(
        default=9,
        ge=6,
        le=12,
        description="greatest octree depth of the Poisson surface across the subject, which holds nine tenths of the "
        "points",
    )
    threads: int = Field(
        default=2, ge=1, le=64, description="threads of feature extraction, matching, mapping and stereo"
    )
