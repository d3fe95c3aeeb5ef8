"""Photographs or a film and a dive's log to sharp photographs at even steps, with poses and their uncertainty."""

from __future__ import annotations

import math
import shutil
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from wakewise.core.arrays import Array, IntArray
from wakewise.core.errors import InputError
from wakewise.core.files import write_json, write_rows
from wakewise.core.geometry import Pose, euler_from_quat, quat_from_matrix
from wakewise.core.interfaces import Progress, no_progress
from wakewise.vision.photo_selection.clock_offset import ClockOffset, find_offset, predict_motion
from wakewise.vision.photo_selection.dive_track import (
    DiveTrack,
    InterpolatedPoses,
    camera_poses,
    mounted_camera,
    poses_at,
)
from wakewise.vision.photo_selection.photo_times import PhotoTime, name_time, photo_times
from wakewise.vision.photo_selection.picture_statistics import PictureStatistics, film_statistics, photo_statistics
from wakewise.vision.photo_selection.spacing import choose_spaced, path_length
from wakewise.vision.reconstruction.photos.photo_folder import SUFFIXES, photo_files, unread_photos
from wakewise.vision.reconstruction.photos.video_frames import is_film, write_frames

PHOTOS, CAMERAS, FIGURES, PICTURE = "photos", "cameras.csv", "picked.json", "track.png"
WINDOW_S = 54_000.0
"""Greatest difference of two clocks with a calendar: all time zones, and an hour more."""
DISTANCE_M = 1.5
"""Distance to the surface where neither the log nor the user states one."""
DEPTH_SIGMA_M, ATTITUDE_SIGMA_DEG = 0.05, 1.0
"""Standard deviations that are assumed of a pressure gauge, and of roll, pitch and heading."""
RULER_SHARE, WAY_STEP_S = 0.1, 0.2
"""Length of the ruler that the way is measured with, of a step; steps of time along the way."""
NOT_READ = "not read"
LEAST_TOLD = 0.5
"""Least correlation of the shift with which the field of view is known from motion."""
MOST_FOCAL_RATIO, NARROWEST_DEG, WIDEST_DEG, MOST_STEPS = 1.5, 25.0, 110.0, 1.5
"""Bounds of the warnings: focal length by motion over the stated one; field of view by motion where none is stated;
median of the picked photographs' spacing, in steps."""
_COLUMNS = (
    "name", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "roll_deg", "pitch_deg", "heading_deg", "sigma_x_m",
    "sigma_y_m", "sigma_z_m", "sigma_attitude_deg", "time_s", "altitude_m", "way_m", "sharpness",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True, eq=False)
class PickRequest:
    """What is to be picked: every `every_m` metres of the way, or so that neighbours overlap by `overlap_pct`.

    `offset_s`: to add to the camera's clock for the log's; found from motion if None. `window_s`: greatest offset that
    is tried. `interval_s`: from one photograph to the next, where nothing else says when they were taken. `X_BC`: the
    camera in the body. `distance_m`: to the surface where the log has no altitude. `field_of_view_deg`: across the
    picture, in water; found from motion if None. `position_sigma_m` and `drift_pct` (of the way flown) are standard
    deviations of the log's positions, where it states none.
    """

    every_m: float | None = 1.0
    overlap_pct: float | None = None
    offset_s: float | None = None
    window_s: float = WINDOW_S
    interval_s: float | None = None
    X_BC: Pose = field(default_factory=lambda: mounted_camera(np.zeros(3), 90.0))
    distance_m: float | None = None
    field_of_view_deg: float | None = None
    position_sigma_m: float = 0.1
    drift_pct: float = 1.0

    def __post_init__(self) -> None:
        if (self.every_m is None) == (self.overlap_pct is None):
            raise InputError("--every and --overlap: one of them says how far apart photos are picked")
        for option, value, low, high in (
            ("--every", self.every_m, 1e-3, 1e4),
            ("--overlap", self.overlap_pct, 0.0, 95.0),
            ("--offset", self.offset_s, -1e10, 1e10),
            ("--window", self.window_s, 1e-3, 1e10),
            ("--distance", self.distance_m, 0.01, 1e3),
            ("--fov", self.field_of_view_deg, 1.0, 179.0),
            ("--position-sigma", self.position_sigma_m, 0.0, 1e3),
            ("--drift", self.drift_pct, 0.0, 100.0),
        ):
            if value is not None and not low <= value <= high:
                raise InputError(f"{option} {value:g}: must be a number from {low:g} to {high:g}")


