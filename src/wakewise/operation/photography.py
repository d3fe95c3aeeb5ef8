"""Renders what the camera saw at each exposure of a flight, and lists it in images.csv."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.core.arrays import Array
from wakewise.core.files import whole_file, write_rows, write_text
from wakewise.core.geometry import Pose
from wakewise.core.interfaces import no_progress
from wakewise.operation.flight_log import ExposureRecord, read_exposures
from wakewise.operation.parts import Parts
from wakewise.operation.scenario import Scenario
from wakewise.operation.scenario.calibration_error import calibration_with_error
from wakewise.scene.targets import turned_normals
from wakewise.vision.imaging import Scene, calibrate, photograph

SMEAR_PX = 0.5
"""Way of the fastest tip across the picture from one scene of an exposure to the next."""
MOST_FRAMES, NEAREST_M = 15, 0.05

IMAGE_COLUMNS = (
    "name",
    "time_s",
    *(f"{who}_{what}" for who in ("est", "true") for what in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")),
    "sharpness",
    "turbidity_per_m",
)


def photograph_flight(parts: Parts, folder: Path, progress: Callable[..., None] = no_progress) -> None:
    """Render the photographs that are not there yet; images.csv, written last, says that all are.

    camera.json holds the camera model, cameras.txt (COLMAP) what the crew takes it for; the poses of images.csv are
    those of its projection centre, which lies off the lens's pupil where a flat port bends the rays.
    """
    exposures = read_exposures(folder / "exposures.npz")
    calibration = calibrate(parts.camera)
    calibration.write(folder)
    known = calibration_with_error(calibration, parts.scenario.calibration_error, parts.seeds.survey()[1])
    write_text(folder / "cameras.txt", known.cameras_txt("As the crew knows it; the true one is in camera.json"))
    rows = []
    for k, exposure in enumerate(exposures):
        name = photo_name(parts.route.photo(k), parts.scenario)
        progress(k, len(exposures), name)
        seen = take_photograph(parts, folder, k, exposure)
        middle = exposure.X_WC_true[len(exposure.X_WC_true) // 2]
        rows.append(
            [
                name,
                f"{exposure.time_s:.6f}",
                *pose_cells(exposure.X_WC_est @ calibration.X_CM),
                *pose_cells(middle @ calibration.X_CM),
                "" if seen["sharpness"] is None else f"{seen['sharpness']:.6g}",
                f"{seen['turbidity_per_m']:.6g}",
            ]
        )
    progress(len(exposures), len(exposures))
    write_rows(folder / "images.csv", [IMAGE_COLUMNS, *rows])
    for note in (folder / "images").glob(".*.json"):
        note.unlink()


def take_photograph(parts: Parts, folder: Path, number: int, exposure: ExposureRecord) -> dict[str, Any]:
    """Render one exposure into images/ unless that is done; return what was noted of it.

    Each photograph draws its noise from its own child of the seed, so that it is the same whenever it is made. A note
    beside it holds its sharpness, turbidity and the exposure's fingerprint: a photograph of another exposure, left by a
    flight that was cut off, is made anew. Exposures are as `read_exposures` gives them.
    """
    scenario = parts.scenario
    image = folder / "images" / photo_name(parts.route.photo(number), scenario)
    note = image.with_name(f".{image.stem}.json")
    mark = fingerprint(exposure)
    if image.exists() and note.exists():
        noted: dict[str, Any] = json.loads(note.read_text(encoding="utf-8"))
        if noted["exposure"] == mark:
            return noted
    rng = parts.seeds.imaging().spawn(number + 1)[number]
    silt = exposure.silt if exposure.silt.largest > 0.0 else None
    photo = photograph(
        scenes_of(parts, exposure),
        parts.camera,
        exposure.X_WC_true,
        silt,
        scenario.imaging,
        rng,
        parts.grains,
        exposure.X_WC_before,
        exposure.flakes,
    )
    write_image(image, photo.image, scenario.imaging.jpeg_quality)
    noted = {
        "exposure": mark,
        "sharpness": photo.sharpness,
        "turbidity_per_m": photo.turbidity_per_m,
        "exposure_s": photo.exposure_s,
        "gain": photo.gain,
    }
    write_text(note, json.dumps(noted))
    return noted


def scenes_of(parts: Parts, exposure: ExposureRecord) -> list[Scene]:
    """What stands before the camera during an exposure: one scene, or an odd number where the target's motion shows.

    A tip that goes less than half a pixel while the shutter is open, as seen from the nearest camera there may be, is
    shown where it is in the middle of the exposure.
    """
    tips, speeds, shift = exposure.tips_m, exposure.tip_speeds_m_s, exposure.shift_m
    if tips is None or speeds is None or shift is None:
        return [parts.scene]
    open_s = parts.scenario.imaging.exposure_s
    middle = exposure.X_WC_true[len(exposure.X_WC_true) // 2]
    away_m = float(np.linalg.norm(middle.p_m - parts.target.centre_W_m)) - parts.target.radius_m
    fastest = float(np.linalg.norm(speeds, axis=1).max(initial=0.0))
    pixels = fastest * open_s / max(away_m, NEAREST_M) * float(parts.camera.row[1])
    frames = min(2 * math.ceil(0.5 * (pixels / SMEAR_PX - 1.0)) + 1, MOST_FRAMES) if pixels > SMEAR_PX else 1
    return [posed_scene(parts, tips + speeds * (open_s * (k + 0.5) / frames), shift) for k in range(max(frames, 1))]


def moved_m(parts: Parts, exposure: ExposureRecord) -> Array:
    """How far each vertex of a target that yields was from its place at rest when the shutter opened, shape (n, 3)."""
    yielding, mesh = parts.compliance, parts.target.mesh
    moved = np.zeros_like(mesh.vertices_m)
    if exposure.shift_m is not None:
        moved += np.append(exposure.shift_m, 0.0)
    if yielding is not None and yielding.sway is not None and exposure.tips_m is not None:
        moved += yielding.sway.bent(exposure.tips_m)[0]
    return moved


def posed_scene(parts: Parts, tips_m: Array, shift_m: Array) -> Scene:
    """The scene with its target's tips moved and the whole of it shifted."""
    yielding, scene = parts.compliance, parts.scene
    moved, normals = np.zeros((scene.first_bed_vertex, 3)), scene.target_normals.astype(np.float64)
    if yielding is not None and yielding.sway is not None:
        moved, tilt = yielding.sway.bent(tips_m)
        normals = turned_normals(normals, tilt)
    return scene.posed(moved + np.append(shift_m, 0.0), normals)


