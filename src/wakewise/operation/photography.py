"""Renders what the camera saw at each exposure of a flight, and lists it in images.csv."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.files import whole_file, write_text
from wakewise.geometry import Pose
from wakewise.imaging import SiltOptics, calibrate, photograph
from wakewise.interfaces import ScalarGrid, no_progress
from wakewise.operation.parts import Parts
from wakewise.operation.recorder import ExposureRecord, read_exposures
from wakewise.operation.scenario import Scenario

IMAGE_COLUMNS = (
    "name",
    "time_s",
    *(f"{who}_{what}" for who in ("est", "true") for what in ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")),
    "sharpness",
    "turbidity_per_m",
)


def photograph_flight(parts: Parts, folder: Path, progress: Callable[..., None] = no_progress) -> None:
    """Render the photographs that are not there yet; images.csv, written last, says that all are.

    cameras.txt (COLMAP) and camera.json hold the camera model; the poses of images.csv are those of its projection
    centre, which lies off the lens's pupil where a flat port bends the rays. Each photograph draws its noise from its
    own child of the seed, so a resumed run gives the same pictures.
    """
    scenario = parts.scenario
    exposures = read_exposures(folder / "exposures.npz")
    names = parts.route.exposure_names
    camera = parts.camera
    calibration = calibrate(camera)
    calibration.write(folder)
    progress(0, len(exposures), "building the scene")
    scene = parts.scene
    streams = parts.seeds.imaging().spawn(len(exposures))
    grains = SiltOptics(diameter_m=scenario.tank.silt.grain_m, density_kg_m3=scenario.tank.silt.grain_density_kg_m3)
    images = folder / "images"
    rows = []
    for k, (planned, exposure, rng) in enumerate(zip(names, exposures, streams, strict=True)):
        name = photo_name(planned, scenario)
        note = images / f".{Path(name).stem}.json"
        if not ((images / name).exists() and note.exists()):
            photo = photograph(scene, camera, exposure.X_WC_true, _silt(exposure), scenario.imaging, rng, grains)
            write_image(images / name, photo.image, scenario.imaging.jpeg_quality)
            write_text(note, json.dumps({"sharpness": photo.sharpness, "turbidity_per_m": photo.turbidity_per_m}))
        seen = json.loads(note.read_text(encoding="utf-8"))
        middle = exposure.X_WC_true[len(exposure.X_WC_true) // 2]
        rows.append(
            [
                name,
                f"{exposure.time_s:.6f}",
                *_numbers(exposure.X_WC_est @ calibration.X_CM),
                *_numbers(middle @ calibration.X_CM),
                "" if seen["sharpness"] is None else f"{seen['sharpness']:.6g}",
                f"{seen['turbidity_per_m']:.6g}",
            ]
        )
        progress(k + 1, len(exposures), name)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([IMAGE_COLUMNS, *rows])
    write_text(folder / "images.csv", text.getvalue())
    for note in images.glob(".*.json"):
        note.unlink()


def photo_name(planned: str, scenario: Scenario) -> str:
    """File name of the photograph that a route calls `planned`, with the suffix of the scenario's format."""
    return Path(planned).with_suffix(".png" if scenario.imaging.photo_format == "png" else ".jpg").name


def write_image(path: Path, image: NDArray[np.uint8], jpeg_quality: int = 92) -> None:
    """Write an RGB image, shape (h, w, 3), uint8, whole or not at all, as its suffix says (.png or .jpg)."""
    options = [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality] if path.suffix == ".jpg" else []
    with whole_file(path) as temporary:
        temporary.write_bytes(cv2.imencode(path.suffix, image[..., ::-1], options)[1].tobytes())


def _silt(exposure: ExposureRecord) -> ScalarGrid | None:
    return exposure.silt if float(exposure.silt.values.max(initial=0.0)) > 0.0 else None


def _numbers(X_WC: Pose) -> list[str]:
    return [f"{value:.9f}" for value in (*X_WC.p_m, *X_WC.q)]
