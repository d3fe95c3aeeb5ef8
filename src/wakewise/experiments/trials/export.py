"""A trial's folder as files that other tools open: reads the folder, and hands arrays to `experiments.exports`."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from wakewise.core.arrays import Array
from wakewise.core.errors import InputError, MissingExtra
from wakewise.core.files import whole_folder
from wakewise.core.optional_dependencies import need
from wakewise.experiments.exports import (
    GeodeticOrigin,
    Photographs,
    SparsePoints,
    ThrustRecord,
    Trajectory,
    read_points,
    write_colmap,
    write_nerfstudio,
    write_plan,
    write_tum,
)
from wakewise.experiments.exports.training_data import (
    HELD_OUT_ONE_IN,
    UNDISTORTED,
    WaterAttenuation,
    held_out_names,
    undistorted,
    write_dense,
)

EXPORTS = ("nerfstudio", "colmap", "tum", "rosbag2", "qgc-plan")
"""What a trial can be exported to."""
POSES = {"true": "true", "estimated": "est"}
"""Whose poses, and how columns of theirs begin."""
_POSE = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
_CAMERA = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
_WRENCH = ("X_N", "Y_N", "Z_N", "K_Nm", "M_Nm", "N_Nm")


@dataclass(frozen=True, kw_only=True)
class ExportResult:
    """What was written, and where; `water` of nerfstudio and colmap only."""

    to: str
    path: Path
    holds: dict[str, int]
    water: WaterAttenuation | None = None


def export_trial(
    folder: Path,
    to: str,
    *,
    out: Path | None = None,
    poses: str = "true",
    origin: GeodeticOrigin | None = None,
    held_out: int | None = None,
    seed: int | None = None,
) -> ExportResult:
    """Export a trial.

    `out` is a folder (qgc-plan: a file), `export/` in the trial's folder if not given; one that holds something is
    refused. `poses`, of nerfstudio and colmap, are "true" ones with the true camera or "estimated" ones with the camera
    as estimated on board; the others hold both, as far as they are there. `origin`, of qgc-plan, is where the world's
    origin lies. Of nerfstudio and colmap, one photograph in `held_out` (8) is held out from training, drawn by `seed`
    (0); 0 holds none out.

    Raises InputError if a word is not known, or the folder lacks what is asked for. Raises MissingExtra if rosbag2 is
    asked for and rosbags is not installed.
    """
    if to not in EXPORTS:
        raise InputError(f"--to: '{to}', allowed are {', '.join(EXPORTS)}, dataset and, for a vehicle, auv_controllers")
    if poses not in POSES:
        raise InputError(f"--poses: '{poses}', allowed are {', '.join(POSES)}")
    if to == "rosbag2":
        need("wakewise export --to rosbag2", "ros")
    if not folder.is_dir():
        raise InputError(f"{folder}: {'is a file' if folder.exists() else 'no such folder'}; give a trial's folder")
    if (folder / "reconstruction.json").is_file() and not (folder / "scenario.yaml").is_file():
        raise InputError(f"{folder}: is a model of photographs, no trial; its COLMAP model is in {folder / 'sparse'}")
    if to == "qgc-plan":
        return _plan(folder, out or folder / "export" / "route.plan", origin)
    if origin is not None:
        raise InputError(f"--origin: goes with --to qgc-plan only, not with {to}")
    if (held_out is not None or seed is not None) and to not in ("nerfstudio", "colmap"):
        raise InputError(f"--held-out, --seed: go with --to nerfstudio and colmap only, not with {to}")
    path = out or folder / "export" / to
    if path.exists() and not path.is_dir():
        raise InputError(f"--out {path}: is a file, must be a folder that does not exist yet, or an empty one")
    if out is not None and path.is_dir() and any(path.iterdir()):
        raise InputError(f"--out {path}: is not empty; give a folder that does not exist yet")
    make: dict[str, Callable[[Path, Path], dict[str, int]]] = {"tum": _tum, "rosbag2": _bag}
    if to in make:
        return ExportResult(to=to, path=path, holds=make[to](folder, path))
    one_in = HELD_OUT_ONE_IN if held_out is None else held_out
    return _training_data(folder, path, to, poses, one_in, seed or 0)


def _tum(folder: Path, path: Path) -> dict[str, int]:
    bodies, cameras = _bodies(_steps(folder)), _cameras(folder)
    with whole_folder(path) as temporary:
        for who, track in bodies.items():
            write_tum(temporary / f"{who}.txt", track, f"{who} pose of the vehicle, forward-right-down")
        for who, track in cameras.items():
            write_tum(temporary / f"camera_{who}.txt", track, f"{who} pose of the camera, right-down-forward")
    return {"poses": _most(bodies), "camera_poses": _most(cameras)}


def _bag(folder: Path, path: Path) -> dict[str, int]:
    from wakewise.experiments.exports import write_bag

    steps = _steps(folder)
    bodies, telemetry = _found(steps), _telemetry(steps)
    if telemetry is None:
        bodies = _bodies(steps)
    cameras = _cameras(folder)
    who = next((name for name in ("estimated", "true") if name in cameras), None)
    photographs = None if who is None else _photographs_of(folder, who)
    with whole_folder(path) as temporary:
        # A bag makes its own folder, whose name its file bears.
        inner = temporary / path.name
        messages = write_bag(inner, bodies, telemetry, cameras, photographs)
        for file in sorted(inner.iterdir()):
            file.rename(temporary / file.name)
        inner.rmdir()
    return {"messages": messages, "photographs": 0 if photographs is None else len(photographs.files)}


def _training_data(folder: Path, path: Path, to: str, poses: str, one_in: int, seed: int) -> ExportResult:
    photographs = _photographs_of(folder, poses)
    names = [file.name for file in photographs.files]
    judged = held_out_names(names, one_in, seed)
    water = _known_water(folder) if poses == "true" else _estimated_water(folder, names)
    cloud: SparsePoints | None = None
    with suppress(FileNotFoundError):
        cloud = read_points(folder / "sparse" / "points3D.bin")
    holds = {"photographs": len(names), "points": 0 if cloud is None else len(cloud.points_W_m)}
    z_up = to == "nerfstudio"
    dense = "dense_pc.ply" if z_up else "dense.ply"
    with whole_folder(path) as temporary:
        flat = undistorted(photographs, cloud, temporary / UNDISTORTED)
        if to == "colmap":
            holds["observations"] = write_colmap(temporary, photographs, cloud, judged)
            write_colmap(temporary / UNDISTORTED, *flat, judged)
        else:
            write_nerfstudio(temporary, photographs, cloud, judged)
            write_nerfstudio(temporary / UNDISTORTED, *flat, judged)
        there = (folder / "dense.ply").is_file()
        holds["dense_points"] = write_dense(folder / "dense.ply", temporary / dense, z_up=z_up) if there else 0
        holds |= {"train": len(names) - len(judged), "held_out": len(judged)}
        silt = _silt_per_m(folder)
        facts = {
            "format": to,
            "poses": poses,
            "world": "m; x north, y west, z up" if z_up else "m; x north, y east, z down",
            "undistorted": UNDISTORTED,
            "dense": dense if there else None,
            **holds,
            "split": {"one_in": one_in, "seed": seed, "held_out": list(judged)},
            "water": water.figures(),
            "views": [{"name": name, "held_out": name in judged, "silt_per_m": silt.get(name)} for name in names],
            "why": {} if there else {"dense": f"{folder} holds no dense.ply"},
        }
        (temporary / "export.json").write_text(json.dumps(facts, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return ExportResult(to=to, path=path, holds=holds, water=water)


def _known_water(folder: Path) -> WaterAttenuation:
    """Optics of the clear water that the trial was rendered with; silt is given by photograph."""
    from wakewise.operation import read_scenario

    try:
        water = read_scenario(folder / "scenario.yaml").imaging.water()
    except InputError as fault:
        return WaterAttenuation(source=None, why=str(fault))
    return WaterAttenuation(
        source="trial", attenuation_per_m=water.signal_per_m, veil_per_m=water.veil_per_m, veil=water.veil
    )


def _estimated_water(folder: Path, names: list[str]) -> WaterAttenuation:
    """Optics fitted to the photographs and the ranges of the trial's own model."""
    try:
        need("the water of photographs", "photos")
        from wakewise.vision.texturing.photo_colours import estimate_water

        fit, why = estimate_water(folder / "images", names, folder)
    except MissingExtra as fault:
        return WaterAttenuation(source=None, why=str(fault))
    if fit is None:
        return WaterAttenuation(source=None, why=why)
    return WaterAttenuation(
        source="estimated", attenuation_per_m=fit.signal_per_m, veil_per_m=fit.veil_per_m, veil=fit.veil
    )