@dataclass(frozen=True, kw_only=True, eq=False)
class PickedPhotos:
    """Result: `rows` of cameras.csv, one for each chosen photograph; all figures; the track for a picture.

    `track_W_m`, shape (n, 3): camera's way between the first and the last photograph. `photos_W_m`, shape (m, 3): where
    all photographs within the log were taken; `chosen`: indices into them.
    """

    source: Path
    film: bool
    rows: list[tuple[Any, ...]]
    figures: dict[str, Any]
    track_W_m: Array
    photos_W_m: Array
    chosen: IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pictures:
    """Pictures that can be read, in the order of time, and why others were left out."""

    times: list[PhotoTime]
    statistics: PictureStatistics
    film: bool
    left_out: list[tuple[str, str]]


def check_folder(out: Path, photos: Path) -> None:
    """Refuse a folder for the results that holds anything else, or the photographs themselves.

    Raises InputError.
    """
    inside = photos.resolve()
    if out.exists() and not out.is_dir():
        raise InputError(f"--out {out}: a file is there, a folder is needed")
    if out.resolve() in (inside, *inside.parents) or inside in out.resolve().parents:
        raise InputError(
            f"--out {out}: the photos lie in it, or it in them; give another folder, the originals are never changed"
        )
    others = {path.name for path in out.iterdir()} - {PHOTOS, CAMERAS, FIGURES, PICTURE} if out.is_dir() else set()
    if others:
        raise InputError(f"--out {out}: holds {min(others)}, which would be lost; give another folder")


