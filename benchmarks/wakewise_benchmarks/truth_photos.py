"""Reconstruction and calibration from real photographs, against surveyed cameras, laser depths and COLMAP's own run."""

from __future__ import annotations

import math
import shutil
import tempfile
from pathlib import Path

import numpy as np
import pycolmap

from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, quat_from_matrix
from wakewise.core.interfaces import Progress
from wakewise.perception import CalibratedCamera
from wakewise.perception.feature_tracks import fitted, grey_picture
from wakewise.perception.plane_sweep import begin_sweep, compared, sweep_view, swept_depth
from wakewise.perception.surface_map import turned_about
from wakewise.vision.evaluation.depth_maps import compare_depths, read_depth_views
from wakewise.vision.image_decoding import AS_STORED, read_picture
from wakewise.vision.reconstruction import (
    CalibrationBoard,
    ReconstructionRequest,
    ReconstructionSettings,
    calibrate,
    read_cloud,
    read_reference_cameras,
    reconstruct,
)
from wakewise_benchmarks.truth_records import Asked, Part

CORAL_FOCAL_PX, FOUNTAIN_FOCAL_PX = 1277.8, 1379.74
"""By pycolmap on all 31 photographs of the coral, and by the fountain's calibration at half size."""


def _photos(folder: Path, into: Path) -> int:
    """Copy the photographs of a folder that may not be written to; how many there are."""
    found = sorted(path for path in folder.glob("*") if path.suffix.lower() in (".jpg", ".png"))
    if not found:
        raise InputError(f"{folder}: holds no photographs")
    into.mkdir()
    for path in found:
        shutil.copyfile(path, into / path.name)
    return len(found)


def coral_figures(folder: Path, progress: Progress) -> dict[str, float]:
    """Sparse model of a diver's photographs of one coral."""
    with tempfile.TemporaryDirectory(prefix="wakewise-truth-") as scratch:
        photos = Path(scratch) / "photos"
        count = _photos(folder / "images_1280", photos)
        settings = ReconstructionSettings(mesh=False, threads=1, check_shared_intrinsics=False)
        model = reconstruct(
            photos,
            Path(scratch) / "model",
            settings,
            request=ReconstructionRequest(until="sparse"),
            progress=progress,
        )
        swept = coral_sweep_figures(Path(scratch) / "model" / "sparse", photos)
    return {
        **swept,
        "registered_pct": 100.0 * model.registered_images / count,
        "reprojection_px": model.reprojection_uncut_px,
        "focal_pct": 100.0 * abs(model.focal_px / CORAL_FOCAL_PX - 1.0),
        "photos": float(count),
    }


SWEEP_PX, SHARED, SWEEP_DEG, ABOUT_DEG = 640, 40, (2.0, 20.0), 8.0
"""Width of the coral's photographs for a sweep; the others are those that share so many points and lie so far round
the scene, those nearest to `ABOUT_DEG` first."""