def _silt_per_m(folder: Path) -> dict[str, float]:
    """Mean beam attenuation by silt between camera and target, 1/m, by photograph; of rendered photographs only."""
    table = _images(folder)
    if "turbidity_per_m" not in table.columns:
        return {}
    values = table["turbidity_per_m"].cast(pl.Float64, strict=False)
    return {
        Path(name).name: value
        for name, value in zip(table["name"], values, strict=True)
        if value is not None and np.isfinite(value)
    }


def _plan(folder: Path, path: Path, origin: GeodeticOrigin | None) -> ExportResult:
    if origin is None:
        raise InputError("--origin: missing; qgc-plan needs LAT,LON in degrees of where the world's origin lies")
    if path.is_dir():
        raise InputError(f"--out {path}: is a folder, must be a file such as route.plan")
    steps = _steps(folder)
    shot = (
        steps.filter(pl.col("exposing").cast(pl.Boolean, strict=False))
        if "exposing" in steps.columns
        else steps.clear()
    )
    route = _track(shot, "goal")
    if route is None:
        raise InputError(f"{folder / 'steps.parquet'}: no photograph was taken, so there are no waypoints to make")
    write_plan(path, route, origin, _speed_m_s(steps))
    return ExportResult(to="qgc-plan", path=path, holds={"waypoints": len(route.times_s)})