def pick_photos(
    photos: Path, track: DiveTrack, request: PickRequest, threads: int = 2, progress: Progress = no_progress
) -> PickedPhotos:
    """Choose photographs of a folder, or frames of a film, along a dive.

    Raises InputError if they have no times or do not overlap with the log, the offset of the clocks is ambiguous, or no
    photograph can be used.
    """
    pictures = _read_pictures(photos, request, threads, progress)
    calendar = pictures.times[0].calendar and track.started_s is not None
    zero_s = float(track.started_s or 0.0) if calendar else pictures.times[0].time_s
    time_s = np.array([one.time_s for one in pictures.times]) - zero_s
    offset, offset_s, sigma_s = None, request.offset_s, 0.0
    if offset_s is None:
        window = (-request.window_s, request.window_s) if calendar else None
        predicted = predict_motion(track, request.X_BC, request.distance_m or DISTANCE_M)
        offset = find_offset(predicted, time_s, pictures.statistics.motion, window, progress)
        if offset.ambiguous is not None:
            second = "" if offset.second_offset_s is None else f", next is {offset.second_offset_s:+.1f} s"
            raise InputError(
                f"clock offset is ambiguous: {offset.ambiguous}; best is {offset.offset_s:+.1f} s{second}; state it "
                "with --offset, or check that the log is of this dive"
            )
        offset_s, sigma_s = offset.offset_s, offset.sigma_s
    log_s = time_s + offset_s
    poses = poses_at(track, log_s)
    if not poses.known.any():
        raise InputError(
            f"photos and log do not overlap in time: photos from {log_s[0]:.0f} to {log_s[-1]:.0f} s of the log, which "
            f"goes from {track.time_s[0]:.0f} to {track.time_s[-1]:.0f} s; give another --offset"
        )
    dark, uniform = pictures.statistics.dark, pictures.statistics.uniform
    usable = poses.known & ~dark & ~uniform
    if not usable.any():
        raise InputError(f"{photos}: all {int(poses.known.sum())} photos within the log are dark or uniform")
    first_s, last_s = log_s[poses.known][[0, -1]]
    grid_s = np.linspace(first_s, last_s, max(int((last_s - first_s) / WAY_STEP_S), 1) + 1)
    along = poses_at(track, grid_s)
    # The vehicle's way: a camera ahead of it moves when it turns, too.
    way = path_length(along.position_W_m, RULER_SHARE * (request.every_m or 0.5))
    way_of = np.interp(log_s, grid_s, way)
    unit, step = way_of, request.every_m
    if step is None:
        step = 1.0 - float(request.overlap_pct or 0.0) / 100.0
        unit = np.interp(log_s, grid_s, _in_footprints(along, request, offset, pictures.statistics, way))
    chosen = choose_spaced(unit, pictures.statistics.sharpness, usable, step)
    if len(chosen) < 2:
        raise InputError(
            f"the way along the usable photos within the log is {np.ptp(way_of[usable]):.2f} m, shorter than a step; "
            "give less --every or more --overlap, or a log whose positions move"
        )
    centres, R_WC = camera_poses(poses, request.X_BC)
    sigma_m, sigma_deg = _sigmas(track, request, pictures.times, sigma_s, log_s, way_of)
    degrees = np.degrees(euler_from_quat(poses.q_WB))
    rows = [
        (
            pictures.times[k].name,
            *(f"{value:.4f}" for value in centres[k]),
            *(f"{value:.6f}" for value in quat_from_matrix(R_WC[k])),
            *(f"{value:.2f}" for value in degrees[k]),
            *(f"{value:.4f}" for value in sigma_m[k]),
            f"{sigma_deg[k]:.2f}",
            f"{log_s[k]:.3f}",
            "" if np.isnan(poses.altitude_m[k]) else f"{poses.altitude_m[k]:.3f}",
            f"{way_of[k]:.3f}",
            f"{pictures.statistics.sharpness[k]:.4f}",
        )
        for k in chosen
    ]
    left_out = pictures.left_out + [
        (one.name, why)
        for one, known, is_dark, is_uniform in zip(pictures.times, poses.known, dark, uniform, strict=True)
        if (why := "outside the log" if not known else "dark" if is_dark else "uniform" if is_uniform else "")
    ]
    warnings = _not_read([name for name, why in left_out if why == NOT_READ]) + _units(request, track, offset)
    steps = float(np.median(np.diff(unit[chosen]))) / step
    if steps > MOST_STEPS:
        warnings.append(
            f"the picked photos are {steps:.1f} steps apart (median): fewer usable ones were taken than are asked for, "
            "or positions are in another unit than metres"
        )
    inside = np.flatnonzero(poses.known)
    gaps = np.diff(way_of[chosen])
    jump = int(np.argmax(np.diff(log_s))) if len(log_s) > 1 else 0
    figures = {
        "log": track.name,
        "positions_from": track.positions_from,
        "times_from": pictures.times[0].source,
        "film": pictures.film,
        "offset": _told_offset(offset, offset_s, sigma_s, calendar=calendar),
        "every_m": request.every_m,
        "overlap_pct": request.overlap_pct,
        "way_m": float(np.ptp(way_of[inside])),
        "counts": {
            "photos": len(pictures.times) + len(pictures.left_out),
            **{why.replace(" ", "_"): count for why, count in sorted(Counter(why for _, why in left_out).items())},
            "usable": int(usable.sum()),
            "picked": len(chosen),
        },
        "warnings": warnings,
        "longest_pause_s": float(np.diff(log_s).max()),
        "longest_pause_after": pictures.times[jump].name,
        "spacing_median_m": float(np.median(gaps)) if len(gaps) else None,
        "spacing_max_m": float(gaps.max()) if len(gaps) else None,
        "uncertainty_from": "the log" if track.sigma_m is not None else "assumed",
        "assumed": {
            "position_sigma_m": request.position_sigma_m,
            "drift_pct": request.drift_pct,
            "depth_sigma_m": DEPTH_SIGMA_M,
            "attitude_sigma_deg": ATTITUDE_SIGMA_DEG,
        },
        "left_out": [{"name": name, "why": why} for name, why in left_out],
    }
    return PickedPhotos(
        source=photos,
        film=pictures.film,
        rows=rows,
        figures=figures,
        track_W_m=camera_poses(along, request.X_BC)[0],
        photos_W_m=centres[inside],
        chosen=np.searchsorted(inside, chosen),
    )