def coral_sweep_figures(sparse: Path, photos: Path) -> dict[str, float]:
    """Plane sweeps through the photographs of a sparse model, with its cameras, against the depths of its points."""
    model = pycolmap.Reconstruction(sparse)
    (own,) = model.cameras.values()
    f, cx, cy, k1 = own.params  # SIMPLE_RADIAL, what `reconstruct` takes for photographs of one lens
    camera = CalibratedCamera(
        width=own.width, height=own.height, fx=f, fy=f, cx=cx - 0.5, cy=cy - 0.5, distortion=(k1, 0.0, 0.0, 0.0)
    ).scaled(SWEEP_PX)
    images = sorted(model.images.values(), key=lambda image: image.name)
    poses = [
        Pose(image.projection_center(), quat_from_matrix(image.cam_from_world().rotation.matrix().T))
        for image in images
    ]
    views = []
    for image, X_WC in zip(images, poses, strict=True):
        picture = read_picture(photos / image.name, AS_STORED)
        if picture is None:
            raise InputError(f"{photos / image.name}: is no picture")
        views.append(sweep_view(fitted(grey_picture(picture), camera), X_WC, camera))
    seen = [{point.point3D_id for point in image.points2D if point.has_point3D()} for image in images]
    errors, known = [], 0
    for r, mine in enumerate(seen):
        points = np.array([model.points3D[k].xyz for k in sorted(mine)])
        middle = np.median(points, axis=0)
        apart = {
            o: math.degrees(turned_about(middle, poses[r].p_m, poses[o].p_m))
            for o in range(len(images))
            if o != r and len(mine & seen[o]) >= SHARED
        }
        others = sorted(
            (o for o, angle in apart.items() if SWEEP_DEG[0] < angle < SWEEP_DEG[1]),
            key=lambda o: abs(apart[o] - ABOUT_DEG),
        )[:3]
        if len(others) < 2:
            continue
        p_C = poses[r].inverse().apply(points)
        near, far = np.quantile(p_C[:, 2], (0.02, 0.98))
        whole = (0, 0, camera.width, camera.height)
        sweep = begin_sweep(views[r], [views[o] for o in others], whole, 0.9 * float(near), 1.1 * float(far))
        while not sweep.done:
            sweep = compared(sweep, camera)
        u = np.round(camera.fx * p_C[:, 0] / p_C[:, 2] + camera.cx).astype(int)
        v = np.round(camera.fy * p_C[:, 1] / p_C[:, 2] + camera.cy).astype(int)
        within = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        depth = swept_depth(sweep, camera).depth_m[v[within], u[within]]
        found = np.isfinite(depth)
        errors.append(np.abs(depth[found] / p_C[within, 2][found] - 1.0))
        known += len(points)
    if not errors:
        return {}
    every = np.concatenate(errors)
    return {
        "sweep_pct": 100.0 * float(np.median(every)),
        "sweep_known_pct": 100.0 * len(every) / known,
        "swept_photos": float(len(errors)),
    }


def fountain_figures(folder: Path, progress: Progress) -> dict[str, float | None]:
    """Model of eleven photographs, with cameras held against a survey and dense points against a laser scan."""
    cameras = folder / "gt_dense_cameras"
    with tempfile.TemporaryDirectory(prefix="wakewise-truth-") as scratch:
        photos, out = Path(scratch) / "photos", Path(scratch) / "model"
        count = _photos(folder / "images_1536x1024", photos)
        settings = ReconstructionSettings(mesh=False, threads=1, check_shared_intrinsics=False)
        model = reconstruct(
            photos,
            out,
            settings,
            reference_positions=read_reference_cameras(cameras),
            request=ReconstructionRequest(until="dense"),
            progress=progress,
        )
        views = read_depth_views(folder / "gt_depth_z_m_768x512.npz", cameras)
        score = compare_depths(np.asarray(read_cloud(out / "dense.ply").points_m, dtype=np.float64), views)
    return {
        "registered_pct": 100.0 * model.registered_images / count,
        "cameras_mm": model.cameras_rmse_mm,
        "focal_pct": 100.0 * abs(model.focal_px / FOUNTAIN_FOCAL_PX - 1.0),
        "cloud_mm": score.accuracy_median_mm,
        "complete_pct": score.completeness_50mm_pct,
        **sweep_figures(folder),
    }


SWEPT, OTHERS, WINDOW = (3, 5, 7), (-2, -1, 1), (150, 80, 600, 450)
"""Photographs of the fountain through which planes are swept, the others that are compared, and the part, px of 768."""


def sweep_figures(folder: Path) -> dict[str, float]:
    """Plane sweeps through surveyed photographs against the laser's depths, without what is nearer or farther."""
    views = read_depth_views(folder / "gt_depth_z_m_768x512.npz", folder / "gt_dense_cameras")
    paths = sorted((folder / "images_1536x1024").glob("*.jpg"))
    shares, known = [], []
    for reference in SWEPT:
        own = views[reference]
        height, width = own.depth_m.shape
        camera = CalibratedCamera(
            width=width, height=height, fx=own.K[0, 0], fy=own.K[1, 1], cx=own.K[0, 2], cy=own.K[1, 2]
        )
        chosen = []
        for k in (reference, *(reference + step for step in OTHERS)):
            picture = read_picture(paths[k])
            if picture is None:
                raise InputError(f"{paths[k]}: is no picture")
            X_WC = Pose(views[k].p_WC_m, quat_from_matrix(views[k].R_WC))
            chosen.append(sweep_view(fitted(grey_picture(picture), camera), X_WC, camera))
        left, top, right, bottom = WINDOW
        laser = own.depth_m[top:bottom, left:right]
        there = laser > 0.0
        near, far = np.percentile(laser[there], (0.5, 99.5))
        sweep = begin_sweep(chosen[0], chosen[1:], WINDOW, 0.95 * float(near), 1.05 * float(far))
        while not sweep.done:
            sweep = compared(sweep, camera)
        depth = swept_depth(sweep, camera).depth_m
        found = there & np.isfinite(depth)
        shares.append(np.abs(depth[found] / laser[found] - 1.0))
        known.append(found.sum() / there.sum())
    return {
        "sweep_pct": 100.0 * float(np.median(np.concatenate(shares))),
        "sweep_known_pct": 100.0 * float(np.mean(known)),
    }


