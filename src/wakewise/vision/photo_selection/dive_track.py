"""Where a vehicle was at each time of a dive: a table of poses, whichever log it comes from.

Frames: world W is NED, body B is FRD, camera C has OpenCV's axes (right, down, ahead).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wakewise.core import plugins
from wakewise.core.arrays import Array, BoolArray, freeze
from wakewise.core.csv_separators import csv_rows
from wakewise.core.errors import InputError
from wakewise.core.geometry import Pose, matrix_from_quat, quat_from_euler

LONGEST_GAP_S = 2.0
"""Poses are interpolated across gaps up to this."""
SINCE_1970_S = 1e8
"""Times of a table above this are seconds since 1970, those below are of a clock of their own."""
LATEST_S, FASTEST_M_S = 1e10, 20.0
"""Later times are not in seconds. Faster positions, in the median while the vehicle moves, are not in metres."""
_POSE = ("time_s", "x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "heading_deg")
_SIGMAS = ("sigma_x_m", "sigma_y_m", "sigma_z_m")
_NEEDED = f"a table with columns {', '.join(_POSE)}, optionally altitude_m and {', '.join(_SIGMAS)}"
# Columns of QGroundControl's telemetry table.
_QGROUNDCONTROL = ("Timestamp", "roll", "pitch", "heading")


@dataclass(frozen=True, kw_only=True, eq=False)
class DiveTrack:
    """Poses of a vehicle: times, shape (n,), rising, in s; positions in NED, shape (n, 3); q_WB, shape (n, 4).

    `altitude_m`, shape (n,), is the height above the bed by a rangefinder, NaN where unknown. `started_s` is the time 0
    in seconds since 1970, None where the log has no calendar. `positions_from` says what measured the positions.
    `sigma_m`, shape (n, 3), holds their standard deviations where the log states them.
    """

    name: str
    time_s: Array
    position_W_m: Array
    q_WB: Array
    altitude_m: Array
    positions_from: str
    started_s: float | None = None
    sigma_m: Array | None = None

    def __post_init__(self) -> None:
        n = len(self.time_s)
        if n < 2 or not (np.diff(self.time_s) > 0.0).all():
            raise InputError(f"{self.name}: {n} poses with a time, at least 2 with rising times are needed")
        freeze(self, time_s=(n,), position_W_m=(n, 3), q_WB=(n, 4))
        self.altitude_m.setflags(write=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class InterpolatedPoses:
    """Poses at some times: `known`, shape (m,), is false outside the log and in its gaps."""

    known: BoolArray
    position_W_m: Array
    q_WB: Array
    altitude_m: Array


def poses_at(track: DiveTrack, time_s: Array) -> InterpolatedPoses:
    """Poses of the vehicle at times, shape (m,), of the log's clock, on straight lines between the log's poses."""
    at, n = track.time_s, len(track.time_s)
    after = np.clip(np.searchsorted(at, time_s), 1, n - 1)
    span = at[after] - at[after - 1]
    known = (time_s >= at[0]) & (time_s <= at[-1]) & (span <= LONGEST_GAP_S)
    share = np.clip((time_s - at[after - 1]) / span, 0.0, 1.0)[:, None]
    first, last = track.q_WB[after - 1], track.q_WB[after]
    last = np.where((first * last).sum(axis=1, keepdims=True) < 0.0, -last, last)
    q_WB = (1.0 - share) * first + share * last
    q_WB /= np.linalg.norm(q_WB, axis=1, keepdims=True)
    place = (1.0 - share) * track.position_W_m[after - 1] + share * track.position_W_m[after]
    return InterpolatedPoses(known=known, position_W_m=place, q_WB=q_WB, altitude_m=_altitudes(track, time_s))


def _altitudes(track: DiveTrack, time_s: Array) -> Array:
    """Altitudes at times, NaN further than `LONGEST_GAP_S` from a measured one."""
    good = np.isfinite(track.altitude_m)
    if not good.any():
        return np.full(len(time_s), np.nan)
    at = track.time_s[good]
    after = np.clip(np.searchsorted(at, time_s), 0, len(at) - 1)
    nearest = np.minimum(np.abs(at[after] - time_s), np.abs(at[np.maximum(after - 1, 0)] - time_s))
    return np.where(nearest <= LONGEST_GAP_S, np.interp(time_s, at, track.altitude_m[good]), np.nan)


def mounted_camera(position_B_m: Array, tilt_deg: float) -> Pose:
    """X_BC of a camera at a place in the body, tilted downward: 0 deg looks ahead, 90 deg straight down.

    Raises InputError if the tilt is outside -90 to 90 deg.
    """
    if not -90.0 <= tilt_deg <= 90.0:
        raise InputError(f"--tilt {tilt_deg:g}: must be from -90 to 90 deg; 0 looks ahead, 90 straight down")
    c, s = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
    return Pose.from_matrix(np.array([[0.0, -s, c], [1.0, 0.0, 0.0], [0.0, c, s]]), np.asarray(position_B_m))


def camera_poses(poses: InterpolatedPoses, X_BC: Pose) -> tuple[Array, Array]:
    """Camera centres in W, shape (m, 3) in m, and rotations R_WC, shape (m, 3, 3)."""
    R_WB = matrix_from_quat(poses.q_WB)
    return poses.position_W_m + R_WB @ X_BC.p_m, R_WB @ X_BC.R


def read_track(path: Path) -> DiveTrack:
    """Read a dive: a CSV file of poses, or a log that an installed package reads.

    Raises InputError if it cannot be read, holds no positions, or no package reads it.
    """
    if not path.is_file():
        raise InputError(f"--log {path}: is no file; a dive's log or {_NEEDED} is needed")
    if path.suffix.lower() == ".csv":
        return read_track_table(path)
    offered = plugins.offered("dive log")
    if not offered:
        raise InputError(f"--log {path}: logs are read by the package wakewise-ardusub; install it, or give {_NEEDED}")
    reader: Callable[[Path], DiveTrack] = plugins.find("dive log", offered[0], {}).maker
    return reader(path)


def read_track_table(path: Path) -> DiveTrack:
    """Read a CSV file of poses: time in s, position in NED in m, attitude in deg.

    Raises InputError if a column is missing, a cell is no number, or times do not rise.
    """
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        header = [name.strip().strip('"') for name in file.readline().split(",")]
    if all(name in header for name in _QGROUNDCONTROL):
        raise InputError(
            f"--log {path}: QGroundControl's table holds no positions in metres; give the .tlog in QGroundControl's "
            "folder Telemetry, or the autopilot's .BIN"
        )
    rows: list[list[float]] = []
    has_sigma = all(name in header for name in _SIGMAS)
    for where, row in csv_rows(path, _POSE, _NEEDED):
        try:
            values = [float(row[name] or "") for name in _POSE]
            height = float(row.get("altitude_m") or "nan")
            sigma = [float(row[name] or "") for name in _SIGMAS] if has_sigma else []
        except ValueError:
            raise InputError(f"{where}: {', '.join(_POSE)} must be numbers") from None
        if not np.isfinite([*values, *sigma]).all():
            raise InputError(f"{where}: {', '.join(_POSE)} must be finite numbers")
        if height <= 0.0:
            raise InputError(f"{where}: altitude_m {height:g}: must be above 0 (m above the bed), or empty if unknown")
        if rows and values[0] <= rows[-1][0]:
            raise InputError(f"{where}: time_s {values[0]:.12g} after {rows[-1][0]:.12g}: times must rise")
        rows.append([*values, height, *sigma])
    if len(rows) < 2:
        raise InputError(f"{path}: holds {len(rows)} poses, at least 2 are needed")
    table = np.array(rows)
    if table[-1, 0] > LATEST_S:
        raise InputError(f"{path}: time_s {table[-1, 0]:.3g}: must be in seconds, it is in milliseconds or less")
    speed = np.linalg.norm(np.diff(table[:, 1:4], axis=0), axis=1) / np.diff(table[:, 0])
    fast = float(np.median(speed[speed > 0.0])) if (speed > 0.0).any() else 0.0
    if fast > FASTEST_M_S:
        raise InputError(
            f"{path}: x_m, y_m, z_m move at {fast:.3g} m/s (median), at most {FASTEST_M_S:g} can be: they must be in "
            "metres, time_s in seconds"
        )
    started = float(table[0, 0]) if table[0, 0] > SINCE_1970_S else None
    roll, pitch, heading = np.radians(table[:, 4:7]).T
    return DiveTrack(
        name=path.name,
        time_s=table[:, 0] - (started or 0.0),
        position_W_m=table[:, 1:4].copy(),
        q_WB=quat_from_euler(roll, pitch, heading),
        altitude_m=table[:, 7].copy(),
        positions_from="the table",
        started_s=started,
        sigma_m=table[:, 8:11].copy() if has_sigma else None,
    )