def write_picked(picked: PickedPhotos, folder: Path, link: bool = False, progress: Progress = no_progress) -> None:
    """Write the chosen photographs (copies, or symbolic links), cameras.csv and picked.json into an empty folder."""
    target = folder / PHOTOS
    target.mkdir()
    names = [str(row[0]) for row in picked.rows]
    if picked.film:
        numbers = {int(Path(name).stem.removeprefix("frame_")) for name in names}
        write_frames(picked.source, target, numbers, progress, max(numbers) + 1)
    for name in [] if picked.film else names:
        place = target / name
        place.parent.mkdir(parents=True, exist_ok=True)
        if link:
            place.symlink_to((picked.source / name).resolve())
        else:
            shutil.copy2(picked.source / name, place)
    write_rows(folder / CAMERAS, [_COLUMNS, *picked.rows])
    write_json(folder / FIGURES, picked.figures)


def _read_pictures(photos: Path, request: PickRequest, threads: int, progress: Progress) -> _Pictures:
    if is_film(photos):
        statistics, numbers, at_s = film_statistics(photos, progress)
        began = name_time(photos.name)
        calendar = began is not None
        start_s = began[0] if began is not None else 0.0
        times = [
            PhotoTime(
                name=f"frame_{k:06d}.jpg", time_s=start_s + float(at), source="frame", calendar=calendar, step_s=0.0
            )
            for k, at in zip(numbers, at_s, strict=True)
        ]
        return _Pictures(times=times, statistics=statistics, film=True, left_out=[])
    if not photos.is_dir():
        raise InputError(f"{photos}: is no folder of photos ({', '.join(SUFFIXES)}) and no film")
    files = photo_files(photos)
    others = unread_photos(photos)
    if len(files) < 2:
        rest = "; ".join(["", *_not_read([path.name for path in others])])
        raise InputError(f"{photos}: holds {len(files)} photos ({', '.join(SUFFIXES)}), at least 2 are needed{rest}")
    times, missing = photo_times(photos, files, request.interval_s)
    statistics, read = photo_statistics([photos / one.name for one in times], threads, progress)
    if len(read) < 2:
        raise InputError(f"{photos}: {len(read)} of {len(files)} photos can be read, at least 2 are needed")
    unread = [(one.name, "unreadable") for k, one in enumerate(times) if k not in set(read)]
    left_out = [(path.relative_to(photos).as_posix(), NOT_READ) for path in others]
    left_out += [(name, "without time") for name in missing] + unread
    return _Pictures(times=[times[k] for k in read], statistics=statistics, film=False, left_out=left_out)


def _not_read(names: list[str]) -> list[str]:
    """What to do about photographs of a kind that is not read, in lines by kind."""
    kinds = Counter(Path(name).suffix for name in names)
    return [f"{count} {kind} are not read: convert them to JPEG" for kind, count in sorted(kinds.items())]