def board_figures(folder: Path, _: Progress) -> dict[str, float | None]:
    """Calibration from boards behind an aquarium's wall, through a lens of strong distortion."""
    photos = folder / "Example_data" / "worst_case_distortion"
    found = calibrate(photos, CalibrationBoard(columns=11, rows=8, square_m=0.008, marker_m=0.006))
    return {"residual_px": found.residual_px, "photos": float(found.photos)}


_BAR = "bound of the package's own test"
_COLMAP = "pycolmap registers all of them"
PARTS = (
    Part(
        name="coral_photos",
        source="W. Million, divers' photographs of Acropora cervicornis; pycolmap 4.2.1 on them",
        asked=(
            Asked(key="registered_pct", what="coral, 31 photographs: registered", unit="%", low=100.0,
                  how=_COLMAP),
            Asked(key="reprojection_px", what="coral: mean reprojection error before the last cuts", unit="px",
                  high=1.2, how="above it a model is called doubtful; pycolmap has 0.64"),
            Asked(key="focal_pct", what="coral: focal length against pycolmap's", unit="%",
                  high=2.0, how="two models of one camera"),
            Asked(key="sweep_pct", what="coral: plane sweep in flight, median error of depth", unit="%",
                  high=1.0, how="5 mm from half a metre: what is asked of a found target"),
            Asked(key="sweep_known_pct", what="coral: COLMAP's points to which the sweep gives a depth", unit="%",
                  low=30.0, how="as of the fountain's pixels"),
        ),
        compute=coral_figures,
        slow="minutes",
    ),
    Part(
        name="strecha_fountain",
        source="Strecha et al. 2008: surveyed cameras and a laser scan",
        asked=(
            Asked(key="registered_pct", what="fountain, 11 photographs: registered", unit="%", low=100.0, how=_COLMAP),
            Asked(key="cameras_mm", what="fountain: rms distance of cameras from the survey", unit="mm", high=10.0,
                  how="pycolmap has 6.1"),
            Asked(key="focal_pct", what="fountain: focal length against the calibration", unit="%", high=0.5,
                  how="pycolmap has 0.09"),
            Asked(key="cloud_mm", what="fountain: median distance of dense points from the laser scan", unit="mm",
                  high=16.0, how="the scan agrees with the cameras to 8 to 16 mm"),
            Asked(key="complete_pct", what="fountain: share of the scan within 50 mm of the model", unit="%", low=50.0,
                  how="half of what any camera sees"),
            Asked(key="sweep_pct", what="fountain: plane sweep in flight, median error of depth", unit="%", high=1.0,
                  how="5 mm from half a metre: what is asked of a found target"),
            Asked(key="sweep_known_pct", what="fountain: pixels to which the sweep gives a depth", unit="%", low=30.0,
                  how="a third of the pixels maps a surface in cells of several"),
        ),
        compute=fountain_figures,
        slow="minutes",
    ),
    Part(
        name="charuco_aquarium",
        source="PIVlab, boards through an aquarium wall",
        asked=(
            Asked(key="residual_px", what="boards through a wall: residual of the calibration", unit="px", high=0.5,
                  how=_BAR),
            Asked(key="photos", what="boards found, of 12 photographs", low=12.0, how=_BAR),
        ),
        compute=board_figures,
        slow="10 s",
    ),
)  # fmt: skip
