"""One photograph: speed by part, memory at 4K, true geometry, a flat port's residual, features of the corals."""

from __future__ import annotations

import math
import resource
import time
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from scipy.spatial import cKDTree

from wakewise.core.geometry import Pose, quat_from_rotvec
from wakewise.core.interfaces import ScalarGrid
from wakewise.experiments.trials.timing import BenchOptions
from wakewise.scene.missions import MissionSettings, plan_route
from wakewise.scene.targets import coral, place_on_bed, stony_kinds
from wakewise.vision.imaging import (
    FlatPort,
    ImagingSettings,
    LensCamera,
    Render,
    Scene,
    SiltOptics,
    attenuate,
    calibrate,
    haze_between,
    motion_blur,
    motion_px,
    photograph,
    photograph_of,
    render,
    sharpness,
)
from wakewise.vision.imaging.particles import draw_flakes, flakes_before
from wakewise.vision.imaging.sensor import expose
from wakewise.vision.imaging.settings import FLAKES_PER_KG
from wakewise_benchmarks.registry import bench_target

FRAMES = 6
PEAK_THRESHOLDS = (0.02, 0.0067)
"""Smallest contrast of a SIFT feature: the paper's figure, and COLMAP's default, which divides it by 3 scales."""


def run(options: BenchOptions) -> dict[str, Any]:
    """Photographs of the quick preset with everything on, silt too, and in clear water, moving as a flight does."""
    scene, settings = Scene.build(bench_target(), 0), ImagingSettings()
    planned = plan_route(bench_target().centre_W_m, MissionSettings()).X_WC_planned
    views = [planned[k * len(planned) // FRAMES] for k in range(FRAMES)]
    rng = np.random.default_rng(0)
    silt = cloud()

    def frame(water: ScalarGrid | None) -> tuple[float, float]:
        """Wall and CPU time of a photograph, s."""
        photograph(scene, settings.camera(), moving(views[0]), water, settings, rng)
        wall, cpu = time.perf_counter(), time.process_time()
        for view in views:
            photograph(scene, settings.camera(), moving(view), water, settings, rng)
        return (time.perf_counter() - wall) / FRAMES, (time.process_time() - cpu) / FRAMES

    (frame_s, frame_cpu_s), (clear_s, clear_cpu_s) = frame(silt), frame(None)
    large = ImagingSettings(width=3840, height=2880)
    photograph(scene, large.camera(), moving(views[0]), None, large, rng)
    return {
        "render_s_per_frame": frame_s,
        "frame_s": frame_s,
        "frame_cpu_s": frame_cpu_s,
        "frame_clear_s": clear_s,
        "frame_clear_cpu_s": clear_cpu_s,
        "parts_cpu_ms": parts(scene, settings, views, silt),
        "pixels": settings.width * settings.height,
        "memory_4k_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        **surface_figures(scene, views),
        "flat_port": {str(fov): port_figures(fov) for fov in (60, 75, 90)},
        "features": {kind: feature_counts(kind) for kind in stony_kinds()},
        "paper_features": {"A": 2847, "B": 1856, "C": 982},
    }


def cloud(mean_kg_m3: float = 0.005) -> ScalarGrid:
    """A patchy cloud round the target, on a grid of 5 cm: 5 mg/L, which attenuate 0.28 per metre."""
    values = np.random.default_rng(1).uniform(0.0, 2.0 * mean_kg_m3, (60, 60, 21))
    return ScalarGrid(origin_W_m=np.array([-1.5, -1.5, 0.5]), spacing_m=0.05, values=values)


def moving(middle: Pose, shift_m: float = 8e-4, turn_rad: float = 1e-3) -> list[Pose]:
    """Five poses about a middle one: 0.1 m/s and 7 deg/s for 8 ms."""
    return [
        middle @ Pose(np.array([k * shift_m, 0.0, 0.0]), quat_from_rotvec(np.array([0.0, k * turn_rad, 0.0])))
        for k in np.linspace(-0.5, 0.5, 5)
    ]


def parts(scene: Scene, settings: ImagingSettings, views: list[Pose], silt: ScalarGrid) -> dict[str, float]:
    """CPU time of each part of a photograph, ms, mean over the views; `motion_px` is how far the camera moved."""
    spent: dict[str, float] = {}

    def timed(name: str, work: Callable[..., Any], *given: Any) -> Any:
        began = time.process_time()
        result = work(*given)
        spent[name] = spent.get(name, 0.0) + 1e3 * (time.process_time() - began) / len(views)
        return result

    camera, lights, water, rng = settings.camera(), settings.lights(), settings.water(), np.random.default_rng(0)
    moved = 0.0
    for view in views:
        clean: Render = timed("render", render, scene, camera, view, lights, settings.samples)
        haze = timed("haze", haze_between, camera, view, water, SiltOptics(), silt, lights)
        wet, _ = timed("water", attenuate, clean, camera, haze, water, lights.from_above, SiltOptics())
        soft = timed("blur", motion_blur, wet, clean.depth_m, camera, moving(view))
        flakes = timed("flakes", flakes_before, camera, view, silt, settings.flakes_per_m3, FLAKES_PER_KG, rng)
        soft = timed(
            "flakes", draw_flakes, soft, clean.depth_m, camera, moving(view), flakes, settings.exposure_s, water, lights
        )
        image = timed("sensor", expose, soft, np.ones(3), 12000.0, 4.0, rng)
        timed("sharpness", sharpness, image, clean.target_fraction)
        moved += motion_px(camera, moving(view), 0.4) / len(views)
    return {**spent, "motion_px": moved}


def surface_figures(scene: Scene, views: list[Pose]) -> dict[str, float]:
    """How far points of the depth map lie from the plane of the coral's nearest face, mm, 1920 px wide."""
    camera, lights = ImagingSettings(width=1920, height=1440).camera(), ImagingSettings().lights()
    mesh = bench_target().mesh
    corners = mesh.triangles_m
    normals = mesh.area_vectors_m2 / mesh.face_areas_m2[:, None]
    tree = cKDTree(corners.mean(axis=1))
    errors = []
    for view in views[:2]:
        seen = render(scene, camera, view, lights, 1)
        rows, columns = np.nonzero(seen.target_fraction > 0.0)
        pixels = np.column_stack([columns + 0.5, rows + 0.5])[::7]
        points = view.apply(camera.unproject(pixels, seen.depth_m[rows, columns][::7]))
        face = tree.query(points)[1]
        errors.append(np.abs(np.sum((points - corners[face, 0]) * normals[face], axis=1)))
    both = 1e3 * np.concatenate(errors)
    return {"surface_error_median_mm": float(np.median(both)), "surface_error_p99_mm": float(np.percentile(both, 99))}


def port_figures(fov_deg: float) -> dict[str, float]:
    """What COLMAP's OPENCV model leaves of a flat port's refraction, 960 x 720, 10 mm of air and 5 mm of acrylic."""
    model = calibrate(LensCamera(960, 720, math.radians(fov_deg), port=FlatPort(air_m=0.01)))
    return {"rms_px": model.rms_px, "max_px": model.max_px, "centre_ahead_mm": 1e3 * model.ahead_m}


def feature_counts(kind: str, width: int = 1920) -> dict[str, float]:
    """SIFT features a photograph on the target's pixels and in all, 0.5 m off; OpenCV's, first octave doubled."""
    target = place_on_bed(kind, coral(kind), 1.5)
    scene = Scene.build(target, 0)
    settings = ImagingSettings(width=width, height=width * 3 // 4)
    planned = plan_route(target.centre_W_m, MissionSettings()).X_WC_planned
    views = [planned[k] for k in (2, len(planned) // 2, len(planned) - 5)]
    counts: dict[str, float] = {"target_px": 0.0}
    for view in views:
        clean = render(scene, settings.camera(), view, settings.lights(), settings.samples)
        image = photograph_of(clean, settings.camera(), [view], None, settings, np.random.default_rng(0)).image
        counts["target_px"] += float((clean.target_fraction >= 0.5).sum()) / len(views)
        for peak in PEAK_THRESHOLDS:
            # OpenCV divides its threshold by the 3 scales of an octave.
            found = cv2.SIFT.create(contrastThreshold=3 * peak).detect(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)
            place = np.array([keypoint.pt for keypoint in found]).reshape(-1, 2).round().astype(int)
            on = clean.target_fraction[place[:, 1], place[:, 0]] >= 0.5
            for name, count in ((f"target_{peak:g}", int(on.sum())), (f"all_{peak:g}", len(found))):
                counts[name] = counts.get(name, 0.0) + count / len(views)
    return counts