def _units(request: PickRequest, track: DiveTrack, offset: ClockOffset | None) -> list[str]:
    """A warning where the field of view by motion cannot be that of the camera: shift is speed over distance."""
    known = request.distance_m is not None or bool(np.isfinite(track.altitude_m).any())
    if not known or offset is None or offset.correlation["shift"] < LEAST_TOLD or offset.focal_widths <= 0.0:
        return []
    found_deg = 2.0 * math.degrees(math.atan(0.5 / offset.focal_widths))
    said = f"the field of view by motion is {found_deg:.0f} deg"
    ask = "are positions or altitudes in another unit than metres?"
    stated_deg = request.field_of_view_deg
    if stated_deg is not None:
        ratio = offset.focal_widths * 2.0 * math.tan(math.radians(stated_deg / 2.0))
        if max(ratio, 1.0 / ratio) > MOST_FOCAL_RATIO:
            return [f"{said}, --fov states {stated_deg:g} deg: {ask}"]
    elif not NARROWEST_DEG <= found_deg <= WIDEST_DEG:
        return [f"{said}, that of a camera is {NARROWEST_DEG:g} to {WIDEST_DEG:g}: {ask}"]
    return []


def _told_offset(offset: ClockOffset | None, offset_s: float, sigma_s: float, *, calendar: bool) -> dict[str, Any]:
    """The offset as plain values; with calendars also in whole hours and the rest."""
    told: dict[str, Any] = {"offset_s": offset_s, "sigma_s": sigma_s, "from": "motion" if offset else "given"}
    if calendar:
        hours = round(offset_s / 3600.0)
        told |= {"whole_hours": hours, "rest_s": offset_s - 3600.0 * hours}
    return told | (asdict(offset) if offset is not None else {})


def _in_footprints(
    along: InterpolatedPoses,
    request: PickRequest,
    offset: ClockOffset | None,
    statistics: PictureStatistics,
    way: Array,
) -> Array:
    """The way, shape (n,), in units of the ground that the picture's shorter side shows."""
    if request.field_of_view_deg is not None:
        focal_widths = 0.5 / math.tan(math.radians(request.field_of_view_deg / 2.0))
    elif offset is not None and offset.correlation["shift"] > LEAST_TOLD:
        focal_widths = offset.focal_widths
    else:
        raise InputError("--overlap: the field of view is not known from motion; state it with --fov DEG, in water")
    depth = along.altitude_m / np.maximum(camera_poses(along, request.X_BC)[1][:, 2, 2], 0.3)
    good = np.isfinite(depth)
    if not good.any() and request.distance_m is None:
        raise InputError("--overlap: the log holds no altitude (rangefinder); state the distance with --distance M")
    number = np.arange(len(way))
    depth = np.interp(number, number[good], depth[good]) if good.any() else np.full(len(way), request.distance_m)
    size = np.median(statistics.size_px, axis=0)
    footprint = np.maximum(depth, 0.1) / focal_widths * float(size.min() / size[0])
    steps = np.diff(way) / (0.5 * (footprint[1:] + footprint[:-1]))
    return np.concatenate([[0.0], np.cumsum(steps)])


def _sigmas(
    track: DiveTrack, request: PickRequest, times: list[PhotoTime], sigma_s: float, log_s: Array, way: Array
) -> tuple[Array, Array]:
    """Standard deviations of positions, shape (n, 3) in m, and of the attitude, shape (n,) in deg.

    The time's standard deviation (of the offset and of the clock's step) counts with the vehicle's speed and rate.
    """
    late = np.sqrt(sigma_s**2 + np.array([one.step_s for one in times]) ** 2 / 12.0)
    before, after = poses_at(track, log_s - 0.5), poses_at(track, log_s + 0.5)
    speed = np.abs(after.position_W_m - before.position_W_m)
    turn = np.degrees(2.0 * np.arccos(np.clip(np.abs((before.q_WB * after.q_WB).sum(axis=1)), 0.0, 1.0)))
    if track.sigma_m is None:
        flat = np.hypot(request.position_sigma_m, 0.01 * request.drift_pct * way)
        base = np.column_stack([flat, flat, np.full(len(way), DEPTH_SIGMA_M)])
    else:
        base = np.column_stack([np.interp(log_s, track.time_s, column) for column in track.sigma_m.T])
    return np.hypot(base, speed * late[:, None]), np.hypot(ATTITUDE_SIGMA_DEG, turn * late)