def fingerprint(exposure: ExposureRecord) -> str:
    """Digest of all that a photograph's pixels hang on."""
    digest = hashlib.blake2b(digest_size=16)
    for X_WC in (*exposure.X_WC_true, *exposure.X_WC_before):
        digest.update(X_WC.p_m.tobytes() + X_WC.q.tobytes())
    for silt in (exposure.silt, exposure.silt.outer):
        if silt is not None:
            where = np.array([silt.spacing_m, *silt.origin_W_m, *silt.values.shape])
            digest.update(where.tobytes() + silt.values.tobytes())
    if exposure.flakes is not None:
        for part in (exposure.flakes.p_W_m, exposure.flakes.v_W_m_s, exposure.flakes.looks):
            digest.update(part.tobytes())
    for stance in (exposure.tips_m, exposure.tip_speeds_m_s, exposure.shift_m):
        if stance is not None:
            digest.update(np.array(stance.shape).tobytes() + stance.tobytes())
    return digest.hexdigest()


def photo_name(planned: str, scenario: Scenario) -> str:
    """File name of the photograph that a route calls `planned`, with the suffix of the scenario's format."""
    return Path(planned).with_suffix(".png" if scenario.imaging.photo_format == "png" else ".jpg").name


def write_image(path: Path, image: NDArray[np.uint8], jpeg_quality: int = 92) -> None:
    """Write an RGB image, shape (h, w, 3), uint8, whole or not at all, as its suffix says (.png or .jpg)."""
    options = [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality] if path.suffix == ".jpg" else []
    with whole_file(path) as temporary:
        temporary.write_bytes(cv2.imencode(path.suffix, image[..., ::-1], options)[1].tobytes())


def pose_cells(X_WC: Pose) -> list[str]:
    """Position and quaternion of a pose as cells of a table."""
    return [f"{value:.9f}" for value in (*X_WC.p_m, *X_WC.q)]
