"""What stays of a trial for a page to show: three photographs, and points of its model with their errors."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import polars as pl

from wakewise.core.errors import InputError, StageError
from wakewise.core.files import whole_file, write_json
from wakewise.scene.targets import Target
from wakewise.vision.evaluation import Crop, compare_surface
from wakewise.vision.image_decoding import read_picture
from wakewise.vision.reconstruction import read_cloud

PICTURES_AT_S = (0.0, 5.0, 10.0)
"""After the first photograph, as the paper shows before and after."""
WIDE_PX, POINTS = 480, 40_000
MODEL = "model.npz"


def keep_pictures(target: Target, trial: Path, folder: Path) -> None:
    """Of a trial's folder, keep in another what a page shows; nothing of a trial without photographs."""
    _keep_model(target, trial, folder)
    _keep_photographs(trial, folder)


def photographs_of(folder: Path) -> list[tuple[float, Path]]:
    """Times after the first photograph and files that a scan left."""
    try:
        listed = json.loads((folder / "photographs.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return [(float(one["after_s"]), folder / one["file"]) for one in listed]


def _keep_model(target: Target, place: Path, folder: Path) -> None:
    """Points of the model with their errors in mm, thinned, for a picture; nothing where there is no model."""
    if not (place / "dense.ply").is_file():
        return
    try:
        compared = compare_surface(
            read_cloud(place / "dense.ply").points_m, target.mesh, crop=Crop(bed_z_m=target.bed_z_m)
        )
    except (StageError, InputError, OSError):
        return
    every = max(1, len(compared.points_W_m) // POINTS)
    points_m, error_mm = (column[::every].astype(np.float32) for column in (compared.points_W_m, compared.error_mm))
    with whole_file(folder / MODEL) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, points_m=points_m, error_mm=error_mm)


def _keep_photographs(place: Path, folder: Path) -> None:
    """The photographs nearest to `PICTURES_AT_S`, small."""
    if not (place / "images.csv").is_file():
        return
    listed = pl.read_csv(place / "images.csv").sort("time_s")
    if listed.is_empty():
        return
    times = listed["time_s"].to_numpy() - float(listed["time_s"][0])
    kept = []
    for desired in PICTURES_AT_S:
        row = int(np.argmin(np.abs(times - desired)))
        image = read_picture(place / "images" / listed["name"][row])
        if image is None:
            continue
        size = (WIDE_PX, round(WIDE_PX * image.shape[0] / image.shape[1]))
        name = f"photograph-{desired:g}s.jpg"
        coded = cv2.imencode(".jpg", cv2.resize(image, size, interpolation=cv2.INTER_AREA))[1]
        with whole_file(folder / name) as temporary:
            temporary.write_bytes(coded.tobytes())
        kept.append({"after_s": float(times[row]), "file": name})
    write_json(folder / "photographs.json", kept)
