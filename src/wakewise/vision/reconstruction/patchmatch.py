"""Dense points by COLMAP's patch-match stereo, where pycolmap was built with CUDA: sparse/ in, dense.ply out."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from wakewise.core.errors import InputError, StageError
from wakewise.core.interfaces import Progress
from wakewise.core.run_lock import temporary_prefix
from wakewise.vision.reconstruction.clouds import read_cloud, write_cloud
from wakewise.vision.reconstruction.colmap import call, pycolmap
from wakewise.vision.reconstruction.registered_photos import RegionOfInterest
from wakewise.vision.reconstruction.settings import RANDOM_SEED, ReconstructionSettings
from wakewise.vision.reconstruction.stages import need_room


def require_cuda() -> None:
    """Check that patch-match can run here.

    Raises
    ------
    InputError
        If pycolmap has no CUDA or there is no device.
    """
    if not pycolmap.has_cuda:
        raise InputError("dense: patch-match needs a pycolmap with CUDA (package pycolmap-cuda12); stereo needs none")
    if pycolmap.get_num_cuda_devices() < 1:
        raise InputError("dense: patch-match needs a CUDA device, none is there; stereo needs none")


def patch_match(
    folder: Path,
    sparse: Path,
    out: Path,
    settings: ReconstructionSettings,
    *,
    region: RegionOfInterest | None,
    progress: Progress,
) -> dict[str, Any]:
    """Patch-match stereo and fusion; what lies outside the region is left out.

    J. L. Schoenberger et al., Pixelwise view selection for unstructured multi-view stereo, ECCV 2016, doi
    10.1007/978-3-319-46487-9_31.

    Returns
    -------
    dict
        As of `densify`.

    Raises
    ------
    StageError
        If no points come out.
    """
    with tempfile.TemporaryDirectory(prefix=temporary_prefix("patch-match"), dir=out.parent) as scratch:
        work = Path(scratch) / "work"
        call(partial(pycolmap.undistort_images, work, sparse, folder), "dense", lambda: progress(0, 3, "undistort"))
        options = pycolmap.PatchMatchOptions()
        options.max_image_size = -1 if region is not None else settings.dense_px
        call(partial(pycolmap.patch_match_stereo, work, options=options), "dense", lambda: progress(1, 3, "stereo"))
        fusion = pycolmap.StereoFusionOptions()
        fusion.min_num_pixels = settings.agreeing_views + 1
        raw = Path(scratch) / "fused.ply"
        call(
            partial(pycolmap.stereo_fusion, raw, work, options=fusion, output_type="ply"),
            "dense",
            lambda: progress(2, 3, "fusion"),
        )
        need_room(out.parent, 0.0, "dense")  # on a full disk the points are cut short without a word
        cloud = read_cloud(raw)
    keep = np.ones(len(cloud.points_m), dtype=np.bool_)
    if region is not None:
        keep = np.linalg.norm(cloud.points_m - region.centre_W_m, axis=1) <= region.radius_m
    if keep.sum() < 100:
        raise StageError(f"dense: {keep.sum()} points survive patch-match, at least 100 must")
    cloud = cloud.only(keep)
    points = cloud.points_m
    write_cloud(out, cloud)
    some = np.random.default_rng(RANDOM_SEED).choice(len(points), min(len(points), 2000), replace=False)
    spacing = float(np.median(np.asarray(KDTree(points).query(points[some], k=2)[0])[:, 1]))
    maps = len(pycolmap.Reconstruction(sparse).images)
    return {"dense_points": len(points), "depth_maps": maps, "point_spacing_mm": 1e3 * spacing}
