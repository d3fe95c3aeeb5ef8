"""A made-up dive: a track over a flat textured bed, its photographs by a camera that looks down, and its log."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter1d

from wakewise.core.geometry import matrix_from_quat, quat_from_euler
from wakewise.vision.photo_selection.dive_track import DiveTrack, mounted_camera, poses_at

START_S = 1_700_000_000.0
RATE_HZ = 10.0
WIDTH, HEIGHT, FOCAL_PX = 320, 240, 280.0
TILE_PX, TILE_M = 1024, 6.0


@dataclass(frozen=True)
class Dive:
    """True poses at `RATE_HZ`."""

    track: DiveTrack
    bed: NDArray[np.uint8]
    tilt_deg: float = 90.0

    def picture(self, time_s: float) -> NDArray[np.uint8]:
        """Photograph at a time of the log."""
        poses = poses_at(self.track, np.array([time_s]))
        R_WC = matrix_from_quat(poses.q_WB[0]) @ mounted_camera(np.zeros(3), self.tilt_deg).R
        K = np.array([[FOCAL_PX, 0, WIDTH / 2], [0, FOCAL_PX, HEIGHT / 2], [0, 0, 1]])
        size = TILE_M / TILE_PX
        # Columns of the tile go east, rows north, at depth 0.
        to_world = np.array([[0, size, 0.0], [size, 0, 0.0], [0, 0, 0.0]])
        to_world[:, 2] = -poses.position_W_m[0]
        to_picture = K @ R_WC.T @ to_world
        flags = cv2.INTER_LINEAR
        return cv2.warpPerspective(self.bed, to_picture, (WIDTH, HEIGHT), flags=flags, borderMode=cv2.BORDER_WRAP)


def dive(seed: int, seconds: float = 120.0) -> Dive:
    """Legs of some 4 m about 1 m above the bed, with the speed, heading and attitude of a vehicle flown by hand."""
    rng = np.random.default_rng(seed)
    n = int(seconds * RATE_HZ) + 1

    def wobble(size: float, over_s: float) -> NDArray[np.float64]:
        smooth = gaussian_filter1d(rng.normal(size=n + 200), over_s * RATE_HZ)[100:-100]
        return size * smooth / smooth.std()

    time_s = np.arange(n) / RATE_HZ
    legs = np.floor(time_s / 18.0) % 4
    heading = gaussian_filter1d(np.cumsum(np.concatenate([[0.0], np.diff(legs) != 0])) * np.pi / 2, 1.2 * RATE_HZ)
    heading = heading + rng.uniform(-np.pi, np.pi) + wobble(0.06, 1.0)
    speed = np.clip(0.25 + wobble(0.07, 1.5), 0.02, 0.6)
    roll, pitch = wobble(0.03, 0.7), wobble(0.03, 0.7)
    north = np.cumsum(speed * np.cos(heading)) / RATE_HZ
    east = np.cumsum(speed * np.sin(heading)) / RATE_HZ
    down = -1.0 + wobble(0.06, 3.0)
    track = DiveTrack(
        name="made",
        time_s=time_s,
        position_W_m=np.column_stack([north, east, down]),
        q_WB=quat_from_euler(roll, pitch, heading),
        altitude_m=-down,
        positions_from="the table",
        started_s=START_S,
    )
    fine = cv2.GaussianBlur(rng.normal(size=(TILE_PX, TILE_PX)), (0, 0), 1.0)
    coarse = cv2.GaussianBlur(rng.normal(size=(TILE_PX, TILE_PX)), (0, 0), 5.0)
    bed = fine / fine.std() + coarse / coarse.std()
    return Dive(track, np.clip(120 + 35 * bed, 0, 255).astype(np.uint8))


def write_table(path: Path, made: Dive, moved_s: float = 0.0) -> Path:
    """The dive as a table of poses, its clock moved."""
    from wakewise.core.geometry import euler_from_quat

    track = made.track
    columns = [START_S + moved_s + track.time_s, *track.position_W_m.T]
    columns += [*np.degrees(euler_from_quat(track.q_WB)).T, track.altitude_m]
    lines = [",".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True)]
    path.write_text("\n".join(["time_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,altitude_m", *lines]) + "\n")
    return path


def write_photos(
    folder: Path,
    made: Dive,
    offset_s: float,
    seed: int = 0,
    every_s: float = 1.0,
    exif: bool = True,
    parts: bool = True,
) -> list[float]:
    """Photographs at nearly even times, one in five blurred, two dark, by a clock that is `offset_s` behind the log's.

    Without `exif` nothing says when; without `parts` the clock counts whole seconds. True times in the log.
    """
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    end_s = float(made.track.time_s[-1])
    times = np.arange(3.0, end_s - 3.0, every_s)
    times = times + rng.uniform(-0.1, 0.1, len(times))
    for k, time_s in enumerate(times):
        picture = made.picture(float(time_s)).astype(np.float64)
        if k % 5 == 2:
            picture = cv2.GaussianBlur(picture, (0, 0), 3.0)
        if k in (10, 11):
            picture = 0.03 * picture
        picture += rng.normal(scale=2.0, size=picture.shape)
        image = Image.fromarray(np.clip(picture, 0, 255).astype(np.uint8)).convert("RGB")
        tags = Image.Exif()
        if exif:
            taken = datetime.fromtimestamp(START_S + float(time_s) - offset_s, tz=UTC)
            more = tags.get_ifd(0x8769)
            more[0x9003] = taken.strftime("%Y:%m:%d %H:%M:%S")
            if parts:
                more[0x9291] = f"{taken.microsecond // 1000:03d}"
        image.save(folder / f"P{k:04d}.jpg", quality=92, exif=tags)
    return [float(t) for t in times]