def _speed_m_s(steps: pl.DataFrame) -> float:
    """The median of the speeds that were asked for while the vehicle was to move; a tenth where none is known."""
    speeds = np.linalg.norm(_numbers(steps, [f"goal_{axis}_m_s" for axis in "uvw"]), axis=1)
    moving = speeds[speeds > 1e-3]
    return float(np.median(moving)) if len(moving) else 0.1


def _steps(folder: Path) -> pl.DataFrame:
    path = folder / "steps.parquet"
    if not path.is_file():
        raise InputError(f"{folder}: holds no steps.parquet; give the folder of a trial that has been flown")
    try:
        steps = pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError):
        raise InputError(f"{path}: is no Parquet file that can be read") from None
    lacking = [name for name in ("time_s", *(f"est_{what}" for what in _POSE)) if name not in steps.columns]
    if lacking or not steps.height:
        told = f"lacks the column {lacking[0]}" if lacking else "holds no step"
        raise InputError(f"{path}: {told}; it must be that of a flight")
    return steps.sort("time_s")


def _numbers(table: pl.DataFrame, columns: list[str]) -> Array:
    """Rows of numbers, shape (n, columns): those in which one is missing or not finite are left out."""
    if not set(columns) <= set(table.columns):
        return np.zeros((0, len(columns)))
    numbers = table.select(pl.col(columns).cast(pl.Float64, strict=False)).to_numpy()
    return numbers[np.isfinite(numbers).all(axis=1)]


def _track(table: pl.DataFrame, begins: str) -> Trajectory | None:
    """Poses of a table whose columns begin so, rows without a pose left out; None if none is left."""
    numbers = _numbers(table, ["time_s", *(f"{begins}_{what}" for what in _POSE)])
    return Trajectory(times_s=numbers[:, 0], p_W_m=numbers[:, 1:4], q=numbers[:, 4:]) if len(numbers) else None


def _found(table: pl.DataFrame) -> dict[str, Trajectory]:
    tracks = {who: _track(table, begins) for who, begins in POSES.items()}
    return {who: track for who, track in tracks.items() if track is not None}


def _bodies(steps: pl.DataFrame) -> dict[str, Trajectory]:
    found = _found(steps)
    if not found:
        raise InputError("steps.parquet: holds neither true nor estimated poses that are numbers")
    return found


def _cameras(folder: Path) -> dict[str, Trajectory]:
    return _found(_images(folder)) if (folder / "images.csv").is_file() else {}


def _most(tracks: dict[str, Trajectory]) -> int:
    return max((len(track.times_s) for track in tracks.values()), default=0)


def _telemetry(steps: pl.DataFrame) -> ThrustRecord | None:
    count = sum(name.startswith("thrust_") for name in steps.columns)
    columns = ["time_s", *(f"thrust_{k + 1}_N" for k in range(count)), *(f"wrench_{axis}" for axis in _WRENCH)]
    numbers = _numbers(steps, columns)
    if not count or not len(numbers):
        return None
    return ThrustRecord(times_s=numbers[:, 0], thrusts_N=numbers[:, 1:-6], wrenches_B=numbers[:, -6:])


def _images(folder: Path) -> pl.DataFrame:
    path = folder / "images.csv"
    if not path.is_file():
        raise InputError(f"{folder}: holds no images.csv; give the folder of a trial with photographs")
    try:
        table = pl.read_csv(path, schema_overrides={"name": pl.String})
    except (OSError, pl.exceptions.PolarsError):
        raise InputError(f"{path}: is no table that can be read") from None
    if not {"name", "time_s"} <= set(table.columns) or not table.height or table["name"].null_count():
        raise InputError(f"{path}: must hold photographs, each with name and time_s")
    return table.sort("time_s")


def _photographs_of(folder: Path, poses: str) -> Photographs:
    table = _images(folder)
    track = _track(table, POSES[poses])
    if track is None or len(track.times_s) != table.height:
        other = next(who for who in POSES if who != poses)
        raise InputError(f"{folder / 'images.csv'}: not all photographs have {poses} poses; try --poses {other}")
    files = tuple(folder / "images" / Path(name).name for name in table["name"])
    lost = next((file for file in files if not file.is_file()), None)
    if lost is not None:
        raise InputError(f"{lost}: listed in images.csv but not there")
    width, height, params = _true_camera(folder) if poses == "true" else _known_camera(folder)
    return Photographs(files=files, track=track, width=width, height=height, params=params)


def _true_camera(folder: Path) -> tuple[int, int, Array]:
    path = folder / "camera.json"
    try:
        told: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return int(told["width"]), int(told["height"]), np.array([float(told[name]) for name in _CAMERA])
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist, so the true camera is not known; try --poses estimated") from None
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{path}: must be JSON with width, height, {', '.join(_CAMERA)}") from None


def _known_camera(folder: Path) -> tuple[int, int, Array]:
    from wakewise.vision.reconstruction.photos.lenses import read_lens

    lens = read_lens(folder / "cameras.txt")
    return lens.width, lens.height, lens.params
