"""Renders what the camera saw at each exposure of a flight, and lists it in images.csv."""

from __future__ import annotations

import csv
import hashlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from wakewise.files import whole_file, write_text
from wakewise.geometry import Pose
from wakewise.imaging import SiltOptics, calibrate, photograph
from wakewise.interfaces import no_progress
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
    centre, which lies off the lens's pupil where a flat port bends the rays.
    """
    exposures = read_exposures(folder / "exposures.npz")
    calibration = calibrate(parts.camera)
    calibration.write(folder)
    rows = []
    for k, exposure in enumerate(exposures):
        name = photo_name(parts.route.exposure_names[k], parts.scenario)
        progress(k, len(exposures), name)
        seen = take_photograph(parts, folder, k, exposure)
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
    progress(len(exposures), len(exposures))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([IMAGE_COLUMNS, *rows])
    write_text(folder / "images.csv", text.getvalue())
    for note in (folder / "images").glob(".*.json"):
        note.unlink()


def take_photograph(parts: Parts, folder: Path, number: int, exposure: ExposureRecord) -> dict[str, Any]:
    """Render one exposure into images/ unless that is done; return what was noted of it.

    Each photograph draws its noise from its own child of the seed, so that it is the same whenever it is made. A note
    beside it holds its sharpness, turbidity and the exposure's fingerprint: a photograph of another exposure, left by a
    flight that was cut off, is made anew. Exposures are as `read_exposures` gives them.
    """
    scenario, names = parts.scenario, parts.route.exposure_names
    image = folder / "images" / photo_name(names[number], scenario)
    note = image.with_name(f".{image.stem}.json")
    mark = fingerprint(exposure)
    if image.exists() and note.exists():
        noted: dict[str, Any] = json.loads(note.read_text(encoding="utf-8"))
        if noted["exposure"] == mark:
            return noted
    rng = parts.seeds.imaging().spawn(len(names))[number]
    grains = SiltOptics(diameter_m=scenario.tank.silt.grain_m, density_kg_m3=scenario.tank.silt.grain_density_kg_m3)
    silt = exposure.silt if float(exposure.silt.values.max(initial=0.0)) > 0.0 else None
    photo = photograph(
        parts.scene, parts.camera, exposure.X_WC_true, silt, scenario.imaging, rng, grains, exposure.X_WC_before
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


def fingerprint(exposure: ExposureRecord) -> str:
    """Digest of all that a photograph's pixels hang on."""
    digest = hashlib.blake2b(digest_size=16)
    for X_WC in (*exposure.X_WC_true, *exposure.X_WC_before):
        digest.update(X_WC.p_m.tobytes() + X_WC.q.tobytes())
    silt = exposure.silt
    digest.update(np.array([silt.spacing_m, *silt.origin_W_m, *silt.values.shape]).tobytes() + silt.values.tobytes())
    return digest.hexdigest()


def photo_name(planned: str, scenario: Scenario) -> str:
    """File name of the photograph that a route calls `planned`, with the suffix of the scenario's format."""
    return Path(planned).with_suffix(".png" if scenario.imaging.photo_format == "png" else ".jpg").name


def write_image(path: Path, image: NDArray[np.uint8], jpeg_quality: int = 92) -> None:
    """Write an RGB image, shape (h, w, 3), uint8, whole or not at all, as its suffix says (.png or .jpg)."""
    options = [cv2.IMWRITE_JPEG_QUALITY, jpeg_quality] if path.suffix == ".jpg" else []
    with whole_file(path) as temporary:
        temporary.write_bytes(cv2.imencode(path.suffix, image[..., ::-1], options)[1].tobytes())


def _numbers(X_WC: Pose) -> list[str]:
    return [f"{value:.9f}" for value in (*X_WC.p_m, *X_WC.q)]
