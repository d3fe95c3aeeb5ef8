"""Photographs of a target from planned orbits without a flight: for what is asked of the photographs alone.

What a flight does to them is put in by numbers that the default tank showed on the standard scan (wake-aware, seed 1):
the vehicle is 8 mm (rms) and 0.5 deg from its plan and knows its place to 1.8 mm and 0.04 deg. Those are defaults here.

A model from a set of photographs and how good it is: what benches and studies without a flight have in common.
"""

from __future__ import annotations

import csv
import dataclasses
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, freeze
from wakewise.core.errors import InputError, StageError
from wakewise.core.files import write_rows
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_rotvec, quat_multiply
from wakewise.core.interfaces import Progress, ScalarGrid, no_progress
from wakewise.experiments.trials.trial import REGION_SHARE
from wakewise.operation.photography import write_image
from wakewise.scene.missions import MissionSettings, plan_route
from wakewise.scene.targets import Target
from wakewise.vision.evaluation import Crop, evaluate_surface
from wakewise.vision.imaging import ImagingSettings, Render, Scene, photograph_of, render
from wakewise.vision.reconstruction import ReconstructionSettings, mesh_model, read_cloud, reconstruct

WANDER_M, WANDER_RAD = 0.008 / np.sqrt(3), np.radians(0.5) / np.sqrt(3)
DOUBT_M, DOUBT_RAD = 0.0018 / np.sqrt(3), np.radians(0.04) / np.sqrt(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoPoses:
    """One photograph: true poses X_WC over the exposure, and the middle one as the vehicle knows it."""

    name: str
    X_WC: tuple[Pose, ...]
    X_WC_est: Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class PhotoSet:
    """A folder of photographs with the poses that go with them; centres have shape (n, 3), `est_R_WC` (n, 3, 3)."""

    folder: Path
    names: tuple[str, ...]
    true_W_m: Array
    est_W_m: Array
    est_R_WC: Array
    focal_px: float

    def __post_init__(self) -> None:
        freeze(self, true_W_m=(None, 3), est_W_m=(None, 3), est_R_WC=(None, 3, 3))

    @property
    def rotations(self) -> dict[str, Array]:
        """Estimated R_WC by photo name."""
        return dict(zip(self.names, self.est_R_WC, strict=True))

    @property
    def references(self) -> dict[str, Array]:
        """Estimated camera centres by photo name."""
        return dict(zip(self.names, self.est_W_m, strict=True))


def planned_views(
    target: Target, mission: MissionSettings, exposure_s: float, rng: np.random.Generator, smear_m: float = 0.0
) -> list[PhotoPoses]:
    """Views along the mission's orbits, off the plan as a flight would be, moving along the orbit at its speed.

    A camera that follows its orbit keeps the target sharp; `smear_m` is a way on top of it that the camera slips
    sideways, in a random direction of the image, while the shutter is open.
    """
    route = plan_route(target.centre_W_m, mission)
    views = []
    for name, planned in zip(route.exposure_names, route.X_WC_planned, strict=True):
        middle = disturbed(planned, rng, WANDER_M, WANDER_RAD)
        # Along a level circle the camera goes sideways and turns with it, so that it keeps looking at the centre.
        step_m = 0.5 * exposure_s * mission.speed_m_s
        radius_m = max(float(np.linalg.norm((planned.p_m - target.centre_W_m)[:2])), 1e-6)
        ends = []
        angle = rng.uniform(0.0, 2.0 * np.pi)
        slip = 0.5 * smear_m * middle.R @ np.array([np.cos(angle), np.sin(angle), 0.0])
        for side in (-1.0, 0.0, 1.0):
            turn = quat_from_rotvec(np.array([0.0, 0.0, -side * step_m / radius_m]))
            ends.append(Pose(middle.p_m + side * (step_m * middle.R[:, 0] + slip), quat_multiply(turn, middle.q)))
        views.append(PhotoPoses(name=name, X_WC=tuple(ends), X_WC_est=disturbed(middle, rng, DOUBT_M, DOUBT_RAD)))
    return views


def disturbed(pose: Pose, rng: np.random.Generator, spread_m: float, spread_rad: float) -> Pose:
    """A pose off by normally distributed amounts per axis."""
    turn = quat_from_rotvec(rng.normal(0.0, spread_rad, 3))
    return Pose(pose.p_m + rng.normal(0.0, spread_m, 3), quat_multiply(pose.q, turn))


def render_clean(
    target: Target, views: list[PhotoPoses], imaging: ImagingSettings, seed: int = 0, progress: Progress = no_progress
) -> list[Render]:
    """Each view in perfectly clear water; water, silt and flakes can be put in many times."""
    scene, camera = Scene.build(target, seed), imaging.camera()
    out = []
    for k, view in enumerate(views):
        progress(k, len(views), "rendering")
        out.append(render(scene, camera, view.X_WC[1], imaging.lights(), imaging.samples))
    return out


def write_photos(
    folder: Path,
    views: list[PhotoPoses],
    renders: list[Render] | None,
    imaging: ImagingSettings,
    target: Target,
    *,
    silt: ScalarGrid | None = None,
    seed: int = 0,
    progress: Progress = no_progress,
) -> PhotoSet:
    """Write images/*.png and, last, poses.csv into `folder`; a photograph that is there already is kept."""
    camera = imaging.camera()
    scene = Scene.build(target, 0) if renders is None else None
    streams = np.random.default_rng(seed).spawn(len(views))
    for k, (view, rng) in enumerate(zip(views, streams, strict=True)):
        progress(k, len(views), "photographs")
        path = folder / "images" / view.name
        if path.exists():
            continue
        if scene is not None:
            clean = render(scene, camera, view.X_WC[1], imaging.lights(), imaging.samples)
        elif renders is not None:
            clean = renders[k]
        write_image(path, photograph_of(clean, camera, view.X_WC, silt, imaging, rng).image)
    rows = []
    for view in views:
        numbers = (*view.X_WC_est.p_m, *view.X_WC[1].p_m, *view.X_WC_est.q)
        rows.append((view.name, *(f"{value:.9f}" for value in numbers)))
    heads = ("name", "x_m", "y_m", "z_m", "true_x_m", "true_y_m", "true_z_m", "qw", "qx", "qy", "qz")
    write_rows(folder / "poses.csv", [heads, *rows])
    return read_photo_set(folder, camera.focal_px)


def read_photo_set(folder: Path, focal_px: float) -> PhotoSet:
    """Read what `write_photos` left.

    Raises
    ------
    InputError
        If poses.csv is not there, or is an older version's.
    """
    path = folder / "poses.csv"
    if not path.is_file():
        raise InputError(f"{path}: does not exist; the folder holds no finished set of photographs")
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    if head[-4:] != ["qw", "qx", "qy", "qz"]:
        raise InputError(f"{path}: ends with columns {', '.join(head[-4:])}, needs qw, qx, qy, qz; make the set anew")
    numbers = np.array([[float(word) for word in row[1:]] for row in rows])
    return PhotoSet(
        folder=folder / "images",
        names=tuple(row[0] for row in rows),
        est_W_m=numbers[:, 0:3],
        true_W_m=numbers[:, 3:6],
        est_R_WC=matrix_from_quat(numbers[:, 6:10]),
        focal_px=focal_px,
    )


_MODEL_FIGURES = (
    "images",
    "registered_images",
    "mapping",
    "poses_refused",
    "posed_pairs",
    "pairs",
    "reprojection_px",
    "cameras_rmse_mm",
    "features_per_image",
    "inlier_matches",
    "dense_points",
    "stages_s",
)


def judge(
    photos: PhotoSet, target: Target, settings: ReconstructionSettings, folder: Path, progress: Progress = no_progress
) -> dict[str, Any]:
    """Reconstruct a photo set as a trial does, from estimated poses only, and hold the model against the truth.

    Returns
    -------
    dict
        Figures of the model and of its surface; `failure` is None, or says why there is no model, and then there are
        no figures of its surface. stages_s holds wall seconds by stage; total_s is from photographs to figures,
        total_cpu_s its CPU time. The mesh, which no figure needs, comes after them: mesh_s is in neither.

    Raises
    ------
    EnvironmentFailure
        If the disk is full, or a file cannot be read or written: that is no figure.
    """
    wall, cpu = time.perf_counter(), time.process_time()
    figures: dict[str, Any] = {"images": len(photos.names), "failure": None}
    try:
        model = reconstruct(
            photos.folder,
            folder,
            settings.model_copy(update={"mesh": False, "check_shared_intrinsics": False}),  # one camera took them all
            focal_px=photos.focal_px,
            reference_positions=photos.references,
            reference_rotations=photos.rotations,
            region=(target.centre_W_m, REGION_SHARE * target.radius_m),
            replace=True,
            progress=progress,
        ).summary()
        figures |= {key: model[key] for key in _MODEL_FIGURES}
        began = time.perf_counter()
        score = evaluate_surface(
            read_cloud(folder / "dense.ply").points_m,
            target.mesh,
            crop=Crop(bed_z_m=target.bed_z_m),
            camera_centres_W_m=photos.true_W_m,
        )
        figures |= dataclasses.asdict(score)
        figures["stages_s"] = figures["stages_s"] | {"evaluate": time.perf_counter() - began}
    except StageError as fault:
        figures |= {"failure": str(fault), "success": False}
    figures |= {"total_s": time.perf_counter() - wall, "total_cpu_s": time.process_time() - cpu, "mesh_s": None}
    if settings.mesh and figures["failure"] is None:
        began = time.perf_counter()
        mesh_model(folder, settings, progress)
        figures["mesh_s"] = time.perf_counter() - began
    return figures
